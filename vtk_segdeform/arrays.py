"""Validation and conversion of array arguments; errors name the argument."""

from __future__ import annotations

import math
from collections.abc import Sized
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import shown
from .errors import ArgumentError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
_Array = TypeVar("_Array", bound=NDArray[Any])

_DEEPEST = 4  # nesting levels; numpy recurses infinitely into a list that contains itself
_LONGEST = 10**8  # entries of a sequence that is converted to an array
_LARGEST = float(np.finfo(np.float64).max)


def as_points(points: ArrayLike, name: str, count: int | None = None) -> FloatArray:
    """Return *points* as (n, 3) float, or raise an ArgumentError.

    If *count* is given, it is the required number of points.
    """
    array = as_numbers(points, name)
    if count is not None and array.shape != (count, 3):
        raise ArgumentError(f"{name} must have shape ({count}, 3); got {array.shape}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ArgumentError(f"{name} must have shape (n, 3); got {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        bad = np.count_nonzero(~finite.all(axis=1))
        raise ArgumentError(
            f"{name} must be finite; {bad} of {len(array)} points have NaN or infinite coordinates"
        )
    return np.ascontiguousarray(array, dtype=np.float64)


def bounds_of(points: FloatArray) -> FloatArray:
    """Return the smallest and the largest coordinates of *points* (n, 3), (2, 3)."""
    # One axis after another: numpy takes five times as long for rows of three numbers.
    return np.array([[axis.min() for axis in points.T], [axis.max() for axis in points.T]])


def as_faces(faces: ArrayLike, n_points: int, name: str) -> IntArray:
    """Return *faces* as (m, 3) int with indices in 0..n_points-1, or raise an ArgumentError."""
    array = plain(faces, name)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ArgumentError(f"{name} must have shape (m, 3), triangles; got {array.shape}")
    if array.dtype.kind not in "iu":
        raise ArgumentError(f"{name} must contain integers; got {array.dtype}")
    if len(array) and (array.min() < 0 or array.max() >= n_points):
        low, high = array.min(), array.max()
        raise ArgumentError(f"{name} must index 0..{n_points - 1}; got {low}..{high}")
    return np.ascontiguousarray(array, dtype=np.int64)


def as_ids(ids: ArrayLike, n_points: int, name: str) -> IntArray:
    """Return vertex indices (k,) from a list of indices or a mask of length *n_points*.

    The order is kept; repeated indices are an error.
    """
    array = plain(ids, name)
    if array.dtype == bool:
        if array.shape != (n_points,):
            raise ArgumentError(f"{name}, a mask, must have shape ({n_points},); got {array.shape}")
        return np.flatnonzero(array).astype(np.int64)
    if array.size == 0:
        return np.empty(0, dtype=np.int64)
    if array.dtype.kind not in "iu":
        raise ArgumentError(f"{name} must contain vertex numbers or be a mask; got {array.dtype}")
    array = np.atleast_1d(array).astype(np.int64)
    if array.ndim != 1:
        raise ArgumentError(f"{name} must be a list of vertex numbers; got shape {array.shape}")
    if array.min() < 0 or array.max() >= n_points:
        low, high = array.min(), array.max()
        raise ArgumentError(f"{name} must index 0..{n_points - 1}; got {low}..{high}")
    if len(np.unique(array)) != len(array):
        raise ArgumentError(f"{name} contains a vertex twice; list each vertex once")
    return array


def is_number(value: object, least: float = -np.inf) -> bool:
    """Return whether *value* is a finite real number of at least *least*."""
    real = isinstance(value, int | float | np.integer | np.floating)
    return real and least <= value <= _LARGEST and not isinstance(value, bool)  # type: ignore[operator]


def is_whole(value: object, least: float, most: float = np.inf) -> bool:
    """Return whether *value* is an integer in *least*..*most*; 4.0 counts as one."""
    return is_number(value, least) and value <= most and value % 1 == 0  # type: ignore[operator]


def frozen(array: _Array) -> _Array:
    """Mark *array* as read-only, so that it can be shared, and return it."""
    array.flags.writeable = False
    return array


def as_numbers(values: ArrayLike, name: str) -> FloatArray:
    """Return *values* as floats of any shape, or raise an ArgumentError."""
    array = plain(values, name)
    if array.dtype.kind == "c":
        raise ArgumentError(f"{name} must contain real numbers; got {array.dtype}")
    if array.dtype.kind == "O":  # the conversion checks each entry
        try:
            return array.astype(np.float64)
        except Exception as fault:  # any of an entry, which may be of any class
            raise ArgumentError(f"{name} must contain numbers; got {array.dtype}") from fault
    if array.dtype.kind not in "biuf":
        raise ArgumentError(f"{name} must contain numbers; got {array.dtype}")
    return array.astype(np.float64, copy=False)


def plain(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return *values* as an array; masked entries are an error, since the mask would be lost."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ArgumentError(f"{name} has masked entries; fill or remove them")
    _require_bounded(values, name)
    try:
        array = np.asarray(values)
    except MemoryError:
        raise
    except Exception as fault:  # rows of different lengths, or the __array__ of *values* fails
        if isinstance(values, list | tuple):
            message = f"{name} must be an array; its rows differ in length"
        else:
            message = f"{name} must be an array; cannot convert {type(values).__name__}"
        raise ArgumentError(message) from fault
    if array.ndim == 0 and array.dtype.kind == "O":
        raise ArgumentError(f"{name} must be an array; got {shown(values)}")
    return array


def coordinate_text(x: float, size: float) -> str:
    """Return the coordinate *x* in 6 digits, or in as many as show 1e-6 of a mesh's *size*.

    Examples
    --------
    >>> coordinate_text(1 / 3, 2.0), coordinate_text(1e6 + 1 / 3, 2.0)
    ('0.333333', '1000000.33333')
    """
    digits = next(d for d in range(6, 17) if d == 16 or abs(x) <= size * 10.0 ** (d - 6))
    return f"{x:.{digits}g}"


def _require_bounded(values: object, name: str) -> None:
    """Raise an ArgumentError where numpy would recurse infinitely or run out of memory.

    This concerns lists that contain themselves and sequences that claim to be very long.
    """
    inner: Any = values
    for _ in range(_DEEPEST):
        if not isinstance(inner, list | tuple) or not inner:
            break
        inner = inner[0]
    if isinstance(inner, list | tuple) and inner:
        raise ArgumentError(
            f"{name} must be an array; its lists are nested more than {_DEEPEST} deep"
        )
    if isinstance(inner, Sized) and not hasattr(inner, "__array__"):
        try:
            count = len(inner)
        except Exception as fault:  # any of its __len__
            raise ArgumentError(f"{name} must be an array; got {shown(inner)}") from fault
        if count > _LONGEST:
            raise ArgumentError(f"{name} has more than {_LONGEST:.0e} entries; got {shown(inner)}")


def largest_length(vectors: FloatArray) -> float:
    """Return the largest length of *vectors* (k, 3); 0 if there are none."""
    return math.sqrt(float(np.einsum("ij,ij->i", vectors, vectors).max(initial=0.0)))
