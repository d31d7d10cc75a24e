"""The last few results of expensive functions, by their inputs.

Inputs are frozen: an array is identified by itself, everything else by its value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


class Memo:
    """Results by kind and inputs; of each kind the ones used last.

    Examples
    --------
    >>> memo = Memo()
    >>> memo.get("sum", (1, 2), lambda: 1 + 2), memo.find("sum", (1, 2)), memo.find("sum", (3, 4))
    (3, 3, None)
    """

    def __init__(self) -> None:
        self._results: dict[str, tuple[tuple[tuple[Any, ...], Any], ...]] = {}

    def find(self, kind: str, inputs: tuple[Any, ...]) -> Any:
        """Return the result of *inputs*; None if it is not known."""
        known = self._results.get(kind, ())
        for each in known:
            if _same(each[0], inputs):
                if each is not known[0]:
                    self._results[kind] = (each, *(other for other in known if other is not each))
                return each[1]
        return None

    def get(self, kind: str, inputs: tuple[Any, ...], make: Callable[[], T], most: int = 1) -> T:
        """Return the result of *inputs*, by *make* if it is not known; keep *most* of its kind."""
        found: T | None = self.find(kind, inputs)
        if found is None:
            found = make()
            self._results[kind] = ((inputs, found), *self._results.get(kind, ()))[:most]
        return found

    def keep(self, kind: str, inputs: tuple[Any, ...], result: T, most: int = 1) -> T:
        """Keep *result* as that of *inputs*, and return it."""
        others = [each for each in self._results.get(kind, ()) if not _same(each[0], inputs)]
        self._results[kind] = ((inputs, result), *others)[:most]
        return result

    def drop(self, kind: str) -> None:
        """Forget all results of a kind."""
        self._results.pop(kind, None)


def _same(a: tuple[Any, ...], b: tuple[Any, ...]) -> bool:
    if len(a) != len(b):
        return False
    for x, y in zip(a, b, strict=True):
        if x is y:
            continue
        if isinstance(x, np.ndarray) or isinstance(y, np.ndarray):
            return False
        if isinstance(x, tuple) and isinstance(y, tuple):
            if not _same(x, y):
                return False
        elif x != y:
            return False
    return True
