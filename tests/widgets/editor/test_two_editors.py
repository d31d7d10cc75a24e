"""Two editors side by side in one window: each receives only its own events."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, picture, plain_view
from scenes import sausage
from vtkmodules.vtkRenderingCore import vtkRenderer

from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("unprepared")

LEFT, RIGHT = (120, 120), (360, 120)


@pytest.fixture
def halves():
    """Return two editors, in the left and right half of a window, and a hand in it."""
    left = plain_view((480, 240))
    left.renderer.SetViewport(0.0, 0.0, 0.5, 1.0)
    renderer = vtkRenderer()
    renderer.SetViewport(0.5, 0.0, 1.0, 1.0)
    left.window.AddRenderer(renderer)
    right = View(renderer, left.interactor)
    editors = [DeformEditor(view, sausage(2, is_coarse=True).mesh) for view in (left, right)]
    for editor in editors:
        editor.mode = Mode.REGIONS
        editor.On()
    left.render()
    hand = Hand(left)
    right.on_failure(hand.failures.append)
    yield editors, hand
    assert hand.failures == []
    for editor in editors:
        editor.remove()


def test_keys_go_to_the_one_under_the_pointer_and_to_its_widgets(halves):
    (left, right), hand = halves
    hand.move(RIGHT)
    hand.key("3")
    assert (left.mode, right.mode) == (Mode.REGIONS, Mode.HANDLES)
    hand.move(LEFT)
    hand.key("2")
    assert (left.mode, right.mode) == (Mode.CAGES, Mode.HANDLES)
    hand.key("1")
    before = left.widgets.selector.radius, right.widgets.selector.radius
    hand.move(RIGHT)
    hand.key("bracketright")
    assert left.widgets.selector.radius == before[0]
    assert right.widgets.selector.radius > before[1]


def test_a_removed_editor_leaves_the_display_of_the_other_and_cannot_be_switched_on(halves, capfd):
    (left, right), _ = halves
    before = picture(right.view)[:, 240:]
    left.remove()
    assert np.array_equal(picture(right.view)[:, 240:], before)
    assert (before[-20:] < 128).mean() > 0.5  # the status line is shown
    with pytest.raises(RuntimeError, match="create another one"):
        left.On()
    assert capfd.readouterr().err == ""
    right.remove()
    assert right.view.window.GetNumberOfLayers() == 1


def test_a_single_editor_receives_keys_wherever_the_pointer_is(halves):
    (left, right), hand = halves
    right.remove()
    hand.move(RIGHT)
    hand.key("3")
    assert left.mode is Mode.HANDLES
