"""Immutable objects: copies, pickles and read-only arrays.

Only the fields of such objects are copied and pickled; cached values are computed again on demand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

_T = TypeVar("_T")


class Frozen:
    """A frozen dataclass that is copied and pickled by its fields alone.

    Arrays among its fields, also in tuples and mappings, become read-only.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: _plain(vars(self)[each.name]) for each in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, read_only(value))


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
    """Return *value* with a dict for each read-only mapping, which cannot be pickled."""
    return dict(value) if isinstance(value, Mapping) else value
