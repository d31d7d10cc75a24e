"""Motions of handles as texts: rotate "z,60", translate "0,0,1".

A motion is a (4, 4) matrix M that maps rest positions x to targets, in homogeneous coordinates.
The order of its parts is fixed, independent of the order in which they are given:

    M = T(translation) T(pivot) R(axis, angle) T(-pivot) M_file

that is, a matrix from a file first, then a rotation about the pivot, then a translation.
Angles are in degrees in the texts, and in radians everywhere else.

M does not tell how many turns the rotation has, and the solver turns a handle the shorter way.  So
where a rotation has half a turn or more, or follows a matrix, the handles go through targets on the
way, in which the shares s = 1/n, 2/n, ... of their rotations and translations are made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray, as_points
from ..errors import ConstraintError
from ..files import open_regular

_LEG = 0.5 * math.pi  # between targets on the way of a far rotation, at most
_MOST_TURNS = 10.0  # each takes four solves: beyond that a typing error is more likely
_LARGEST_FILE = 1 << 20  # bytes of 16 numbers and comments
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def parse_vector(text: str, name: str) -> FloatArray:
    """Parse "1,2,3"; return (3,) float.

    Raises
    ------
    ConstraintError
        If *text* is not three finite numbers separated by commas; the message begins with *name*.
    """
    numbers = _numbers(text, name, "x,y,z")
    if len(numbers) != 3:
        raise ConstraintError(f"{name} must be three numbers, x,y,z; got {text!r}")
    return numbers


def parse_rotation(text: str) -> tuple[FloatArray, float]:
    """Parse "z,60" or "1,0,1,60"; return the unit axis (3,) and the angle in radians.

    Examples
    --------
    >>> axis, angle = parse_rotation("z,180")
    >>> axis, angle == math.pi
    (array([0., 0., 1.]), True)
    """
    form = "axis,degrees with an axis of x, y, z or ax,ay,az"
    first, _, rest = text.partition(",")
    if first.strip().lower() in _AXES:
        axis = np.array(_AXES[first.strip().lower()])
        numbers = _numbers(rest, "rotate", form)
    else:
        numbers = _numbers(text, "rotate", form)
        axis, numbers = numbers[:3], numbers[3:]
    length = float(np.linalg.norm(axis))
    if len(axis) != 3 or len(numbers) != 1 or length == 0.0:
        raise ConstraintError(f"rotate must be {form} (z,60 or 1,0,1,60); got {text!r}")
    if abs(numbers[0]) > 360.0 * _MOST_TURNS:
        raise ConstraintError(
            f"rotate is limited to {_MOST_TURNS:.0f} turns, {360.0 * _MOST_TURNS:.0f} degrees; "
            f"got {text!r}"
        )
    return axis / length, math.radians(numbers[0])


def total_legs(angles: Sequence[float]) -> int:
    """Return the number of equal legs of rotations by *angles*, each the shorter way.

    >>> [total_legs(each) for each in ([1.0, 3.1], [-math.pi], [1.0, 1.5 * math.pi], [])]
    [1, 2, 3, 1]
    """
    largest = max(map(abs, angles), default=0.0)
    return math.ceil(largest / _LEG - 1e-9) if largest > math.pi * (1.0 - 1e-9) else 1


def moved_handles(
    handles: Sequence[Mapping[str, str]],
    select: Callable[[str], IntArray],
    vertices: FloatArray,
    fixed: IntArray,
) -> tuple[IntArray, list[FloatArray]]:
    """Return the vertices (k,) of all handles, and their targets (k, 3): on the way, and last.

    Parameters
    ----------
    handles : sequence of mappings of str to str
        Each has a selection under "select", and at least one of "matrix" (a file), "rotate" and
        "translate".  The "pivot" is a point, or the centre of "fixed" or of the "handle".
    select : callable
        Returns the vertices (k,) of a selection.
    vertices : (n, 3) float
        The mesh at rest.
    fixed : (f,) int
        Vertices whose centre is the pivot "fixed"; without any it is that of the mesh.

    Raises
    ------
    ConstraintError
        If a handle has no motion, two handles share a vertex, or a text is invalid.
    """
    for handle in handles:
        if not {"matrix", "rotate", "translate"} & handle.keys():
            raise ConstraintError(
                f"handle {handle['select']!r} does not move; add a translation, a rotation or a "
                "matrix to it"
            )
    ids = [select(handle["select"]) for handle in handles]
    together = np.concatenate([np.zeros(0, dtype=np.int64), *ids])
    if len(np.unique(together)) < len(together):
        raise ConstraintError("two handles share vertices; each vertex can be in only one handle")
    centre = vertices[fixed if len(fixed) else slice(None)].mean(axis=0)
    pairs = [(vertices[own], handle) for own, handle in zip(ids, handles, strict=True)]
    return together, [
        np.concatenate([np.empty((0, 3)), *(_moved(*pair, centre, share) for pair in pairs)])
        for share in _shares(handles)
    ]


def read_matrix(path: str | Path) -> FloatArray:
    """Return the (4, 4) matrix in a text file of 16 numbers, row by row; # starts a comment."""
    try:
        with open_regular(path) as file:
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ValueError(f"it has more than {_LARGEST_FILE:,} bytes")
        words = " ".join(line.partition("#")[0] for line in content.decode().splitlines()).split()
        matrix = np.array([float(word) for word in words])
    except OSError as error:
        raise ConstraintError(
            f"matrix {path}: {error.strerror}; it must contain 16 numbers"
        ) from None
    except ValueError as error:
        raise ConstraintError(f"matrix {path} must contain 16 numbers: {error}") from None
    if matrix.size != 16 or not np.isfinite(matrix).all():
        raise ConstraintError(f"matrix {path} must contain 16 finite numbers; got {matrix.size}")
    matrix = matrix.reshape(4, 4)
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise ConstraintError(f"the last row of matrix {path} must be 0 0 0 1; got {matrix[3]}")
    return matrix


def rotation(axis: ArrayLike, angle: float, pivot: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return the (4, 4) matrix of a rotation.

    Parameters
    ----------
    axis : (3,) float
        Direction of the axis, of any non-zero length; the rotation is counter-clockwise for a
        viewer towards whom it points.
    angle : float
        In radians.
    pivot : (3,) float
        A point on the axis.

    Examples
    --------
    >>> transform([[1, 0, 0]], rotation([0, 0, 2], math.pi / 2, pivot=[1, 1, 0])).round(12)
    array([[2., 1., 0.]])
    """
    turn = Rotation.from_rotvec(angle * np.asarray(axis, dtype=float) / np.linalg.norm(axis))
    matrix, centre = np.eye(4), np.asarray(pivot, dtype=float)
    matrix[:3, :3] = turn.as_matrix()
    matrix[:3, 3] = centre - turn.apply(centre)
    return matrix


def transform(points: ArrayLike, matrix: FloatArray) -> FloatArray:
    """Return *points* (n, 3) transformed by a (4, 4) *matrix*."""
    return as_points(points, "points") @ matrix[:3, :3].T + matrix[:3, 3]


def _numbers(text: str, name: str, form: str) -> FloatArray:
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise ConstraintError(f"{name} must be {form}; got {text!r}") from None
    if not np.isfinite(numbers).all():
        raise ConstraintError(f"{name} must be finite; got {text!r}")
    return numbers


def _shares(handles: Sequence[Mapping[str, str]]) -> list[float]:
    """Return the shares of the rotations at which the handles stop on the way; the last is 1."""
    turned = [handle for handle in handles if "rotate" in handle]
    count = total_legs([parse_rotation(handle["rotate"])[1] for handle in turned])
    begins = [0.0] if any("matrix" in handle for handle in turned) else []
    return [*begins, *((k + 1) / count for k in range(count))]


def _moved(
    points: FloatArray, handle: Mapping[str, str], fixed_centre: FloatArray, share: float = 1.0
) -> FloatArray:
    """Apply the matrix, and a *share* of the rotation and of the translation, in this order.

    *fixed_centre* (3,) is the mean of the fixed vertices.
    """
    if "matrix" in handle:
        points = transform(points, read_matrix(handle["matrix"]))
    if "rotate" in handle:
        axis, angle = parse_rotation(handle["rotate"])
        pivot = handle.get("pivot", "handle")
        centres = {"handle": points.mean(axis=0), "fixed": fixed_centre}
        centre = centres[pivot] if pivot in centres else parse_vector(pivot, "pivot")
        points = transform(points, rotation(axis, share * angle, centre))
    if "translate" in handle:
        points = points + share * parse_vector(handle["translate"], "translate")
    return points
