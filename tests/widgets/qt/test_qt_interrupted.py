"""Interruptions in Qt: clicks in the panel, other timers, loss of focus, closing.

In mid-drag, while a pose converges, or during a job: nothing hangs, and no drag is lost.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from key_moments import STEPS, Stand, Story, ready, slow_down
from qt_hands import Qt, QtCore, QtTest, QtWidgets, application
from qt_moments import QtStand, delete_now

from vtk_segdeform.errors import SessionError
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.handle_dragger import live_solve
from vtk_segdeform.widgets.scene.view import View

MOMENTS = pytest.mark.parametrize("during", [True, False], ids=["in mid-drag", "converging"])
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


def settings(panel) -> list:
    """Return all widgets that can be clicked or set in mode 4, except files and modes."""
    kinds = QtWidgets.QAbstractButton, QtWidgets.QAbstractSpinBox
    owners = panel, panel.toolbar  # which is not inside the panel of a `DeformWidget`
    inside = {each for kind in kinds for owner in owners for each in owner.findChildren(kind)}
    found = [each for each in inside if each.isVisible()]
    asking = (
        panel.toolbar.buttons["open"],
        panel.toolbar.buttons["save"],
        panel.toolbar.buttons["view"],
    )  # a dialog or a menu
    return [each for each in found if each.isEnabled() and each not in asking]


@pytest.mark.parametrize(
    ("during", "step"),
    [pytest.param(True, 1, id="in mid-drag", marks=pytest.mark.campaign),
     pytest.param(False, 1, id="converging", marks=pytest.mark.campaign),
     pytest.param(False, 5, id="every fifth, converging")],
)  # fmt: skip
def test_any_action_in_the_panel_finishes_the_drag(stand, during, step):
    panel = stand.widget.panel
    panel.history.fold.setChecked(True)
    dragged(stand, during=False)
    stand.settle()
    controls = sorted(settings(panel), key=lambda each: (type(each).__name__, each.toolTip()))
    assert len(controls) > 12
    for control in controls[::step]:
        place = dragged(stand, during=during)
        panel.refresh()
        assert control.isEnabled()
        if isinstance(control, QtWidgets.QAbstractButton):
            control.click()
        else:
            control.stepUp()
        stand.hand.move(place + [-40.0, -30.0])
        stand.hand.move(place)
        assert len(is_kept(stand, place).labels) <= 2
        panel.history.fold.setChecked(True)


@MOMENTS
def test_undo_in_the_panel_reverts_the_drag_and_redo_restores_it(stand, during):
    panel, place = stand.widget.panel, dragged(stand, during=during)
    stand.editor.controller.refresh()
    panel.refresh()
    QtTest.QTest.mouseClick(panel.toolbar.buttons["undo"], Qt.LeftButton)
    assert is_kept(stand, place).done == 0
    assert stand.session.state is stand.start
    QtTest.QTest.mouseClick(panel.toolbar.buttons["redo"], Qt.LeftButton)
    stand.settle()
    assert stand.session.history.undo_label == DRAG


@MOMENTS
def test_a_job_started_by_the_host_finishes_the_drag_first(stand, during):
    place = dragged(stand, during=during)
    with stand.job() as delivered:
        assert stand.session.history.undo_label == DRAG
        pose = stand.session.state.pose
        stand.hand.move(place + [-40.0, -30.0])
        stand.hand.release(place)
        assert stand.session.state.pose is pose  # the job owns it meanwhile
    assert delivered == ["counted"]
    assert is_kept(stand, place).done == 1


def test_cancelling_twice_and_a_second_job_are_harmless(stand):
    stand.begin(Mode.DEFORM)
    cancel = stand.widget.panel.status.cancel
    with stand.job() as delivered:
        with pytest.raises(SessionError, match=r"Busy\. counting"):
            stand.editor.controller.start("more", lambda _: "more", delivered.append)
        stand.editor.do(lambda c: c.start("more", lambda _: "more", delivered.append))
        stand.until(cancel.isVisible, "the button")
        for _ in range(2):
            QtTest.QTest.mouseClick(cancel, Qt.LeftButton)
            stand.hand.types("escape")
        assert "Stopping" in stand.editor.status
    assert delivered == []
    assert "Cancelled" in stand.editor.status
    with stand.job() as delivered:
        pass
    assert delivered == ["counted"]


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


def test_two_editors_in_one_view_do_not_block_each_other(stand):
    stand.begin(Mode.DEFORM)  # before the other one, so that a press is ours
    view = View.of(stand.widget.plotter)
    view.render = lambda: None
    other = DeformEditor(view, ready())
    other.On()
    try:
        dragged(stand, during=False)  # one editor refines while the other runs a job
        done = []
        other.do(lambda c: c.start("counting", lambda _: "counted", done.append))
        stand.until(lambda: done, "the other one's job")
        stand.settle()
        dragged(stand, during=False)
        with stand.job() as delivered:
            other.do(lambda c: c.start("counting", lambda _: "counted", done.append))
            stand.until(lambda: len(done) == 2, "the other one's job")
        assert delivered == ["counted"]
    finally:
        other.remove()
    stand.settle()


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
