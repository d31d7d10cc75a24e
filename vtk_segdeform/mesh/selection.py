"""Point selections as text: ``z>80%``, ``handle.sel``, a file of point ids.

    selection   =  term { "&" term }             points in all terms
    term        =  half-space | array | file
    half-space  =  axis ("<" | "<=" | ">" | ">=") number ["%"]
    axis        =  "x" | "y" | "z"               %: percentage of the bounding box along this axis
    array       =  name ["=" number]             point array: non-zero, or equal to the number
    file        =  path ["=" number]             point ids from 0, separated by blanks or commas;
                                                 a .sel file has one number per point instead

In a ``.sel`` file 0 means fixed, 1 free and 2 handle, as in the benchmark poses of [BS08].  The
selected number follows from the role of the selection, or from "=".  Text is parsed, never
evaluated.

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

from ..arrays import BoolArray, FloatArray, IntArray, coordinate_text
from ..errors import ConstraintError
from ..files import open_regular

Role = Literal["fixed", "handle"]

GRAMMAR = (
    "use a half-space (z>80%, x<=0.25), a point array (name or name=2), a file of point ids "
    "or a .sel file, joined by & to intersect"
)
_ROLE_NUMBER = {"fixed": 0, "handle": 2}
_LARGEST_FILE = 1 << 28  # bytes
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_HALF_SPACE = re.compile(rf"([xyzXYZ])\s*(<=|>=|<|>)\s*({_NUMBER})\s*(%?)")
_EQUALS = re.compile(rf"(.+?)\s*=\s*({_NUMBER})")
_COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def parse_selection(
    text: str,
    points: FloatArray,
    *,
    point_arrays: Mapping[str, ArrayLike] | None = None,
    role: Role | None = None,
) -> IntArray:
    """Return the ids of the points selected by *text*.

    Parameters
    ----------
    text : str
        In the grammar above.
    points : (n, 3) float
        As given, and numbered as in their file.
    point_arrays : mapping of str to (n,) numbers, optional
        The arrays that *text* may name.
    role : "fixed" or "handle", optional
        Selects the zeros or the twos of a ``.sel`` file.

    Returns
    -------
    ids : (k,) int
        Sorted and unique; at least one.

    Raises
    ------
    ConstraintError
        If the text does not follow the grammar, or selects no point.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> parse_selection("z<50%", corners)
    array([0, 1, 2])
    >>> parse_selection("z<50% & x>=1", corners)
    array([1])
    """
    chosen = np.ones(len(points), dtype=bool)
    whole_is_a_file = os.path.isfile(text.strip())  # False for text of any length
    for term in [text] if whole_is_a_file else text.split("&"):
        chosen &= _term(term.strip(), points, dict(point_arrays or {}), role)
    if not chosen.any():
        raise ConstraintError(
            f"{role or 'selection'} {_short(text)} selects none of the {len(points)} points; "
            f"the mesh spans {_extent(points)}"
        )
    return np.flatnonzero(chosen).astype(np.int64)


def _term(
    term: str, points: FloatArray, arrays: Mapping[str, ArrayLike], role: Role | None
) -> BoolArray:
    half_space = _HALF_SPACE.fullmatch(term)
    if half_space:
        axis, sign, number, per_cent = half_space.groups()
        along = points[:, "xyz".index(axis.lower())]
        limit = float(number)
        if per_cent:
            limit = along.min() + limit / 100.0 * np.ptp(along)
        return np.asarray(_COMPARE[sign](along, limit), dtype=bool)
    name, wanted = term, None
    equals = _EQUALS.fullmatch(term)
    if equals and term not in arrays and not os.path.isfile(term):
        name, wanted = equals[1], float(equals[2])
    if name in arrays:
        return _array(name, arrays[name], wanted, len(points))
    if os.path.isfile(name):
        return _file(Path(name), wanted, len(points), role)
    known = f"; point arrays here: {', '.join(sorted(arrays))}" if arrays else ""
    raise ConstraintError(f"cannot read the selection {_short(term)}: {GRAMMAR}{known}")


def _array(name: str, values: ArrayLike, wanted: float | None, n: int) -> BoolArray:
    array = np.asarray(values)
    if array.shape != (n,) or array.dtype.kind not in "biuf":
        raise ConstraintError(
            f"point array {name!r} must have one number per point, shape ({n},); "
            f"got {array.shape} {array.dtype}"
        )
    if wanted is None:
        return np.asarray((array != 0) & ~np.isnan(array))  # NaN means no data
    return np.asarray(array == wanted)


def _file(path: Path, wanted: float | None, n: int, role: Role | None) -> BoolArray:
    numbers = _numbers(path)
    if path.suffix == ".sel":
        if len(numbers) != n:
            raise ConstraintError(
                f"{path} must have one number per point, {n} numbers; got {len(numbers)}"
            )
        if wanted is None:
            if role is None:
                raise ConstraintError(f"select one of the numbers in {path}, for example {path}=2")
            wanted = _ROLE_NUMBER[role]
        return np.asarray(numbers == wanted)
    if wanted is not None:
        raise ConstraintError(f"{path}={wanted:g}: '=' applies to .sel files only")
    if not np.array_equal(numbers, np.rint(numbers)):  # NaN is unequal to itself
        raise ConstraintError(f"{path} must contain point ids, which are whole numbers")
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= n):
        low, high = numbers.min(), numbers.max()
        raise ConstraintError(f"point ids in {path} must be 0..{n - 1}; got {low:g}..{high:g}")
    chosen = np.zeros(n, dtype=bool)
    chosen[numbers.astype(np.int64)] = True
    return chosen


def _numbers(path: Path) -> FloatArray:
    """Return all numbers of a text file; # starts a comment."""
    try:
        with open_regular(path) as file:
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ValueError(f"it has more than {_LARGEST_FILE:,} bytes")
        lines = content.decode("utf-8").splitlines()
        words = " ".join(line.partition("#")[0] for line in lines).replace(",", " ").split()
        return np.array([float(word) for word in words])
    except ValueError as error:  # not a number, or not text
        raise ConstraintError(f"{path} must contain only numbers: {error}") from None


def _short(text: str) -> str:
    """Return *text* in quotes, truncated if long."""
    return repr(text if len(text) <= 200 else f"{text[:200]}...")


def _extent(points: FloatArray) -> str:
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    return ", ".join(
        f"{axis} {coordinate_text(a, size)}..{coordinate_text(b, size)}"
        for axis, a, b in zip("xyz", low, high, strict=True)
    )
