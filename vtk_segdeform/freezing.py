"""Objects that are never changed: how they are copied and pickled, and their arrays read-only.

What such an object keeps besides its fields, its caches, is in no pickle and in no copy: it is
found again when it is asked for.
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

    Arrays among its fields, also in tuples and mappings, are read-only afterwards.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: _plain(vars(self)[each.name]) for each in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, read_only(value))


def read_only(value: _T) -> _T:
    """Return *value* with every array of it read-only, in tuples and mappings as well.

    The arrays are views: who has another reference to one of them may still write to it.
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
    """Return *value* with a dict for each read-only mapping, which nobody can copy or pickle."""
    return dict(value) if isinstance(value, Mapping) else value
