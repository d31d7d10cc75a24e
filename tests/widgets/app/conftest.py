"""Settings for all tests of the desktop program."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from typing import Any

import pytest
import pyvista as pv
from pyvistaqt.rwi import QVTKRenderWindowInteractor

from vtk_segdeform.widgets.editor import finishing


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


@pytest.fixture
def unpainted(monkeypatch):
    """Leave the view blank, which is slow to draw: for tests of files, menus and dialogs.

    PySide keeps the method that a widget was first painted by, so it is replaced for good.
    """
    monkeypatch.setattr(_Painting, "is_on", False)


class _Painting:
    """Whether views are painted."""

    is_on = True


def _painted_if_wanted(self, _paint=QVTKRenderWindowInteractor.paintGL):
    if _Painting.is_on:
        _paint(self)


QVTKRenderWindowInteractor.paintGL = _painted_if_wanted


@pytest.fixture(autouse=True)
def poses_are_not_finished(monkeypatch):
    """Leave poses as they are after a drag: a later change would be saved once more."""
    monkeypatch.setattr(finishing, "MOST_VERTICES", 0)


@pytest.fixture
def boxes() -> Iterator[Any]:
    """Yield a user who answers dialogs, with every answer that the test has prepared."""
    from app_hands import Boxes, application  # which skips the tests where there is no screen

    application()
    made = Boxes()
    yield made
    assert made.unexpected == []
    assert made.answers == []
