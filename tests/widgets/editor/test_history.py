"""The history of the editor: names of states, jumps, and previews that change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, draw_seldom, plain_view
from scenes import sausage

from vtk_segdeform.session.session import Session
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor.actions import redo, undo
from vtk_segdeform.widgets.editor.history import (
    jumping_to,
    position_of,
    preview,
    states_of,
)
from vtk_segdeform.widgets.editor.neighbours import Neighbour

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")
UP = np.eye(4)
UP[2, 3] = 0.3


@pytest.fixture
def editor():
    """Return an editor over a session with two steps, "tip" and a drag of it."""
    scene, view = sausage(is_coarse=True), plain_view((200, 200))
    session = Session(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session = Session(scene.mesh, state=session.state)
    session.handles.add(scene.handle, "tip")
    draw_seldom(view)
    editor = DeformEditor(view, session)
    editor.mode = Mode.REGIONS
    editor.On()
    session.move_handle("tip", UP)
    session.commit()
    return editor


def test_states_are_named_and_a_jump_reaches_even_the_one_before_the_session(editor):
    controller, session, undone = editor.controller, editor.session, []
    assert states_of(controller) == ("Opened", "Set tip", "Drag tip")
    editor.do(jumping_to(1))
    assert editor.status.startswith("History: Set tip")
    assert (position_of(controller), len(states_of(controller))) == (1, 3)

    def enter(position, message):
        undone.append((session.history.position, position, message))

    controller.neighbours.before = Neighbour("repair", ("Opened", "Pull"), enter)
    assert states_of(controller) == ("Opened", "Pull", "Repair", "Set tip", "Drag tip")
    editor.do(jumping_to(4))
    assert (session.history.position, position_of(controller), undone) == (2, 4, [])
    editor.do(jumping_to(0))
    assert undone == [(0, 0, "History: Opened")]
    assert controller.undo_label == "repair"
    editor.do(undo)
    assert undone[1:] == [(0, 1, "Undo: repair")]


def test_the_states_of_a_session_that_followed_are_in_the_history_until_a_step_replaces_them(
    editor,
):
    controller, session, entered = editor.controller, editor.session, []
    session.history.jump(1)

    def enter(position, message):
        entered.append((session.history.position, position, message))

    after = Neighbour("repair", ("Pull",), enter)
    controller.neighbours.follow(session, 1, after)
    assert states_of(controller) == ("Opened", "Set tip", "Repair", "Pull")
    assert controller.redo_label == "repair"
    session.history.jump(0)
    assert controller.redo_label == "set tip"
    assert states_of(controller)[2:] == ("Repair", "Pull")
    for position in (2, 3):
        session.history.jump(0)
        editor.do(jumping_to(position))
    session.history.jump(1)
    editor.do(redo)
    assert entered == [
        (1, 2, "History: Repair"),
        (1, 3, "History: Pull"),
        (1, 2, "Redo: repair"),
    ]
    preview(controller, 2)
    assert editor.widgets.surface.instead is None  # that pose is of another mesh
    session.set_fixed([250])
    assert states_of(controller) == ("Opened", "Set tip", "Set fixed vertices")
    session.undo()
    assert controller.redo_label == "set fixed vertices"


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
    session.change_options(stretch=5.0)  # by a script
    assert surface.instead is None
    np.testing.assert_array_equal(surface.points, end)
    session.move_handle("tip", UP, max_steps=1)
    assert not shows_rest(0)  # during a drag
    assert session.is_dragging
    session.commit()
    controller.start("Waiting", lambda _: None, lambda _: None)
    assert not shows_rest(0)  # during a job
    editor.wait()
    controller.neighbours.before = Neighbour("repair", ("Opened",), lambda *_: None)
    assert not shows_rest(0)  # the pose before the session is not known
    assert shows_rest(1)


def test_a_preview_neither_binds_cages_nor_ends_refinement(editor):
    session, controller, surface = editor.session, editor.controller, editor.widgets.surface
    posed = session.vertices
    for k in range(3):
        session.change_options(stretch=float(k + 2))  # only the last three are bound
        session.bind()
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
