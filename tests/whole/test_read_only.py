"""Arrays that properties and fields return by reference are read-only.

The properties are discovered on an object of each public class.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping

import numpy as np
import public_calls
import pytest
from scipy import sparse

import vtk_segdeform as sd
from vtk_segdeform.session import State
from vtk_segdeform.subspace.passengers import Passengers

CLASSES = [sd.Mesh, sd.Regions, sd.Cage, sd.Deformer, sd.Solution, sd.Session, Passengers]
WIDGETS = ["CageDisplay", "HandleDragger", "RegionSelector", "SurfaceDisplay", "VolumeOverlay"]
NOT_READ = {"state"}  # `Session.state`, whose arrays are those of the session


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


def _shared(thing: object) -> list[str]:
    """Return the names of arrays that *thing* returns by reference and writeable."""
    twice = zip(_public(thing), _public(thing), strict=True)
    return [
        name
        for (name, first), (_, second) in twice
        for a, b in zip(_arrays(first), _arrays(second), strict=True)
        if a.flags.writeable and b.flags.writeable and np.shares_memory(a, b)
    ]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_an_array_returned_by_reference_is_read_only(cls):
    thing = public_calls.instance(cls)
    if isinstance(thing, sd.Session):
        thing.drag(public_calls.ARGUMENTS["targets"]())
    assert _shared(thing) == []


@pytest.mark.parametrize("name", WIDGETS)
def test_an_array_of_a_widget_is_read_only(name):
    widget = public_calls.instance(getattr(sd.widgets, name))
    if name == "VolumeOverlay":
        widget.show()
    try:
        assert _shared(widget) == []
    finally:
        public_calls.tidy()


def test_the_arguments_stay_writable():
    x, faces = np.array(public_calls.mesh().vertices), np.array(public_calls.mesh().faces)
    masks, points = np.array(public_calls.regions().membership), x[:3].copy()
    mesh = sd.Mesh(x, faces)
    regions = sd.Regions(mesh, masks)
    passengers = public_calls.bound().passengers(points)
    for array in (x, faces, masks, points):
        array[:1] = 0
    assert passengers.points[0].any()
    assert mesh.vertices[0].any()
    assert regions.membership.any(axis=0).all()
