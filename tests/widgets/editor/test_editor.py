"""The whole editor, by real events: from a bare mesh to a pose, undone, saved and opened again."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from hands import Hand, picture, plain_view
from numpy.testing import assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation

from vtk_segdeform import Session, load_session, models, save_session
from vtk_segdeform.errors import RegionError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.widgets.editor.bindings import BINDINGS
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.handle_dragger.gizmo_shapes import Kind, Part
from vtk_segdeform.widgets.region_selector.region_selector import Paint, Tool
from vtk_segdeform.widgets.scene.view import View
from vtk_segdeform.widgets.volume_overlay.volume_overlay import VolumeOverlay

ROOT = Path(__file__).resolve().parents[3]


class Desk:
    """An editor in a view, seen from the front with z up, and a hand."""

    def __init__(self, view: View, session):
        self.view = view
        self.editor = DeformEditor(view, session)
        view.camera.SetPosition(0.0, -5.0, 0.5)
        view.camera.SetFocalPoint(0.0, 0.0, 0.5)
        view.camera.SetViewUp(0.0, 0.0, 1.0)
        view.renderer.ResetCamera()
        view.render()
        self.hand = Hand(view)
        self.editor.On()

    @property
    def session(self) -> Session:
        return self.editor.session

    def settle(self):
        """Let the timer fire until no job is running."""
        end = time.monotonic() + 20.0
        while self.editor.is_busy:
            assert time.monotonic() < end, "the job does not end"
            self.hand.tick()

    def type(self, *keys):
        """Type keys, "z" or "ctrl+z", and let what they begin be done."""
        for key in keys:
            self.hand.key(key.split("+")[-1], control="ctrl+" in key, shift="shift+" in key)
            self.settle()

    def around(self, mask):
        """Return the corners, in order, of a box around vertices as they are seen."""
        seen = self.view.to_display(self.session.vertices[mask])[:, :2]
        (x0, y0), (x1, y1) = seen.min(axis=0) - 4.0, seen.max(axis=0) + 4.0
        return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


@pytest.fixture(params=["plain", "pyvista"])
def any_view(request):
    """Yield a view with pyvista, and one without."""
    if request.param == "plain":
        yield plain_view((500, 500))
        return
    plotter = pv.Plotter(off_screen=True, window_size=(500, 500))
    plotter.disable_anti_aliasing()
    plotter.show(auto_close=False, interactive=False)
    yield View.of(plotter)
    plotter.close()


@pytest.fixture(scope="module")
def ready():
    """Return the state of a small session with everything but a pose."""
    scene = sausage()
    session = Session(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.set_fixed(scene.fixed)
    session.add_handle(scene.handle)
    return scene.mesh, session.state


@pytest.fixture
def desk(ready):
    """Yield an editor over a session that is ready, in a plain view."""
    mesh, state = ready
    made = Desk(plain_view((500, 400)), Session(mesh, state=state))
    yield made
    assert made.hand.failures == []
    made.editor.remove()


@pytest.fixture
def bare():
    """Yield an editor over a mesh and nothing else."""
    made = Desk(plain_view((500, 400)), sausage().mesh)
    yield made
    made.editor.remove()


def pull_handle(desk, shift=(20, 30), moves=4):
    """Grab the handle in the middle and drag it by as many pixels."""
    name = next(iter(desk.session.handles))
    middle = desk.session.vertices[desk.session.handles[name]].mean(axis=0)
    start = np.array(desk.hand.at(middle))
    desk.hand.drag([start + share * np.array(shift) for share in np.linspace(0.0, 1.0, moves + 1)])


def test_the_whole_story(any_view, tmp_path, request):
    mesh = models.cactus(1500)
    desk = Desk(any_view, mesh)
    hand, z = desk.hand, mesh.vertices[:, 2]
    volume = signed_volume(mesh.vertices, mesh.faces)
    drawn = []

    def check_frame(*_):
        points = desk.editor.stage.surface.points
        drawn.append(abs(signed_volume(points, mesh.faces) / volume - 1.0))

    any_view.renderer.AddObserver("EndEvent", check_frame)

    desk.type("g")
    assert desk.session.regions.n_regions >= 2
    assert desk.editor.stage.selector.region == 1
    before = desk.session.regions.membership[1].copy()
    hand.drag([hand.at([0.0, -0.1, height]) for height in (0.45, 0.5, 0.55)])
    assert desk.session.undo_label == "paint region 2"
    assert np.count_nonzero(desk.session.regions.membership[1]) > np.count_nonzero(before)

    desk.type("f")
    assert len(desk.session.cages) == desk.session.regions.n_regions

    desk.type("3", "v", "t")
    start, _, end, _ = desk.around(z < 0.08)
    hand.drag([start, (end[0], start[1]), end])
    assert set(np.flatnonzero(z < 0.08)) <= set(desk.session.fixed)
    assert z[desk.session.fixed].max() < 0.16
    desk.type("d", "l")
    hand.drag(desk.around(z > 0.9))
    assert set(np.flatnonzero(z > 0.9)) <= set(desk.session.handles["handle 1"])

    desk.type("4")
    assert desk.session.is_bound
    marked = desk.session.state
    handle = desk.session.handles["handle 1"]
    middle = mesh.vertices[handle].mean(axis=0)
    pivot = np.array(hand.at([0.0, 0.0, 0.5]))
    arm = np.array(hand.at(middle)) - pivot
    way = [
        pivot + [np.cos(a) * arm[0] + np.sin(a) * arm[1], np.cos(a) * arm[1] - np.sin(a) * arm[0]]
        for a in np.radians(np.linspace(0.0, 60.0, 31))
    ]
    hand.drag(way)
    assert desk.session.undo_label == "drag handle 1"
    there = desk.session.vertices[handle].mean(axis=0)
    assert np.linalg.norm(np.array(hand.at(there)) - way[-1]) < 12.0
    turn_by_a_ring(desk)
    turned = desk.session.vertices
    assert len(drawn) > 35
    assert max(drawn) < 1e-12

    steps = 0
    while desk.session.can_undo:
        desk.type("z")
        steps += 1
    assert steps == 7  # regions, brush, cages, fixed, handle, drag, turn
    assert desk.session.regions is None
    assert_array_equal(desk.editor.stage.surface.points, mesh.vertices)
    desk.type(*["ctrl+y", "ctrl+shift+z"] * 3, "y")
    assert not desk.session.can_redo
    assert_array_equal(desk.session.vertices, turned)
    assert not desk.session.state.changes(replace(marked, pose=desk.session.state.pose))

    desk.editor.path = tmp_path / "cactus.segdeform"
    desk.type("ctrl+s")
    assert "cactus.segdeform" in desk.editor.status
    assert_array_equal(load_session(desk.editor.path).vertices, turned)
    if "plain" in request.node.name:  # and in another process; once is enough
        reopened = subprocess.run(
            [sys.executable, "-c", REOPEN, str(desk.editor.path)], capture_output=True, cwd=ROOT
        )
        assert reopened.stdout == turned.tobytes(), reopened.stderr.decode()
    assert max(drawn) < 1e-12
    assert hand.failures == []
    desk.editor.remove()


REOPEN = """
import sys
from vtk_segdeform import load_session
sys.stdout.buffer.write(load_session(sys.argv[1]).vertices.tobytes())
"""


def turn_by_a_ring(desk):
    """Turn the handle about the line of sight, by a sixth of the outermost ring."""
    dragger = desk.editor.stage.dragger
    ring = dragger.gizmo.line(Part(Kind.ROTATION))[:, :2]
    before = desk.session.targets[dragger.handle]
    desk.hand.drag(ring[: len(ring) // 6])
    assert desk.session.undo_label == "rotate handle 1"
    a, b = (x - x.mean(axis=0) for x in (before, desk.session.targets[dragger.handle]))
    turn = Rotation.align_vectors(b, a)[0]
    assert np.degrees(turn.magnitude()) == pytest.approx(60.0, abs=8.0)


# Modes, keys and words.


def test_every_mode_says_what_it_lacks_and_the_key_that_makes_it(bare):
    said = []
    for key in "1234":
        bare.type(key)
        said.append(bare.editor.status)
    assert bare.editor.mode is Mode.DEFORM
    assert "G finds" in said[0]
    assert "G finds" in said[1]
    assert "what stays" in said[2]
    assert "G finds" in said[3]
    bare.type("g")
    assert "F fits" in bare.editor.status
    bare.type("f")
    assert "3 to mark a handle" in bare.editor.status
    assert not bare.session.is_bound
    x = bare.session.mesh.vertices[:, 0]
    bare.type("3", "t", "v", "d")
    corners = bare.around(x > 2.4)
    bare.hand.drag([corners[0], corners[2]])
    assert "rectangle for handle 1" in bare.editor.status
    bare.type("4")
    assert bare.session.is_bound
    assert "drag or turn a handle" in bare.editor.status
    pull_handle(bare)
    assert bare.session.undo_label == "drag handle 1"
    assert bare.hand.failures == []


def test_each_mode_has_its_own_widget_and_shows_what_belongs_to_it(desk):
    stage = desk.editor.stage
    owners = {"1": stage.selector, "2": stage.cages, "3": stage.selector, "4": stage.dragger}
    for key, widget in owners.items():
        desk.type(key)
        assert [w for w in stage.widgets if w.GetEnabled()] == [widget]
        assert stage.cages.is_shown == (key == "2")
    desk.type("c")
    assert stage.cages.is_shown
    desk.type("1", "c")
    assert not stage.cages.is_shown
    desk.type("4", "o")
    assert stage.overlay.is_shown
    desk.type("1")
    assert not stage.overlay.is_shown  # one paints on regions, not on volumes
    desk.type("4")
    assert stage.overlay.is_shown


def test_what_is_painted_is_chosen_by_keys(desk):
    selector = desk.editor.stage.selector
    tools = {"l": Tool.LASSO, "t": Tool.RECTANGLE, "k": Tool.COMPONENT, "b": Tool.BRUSH}
    for key, tool in tools.items():
        desk.type(key)
        assert selector.tool is tool
    assert selector.paints is Paint.REGION
    desk.type("n")
    assert "region 2" in desk.editor.status
    desk.type("n", "a")
    assert "region 3 (new)" in desk.editor.status
    desk.type("3", "s")
    assert selector.paints is Paint.FIXED
    desk.type("d", "n")
    assert "handle 1" in desk.editor.status
    desk.type("a")
    assert "a new handle" in desk.editor.status
    radius = selector.radius
    desk.hand.hover(desk.hand.at([0.0, -0.8, 0.0]))
    desk.type("bracketright")
    assert selector.radius > radius


def test_without_regions_one_paints_the_first_beside_all_the_rest(bare):
    bare.type("g", "n", "n", "z")
    assert bare.session.regions is None
    bare.hand.click(bare.hand.at([-2.0, 0.0, 0.0]))
    everything, painted = bare.session.regions.membership
    assert everything.all()
    assert 0 < np.count_nonzero(painted) < len(painted)
    assert "region 2" in bare.editor.status
    bare.type("g", "a", "z", "z")  # from a new region after many back to none
    assert "no regions yet" in bare.editor.status
    bare.hand.click(bare.hand.at([2.0, 0.0, 0.0]))
    assert bare.session.regions.n_regions == 2
    assert bare.hand.failures == []


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ("m", "no regions to merge yet: G finds some"),
        ("x", "no regions to cut yet: G finds some"),
        ("c", "no cages to show yet: F fits them"),
        ("f", "no regions to fit cages to"),
        ("3n", "no handle yet"),
    ],
)
def test_a_key_with_nothing_to_work_on_says_what_comes_first(bare, keys, says):
    bare.type(*keys)
    assert says in bare.editor.status
    bare.type("3", "Delete")
    assert "there is no handle yet" in bare.editor.status


def test_what_a_stroke_leaves_alone_is_told(desk):
    hand, held = desk.hand, desk.session.regions.membership.sum(axis=0)
    size = np.count_nonzero(desk.session.regions.membership[0])
    desk.type("t", "v")  # all of it, through the body
    hand.drag([(2, 40), (398, 398)], control=True)
    left = np.count_nonzero(desk.session.regions.membership[0])
    assert 0 < left < size
    assert f"{left} vertices skipped: in no other region" in desk.editor.status
    assert left == np.count_nonzero(held[desk.session.regions.membership[0]] == 1)


def test_painting_over_a_pose_says_that_it_is_at_rest_again(desk):
    desk.type("4")
    pull_handle(desk)
    desk.type("1", "plus")
    assert desk.session.state.pose is None
    assert "at rest again" in desk.editor.status
    desk.type("z")
    assert desk.session.state.pose is not None
    assert "at rest again" not in desk.editor.status


def test_regions_are_merged_cut_grown_and_shrunk(desk):
    hand, selector = desk.hand, desk.editor.stage.selector
    size = np.count_nonzero(desk.session.regions.membership[0])
    desk.type("plus")
    assert np.count_nonzero(desk.session.regions.membership[0]) > size
    desk.type("z", "minus")
    assert np.count_nonzero(desk.session.regions.membership[0]) < size
    desk.type("z")
    hand.hover(hand.at([2.0, 0.0, 0.0]))  # on region 1
    desk.type("m")
    assert desk.session.regions.n_regions == 1
    desk.type("x")
    assert desk.session.regions.n_regions == 2
    desk.type("n")
    assert selector.region == 1
    desk.type("z")
    desk.type("n")
    assert selector.region == 0  # there is only one again


def test_handles_are_chosen_and_removed(desk):
    desk.type("3", "d", "a", "t")
    x = desk.session.mesh.vertices[:, 0]
    corners = desk.around((x > 0.0) & (x < 0.4))
    desk.hand.drag([corners[0], corners[2]])
    assert list(desk.session.handles) == ["handle 1", "handle 2"]
    desk.type("4", "n")
    first = desk.editor.stage.dragger.handle
    desk.type("Tab")
    assert {first, desk.editor.stage.dragger.handle} == {"handle 1", "handle 2"}
    gone = desk.editor.stage.dragger.handle
    desk.type("Delete")
    assert list(desk.session.handles) == [name for name in ("handle 1", "handle 2") if name != gone]


def test_back_to_rest_and_the_volume_let_go(desk):
    desk.type("4")
    pull_handle(desk)
    assert desk.session.state.pose is not None
    desk.type("Home")
    assert desk.session.state.pose is None
    desk.type("p")
    assert not desk.session.options.preserve_volume
    assert desk.session.is_bound  # still
    assert "volume let go" in desk.editor.status
    assert "the volume is free" in desk.editor.status
    pull_handle(desk)
    assert abs(desk.session.volume_change) > 1e-6


def test_z_undoes_but_constrains_while_a_handle_is_dragged(desk):
    desk.type("4")
    before = desk.session.state
    handle = desk.session.handles["handle 1"]
    middle = desk.session.vertices[handle].mean(axis=0)
    x, y = desk.hand.at(middle)
    desk.hand.press((x, y))
    desk.hand.move((x + 10, y + 10))
    desk.hand.key("z")
    desk.hand.move((x + 20, y + 30))
    assert desk.session.is_dragging
    moved = desk.session.targets["handle 1"] - desk.session.mesh.vertices[handle]
    assert np.abs(moved[:, :2]).max() < 1e-9 < moved[:, 2].min()
    desk.hand.release((x + 20, y + 30))
    desk.type("z")
    assert not desk.session.state.changes(before)


def test_no_two_bindings_want_the_same_key_in_the_same_mode():
    taken = [(key, mode) for b in BINDINGS if b.action for key in b.keys for mode in b.modes]
    assert len(taken) == len(set(taken))
    assert "q" not in {key for key, _ in taken}


def test_a_key_of_another_mode_is_kept_from_vtk_and_explained(desk):
    heard = []
    desk.view.interactor.AddObserver("CharEvent", lambda *_: heard.append("char"), -1.0)
    desk.type("s")  # surface, to VTK; what stays, in mode 3
    assert heard == []
    assert "S is a key of 3 (paint what stays)" in desk.editor.status
    desk.type("w")
    assert heard == ["char"]


def test_the_card_of_keys_comes_and_goes(desk):
    without = picture(desk.view)
    for key in ("h", "question", "F1"):
        desk.type(key)
        assert (picture(desk.view) != without).any()
        desk.type("Escape" if key == "F1" else key)
        assert_array_equal(picture(desk.view), without)


def test_without_numba_the_status_line_says_so_until_the_first_action(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "numba" else name)
    made = Desk(plain_view((500, 400)), sausage().mesh)
    said = "numba is not installed: frames take 3 to 6 times as long. pip install numba"
    assert made.editor.status.startswith(said)
    made.type("1")
    assert made.editor.status
    assert "numba" not in made.editor.status
    made.editor.remove()


def test_what_goes_wrong_is_said_until_something_succeeds(desk):
    desk.hand.click(desk.hand.at([-2.0, 0.0, 0.0]), control=True)  # out of the only region there
    assert "in no region but region 1" in desk.editor.status
    assert [type(failure).__name__ for failure in desk.hand.failures] == ["RegionError"]
    desk.hand.failures.clear()
    desk.hand.hover((5, 5))
    assert "in no region but region 1" in desk.editor.status
    desk.hand.click(desk.hand.at([1.0, -0.7, 0.0]))
    assert desk.session.undo_label == "paint region 1"
    assert desk.editor.status.startswith("brush for region 1")
    desk.hand.hover((5, 5))
    desk.type("m")  # with the pointer beside the mesh
    assert "point at the region" in desk.editor.status
    assert len(desk.hand.failures) == 1
    desk.hand.failures.clear()


def test_a_fault_of_our_own_is_said_too(desk):
    desk.session.on_change(lambda change: 1 // 0)
    desk.type("2", "z")
    assert "nothing to undo" in desk.editor.status
    desk.type("p")
    assert "ZeroDivisionError" in desk.editor.status
    assert desk.hand.failures
    desk.hand.failures.clear()


# Jobs.


def test_while_a_job_runs_the_camera_works_and_nothing_else_does(bare):
    bare.hand.key("g")
    assert bare.editor.is_busy
    assert "finding regions" in bare.editor.status
    assert "Esc cancels" in bare.editor.status
    camera = bare.view.camera.GetPosition()
    middle = bare.hand.at([0.0, -0.8, 0.0])
    bare.hand.drag([middle, (middle[0] + 30, middle[1] + 20)])
    assert bare.view.camera.GetPosition() != camera
    bare.hand.key("f")
    bare.hand.key("3")
    assert bare.editor.mode is Mode.REGIONS
    assert bare.editor.status.startswith("busy finding regions")
    assert bare.session.regions is None
    bare.settle()
    assert bare.session.regions is not None
    assert "1 region found · brush for region 1," in bare.editor.status
    assert bare.hand.failures == []


def test_escape_cancels_a_job_and_nothing_is_changed(bare):
    bare.hand.key("g")
    bare.hand.key("Escape")
    bare.settle()
    assert bare.session.regions is None
    assert not bare.session.can_undo
    assert "cancelled" in bare.editor.status
    assert bare.hand.failures == []
    bare.hand.click(bare.hand.at([0.0, -0.8, 0.0]))  # and the brush paints again
    assert bare.session.undo_label == "paint region 2"
    bare.type("g")
    assert bare.session.regions is not None


def test_a_second_escape_does_not_restart_a_cancelled_job(desk):
    desk.hand.key("4")
    assert desk.editor.is_busy
    for _ in range(3):
        desk.hand.key("Escape")
        desk.settle()
    desk.hand.key("h")
    assert not desk.editor.is_busy
    assert not desk.session.is_bound
    desk.type("4")
    assert desk.session.is_bound


def test_cages_for_regions_that_another_window_has_changed_are_not_taken(bare):
    bare.type("g")
    bare.settle()
    bare.hand.key("f")
    assert bare.editor.is_busy
    bare.session.paint_region(bare.session.regions.n_regions, np.arange(40))
    bare.settle()
    assert not bare.session.cages
    assert isinstance(bare.hand.failures.pop(), RegionError)
    assert "regions changed while cages were fitted" in bare.editor.status
    bare.type("f")
    bare.settle()
    assert len(bare.session.cages) == bare.session.regions.n_regions


def test_a_job_that_fails_says_so_and_the_editor_goes_on(desk):
    desk.session.change_options(n_cage_vertices=8, offset=1e-9)
    desk.type("f")
    assert len(desk.hand.failures) == 1
    assert desk.editor.status == " ".join(str(desk.hand.failures.pop()).split())
    desk.type("4")
    pull_handle(desk)
    assert desk.session.undo_label == "drag handle 1"


def test_switched_off_or_removed_in_the_middle_of_a_job_it_lets_go(bare):
    bare.hand.key("g")
    bare.editor.Off()
    assert not bare.editor.is_busy
    bare.hand.tick(3)
    assert bare.session.regions is None
    bare.editor.On()
    bare.hand.key("g")
    bare.editor.remove()
    bare.hand.tick(3)
    assert bare.session.regions is None
    assert bare.hand.failures == []


# Files.


@pytest.mark.parametrize("end", ["Off", "remove"])
def test_it_can_be_left_while_a_job_is_about_to_fail(bare, tmp_path, end):
    bare.editor.path = tmp_path / "none.segdeform"
    bare.hand.key("o", control=True)
    time.sleep(0.1)  # the job has failed, and nobody was told yet
    getattr(bare.editor, end)()
    assert not bare.editor.is_busy
    assert not bare.editor.GetEnabled()
    assert bare.hand.failures == []


def test_opening_another_session_shows_it_and_goes_on_with_it(desk, tmp_path):
    desk.type("4")
    pull_handle(desk)
    posed = desk.session.vertices
    path = tmp_path / "posed.segdeform"
    desk.editor.save(path)
    desk.type("0")
    first = desk.session
    desk.type("ctrl+o")
    assert "not saved: again" in desk.editor.status
    assert desk.session is first
    shown = desk.view.renderer.GetViewProps().GetNumberOfItems()
    desk.type("ctrl+o")
    assert desk.view.renderer.GetViewProps().GetNumberOfItems() == shown
    assert desk.session is not first
    assert "opened" in desk.editor.status
    assert_array_equal(desk.editor.stage.surface.points, posed)
    assert not desk.session.can_undo
    first.set_fixed([])  # nobody listens to it any more
    assert "opened" in desk.editor.status
    pull_handle(desk, (0, -20))
    assert desk.session.can_undo
    assert not first.is_dragging


def test_what_was_chosen_stays_chosen_when_another_session_is_opened(desk, tmp_path):
    half = sausage().transformed(scale=0.5).mesh
    path = tmp_path / "half.segdeform"
    save_session(path, Session(half))
    desk.type("3", "t", "v", "c", "4", "o", "3")
    desk.editor.stage.selector.radius = 0.07 * desk.session.mesh.diagonal
    before = desk.editor.stage
    desk.editor.path = path
    desk.type("ctrl+o", "ctrl+o")
    stage = desk.editor.stage
    assert stage is not before
    assert desk.editor.mode is Mode.HANDLES
    assert (stage.selector.tool, stage.selector.through) == (Tool.RECTANGLE, True)
    assert stage.selector.radius == pytest.approx(0.07 * half.diagonal)
    assert stage.cages.is_shown
    desk.type("4")
    assert stage.overlay.is_shown


def test_volumes_are_prepared_beside_the_event_loop_in_the_mode_of_cages_too(desk, monkeypatch):
    threads = []

    def prepare(overlay):
        threads.append(threading.current_thread())
        own(overlay)

    own = VolumeOverlay.prepare
    monkeypatch.setattr(VolumeOverlay, "prepare", prepare)
    desk.type("2")
    desk.hand.key("o")
    assert desk.editor.is_busy
    assert "measuring local volumes" in desk.editor.status
    assert not desk.editor.stage.overlay.is_shown
    desk.settle()
    assert desk.editor.stage.overlay.is_shown
    assert desk.editor.stage.cages.GetEnabled()
    assert threads != []
    assert threading.main_thread() not in threads


def test_opening_asks_again_when_something_was_done_in_between(desk, tmp_path):
    desk.editor.save(tmp_path / "one.segdeform")
    first = desk.session
    desk.type("x", "ctrl+o", "n", "ctrl+o")
    assert desk.session is first
    desk.type("z", "ctrl+o")  # as it was saved: nothing to lose
    assert desk.session is not first


def test_a_file_of_somebody_else_is_replaced_only_when_asked_twice(desk, tmp_path):
    path = tmp_path / "other.segdeform"
    path.write_text("something dear")
    desk.editor.path = path
    desk.type("ctrl+s")
    assert path.read_text() == "something dear"
    assert "again to replace it" in desk.editor.status
    desk.type("ctrl+s")
    assert_array_equal(load_session(path).fixed, desk.session.fixed)
    assert "saved to" in desk.editor.status
    desk.type("n", "ctrl+s")
    assert "saved to" in desk.editor.status


def test_a_file_that_is_no_session_leaves_everything_as_it_was(desk, tmp_path):
    path = tmp_path / "noise.segdeform"
    path.write_bytes(b"noise")
    first = desk.session
    desk.editor.path = path
    desk.type("ctrl+o")
    assert desk.session is first
    assert "no readable session" in desk.editor.status
    assert len(desk.hand.failures) == 1
    desk.hand.failures.clear()
    with pytest.raises(Exception, match="no readable session"):
        desk.editor.load(path)
    assert desk.session is first
    desk.type("4")
    pull_handle(desk)


def test_a_session_of_another_mesh_is_shown_whole(desk, tmp_path):
    path = tmp_path / "sphere.segdeform"
    sphere = models.sphere(200)
    save_session(path, Session(sphere.with_vertices(20.0 * sphere.vertices + [50.0, 0.0, 0.0])))
    desk.editor.load(path)
    assert desk.editor.stage.surface.points.shape == desk.session.mesh.vertices.shape
    seen = desk.view.to_display(desk.session.mesh.vertices)[:, :2]
    assert ((seen > 0) & (seen < [500, 400])).all()


# Coming and going.


def test_when_it_is_gone_everything_is_as_before(any_view):
    heard = []
    interactor, style = any_view.interactor, any_view.interactor.GetInteractorStyle()
    interactor.AddObserver("KeyPressEvent", lambda *_: heard.append(interactor.GetKeySym()), 0.5)
    blank = picture(any_view)
    layers = any_view.window.GetNumberOfLayers()
    desk = Desk(any_view, models.sphere(200))
    desk.type("n")
    assert heard == []
    assert (picture(any_view) != blank).any()
    desk.editor.remove()
    assert_array_equal(picture(any_view), blank)
    assert any_view.window.GetNumberOfLayers() == layers
    assert interactor.GetInteractorStyle() is style
    desk.hand.key("n")
    assert heard == ["n"]
    session = desk.editor.session
    session.segment(2)  # nobody listens any more
    assert_array_equal(picture(any_view), blank)
    assert desk.hand.failures == []


def test_off_hears_nothing_and_on_goes_on(desk):
    desk.type("2")
    desk.editor.Off()
    assert desk.editor.status == ""
    desk.type("4")
    assert desk.editor.mode is Mode.CAGES
    assert not any(widget.GetEnabled() for widget in desk.editor.stage.widgets)
    desk.editor.SetEnabled(True)
    assert desk.editor.GetEnabled()
    assert desk.editor.stage.cages.GetEnabled()


@pytest.mark.parametrize("mode", ["deform", 4, None])
def test_only_a_mode_can_be_entered(desk, mode):
    with pytest.raises(ValueError, match="mode must be one of"):
        desk.editor.mode = mode
    desk.type("3")
    assert desk.editor.mode is Mode.HANDLES


def test_only_a_session_or_a_mesh_can_be_edited():
    with pytest.raises(ValueError, match="a Session or a Mesh; got 'cactus"):
        DeformEditor(plain_view(), "cactus.obj")


def test_a_window_of_one_pixel_is_drawn_without_complaint(desk, capfd):
    desk.type("4", "o", "h")
    for size in ((1, 300), (300, 1), (1, 1), (300, 300)):
        desk.view.window.SetSize(*size)
        desk.view.render()
    assert capfd.readouterr() == ("", "")
