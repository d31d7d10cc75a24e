"""Settings for all tests of the desktop program."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
import pyvista as pv

from vtk_segdeform.widgets.editor import preparing


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
    gc.unfreeze()
    pv.global_theme.anti_aliasing = smooth


@pytest.fixture
def unprepared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not prepare sessions for pulls in the background: for tests of the other modes."""
    monkeypatch.setattr(preparing, "lacking", lambda _: None)
