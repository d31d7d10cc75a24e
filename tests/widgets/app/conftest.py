"""Settings for all tests of the desktop program."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
import pyvista as pv


@pytest.fixture(scope="module", autouse=True)
def in_haste() -> Iterator[None]:
    """Save time on antialiasing, and collect garbage in Qt's thread only."""
    smooth = pv.global_theme.anti_aliasing
    pv.global_theme.anti_aliasing = None
    gc.collect()
    gc.freeze()
    gc.disable()
    yield
    gc.enable()
    pv.global_theme.anti_aliasing = smooth
