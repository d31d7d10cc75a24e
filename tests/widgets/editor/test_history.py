"""The history of the editor: names of states, jumps, and previews that change nothing."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hands import Hand, draw_seldom, plain_view
from scenes import sausage

from vtk_segdeform import models, save_session
from vtk_segdeform.session.session import Session
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import (
    Controller,
    SessionFile,
    jumping_to,
    preview,
    states_of,
)

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")
UP = np.eye(4)
UP[2, 3] = 0.3


@pytest.fixture
def editor():
    """Return an editor over a session with two steps, "tip" and a drag of it."""
    scene, view = sausage(is_coarse=True), plain_view((200, 200))
    session = scene.caged()
    session = Session(scene.mesh, state=session.state)
    session.handles.add(scene.handle, "tip")
    draw_seldom(view)
    editor = DeformEditor(view, session)
    editor.mode = Mode.REGIONS
    editor.On()
    session.move_handle("tip", UP)
    session.commit()
    return editor


def test_states_are_named_and_a_jump_reaches_each(editor):
    controller = editor.controller
    assert states_of(controller) == ("Opened", "Set tip", "Drag tip, 0.3")
    for position in (1, 0, 2):
        editor.do(jumping_to(position))
        assert editor.status.startswith(f"History: {states_of(controller)[position]}")
        assert editor.session.history.position == controller.history.position == position


FIXED = "Set fixed vertices"
WHOLE = "Opened", "Set tip", "Repair", FIXED, "Repair", FIXED
PLACES = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]  # sessions, and positions in them


class Repaired:
    """An editor whose mesh was repaired twice, and each copy edited."""

    def __init__(self, editor):
        self.editor, self.sessions = editor, [editor.session]
        editor.run("undo")  # the repair takes the place of the drag
        for n in (300, 500):
            copy = Session(models.sphere(n))
            file = SessionFile(Path(f"{n}.segdeform"), copy)
            assert editor.do(partial(Controller.open_repaired, session=copy, file=file)) is None
            copy.set_fixed([7])
            self.sessions.append(copy)

    def check(self, position):
        """Check that the editor shows the state at *position*, with the file of its session."""
        editor, history = self.editor, self.editor.controller.history
        number, own = PLACES[position]
        assert editor.session is self.sessions[number]
        assert editor.session.history.position == own
        assert (history.position, states_of(editor.controller)) == (position, WHOLE)
        assert editor.path.name == ("session.segdeform", "300.segdeform", "500.segdeform")[number]


@pytest.fixture
def repaired(editor):
    """Return the editor after two repairs, at its last state."""
    return Repaired(editor)


def test_a_repair_is_a_step_that_is_undone_and_redone_as_any_other(editor, repaired):
    history, camera = editor.controller.history, editor.view.camera.GetPosition()
    repaired.check(5)
    for verb, way in (("undo", range(4, -1, -1)), ("redo", range(1, 6))):
        for position in way:
            label = history.undo_label if verb == "undo" else history.redo_label
            assert editor.run(verb) is None
            assert editor.status.startswith(f"{verb.capitalize()}: {label}")
            repaired.check(position)
        editor.run(verb)
        assert editor.status.startswith(f"Nothing to {verb}")
    assert editor.view.camera.GetPosition() == camera


def test_a_jump_leads_to_a_state_of_any_session(editor, repaired):
    for position in (0, 5, 1, 2, 0, 3, 4, 1, 5, 2):
        editor.do(jumping_to(position))
        assert editor.status.startswith(f"History: {WHOLE[position]}")
        repaired.check(position)
    preview(editor.controller, 3)
    assert editor.widgets.surface.instead is not None
    preview(editor.controller, 1)
    assert editor.widgets.surface.instead is None  # a pose of another mesh


def test_another_step_in_place_of_a_repair_replaces_the_copies(editor, repaired):
    controller = editor.controller
    editor.do(jumping_to(1))
    editor.session.move_handle("tip", UP, max_steps=1)
    assert states_of(controller) == ("Opened", "Set tip", "Drag tip, 0.3")
    assert controller.history.redo_label is None
    editor.session.revert()
    repaired.check(1)
    editor.do(jumping_to(2))
    repaired.sessions[1].set_fixed([3])  # instead of fixing 7, and of the second repair
    assert states_of(controller) == WHOLE[:4]
    editor.do(jumping_to(0))
    assert states_of(controller) == WHOLE[:4]
    editor.session.set_fixed([3])
    assert states_of(controller) == ("Opened", FIXED)
    editor.run("undo")
    assert controller.history.redo_label == "set fixed vertices"


def test_each_session_has_unsaved_changes_of_its_own(editor, repaired):
    is_modified = []
    for position in (5, 4, 2, 3):
        editor.do(jumping_to(position))
        is_modified.append(editor.controller.is_modified)
    assert is_modified == [True, False, False, True]


def test_a_file_that_is_opened_begins_another_history(editor, repaired, tmp_path):
    save_session(tmp_path / "other.segdeform", Session(models.sphere(300)))
    editor.load(tmp_path / "other.segdeform")
    assert states_of(editor.controller) == ("Opened",)
    assert editor.session not in repaired.sessions
    assert editor.controller.history.undo_label is None


def test_a_preview_shows_another_state_until_anything_happens(editor):
    controller, session, hand = editor.controller, editor.session, Hand(editor.view)
    surface, state, end = editor.widgets.surface, session.state, session.vertices

    def shows_rest(position):
        preview(controller, position)
        return np.array_equal(surface.points, session.mesh.vertices)

    assert shows_rest(0)
    assert editor.status == "History: Opened"
    assert not shows_rest(2)  # the current state
    assert "History" not in editor.status
    assert shows_rest(1)
    assert session.state is state
    assert session.vertices is end
    hand.types("w")  # a key of the editor
    assert surface.instead is None
    assert shows_rest(0)
    session.handles.set_pivot("tip", [0.0, 0.0, 0.0])  # by a script
    assert surface.instead is None
    np.testing.assert_array_equal(surface.points, end)
    session.move_handle("tip", UP, max_steps=1)
    assert not shows_rest(0)  # during a drag
    assert session.is_dragging
    session.commit()
    controller.start("Waiting", lambda _: None, lambda _: None)
    assert not shows_rest(0)  # during a job
    editor.wait()
    assert shows_rest(0)


def test_a_preview_neither_binds_cages_nor_ends_refinement(editor):
    session, controller, surface = editor.session, editor.controller, editor.widgets.surface
    posed = session.vertices
    session.change_options(stretch=3.0)  # with which they are not bound yet
    session.history.jump(0)
    assert session.poses.peek(session.history.state_at(2)) is None
    preview(controller, 2)
    assert surface.instead is None
    editor.do(jumping_to(2))
    np.testing.assert_array_equal(surface.points, posed)
    editor.mode = Mode.DEFORM
    session.move_handle("tip", np.eye(4) + 3.0 * (UP - np.eye(4)), max_steps=1)
    session.commit()
    assert session.solution.status is Status.STEP_LIMIT
    editor.widgets.dragger._live.resume()
    preview(controller, 0)
    assert surface.instead is None
    assert editor.widgets.dragger.is_refining


def test_a_row_of_a_state_that_was_dropped_does_nothing(editor):
    """A list is redrawn a moment after an edit has dropped what was undone."""
    hand, state = Hand(editor.view), editor.session.state
    dropped = len(states_of(editor.controller))
    assert editor.do(jumping_to(dropped)) is None
    preview(editor.controller, dropped)
    assert hand.failures == []
    assert editor.widgets.surface.instead is None
    assert editor.session.state is state
