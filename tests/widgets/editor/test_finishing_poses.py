"""Poses are finished on the mesh after a drag, and nothing waits for it."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import time
from types import SimpleNamespace

import numpy as np
import pytest
from hands import plain_view
from soaking import NAME, slender
from test_editor import Bench, bench  # noqa: F401 - one of them is a fixture
from test_editor import pull_handle as pull_handle_in

from vtk_segdeform import Mesh, Regions, Session, fit_cages, load_session, read_mesh
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.session import pulls, save_session
from vtk_segdeform.solver import Status
from vtk_segdeform.widgets.editor import (
    Mode,
    exporting,
    finishing,
    opening,
    queue,
    saving,
)
from vtk_segdeform.widgets.panel import status
from vtk_segdeform.widgets.scene import Phase, Pointer, glide

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")

pull_handle = functools.partial(pull_handle_in, moves=2)


@pytest.fixture(scope="module")
def ready():
    """Return the state of a session of few vertices, complete except for a pose."""
    session = slender().session(NAME)
    return session.mesh, session.state


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    compiled_kernels()
    monkeypatch.setattr(finishing, "_REST", 0.0)


def until(bench, seen):  # noqa: F811
    end = time.monotonic() + 20.0
    while not seen():
        assert time.monotonic() < end, "waited in vain"
        bench.hand.tick()


def is_finished(bench):  # noqa: F811
    pose = bench.session.state.pose
    return pose is not None and pose.finished is not None and not bench.session.can_finish


def test_a_pose_is_finished_after_each_drag(bench):  # noqa: F811
    bench.type("4")
    pull_handle(bench, (15, 25))
    until(bench, lambda: is_finished(bench))
    assert len(bench.session.history.labels) == 2
    assert bench.session.solution.handle_error < 1e-12
    first = bench.session.vertices
    pull_handle(bench, (-10, 12))
    until(bench, lambda: is_finished(bench))
    bench.type("ctrl+z")
    assert np.array_equal(bench.session.vertices, first)


def test_the_next_press_and_escape_and_undo_cancel_it(bench, monkeypatch):  # noqa: F811
    bench.type("4")
    running = bench.editor.controller.finishing

    def begin():
        pull_handle(bench, (5, 8))
        until(bench, lambda: running.fraction is not None)
        assert not bench.editor.is_busy

    def blocked(_, progress):
        while True:
            progress(0.5, "waiting")
            time.sleep(0.001)

    monkeypatch.setattr("vtk_segdeform.session.finishing.Finish.__call__", blocked)
    begin()
    assert "Finishing" in bench.editor.controller.messages._line.aside
    begin()  # a press
    bench.type("escape")
    assert running.fraction is None
    begin()
    bench.type("ctrl+z")
    assert running.fraction is None
    pull_handle(bench, (5, 8))
    bench.editor.controller.finishing.is_wanted = False
    bench.hand.tick()
    assert running.fraction is None


@pytest.mark.parametrize("write", ["session", "mesh"])
def test_what_is_saved_is_what_was_shown_and_is_not_changed_later(bench, tmp_path, write):  # noqa: F811
    bench.editor.path = tmp_path / "work.segdeform"
    mesh_file = tmp_path / "posed.ply"
    bench.type("4")
    running = bench.editor.controller.finishing
    pull_handle(bench, (5, 8))
    until(bench, lambda: running.fraction is not None)
    shown = np.array(bench.editor.widgets.surface.points)
    if write == "session":
        bench.type("ctrl+s")
        written = load_session(bench.editor.path).vertices
    else:
        bench.editor.do(exporting(mesh_file))
        written = read_mesh(mesh_file).vertices
    assert np.allclose(written, shown, rtol=0.0, atol=1e-6)
    assert running.fraction is None
    for _ in range(30):
        bench.hand.tick()
    assert np.array_equal(bench.editor.widgets.surface.points, shown)
    assert bench.editor.controller.file.is_modified(bench.session) == (write == "mesh")


@pytest.fixture
def settling(bench, monkeypatch):  # noqa: F811
    """Yield what settles after a drag whose pose has not converged; the timer has not fired yet."""
    monkeypatch.setattr(queue, "_SHOWN_AFTER", 0.0)
    monkeypatch.setattr("vtk_segdeform.widgets.handle_dragger.live_solve.STEPS", 3)
    bench.editor.controller.finishing.is_wanted = False
    bench.type("4")
    pull_handle(bench, (-40, 90))
    assert bench.session.solution.status is Status.STEP_LIMIT
    assert bench.editor.widgets.is_settling
    return bench.editor.widgets


def test_a_pose_that_settles_after_its_release_says_so(bench, settling):  # noqa: F811
    bench.editor.controller.refresh()
    now = status(bench.editor)
    assert (now.work, now.progress, now.is_busy) == ("Settling", 0.0, False)
    assert now.cancel.visible
    assert now.cancel.tip == "Stop at this pose"
    assert bench.editor.controller.messages._line.aside == "Settling ... (Esc)"
    while settling.is_settling:
        bench.hand.tick()
    until(bench, lambda: bench.editor.controller.messages._line.aside == "")
    assert bench.session.solution.status is not Status.STEP_LIMIT
    assert not status(bench.editor).cancel.visible


def test_escape_stops_a_pose_that_settles(bench, settling, tmp_path):  # noqa: F811
    shown, bench.editor.path = bench.session.vertices, tmp_path / "work.segdeform"
    bench.type("escape")
    assert not settling.is_settling
    assert "Stopped. The pose has not settled" in bench.editor.status
    bench.type("0", "4")
    for _ in range(5):
        bench.hand.tick()
    assert bench.session.vertices is shown
    bench.type("ctrl+s")
    assert "The pose had not settled" in bench.editor.status
    assert np.array_equal(load_session(bench.editor.path).vertices, shown)
    pull_handle(bench, (5, 5))
    until(bench, lambda: bench.session.solution.status is not Status.STEP_LIMIT)


@pytest.mark.parametrize("write", ["session", "mesh"])
def test_saving_waits_until_the_pose_has_settled(bench, settling, tmp_path, write):  # noqa: F811
    path = tmp_path / ("posed.ply" if write == "mesh" else "work.segdeform")
    bench.editor.do(exporting(path) if write == "mesh" else saving(path))
    assert "Saving once the pose has settled" in bench.editor.status
    assert status(bench.editor).work == "Saving"
    until(bench, path.exists)
    assert not settling.is_settling
    assert bench.session.solution.status is not Status.STEP_LIMIT
    assert f"aved to {path}" in bench.editor.status
    read = read_mesh if write == "mesh" else load_session
    assert np.allclose(read(path).vertices, bench.session.vertices, rtol=0.0, atol=1e-6)
    assert bench.editor.controller.file.is_modified(bench.session) == (write == "mesh")


@pytest.mark.parametrize("change", ["escape", "undo", "press", "off", "another mode"])
def test_what_ends_the_wait_saves_the_pose_as_it_is(bench, settling, tmp_path, change):  # noqa: F811
    bench.editor.path = tmp_path / "work.segdeform"
    shown = bench.session.vertices
    bench.type("ctrl+s")
    assert settling.is_settling
    assert not bench.editor.path.exists()
    ends = {
        "escape": lambda: bench.type("escape"),
        "undo": lambda: bench.type("ctrl+z"),
        "press": lambda: pull_handle(bench, (5, 5)),
        "off": bench.editor.Off,
        "another mode": lambda: bench.type("3"),
    }
    ends[change]()
    assert np.array_equal(load_session(bench.editor.path).vertices, shown)


def test_a_script_that_saves_waits_until_the_pose_has_settled(bench, settling, tmp_path):  # noqa: F811
    bench.editor.save(tmp_path / "work.segdeform")
    assert not settling.is_settling
    assert bench.session.solution.status is not Status.STEP_LIMIT
    assert np.array_equal(load_session(bench.editor.path).vertices, bench.session.vertices)


@pytest.mark.parametrize("end", ["Off", "remove"])
def test_a_pose_that_settled_when_the_editor_was_turned_off_is_completed(bench, settling, end):  # noqa: F811
    shown = bench.session.vertices
    getattr(bench.editor, end)()
    assert not settling.is_settling
    assert bench.session.solution.status is Status.STEP_LIMIT
    bench.editor.complete()
    assert bench.session.solution.status is not Status.STEP_LIMIT
    completed = bench.session.vertices
    assert not np.array_equal(completed, shown)
    bench.editor.complete()
    assert bench.session.vertices is completed


def grabbed(bench, fraction=0.6):  # noqa: F811
    """Pull the surface at a share of the handle's distance, with the hand, and rest."""
    hand, x = bench.hand, bench.session.vertices
    seen = np.argmax(x[:, 0] - 2.0 * x[:, 1])  # towards the viewer, near the handle
    start = np.array(hand.at(fraction * x[seen] + (1.0 - fraction) * x.mean(axis=0)))
    hand.drag([start + share * np.array([15.0, 25.0]) for share in np.linspace(0.0, 1.0, 3)])


def test_the_error_of_a_move_is_shown_until_a_move_that_succeeds(bench):  # noqa: F811
    hand, x = bench.hand, bench.session.vertices
    bench.session.bind()
    bench.type("0")
    hand.press(hand.at(x[np.argmax(x[:, 0] - 2.0 * x[:, 1])]))
    for key in ("z", "9", "9", "9", "Return"):
        hand.key(key)
    assert "more than 10 mesh diagonals away" in bench.editor.status
    hand.key("BackSpace")  # 99
    assert "more than 10 mesh diagonals away" in bench.editor.status
    hand.key("BackSpace")
    assert "diagonals" not in bench.editor.status
    hand.key("Escape")
    hand.failures.clear()


@pytest.mark.parametrize("avoids", [False, True])
def test_a_pull_stays_as_it_is_unless_contact_is_avoided(bench, avoids):  # noqa: F811
    bench.session.bind()
    bench.session.change_options(avoid_contact=avoids)
    bench.type("0")
    grabbed(bench)
    assert bench.editor.controller.finishing.is_pending == avoids


def test_what_is_pulled_again_without_touching_its_dot_is_selected(bench):  # noqa: F811
    """Otherwise Remove would remove the point that was pulled before it."""
    bench.session.bind()
    bench.type("0")
    bench.session.handles.remove(*bench.session.handles)
    puller, dragger = bench.editor.widgets.puller, bench.editor.widgets.dragger
    grabbed(bench, 0.6)
    grabbed(bench, -0.4)
    assert dragger.handle == "pull 2"
    puller.radius = bench.session.mesh.diagonal
    (vertex,) = bench.session.handles["pull 1"]
    dot = np.array(bench.hand.at(bench.session.vertices[vertex]))
    beside = next(
        place
        for place in dot + 14.0 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        if (hit := puller._picker.hit(Pointer(Phase.HOVER, *place))) is not None
        and pulls.grabbed(bench.session.mesh, bench.session.state, hit.vertex, puller.radius)
        == "pull 1"
    )
    bench.hand.hover(beside)
    assert puller.marker_under_pointer() is None
    bench.hand.drag([beside, beside + 10.0])
    assert list(bench.session.handles) == ["pull 1", "pull 2"]
    assert dragger.handle == "pull 1"


def test_pulls_are_finished_and_add_up(bench):  # noqa: F811
    bench.session.bind()
    bench.type("0")
    poses = []
    for fraction in (0.7, 0.3):
        grabbed(bench, fraction)
        assert bench.session.history.undo_label == "pull"
        bench.type("shift+f")
        until(bench, lambda: is_finished(bench))
        assert bench.session.solution.handle_error < 1e-12
        poses.append(bench.session.vertices)
    bench.type("ctrl+z")
    assert np.array_equal(bench.session.vertices, poses[0])
    bench.type("ctrl+y")
    assert np.array_equal(bench.session.vertices, poses[1])


def glided(bench):  # noqa: F811
    """Drag the handle until the surface glides to the finished pose; return the one before."""
    pull_handle(bench, (15, 25))
    running, poses = bench.editor.controller.finishing, []
    while not running.glide.is_running:
        poses.append(bench.session.vertices)
        until(bench, lambda: running.glide.is_running or bench.session.vertices is not poses[-1])
    return poses[-1]


def test_the_surface_glides_to_the_finished_pose(bench, monkeypatch):  # noqa: F811
    monkeypatch.setattr(glide, "SECONDS", 1.0)
    clock = itertools.count()  # 40 ms from picture to picture
    monkeypatch.setattr(glide, "time", SimpleNamespace(monotonic=lambda: 0.04 * next(clock)))
    bench.type("4")
    before = glided(bench)
    points, after = bench.editor.widgets.surface.points, bench.session.vertices
    assert is_finished(bench)
    way = after - before
    shares = []
    while bench.editor.controller.finishing.glide.is_running:
        shares.append(np.vdot(points - before, way) / np.vdot(way, way))
        bench.hand.tick()
    assert shares[0] < 0.2
    assert np.all(np.diff(shares) >= 0.0)
    assert sum(0.0 < share < 1.0 for share in shares) > 3
    assert np.array_equal(points, after)


def test_anything_ends_the_glide_at_once(bench, monkeypatch, tmp_path):  # noqa: F811
    monkeypatch.setattr(glide, "SECONDS", 100.0)
    bench.type("4")
    save_session(tmp_path / "other.segdeform", bench.session)
    before = glided(bench)
    running, hand = bench.editor.controller.finishing.glide, bench.hand

    def click():
        hand.press((10, 10))
        hand.release((10, 10))

    def open_another():
        bench.editor.do(opening(tmp_path / "other.segdeform"))
        bench.settle()

    for end in (
        click,
        lambda: hand.event("MouseWheelForwardEvent", (200, 160)),
        lambda: hand.key("h"),
        lambda: (bench.view.camera.Azimuth(5.0), hand.tick()),
        bench.session.undo,
        bench.editor.Off,
        open_another,
    ):
        running.begin(bench.editor.widgets.surface, before)
        assert running.is_running
        end()
        assert not running.is_running
        for _ in range(3):
            points = bench.editor.widgets.surface.points
            assert np.array_equal(points, bench.session.vertices)
            hand.tick()


def test_a_press_during_the_glide_drags_the_finished_pose_on(bench, monkeypatch):  # noqa: F811
    monkeypatch.setattr(glide, "SECONDS", 100.0)
    bench.type("4")
    glided(bench)
    finished = bench.session.vertices
    middle = finished[next(iter(bench.session.handles.values()))].mean(axis=0)
    at = np.array(bench.hand.at(middle))
    bench.hand.press(at)
    bench.hand.move(at + 1.0)
    moved = np.abs(bench.session.vertices - finished).max() / bench.session.mesh.diagonal
    assert 0.0 < moved < 0.02
    bench.hand.release(at + 1.0)
    assert bench.hand.failures == []


def test_another_mode_during_a_finish_does_not_stop_it(bench):  # noqa: F811
    bench.type("4")
    pull_handle(bench, (15, 25))
    until(bench, lambda: bench.editor.controller.finishing.fraction is not None)
    bench.type("2")
    until(bench, lambda: is_finished(bench))
    assert bench.hand.failures == []


def test_a_key_finishes_the_pose_on_request(bench):  # noqa: F811
    bench.editor.controller.finishing.is_wanted = False
    bench.type("4", "shift+f")
    assert "no pose to finish" in bench.editor.status.lower()
    bench.hand.failures.clear()
    pull_handle(bench)
    bench.hand.tick(5)
    assert bench.editor.controller.finishing.fraction is None
    assert bench.session.can_finish
    bench.type("shift+f")
    assert is_finished(bench)
    assert "Pose finished on the mesh" in bench.editor.status


def test_the_status_line_tells_what_holds_of_a_finished_pose(bench):  # noqa: F811
    bench.editor.controller.finishing.is_wanted = False
    bench.type("4")
    pull_handle(bench)
    bench.type("shift+f")
    session, solution = bench.session, bench.session.solution
    few, many, controller = np.arange(3), np.arange(1200), bench.editor.controller

    def told(**changes):
        changed = dataclasses.replace(solution, **changes)
        session.poses.keep_solution(session.state.pose, changed)
        controller.refresh()
        return bench.editor.status

    assert "Move or rotate a handle" in told(status=Status.CONVERGED)
    assert "faces" not in bench.editor.status
    assert "further" not in bench.editor.status
    crossing = told(crossed=lambda _: few)
    assert "3 faces cross others. Move less, or turn on Avoid contact" in crossing
    assert "1,200 turned-over faces. Move less, or add" in told(folded=lambda _: many)
    assert "Shift+F: finish further" in told(status=Status.STEP_LIMIT)
    before = session.vertices
    assert not session.can_finish
    assert session.can_finish_further
    assert not session.is_unsettled
    bench.type("shift+f")
    assert session.solution.is_finished
    assert np.abs(session.vertices - before).max() < 1e-3 * session.mesh.diagonal


def test_a_part_that_no_handle_moves_is_named_once():
    scene = slender()
    mesh, far = scene.mesh, np.array([0.0, 0.0, 6.0])
    n = mesh.n_vertices
    both = Mesh(
        np.concatenate([mesh.vertices, mesh.vertices + far]),
        np.concatenate([mesh.faces, mesh.faces + n]),
    )
    masks = np.zeros((3, 2 * n), dtype=bool)
    masks[:2, :n], masks[2, n:] = scene.regions.membership, True
    session = Session(both)
    session.set_regions(Regions.from_masks(both, masks))
    moved = mesh.with_vertices(both.vertices[n:])
    session.set_cages([*scene.cages, *fit_cages(moved, Regions.single(moved), 20)])
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle)
    session.bind()
    made = Bench(plain_view((400, 320)), session, Mode.DEFORM)
    made.editor.controller.finishing.is_wanted = False
    said = f"Part 2 ({n} vertices) has no handle and no fixed vertices: it stays where it is"
    for is_said in (True, False):
        pull_handle(made)
        made.hand.tick(2)
        assert (said in made.editor.status) == is_said
    assert made.hand.failures == []
    made.editor.remove()
