"""The menu of the right button: it opens at a click, and its entries do what they say, undone."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hands import Hand, draw_seldom, look_from, plain_view
from numpy.testing import assert_array_equal
from scenes import sausage

from vtk_segdeform import Session
from vtk_segdeform.session import solving
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.panel import menu, press
from vtk_segdeform.widgets.scene import Phase, Pointer

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")
SCENE = sausage(is_coarse=True)


class Bench:
    """An editor over two regions, of which one is called arm, seen from the front, and a hand."""

    def __init__(self):
        self.session = Session(SCENE.mesh)
        self.session.set_regions(SCENE.regions)
        self.session.painting.rename(1, "arm")
        self.session.set_cages(SCENE.cages)
        self.session.bind()
        view = plain_view()
        self.editor = DeformEditor(view, self.session)
        look_from(view, 0.0, -12.0, 0.0)
        draw_seldom(view)
        self.editor.On()
        self.hand, self.opened = Hand(view), 0
        self.editor.controller.show_menu = self.open

    def open(self, _):
        self.opened += 1

    def click(self, place, *way, button="Right"):
        """Press the right button at *place*, move along a *way*, and release."""
        self.hand.event("MouseMoveEvent", place)
        self.hand.event(f"{button}ButtonPressEvent", place)
        for step in way:
            self.hand.event("MouseMoveEvent", place + step)
        self.hand.event(f"{button}ButtonReleaseEvent")

    def entry(self, name):
        return next(f for f in menu(self.editor) if f is not None and f.name == f"menu.{name}")

    def settle(self):
        puller = self.editor.widgets.puller
        for _ in range(300):
            self.hand.tick()
            if not (puller.is_refining or self.editor.is_busy):
                return
        raise AssertionError("the pose does not settle")


@pytest.fixture
def bench():
    made = Bench()
    yield made
    assert made.hand.failures == []
    made.editor.remove()


@pytest.fixture
def arm(bench):
    """Return the place of a vertex of the arm on the screen, and open the menu there."""
    x = SCENE.mesh.vertices
    vertex = int(np.where(x[:, 1] < 0.0, np.abs(x[:, ::2] - [1.8, 0.0]).max(axis=1), 9.0).argmin())
    place = np.array(bench.hand.at(x[vertex]))
    bench.session.pull(vertex, x[vertex] + [0.2, 0.0, 0.8])
    bench.session.commit("pull")
    place = np.array(bench.hand.at(bench.session.vertices[vertex]))
    bench.click(place)
    return place


def test_it_opens_at_a_click_and_not_at_a_drag_nor_where_that_cancels(bench, arm):
    assert bench.opened == 1
    assert bench.editor.controller.spot.region == 1
    camera = bench.editor.view.camera.GetPosition()
    bench.click(arm, [0.0, 2.0], [0.0, 0.0])  # a hand is never quite still
    assert bench.opened == 2
    bench.click(arm, [0.0, 30.0])
    assert bench.opened == 2
    assert bench.editor.view.camera.GetPosition() != camera  # a drag zooms
    bench.editor.controller.camera.viewpoint.frame(animate=False)
    bench.hand.press(arm)
    bench.hand.move(arm + [20.0, 0.0])
    bench.click(arm + [20.0, 0.0])  # cancels the pull
    assert bench.opened == 2
    bench.hand.release()
    bench.click(np.array([5.0, 5.0]))  # beside the mesh
    assert bench.opened == 3
    assert menu(bench.editor)[0].name.startswith("view.")


def test_a_part_is_reset_and_the_rest_follows(bench, arm):
    session, rest = bench.session, SCENE.mesh.vertices
    session.pull(int(rest[:, 0].argmin()), rest[rest[:, 0].argmin()] + [0.0, 0.0, 0.7])
    session.commit("pull")
    own, posed, state = SCENE.regions.labels == 1, session.vertices, session.state
    assert bench.entry("reset").label == "Reset arm"
    assert press(bench.editor, "menu.reset") is None
    bench.editor.wait()
    away = np.linalg.norm(session.vertices - rest, axis=1)
    assert away[own].max() < 0.05 < 0.5 < np.linalg.norm(posed - rest, axis=1)[own].max()
    assert away[~own].max() > 0.3
    assert abs(session.volume_change) < 1e-12
    assert session.history.undo_label == "reset arm"
    assert list(session.handles) == list(state.handles)
    bench.hand.types("ctrl+z")
    assert_array_equal(session.vertices, posed)


def test_a_slow_reset_of_a_part_leaves_the_window_free_and_is_cancelled(bench, arm, monkeypatch):
    session, editor, goes_on = bench.session, bench.editor, threading.Event()

    def slow(*how, progress, **more):
        assert goes_on.wait(60.0)
        progress(0.5, "")
        raise AssertionError("not cancelled")

    monkeypatch.setattr(solving, "solve", slow)
    before = session.state
    assert press(editor, "menu.reset") is None
    assert editor.is_busy
    assert "Resetting" in editor.status
    bench.hand.types("kp_1")  # the camera moves meanwhile
    bench.hand.types("Escape")
    goes_on.set()
    editor.wait()
    assert session.state is before
    assert not editor.is_busy


def test_points_are_pinned_parts_rigid_kept_and_enlarged_handles_locked(bench, arm):
    session, editor = bench.session, bench.editor
    name = editor.controller.spot.handle
    assert name == "pull 1"
    assert not bench.entry("lock").value
    press(editor, "menu.lock")
    assert bench.entry("lock").value
    assert name in editor.widgets.dragger.locked
    assert bench.entry("pin").label == "Remove pull 1"
    press(editor, "menu.pin")
    assert not session.handles
    bench.click(arm)
    press(editor, "menu.pin")
    assert list(session.handles) == ["pin 1"]
    press(editor, "menu.rigid")
    assert bench.entry("rigid").value
    assert_array_equal(np.isinf(session.state.stiffness), SCENE.regions.labels == 1)
    press(editor, "menu.rigid")
    assert session.state.stiffness is None
    press(editor, "menu.keep")
    bench.settle()
    assert bench.entry("keep").value
    assert abs(session.volume("region 1")[1]) < 1e-9
    press(editor, "menu.grow")
    bench.settle()
    assert session.volume("region 1")[1] == pytest.approx(0.2, abs=1e-9)
    press(editor, "menu.frame")
    editor.mode = Mode.DEFORM
    press(editor, "menu.reset_pose")
    assert session.state.pose is None
    assert not bench.entry("reset").enabled


def test_an_isolated_part_is_shown_and_grabbed_alone_until_everything_is_shown(bench, arm):
    editor, surface = bench.editor, bench.editor.widgets.surface
    own = SCENE.regions.membership[1][SCENE.mesh.faces].all(axis=1)
    far = np.array(bench.hand.at(SCENE.mesh.vertices[SCENE.mesh.vertices[:, 0].argmin()] + 0.1))
    other = lambda: editor.widgets.spot_at(Pointer(Phase.HOVER, *far))  # noqa: E731
    assert other() is not None
    bench.session.handles.pin(other().vertex)
    visible = editor.widgets.selector._picker.visible()
    assert visible[~SCENE.regions.membership[1]].any()
    assert editor.widgets.puller._markers._shown.keys() == {"pin 1", "pull 1"}
    press(editor, "menu.isolate")
    assert editor.widgets.puller._markers._shown.keys() == {"pull 1"}
    assert "Only arm is shown" in editor.status
    assert surface.polydata.GetNumberOfPolys() == own.sum()
    assert bench.entry("isolate").value
    assert other() is None
    assert editor.widgets.spot_at(Pointer(Phase.HOVER, *arm)).region == 1
    visible = editor.widgets.selector._picker.visible()
    assert not visible[~SCENE.regions.membership[1]].any()
    assert not bench.session.history.redo_label
    bench.hand.press(far)  # beside what is shown
    assert not editor.widgets.puller.is_grabbing
    bench.hand.release()
    press(editor, "view.isolate")
    assert surface.polydata.GetNumberOfPolys() == SCENE.mesh.n_faces
    assert other() is not None
    bench.hand.types("slash", arm)
    assert surface.polydata.GetNumberOfPolys() == own.sum()
    bench.hand.types("slash", (3, 3))
    assert surface.only is None
    bench.hand.types("slash", (3, 3))
    assert "Point at the part" in editor.status
    bench.hand.failures.clear()  # that refusal
