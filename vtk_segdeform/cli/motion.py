"""How a handle moves, told in a few characters: ``--rotate z,60 --translate 0,0,1``.

A motion is a (4, 4) matrix M that takes a rest position x to its target, in homogeneous
coordinates.  It is put together in a fixed order, whatever order it was written in:

    M = T(translation) T(pivot) R(axis, angle) T(-pivot) M_file

a matrix from a file first, then a turn about the pivot, then a shift.  R is Rodrigues' formula,
with K the cross-product matrix of the unit axis:

    R = 1 + sin(angle) K + (1 - cos(angle)) K^2

Degrees are for people and end here; everything behind this door is in radians.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, as_points
from ..errors import ConstraintError

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def parse_vector(text: str, name: str) -> FloatArray:
    """Return "1,2,3" as (3,) float.

    Raises
    ------
    ConstraintError
        If it is not three finite numbers between commas; *name* is what to call it.
    """
    numbers = _numbers(text, name, "x,y,z")
    if len(numbers) != 3:
        raise ConstraintError(f"{name} must be three numbers, x,y,z; got {text!r}")
    return numbers


def parse_rotation(text: str) -> tuple[FloatArray, float]:
    """Return the unit axis (3,) and the angle in radians of "z,60" or "1,0,1,60".

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
    return axis / length, math.radians(numbers[0])


def read_matrix(path: str | Path) -> FloatArray:
    """Return the (4, 4) matrix in a text file of 16 numbers, row by row; # begins a comment."""
    if not os.path.isfile(path):  # reading a device may never end
        raise ConstraintError(f"matrix {path}: there is no such file; give one of 16 numbers")
    try:
        matrix = np.loadtxt(path, ndmin=2)
    except (ValueError, OSError) as error:
        raise ConstraintError(f"matrix {path} must hold 16 numbers: {error}") from None
    if matrix.size != 16 or not np.isfinite(matrix).all():
        raise ConstraintError(f"matrix {path} must hold 16 finite numbers; got {matrix.size}")
    matrix = matrix.reshape(4, 4)
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise ConstraintError(f"matrix {path} must end in the row 0 0 0 1; got {matrix[3]}")
    return matrix


def translation(shift: ArrayLike) -> FloatArray:
    """Return the (4, 4) matrix of a shift by (3,) *shift*."""
    matrix = np.eye(4)
    matrix[:3, 3] = shift
    return matrix


def rotation(axis: ArrayLike, angle: float, pivot: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return the (4, 4) matrix of a turn by *angle* radians about the line along *axis*.

    Parameters
    ----------
    axis : (3,) float
        Of any length but zero; the turn is counter-clockwise seen against it.
    angle : float
        In radians.
    pivot : (3,) float
        A point of the line.

    Examples
    --------
    >>> transform([[1, 0, 0]], rotation([0, 0, 2], math.pi / 2, pivot=[1, 1, 0])).round(12)
    array([[2., 1., 0.]])
    """
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)
    pivot = np.asarray(pivot, dtype=float)
    return translation(pivot) @ matrix @ translation(-pivot)


def transform(points: ArrayLike, matrix: FloatArray) -> FloatArray:
    """Return (n, 3) *points* moved by a (4, 4) *matrix*."""
    return as_points(points, "points") @ matrix[:3, :3].T + matrix[:3, 3]


def _numbers(text: str, name: str, form: str) -> FloatArray:
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise ConstraintError(f"{name} must be {form}; got {text!r}") from None
    if not np.isfinite(numbers).all():
        raise ConstraintError(f"{name} must be finite; got {text!r}")
    return numbers
