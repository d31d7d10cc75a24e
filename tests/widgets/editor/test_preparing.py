"""The preparation for pulls: it runs in the background, and nothing else waits for it."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from types import SimpleNamespace

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, plain_view
from numpy.testing import assert_array_equal
from scenes import sausage

from vtk_segdeform import Regions, Session, load_session, sizes
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.errors import CageError
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io.convert import write_mesh
from vtk_segdeform.session import Preparation, StandIn
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import actions, controller, queue, saving
from vtk_segdeform.widgets.panel.volumes import volumes_section


@pytest.fixture(scope="module")
def prepared():
    """Return a mesh and the preparation of its session; tests do not change them."""
    session = Session(sausage(is_coarse=True).mesh)
    session.set_regions(Regions.single(session.mesh))
    return session.mesh, session.preparation()


class Gate:
    """Preparations that report 40 %, wait until the gate is open, and then return a result."""

    def __init__(self, result: Preparation):
        self.result, self.error = result, None
        self.is_open, self.has_begun = threading.Event(), threading.Event()
        self.begun = self.cancelled = 0

    def prepare(self, progress):
        self.begun += 1
        try:
            progress(0.4, "waiting")
            self.has_begun.set()
            while not self.is_open.wait(0.001):
                progress(0.4, "waiting")
        except BaseException:
            self.cancelled += 1
            raise
        if self.error is not None:
            raise self.error
        return self.result


class Bench:
    """An editor in mode PULL, seen from the front, and a simulated hand."""

    def __init__(self, mesh, gate, monkeypatch):
        monkeypatch.setattr(Session, "preparation", lambda _, progress: gate.prepare(progress))
        self.view, self.gate = plain_view((250, 200)), gate
        self.editor = DeformEditor(self.view, mesh)
        camera = self.view.camera
        camera.SetPosition(0.0, -5.0, 0.5)
        camera.SetFocalPoint(0.0, 0.0, 0.5)
        camera.SetViewUp(0.0, 0.0, 1.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        draw_seldom(self.view)
        self.hand = Hand(self.view)
        self.editor.mode = Mode.PULL
        self.editor.On()

    @property
    def session(self):
        return self.editor.session

    @property
    def puller(self):
        return self.editor.widgets.puller

    @property
    def surface(self):
        return self.editor.widgets.surface

    @property
    def aside(self):
        return self.editor.controller.messages.fraction

    @property
    def place(self):
        """A pixel of the surface."""
        return np.array(self.hand.at(self.session.mesh.vertices.mean(axis=0)))

    def until(self, seen):
        end = time.monotonic() + 20.0
        while not seen():
            assert time.monotonic() < end, "waited in vain"
            self.hand.tick()

    def finish(self):
        self.gate.is_open.set()
        self.until(lambda: not self.editor.is_preparing)


@pytest.fixture
def bench(prepared, monkeypatch):
    """Yield an editor in mode PULL whose preparation waits for a gate."""
    mesh, result = prepared
    made = Bench(mesh, Gate(result), monkeypatch)
    yield made
    made.gate.is_open.set()
    made.editor.remove()


@pytest.fixture
def standing_in(monkeypatch, request):
    """Yield the same with a stand-in, although the mesh is small."""
    monkeypatch.setattr(sizes, "STAND_IN_POINTS", 100)
    return request.getfixturevalue("bench")


def test_everything_works_meanwhile_and_the_result_is_no_step(bench):
    editor, hand, camera = bench.editor, bench.hand, bench.view.camera
    bench.until(lambda: bench.aside == 0.4)
    assert "Preparing ... 40 % (Esc)" in editor.controller.messages._line.aside
    assert not editor.is_busy
    before = camera.GetPosition()
    hand.drag([(5, 5), (40, 30)])  # beside the mesh
    assert camera.GetPosition() != before
    hand.types("h")
    assert editor.controller.help.is_shown
    hand.types("escape")  # closes the help card only
    assert editor.is_preparing
    assert editor.do(actions.toggle_volume) is None
    assert editor.do(actions.toggle_volume) is None
    bench.finish()
    assert bench.aside is None
    assert bench.session.is_bound
    assert not bench.session.history.can_undo
    assert not editor.controller.file.is_modified(bench.session)
    assert bench.gate.begun == 1
    assert hand.failures == []


def test_a_press_during_opening_becomes_a_pull(bench, tmp_path, monkeypatch):
    monkeypatch.undo()  # the real preparation
    write_mesh(tmp_path / "a.ply", bench.session.mesh)
    bench.editor.load(tmp_path / "a.ply")
    before, session = bench.session.vertices, bench.session
    assert not session.is_bound
    start = bench.place
    bench.hand.press(start)
    bench.hand.move(start + [30.0, 0.0])
    bench.until(lambda: session.is_bound)
    bench.until(lambda: bench.hand.move(start + [40.0, 0.0]) or session.is_dragging)
    assert np.abs(session.vertices - before).max() > 0.01
    bench.hand.release(start + [40.0, 0.0])
    assert session.history.undo_label == "pull"
    session.undo()
    assert not session.history.can_undo
    assert session.is_bound
    assert bench.hand.failures == []


def test_a_stand_in_follows_until_the_session_does(standing_in):
    bench, hand, session = standing_in, standing_in.hand, standing_in.session
    mesh, rest, start, surface = session.mesh, session.mesh.vertices, bench.place, bench.surface
    hand.press(start)
    bench.until(lambda: hand.move(start + [30.0, 0.0]) or np.abs(surface.points - rest).max() > 0.1)
    assert not session.is_bound
    assert "Preview until" in bench.editor.status
    volume = signed_volume(rest, mesh.faces)
    assert abs(signed_volume(surface.points, mesh.faces) / volume - 1.0) < 1e-12
    assert_array_equal(session.vertices, rest)
    assert not session.history.can_undo
    hand.key("Escape")
    assert_array_equal(surface.points, rest)
    hand.release()
    hand.press(start)
    hand.move(start + [30.0, 0.0])
    hand.release()
    bench.until(lambda: bench.puller.waiting.is_shown)
    shown = np.array(surface.points)
    assert np.abs(shown - rest).max() > 0.1
    hand.tick(3)
    assert_array_equal(surface.points, shown)  # it stays, and the pull follows
    bench.gate.is_open.set()
    bench.until(lambda: session.history.can_undo)
    assert session.history.undo_label == "pull"
    assert_array_equal(surface.points, session.vertices)
    assert np.linalg.norm(session.vertices - shown, axis=1).mean() < 0.05 * mesh.diagonal
    session.undo()
    assert not session.history.can_undo  # the stand-in is no step
    assert_array_equal(surface.points, rest)
    assert hand.failures == []


def test_a_drag_goes_on_with_the_session_as_soon_as_it_is_bound(standing_in):
    bench, hand, session = standing_in, standing_in.hand, standing_in.session
    start, to, surface = bench.place, bench.place + [0.0, 90.0], bench.surface
    hand.press(start)
    bench.until(lambda: hand.move(to) or bench.puller.waiting.is_shown)
    hand.tick(20)
    farthest = np.abs(surface.points - session.mesh.vertices).max()
    shown = []
    bench.gate.is_open.set()
    bench.until(lambda: shown.append(np.array(surface.points)) or session.is_dragging)
    shown.append(np.array(surface.points))
    assert not bench.puller.waiting.is_shown
    for x in shown:  # not back to rest on the way
        assert np.abs(x - session.mesh.vertices).max() > 0.8 * farthest
    hand.move(to)
    hand.release()
    assert session.history.undo_label == "pull"
    assert hand.failures == []


def release_early(bench):
    """Pull and release while the stand-in is shown; return its pose."""
    bench.hand.press(bench.place)
    bench.until(lambda: bench.hand.move(bench.place + [30.0, 0.0]) or bench.puller.waiting.is_shown)
    bench.hand.release()
    return np.array(bench.surface.points)


@pytest.mark.parametrize("way", every(3, ["undo", "escape", "mode"]))
def test_a_released_pull_can_be_given_up_while_it_waits(standing_in, way):
    bench, editor, rest = standing_in, standing_in.editor, standing_in.session.mesh.vertices
    assert np.abs(release_early(bench) - rest).max() > 0.1
    if way == "escape":
        bench.hand.types("escape")
    elif way == "undo":
        editor.do(actions.undo)
        assert "Undo: pull" in editor.status
    else:
        editor.mode = Mode.REGIONS
        assert "Pull cancelled" in editor.status
        editor.mode = Mode.PULL
    assert_array_equal(bench.surface.points, rest)
    assert not bench.puller.waiting.is_active
    assert "Preview" not in editor.status
    assert editor.is_preparing  # a second Escape would cancel that
    bench.finish()
    bench.hand.tick(5)
    assert not bench.session.history.can_undo
    bench.hand.drag([bench.place, bench.place + [30.0, 0.0]])
    assert bench.session.history.undo_label == "pull"
    assert bench.hand.failures == []


def test_turning_the_camera_keeps_a_pull_that_waits_and_another_press_is_refused(standing_in):
    bench, hand = standing_in, standing_in.hand
    shown = release_early(bench)
    before = bench.view.camera.GetPosition()
    hand.drag([(5, 5), (40, 30)])  # beside the mesh
    assert bench.view.camera.GetPosition() != before
    assert_array_equal(bench.surface.points, shown)
    hand.drag([bench.place, bench.place + [0.0, 20.0]])
    assert "not computed yet" in bench.editor.status
    assert_array_equal(bench.surface.points, shown)
    bench.finish()
    bench.until(lambda: bench.session.history.can_undo)
    assert bench.session.history.undo_label == "pull"
    assert bench.session.undo() == "pull"
    assert not bench.session.history.can_undo
    assert hand.failures == []


def test_the_stand_in_is_hidden_if_the_preparation_fails(standing_in):
    bench = standing_in
    release_early(bench)
    bench.gate.error = CageError("no cage fits")
    bench.finish()
    bench.hand.tick(5)
    assert_array_equal(bench.surface.points, bench.session.mesh.vertices)
    assert len(bench.hand.failures) == 1
    bench.until(lambda: not bench.puller.waiting.is_active)
    assert not bench.editor.controller.is_modified
    bench.gate.error = None
    bench.hand.drag([bench.place, bench.place + [30.0, 0.0]])  # retries
    bench.until(lambda: bench.session.history.can_undo)


def test_a_pull_that_waits_is_an_unsaved_change_and_is_saved(standing_in, tmp_path):
    bench, controller = standing_in, standing_in.editor.controller
    release_early(bench)
    assert controller.is_modified
    bench.editor.do(saving(tmp_path / "pulled.segdeform"))
    assert not (tmp_path / "pulled.segdeform").exists()
    bench.finish()
    bench.until((tmp_path / "pulled.segdeform").exists)
    assert_array_equal(load_session(tmp_path / "pulled.segdeform").vertices, bench.session.vertices)
    assert bench.session.history.can_undo
    assert not controller.is_modified


@pytest.mark.parametrize("change", ["pin", "failure"])
def test_without_a_stand_in_the_pull_waits(monkeypatch, request, change):
    def fails(*_):
        raise ZeroDivisionError("a strange mesh")

    if change == "failure":
        monkeypatch.setattr(StandIn, "of", fails)
    bench = request.getfixturevalue("standing_in")
    hand, session = bench.hand, bench.session
    bench.until(bench.gate.has_begun.is_set)
    if change == "pin":
        session.handles.pin(0)
    hand.press(bench.place)
    hand.move(bench.place + [30.0, 0.0])
    hand.tick(5)
    assert not bench.puller.waiting.is_shown
    assert_array_equal(bench.surface.points, session.vertices)
    bench.gate.is_open.set()
    bench.until(lambda: session.is_dragging)
    hand.release()
    assert session.history.undo_label == "pull"
    assert hand.failures == []


def test_drags_during_the_first_compilation_say_so(bench, monkeypatch):
    bench.finish()
    for is_compiling in (True, False):
        monkeypatch.setattr(controller, "is_compiling", lambda seen=is_compiling: seen)
        bench.hand.press(bench.place)
        bench.hand.move(bench.place + [30.0, 0.0])
        assert ("First run" in bench.editor.status) == is_compiling
        bench.hand.release()


def test_jobs_load_the_kernels_if_the_mesh_is_large(bench, monkeypatch):
    asked = []
    monkeypatch.setattr(controller, "load_for", asked.append)
    bench.editor.controller.start("counting", lambda _: asked.append("work"), lambda _: None)
    bench.until(lambda: not bench.editor.is_busy)
    assert asked == [bench.session.mesh.n_vertices, "work"]


def test_a_thread_that_has_not_ended_keeps_no_widget(prepared, monkeypatch):
    """Widgets that it kept last would be deleted in that thread."""
    mesh, result = prepared
    has_begun, may_end = threading.Event(), threading.Event()

    def preparation(*_):
        has_begun.set()
        return may_end.wait(20.0) and result

    monkeypatch.setattr(Session, "preparation", preparation)
    editor = DeformEditor(plain_view((100, 100)), Session(mesh))
    editor.On()
    assert has_begun.wait(20.0)
    gone = [weakref.ref(each) for each in (editor, editor.controller, editor.widgets)]
    editor.remove()
    del editor
    gc.collect()
    assert [each() for each in gone] == [None] * 3
    may_end.set()


@pytest.fixture
def kernels(monkeypatch):
    """Return a list of what has been loaded; the clock of a rest stands still."""
    loaded = []
    monkeypatch.setattr(controller, "load_early", lambda: loaded.append("kernels"))
    monkeypatch.setattr(queue, "time", SimpleNamespace(monotonic=lambda: 0.0))
    return loaded


def test_kernels_are_loaded_once_the_hand_has_rested(kernels, bench, monkeypatch):
    def wait(seconds):
        monkeypatch.setattr(queue, "time", SimpleNamespace(monotonic=lambda: seconds))
        bench.hand.tick(3)

    monkeypatch.setattr(controller, "_REST", 1.0)  # as in the program
    bench.until(bench.gate.has_begun.is_set)
    bench.hand.press(bench.place + [0.0, 10.0])
    bench.hand.release()
    wait(5.0)
    assert not kernels  # the session is being prepared
    bench.hand.drag([bench.place, bench.place + 30.0])  # released before the session is ready
    wait(5.0)
    assert not kernels
    bench.finish()
    bench.until(lambda: bench.session.history.can_undo and not bench.puller.is_refining)
    wait(5.9)
    assert not kernels
    bench.hand.press(bench.place)
    bench.hand.move(bench.place - 30.0)
    wait(20.0)
    assert not kernels  # it is being pulled
    bench.hand.release()
    bench.until(lambda: not bench.puller.is_refining)
    wait(20.9)
    assert not kernels
    wait(21.1)
    assert kernels == ["kernels"]
    wait(30.0)
    assert kernels == ["kernels"]


def test_escape_cancels_until_the_next_press(bench):
    gate, hand = bench.gate, bench.hand
    bench.until(gate.has_begun.is_set)
    hand.types("escape")
    assert bench.aside is None
    assert "Preparation cancelled" in bench.editor.status
    bench.until(lambda: gate.cancelled == 1)
    hand.tick(5)
    hand.types("p")  # another action
    hand.tick(5)
    assert gate.begun == 1
    hand.press(bench.place)
    hand.tick(2)
    assert bench.editor.is_preparing
    bench.finish()
    hand.release()
    assert bench.session.is_bound


def test_changed_options_start_it_again_and_a_job_wins(bench):
    gate, session = bench.gate, bench.session
    bench.until(gate.has_begun.is_set)
    session.change_options(stretch=3.0)
    bench.until(lambda: gate.begun == 2)
    assert gate.cancelled == 1
    go_on = threading.Event()
    bench.editor.controller.start("counting", lambda _: go_on.wait(20.0), lambda _: None)
    assert bench.editor.is_busy
    assert not bench.editor.is_preparing
    bench.until(lambda: gate.cancelled == 2)
    go_on.set()
    bench.until(lambda: not bench.editor.is_busy)
    bench.until(lambda: gate.begun == 3)
    bench.finish()
    assert session.is_bound


def test_the_result_waits_for_mode_pull_and_a_changed_session_refuses_it(bench):
    bench.until(bench.gate.has_begun.is_set)
    bench.editor.mode = Mode.HANDLES
    bench.gate.is_open.set()
    time.sleep(0.05)
    bench.hand.tick(5)
    assert bench.session.regions is None
    bench.session.set_fixed([0, 1])  # not an input of the preparation
    bench.editor.mode = Mode.PULL
    bench.hand.tick(5)
    assert bench.session.is_bound
    assert bench.session.history.undo_label == "set fixed vertices"
    assert bench.gate.begun == 1


def test_an_error_is_shown_once_and_says_what_to_do(bench):
    bench.gate.error = CageError("no cage fits")
    bench.finish()
    [error] = bench.hand.failures
    assert "no cage fits" in str(error)
    assert "Press 1" in bench.editor.status
    bench.hand.tick(5)
    bench.hand.types("p")
    bench.hand.tick(5)
    assert bench.gate.begun == 1
    assert "no cage fits" not in bench.editor.status


def test_removing_the_editor_does_not_wait(bench):
    bench.until(bench.gate.has_begun.is_set)
    bench.editor.remove()
    assert not bench.editor.is_preparing
    bench.hand.tick(3)
    assert bench.session.regions is None


@pytest.mark.parametrize("mode", [Mode.PULL, Mode.DEFORM])
def test_another_stiffness_is_bound_in_the_background_while_volumes_are_shown(mode, monkeypatch):
    scene, threads, stiffened = sausage(is_coarse=True), [], Deformer.stiffened
    session = scene.session("tip")
    session.bind()

    def noted(deformer, stiffness):
        threads.append(threading.current_thread())
        return stiffened(deformer, stiffness)

    monkeypatch.setattr(Deformer, "stiffened", noted)
    editor = DeformEditor(plain_view(), session)
    draw_seldom(editor.view)
    hand = Hand(editor.view)
    editor.mode = mode
    editor.On()
    names = session.volume_names
    session.set_stiffness(1.0 + 9.0 * (session.regions.labels == 1))
    assert not session.is_bound
    section = volumes_section(editor)
    assert (session.volume_names, bool(names)) == (names, True)
    assert next(f for f in section.fields if f.name == "volumes.name").enabled
    end = time.monotonic() + 20.0
    while not session.is_bound:
        assert time.monotonic() < end, "waited in vain"
        hand.tick()
    session.drag({"tip": session.mesh.vertices[session.handles["tip"]] + [0.0, 0.0, 0.2]})
    session.history.undo()
    session.history.undo()
    assert session.is_bound  # what was bound before is kept
    assert threads
    assert threading.main_thread() not in threads
    assert hand.failures == []
    editor.remove()
