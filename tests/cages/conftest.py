"""Settings for the tests of cages: each cage is fitted anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from vtk_segdeform.cages import fit


@pytest.fixture(scope="module", autouse=True)
def fitted_anew(fitted_once: Callable[..., Any]) -> Iterator[None]:
    """Undo `fitted_once`, whose value is the function that fits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "_fit", fitted_once)
        yield
