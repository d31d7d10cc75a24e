"""What of a long list is tested every day, and what in the campaign only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def every(step: int, values: Iterable[Any]) -> list[Any]:
    """Return *values* for `parametrize`; all but every *step*-th are left to the campaign."""
    rows = [each if isinstance(each, tuple) else (each,) for each in values]
    marks = [pytest.mark.campaign if k % step else () for k in range(len(rows))]
    return [pytest.param(*row, marks=own) for row, own in zip(rows, marks, strict=True)]
