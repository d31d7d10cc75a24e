"""Search for arrays that an object returns by reference and that callers could overwrite.

The properties are discovered on an object of each public class.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping

import numpy as np
from scipy import sparse

import vtk_segdeform as sd
from vtk_segdeform.session import State
from vtk_segdeform.subspace.passengers import Passengers

CLASSES = [sd.Mesh, sd.Regions, sd.Cage, sd.Deformer, sd.Solution, sd.Session, Passengers]


def writable_shared_arrays(thing: object) -> list[str]:
    """Return the names of arrays that *thing* returns by reference and writeable."""
    twice = zip(_public(thing), _public(thing), strict=True)
    return [
        name
        for (name, first), (_, second) in twice
        for a, b in zip(_arrays(first), _arrays(second), strict=True)
        if a.flags.writeable and b.flags.writeable and np.shares_memory(a, b)
    ]


def _public(thing: object) -> Iterator[tuple[str, object]]:
    """Yield the names and values of the public properties and fields of *thing*."""
    properties = (name for name, _ in inspect.getmembers(type(thing), _is_read))
    for name in sorted({*properties, *vars(thing)}):
        if not name.startswith("_"):
            yield name, getattr(thing, name)


def _is_read(member: object) -> bool:
    return isinstance(member, property) or type(member).__name__ == "cached_property"


def _arrays(value: object) -> Iterator[np.ndarray]:
    if isinstance(value, np.ndarray):
        yield value
    elif sparse.issparse(value):
        yield from (value.data, value.indices, value.indptr)
    elif isinstance(value, tuple | list):
        for each in value:
            yield from _arrays(each)
    elif isinstance(value, Mapping):
        yield from _arrays([*value.values()])
    elif isinstance(value, State):
        yield from _arrays([*vars(value).values()])
