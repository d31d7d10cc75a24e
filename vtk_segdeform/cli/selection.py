"""A set of vertices, told in a few characters: ``z>80%``, ``handle.sel``, a file of numbers.

    selection   =  term { "&" term }                 vertices that are in every term
    term        =  half-space | array | file
    half-space  =  axis ("<" | "<=" | ">" | ">=") number ["%"]
    axis        =  "x" | "y" | "z"               per cent: of the bounding box along that axis
    array       =  name ["=" number]             point array: not zero, or equal to the number
    file        =  path ["=" number]             vertex numbers from 0, between blanks or commas;
                                                 a path.sel has one number per vertex instead

In a ``.sel`` file 0 means fixed, 1 free and 2 handle, the convention of the benchmark poses of
[BS08]; which of them is wanted follows from the role the selection is for, or from "=".  Text is
only ever parsed, never evaluated.

Source
------
[BS08] M. Botsch, O. Sorkine, "On linear variational surface deformation methods", IEEE Trans.
       Vis. Comput. Graph. 14(1), 213-230, 2008.
"""

from __future__ import annotations

import operator
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray
from ..errors import ConstraintError
from ..files import open_regular
from ..mesh import Mesh

Role = Literal["fixed", "handle"]

GRAMMAR = (
    "write a half-space (z>80%, x<=0.25), a point array (name or name=2), a file of vertex "
    "numbers or a .sel file; join with & what must hold together"
)
_ROLE_NUMBER = {"fixed": 0, "handle": 2}
_LARGEST_FILE = 1 << 28  # bytes
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_HALF_SPACE = re.compile(rf"([xyzXYZ])\s*(<=|>=|<|>)\s*({_NUMBER})\s*(%?)")
_EQUALS = re.compile(rf"(.+?)\s*=\s*({_NUMBER})")
_COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def parse_selection(
    text: str,
    mesh: Mesh,
    *,
    point_arrays: Mapping[str, ArrayLike] | None = None,
    role: Role | None = None,
) -> IntArray:
    """Return the numbers of the vertices that *text* describes.

    Parameters
    ----------
    text : str
        In the grammar of this module's header.
    mesh : Mesh
        Whose vertices are meant.
    point_arrays : mapping of str to (n,) numbers, optional
        The arrays that *text* may name.
    role : "fixed" or "handle", optional
        What the selection is for: picks the 0s or the 2s of a ``.sel`` file.

    Returns
    -------
    ids : (k,) int
        Ascending, each once, at least one.

    Raises
    ------
    ConstraintError
        If the text does not follow the grammar, or selects nothing.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> parse_selection("z<50%", mesh)
    array([0, 1, 2])
    >>> parse_selection("z<50% & x>=1", mesh)
    array([1])
    """
    chosen = np.ones(mesh.n_vertices, dtype=bool)
    whole_is_a_file = os.path.isfile(text.strip())  # accepts text of any length
    for term in [text] if whole_is_a_file else text.split("&"):
        chosen &= _term(term.strip(), mesh, dict(point_arrays or {}), role)
    if not chosen.any():
        raise ConstraintError(
            f"{role or 'selection'} {_short(text)} selects none of the {mesh.n_vertices} vertices; "
            f"the mesh spans {_extent(mesh)}"
        )
    return np.flatnonzero(chosen).astype(np.int64)


def _term(term: str, mesh: Mesh, arrays: Mapping[str, ArrayLike], role: Role | None) -> BoolArray:
    half_space = _HALF_SPACE.fullmatch(term)
    if half_space:
        axis, sign, number, per_cent = half_space.groups()
        along = mesh.vertices[:, "xyz".index(axis.lower())]
        limit = float(number)
        if per_cent:
            limit = along.min() + limit / 100.0 * np.ptp(along)
        return np.asarray(_COMPARE[sign](along, limit), dtype=bool)
    name, wanted = term, None
    equals = _EQUALS.fullmatch(term)
    if equals and term not in arrays and not os.path.isfile(term):
        name, wanted = equals[1], float(equals[2])
    if name in arrays:
        return _array(name, arrays[name], wanted, mesh.n_vertices)
    if os.path.isfile(name):
        return _file(Path(name), wanted, mesh.n_vertices, role)
    known = f"; point arrays here: {', '.join(sorted(arrays))}" if arrays else ""
    raise ConstraintError(f"cannot read the selection {_short(term)}: {GRAMMAR}{known}")


def _array(name: str, values: ArrayLike, wanted: float | None, n: int) -> BoolArray:
    array = np.asarray(values)
    if array.shape != (n,) or array.dtype.kind not in "biuf":
        raise ConstraintError(
            f"point array {name!r} must hold one number per vertex, ({n},); "
            f"got {array.shape} {array.dtype}"
        )
    return np.asarray(array != 0 if wanted is None else array == wanted)


def _file(path: Path, wanted: float | None, n: int, role: Role | None) -> BoolArray:
    numbers = _numbers(path)
    if path.suffix == ".sel":
        if len(numbers) != n:
            raise ConstraintError(
                f"{path} has {len(numbers)} entries; the mesh has {n} vertices, one entry each"
            )
        if wanted is None:
            if role is None:
                raise ConstraintError(f"say which entries of {path} are meant: {path}=2")
            wanted = _ROLE_NUMBER[role]
        return np.asarray(numbers == wanted)
    if wanted is not None:
        raise ConstraintError(f"{path}={wanted:g}: only a .sel file has values to choose from")
    if not np.array_equal(numbers, np.rint(numbers)):  # NaN is unequal to itself
        raise ConstraintError(f"{path} must hold vertex numbers, which are whole")
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= n):
        low, high = numbers.min(), numbers.max()
        raise ConstraintError(f"{path} must hold 0..{n - 1}; got {low:g}..{high:g}")
    chosen = np.zeros(n, dtype=bool)
    chosen[numbers.astype(np.int64)] = True
    return chosen


def _numbers(path: Path) -> FloatArray:
    """Return all numbers of a text file; from a # to the end of its line is a comment."""
    try:
        with open_regular(path) as file:
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ValueError(f"it has more than {_LARGEST_FILE:,} bytes")
        lines = content.decode("utf-8").splitlines()
        words = " ".join(line.partition("#")[0] for line in lines).replace(",", " ").split()
        return np.array([float(word) for word in words])
    except ValueError as error:  # a word that is no number, or bytes that are no text
        raise ConstraintError(f"{path} must hold numbers and nothing else: {error}") from None


def _short(text: str) -> str:
    """Return *text* in quotes, truncated if long."""
    return repr(text if len(text) <= 200 else f"{text[:200]}...")


def _extent(mesh: Mesh) -> str:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return ", ".join(
        f"{axis} {a:.6g}..{b:.6g}" for axis, a, b in zip("xyz", low, high, strict=True)
    )
