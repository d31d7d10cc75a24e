"""Interruptions in Qt: other timers, loss of focus, closing.

In mid-drag, while a pose converges, or during a job: nothing hangs, and no drag is lost.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from key_moments import STEPS, Stand, Story, slow_down
from qt_hands import QtCore, application
from qt_moments import QtStand, delete_now

from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.handle_dragger import live_solve

DRAG = STEPS[Mode.DEFORM]


@pytest.fixture(scope="module")
def slowly():
    with pytest.MonkeyPatch.context() as patch:
        slow_down(patch)
        yield


@pytest.fixture(scope="module")
def stand(slowly, tmp_path_factory):
    """Yield an editor that all tests share."""
    stand = QtStand(tmp_path_factory.mktemp("qt"), is_drawn=False)
    yield stand
    stand.close()


@pytest.fixture
def another(slowly, tmp_path):
    """Yield an editor that a test may close."""
    stand = QtStand(tmp_path, is_drawn=False)
    yield stand
    stand.close()


def dragged(stand: Stand, *, during: bool):
    """Drag the handle; release it unless the interruption comes *during* the drag."""
    stand.begin(Mode.DEFORM)
    place = stand.drag(Mode.DEFORM)
    if not during:
        stand.hand.release(place)
        assert stand.editor.widgets.dragger.is_refining
    return place


def is_kept(stand: Stand, place) -> Story:
    """Release, and check that the drag is the first step of the history; return the story."""
    stand.hand.release(place)
    stand.hand.failures.clear()  # refusals are reported
    with pytest.MonkeyPatch.context() as patch:  # nothing interrupts any more
        patch.setattr(live_solve, "STEPS", 20)
        stand.settle()
    story = Story.of(stand.session)
    assert story.labels[0] == DRAG
    assert not story.states[0].changes(stand.start)
    assert story.states[1].pose is not None
    return story


@pytest.mark.parametrize("what", ["timer", "interactor"])
def test_a_job_ends_even_if_a_foreign_timer_ends_or_the_interactor_is_initialised_again(
    stand, what
):
    dragged(stand, during=False)
    interactor = stand.editor.view.interactor
    with stand.job() as delivered:
        if what == "timer":
            interactor.DestroyTimer(interactor.CreateRepeatingTimer(50))
        else:
            interactor.ReInitialize()
            stand.widget.plotter.iren.initialize()
    assert delivered == ["counted"]


@pytest.mark.parametrize("what", ["focus", "release"])
def test_a_drag_that_loses_the_focus_or_its_release_is_finished(stand, what):
    place = dragged(stand, during=True)
    if what == "focus":
        stand.widget.panel.controls["deform.stretch"].setFocus()
        event = QtCore.QEvent(QtCore.QEvent.WindowDeactivate)
        application().sendEvent(stand.widget, event)
        assert stand.session.is_dragging
    else:  # released in a dialog: the next press, beside the mesh, ends the drag
        stand.hand.press((5.0, 5.0))
        assert not stand.session.is_dragging
        stand.hand.release((5.0, 5.0))
    story = is_kept(stand, place)
    assert (story.labels, story.done) == ([DRAG], 1)


def test_a_slot_that_processes_events_loses_no_drag(stand):
    stand.begin(Mode.DEFORM)
    stand.draw()
    first, second, last = stand.way(Mode.DEFORM)
    waiting = [np.round(0.5 * (second + last)), last]

    def deformed():
        if waiting:
            stand.hand.move(waiting.pop(0))
        application().processEvents()

    stand.widget.deformed.connect(deformed)
    try:
        stand.hand.press(first)
        stand.hand.move(second)
        assert not waiting
        stand.hand.release(last)
    finally:
        stand.widget.deformed.disconnect(deformed)
    story = is_kept(stand, last)
    assert (story.labels, story.done) == ([DRAG], 1)
    centre = stand.session.targets["tip"].mean(axis=0)
    assert np.linalg.norm(stand.hand.at(centre) - last) < 3.0


@pytest.mark.parametrize("moment", every(3, ["in mid-drag", "converging", "in a job"]))
def test_closing_a_widget_is_immediate_and_keeps_the_drag(another, moment):
    dragged(another, during=moment == "in mid-drag")
    if moment == "in a job":
        another.editor.do(lambda c: c.start("counting", lambda _: "counted", print))
    session = another.session
    another.widget.close()
    assert not another.editor.is_busy
    assert not another.has_timers()
    assert session.history.undo_label == DRAG
    assert not session.is_dragging
    assert abs(session.volume_change) < 1e-12
    session.undo()
    assert session.state is another.start
    delete_now()
