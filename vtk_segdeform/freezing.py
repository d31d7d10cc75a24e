"""Immutable objects: copies, pickles and read-only arrays.

Only the fields of such objects are copied and pickled; cached values are computed again on demand.
Matrices are stored without their zeros.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .checks import shown

_T = TypeVar("_T")
_POINTS = 3  # columns of an array of points, which has few zeros


class Frozen:
    """A frozen dataclass that is copied and pickled by its fields alone.

    Arrays among its fields, also in tuples and mappings, become read-only.  Its text, for which the
    dataclass must not have one, is short whatever is in them.
    """

    def __repr__(self) -> str:
        own = (f"{each.name}={shown(vars(self)[each.name])}" for each in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(own)})"

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: _plain(vars(self)[each.name]) for each in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, read_only(stored_whole(value)))


class _WithoutZeros(NamedTuple):
    """A matrix in a pickle."""

    shape: tuple[int, ...]
    order: Literal["C", "F"]  # of its memory: products depend on it, bit for bit
    places: NDArray[np.uint8]  # one bit for each number
    numbers: NDArray[np.float64] | None  # nonzero entries; None if all of them are True


def without_zeros(value: Any) -> Any:
    """Return a matrix (n, m) of floats or bools as it is pickled; anything else unchanged."""
    is_matrix = isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[1] > _POINTS
    if not is_matrix or value.dtype not in (np.float64, np.bool_):
        return value
    order: Literal["C", "F"] = "F" if value.flags.fnc else "C"
    flat = value.ravel(order=order)
    if value.dtype == np.bool_:
        return _WithoutZeros(value.shape, order, np.packbits(flat), None)
    kept = flat.view(np.uint64) != 0  # by bits: -0.0 is kept
    return _WithoutZeros(value.shape, order, np.packbits(kept), flat[kept])


def stored_whole(value: Any) -> Any:
    """Return the matrix that `without_zeros` has stored; anything else unchanged."""
    if not isinstance(value, _WithoutZeros):
        return value
    size = value.shape[0] * value.shape[1]
    flat: NDArray[Any] = np.unpackbits(value.places, count=size).view(np.bool_)
    if value.numbers is not None:
        kept, flat = flat, np.zeros(size)
        flat[kept] = value.numbers
    return flat.reshape(value.shape, order=value.order)


def read_only(value: _T) -> _T:
    """Return *value* with read-only views of its arrays, also in tuples and mappings.

    The original arrays remain writeable through other references.
    """
    same: _T = _read_only(value)
    return same


def _read_only(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        view = value.view()
        view.flags.writeable = False
        return view
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(map(_read_only, value))
    if isinstance(value, Mapping):
        return MappingProxyType({name: _read_only(each) for name, each in value.items()})
    return value


def _plain(value: Any) -> Any:
    """Return *value* as it is pickled: read-only mappings cannot be."""
    return dict(value) if isinstance(value, Mapping) else without_zeros(value)
