"""Immutable objects: copies, pickles, read-only arrays, and results kept by frozen inputs.

Only the fields of such objects are copied and pickled; cached values are computed again on demand.
Matrices are stored without their zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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


class Memo:
    """The last few results of expensive functions, by kind and inputs.

    Inputs are frozen: an array is identified by itself, everything else by its value.

    Examples
    --------
    >>> memo = Memo()
    >>> memo.get("sum", (1, 2), lambda: 1 + 2), memo.find("sum", (1, 2)), memo.find("sum", (3, 4))
    (3, 3, None)
    """

    def __init__(self) -> None:
        self._results: dict[str, tuple[tuple[tuple[Any, ...], Any], ...]] = {}

    def copy(self) -> Memo:
        """Return another one with the same results."""
        other = Memo()
        other._results = dict(self._results)
        return other

    def find(self, kind: str, inputs: tuple[Any, ...]) -> Any:
        """Return the result of *inputs*; None if it is not known."""
        known = self._results.get(kind, ())
        for each in known:
            if same_inputs(each[0], inputs):
                if each is not known[0]:
                    self._results[kind] = (each, *(other for other in known if other is not each))
                return each[1]
        return None

    def get(self, kind: str, inputs: tuple[Any, ...], make: Callable[[], _T], most: int = 1) -> _T:
        """Return the result of *inputs*, by *make* if it is not known; keep *most* of its kind."""
        found: _T | None = self.find(kind, inputs)
        if found is None:
            found = make()
            self._results[kind] = ((inputs, found), *self._results.get(kind, ()))[:most]
        return found

    def keep(self, kind: str, inputs: tuple[Any, ...], result: _T, most: int = 1) -> _T:
        """Keep *result* as that of *inputs*, and return it."""
        others = [each for each in self._results.get(kind, ()) if not same_inputs(each[0], inputs)]
        self._results[kind] = ((inputs, result), *others)[:most]
        return result

    def drop(self, kind: str) -> None:
        """Forget all results of a kind."""
        self._results.pop(kind, None)


def same_inputs(a: tuple[Any, ...], b: tuple[Any, ...]) -> bool:
    """Return whether *a* and *b* are the same inputs."""
    if len(a) != len(b):
        return False
    for x, y in zip(a, b, strict=True):
        if x is y:
            continue
        if isinstance(x, np.ndarray) or isinstance(y, np.ndarray):
            return False
        if isinstance(x, tuple) and isinstance(y, tuple):
            if not same_inputs(x, y):
                return False
        elif x != y:
            return False
    return True
