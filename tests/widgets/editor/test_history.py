"""The history of the editor: names of states, jumps, and previews that change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, draw_seldom, plain_view
from scenes import sausage

from vtk_segdeform.session.session import Session
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import jumping_to, preview, states_of

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


def test_states_are_named_and_a_jump_reaches_each(editor):
    session = editor.session
    assert states_of(session) == ("Opened", "Set tip", "Drag tip")
    for position in (1, 0, 2):
        editor.do(jumping_to(position))
        assert editor.status.startswith(f"History: {states_of(session)[position]}")
        assert session.history.position == position


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
    assert shows_rest(0)


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
