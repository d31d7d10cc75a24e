"""An editor whose panel moves, saves and blends poses."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hands import draw_seldom, look_from, plain_view
from scenes import sausage

from vtk_segdeform.widgets import DeformEditor, Mode


@pytest.fixture
def editor() -> Iterator[DeformEditor]:
    """Yield an editor that deforms the coarse sausage, seen from the front."""
    view = plain_view()
    made = DeformEditor(view, sausage(is_coarse=True).session())
    look_from(view, 0.0, -12.0, 0.0)
    draw_seldom(view)
    made.On()
    made.mode = Mode.DEFORM
    made.wait()
    made.controller.finishing.is_wanted = False
    yield made
    made.remove()
