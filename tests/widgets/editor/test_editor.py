"""The whole editor by real events: from a mesh to a pose, undone, saved and opened again."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from hands import Hand, draw_seldom, picture, plain_view
from numpy.testing import assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform import Session, load_session, models, save_session
from vtk_segdeform.deformer import LOCALITY
from vtk_segdeform.errors import CageError, MeshError, RegionError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.session import solving
from vtk_segdeform.widgets.editor import actions, controller
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.editor.queue import _Shared
from vtk_segdeform.widgets.editor.session_file import read_session
from vtk_segdeform.widgets.handle_dragger.gizmo_shapes import Kind, Part
from vtk_segdeform.widgets.region_selector.region_selector import Paint, Tool
from vtk_segdeform.widgets.scene.surface_display import SurfaceStyle
from vtk_segdeform.widgets.scene.view import View
from vtk_segdeform.widgets.volume_overlay.volume_overlay import VolumeOverlay

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")


class Bench:
    """An editor in a view, seen from the front with z up, and a simulated hand."""

    def __init__(self, view: View, session, mode: Mode | None = Mode.REGIONS):
        self.view = view
        self.editor = DeformEditor(view, session)
        view.camera.SetPosition(0.0, -5.0, 0.5)
        view.camera.SetFocalPoint(0.0, 0.0, 0.5)
        view.camera.SetViewUp(0.0, 0.0, 1.0)
        view.renderer.ResetCamera()
        view.render()
        draw_seldom(view)
        self.hand = Hand(view)
        if mode is not None:
            self.editor.mode = mode
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
        """Type keys such as "z" or "ctrl+z", and wait for the jobs that they start."""
        for key in keys:
            self.hand.key(key.split("+")[-1], control="ctrl+" in key, shift="shift+" in key)
            self.settle()

    def around(self, mask):
        """Return the corners, in order, of a box on the screen around vertices."""
        seen = self.view.to_display(self.session.vertices[mask])[:, :2]
        (x0, y0), (x1, y1) = seen.min(axis=0) - 4.0, seen.max(axis=0) + 4.0
        return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


@pytest.fixture(scope="module")
def ready():
    """Return the state of a small session, complete except for a pose."""
    scene = sausage(is_coarse=True)
    session = scene.session()
    return scene.mesh, session.state


@pytest.fixture
def bench(ready):
    """Yield an editor over a session that is ready, in a plain view."""
    mesh, state = ready
    made = Bench(plain_view((400, 320)), Session(mesh, state=state))
    yield made
    assert made.hand.failures == []
    made.editor.remove()


@pytest.fixture
def bare():
    """Yield an editor over a mesh without regions."""
    made = Bench(plain_view((400, 320)), sausage(is_coarse=True).mesh)
    yield made
    made.editor.remove()


def pull_handle(bench, shift=(20, 30), moves=2):
    """Drag the handle by its centre, *shift* pixels."""
    name = next(iter(bench.session.handles))
    middle = bench.session.vertices[bench.session.handles[name]].mean(axis=0)
    start = np.array(bench.hand.at(middle))
    bench.hand.drag([start + share * np.array(shift) for share in np.linspace(0.0, 1.0, moves + 1)])


def test_the_whole_story(tmp_path):
    mesh = models.cactus(500)
    coarse = Session(mesh)
    coarse.change_options(n_cage_vertices=60)
    bench = Bench(plain_view((400, 400)), Session(mesh, state=coarse.state))  # without a history
    del bench.view.render  # drawn at every event
    hand, z = bench.hand, mesh.vertices[:, 2]
    volume = signed_volume(mesh.vertices, mesh.faces)
    drawn = []

    def check_frame(*_):
        points = bench.editor.widgets.surface.points
        drawn.append(abs(signed_volume(points, mesh.faces) / volume - 1.0))

    bench.view.renderer.AddObserver("EndEvent", check_frame)

    bench.type("g")
    assert bench.session.regions.n_regions >= 2
    assert bench.editor.widgets.selector.region == 1
    before = bench.session.regions.membership[1].copy()
    hand.drag([hand.at([0.0, -0.1, height]) for height in (0.45, 0.5, 0.55)])
    assert bench.session.history.undo_label == "paint region 2"
    assert np.count_nonzero(bench.session.regions.membership[1]) > np.count_nonzero(before)

    bench.type("f")
    assert len(bench.session.cages) == bench.session.regions.n_regions

    bench.type("3", "v", "t")
    start, _, end, _ = bench.around(z < 0.08)
    hand.drag([start, (end[0], start[1]), end])
    assert set(np.flatnonzero(z < 0.08)) <= set(bench.session.fixed)
    assert z[bench.session.fixed].max() < 0.16
    bench.type("d", "l")
    hand.drag(bench.around(z > 0.9))
    assert set(np.flatnonzero(z > 0.9)) <= set(bench.session.handles["handle 1"])

    bench.type("4")
    assert bench.session.is_bound
    marked = bench.session.state
    handle = bench.session.handles["handle 1"]
    middle = mesh.vertices[handle].mean(axis=0)
    pivot = np.array(hand.at([0.0, 0.0, 0.5]))
    arm = np.array(hand.at(middle)) - pivot
    way = [
        pivot + [np.cos(a) * arm[0] + np.sin(a) * arm[1], np.cos(a) * arm[1] - np.sin(a) * arm[0]]
        for a in np.radians(np.linspace(0.0, 60.0, 13))
    ]
    hand.drag(way)
    assert bench.session.history.undo_label == "drag handle 1"
    there = bench.session.vertices[handle].mean(axis=0)
    assert np.linalg.norm(np.array(hand.at(there)) - way[-1]) < 12.0
    turn_by_a_ring(bench)
    turned = bench.session.vertices
    assert len(drawn) > 20
    assert max(drawn) < 1e-12

    steps = 0
    while bench.session.history.can_undo:
        bench.type("ctrl+z")
        steps += 1
    assert steps == 7  # regions, brush, cages, fixed, handle, drag, turn
    assert bench.session.regions is None
    assert_array_equal(bench.editor.widgets.surface.points, mesh.vertices)
    bench.type(*["ctrl+y", "ctrl+shift+z"] * 3, "ctrl+y")
    assert not bench.session.history.can_redo
    assert_array_equal(bench.session.vertices, turned)
    assert not bench.session.state.changes(replace(marked, pose=bench.session.state.pose))

    bench.editor.path = tmp_path / "cactus.segdeform"
    bench.type("ctrl+s")
    while "once the pose has settled" in bench.editor.status:
        hand.tick()
    assert "cactus.segdeform" in bench.editor.status
    assert_array_equal(load_session(bench.editor.path).vertices, bench.session.vertices)
    assert max(drawn) < 1e-12
    assert hand.failures == []
    bench.editor.remove()


def turn_by_a_ring(bench):
    """Rotate the handle about the view direction, by a sixth of the outermost ring."""
    dragger = bench.editor.widgets.dragger
    ring = dragger.gizmo.line(Part(Kind.ROTATION))[:, :2]
    before = bench.session.targets[dragger.handle]
    bench.hand.drag(ring[np.linspace(0, len(ring) // 6 - 1, 5).astype(int)])
    assert bench.session.history.undo_label == "rotate handle 1"
    a, b = (x - x.mean(axis=0) for x in (before, bench.session.targets[dragger.handle]))
    turn = Rotation.align_vectors(b, a)[0]
    assert np.degrees(turn.magnitude()) == pytest.approx(60.0, abs=8.0)


# Modes, keys and messages.


def test_each_mode_shows_what_is_missing_and_the_key_that_adds_it(bare):
    bare.session.change_options(n_cage_vertices=40)
    said = []
    for key in "1234":
        bare.type(key)
        said.append(bare.editor.status)
    assert bare.editor.mode is Mode.DEFORM
    assert "Press G" in said[0]
    assert "Press G" in said[1]
    assert "paint fixed vertices" in said[2]
    assert "Press G" in said[3]
    bare.type("g")
    assert "Press F" in bare.editor.status
    bare.type("f")
    assert "No handle yet. Press 3 to paint one" in bare.editor.status
    assert not bare.session.is_bound
    x = bare.session.mesh.vertices[:, 0]
    bare.type("3", "t", "v", "d")
    corners = bare.around(x > 2.4)
    bare.hand.drag([corners[0], corners[2]])
    assert "Rectangle: paint handle 1" in bare.editor.status
    bare.type("4")
    assert bare.session.is_bound
    assert "Move or rotate a handle" in bare.editor.status
    pull_handle(bare)
    assert bare.session.history.undo_label == "drag handle 1"
    assert bare.hand.failures == []


def test_each_mode_switches_on_its_own_widget_and_display(bench):
    widgets = bench.editor.widgets
    owners = {
        "1": widgets.selector,
        "2": widgets.cages,
        "3": widgets.selector,
        "4": widgets.dragger,
    }
    for key, widget in owners.items():
        bench.type(key)
        others = [w for w in widgets.interactive if w is not widgets.landmarks]
        assert [w for w in others if w.GetEnabled()] == [widget]
        assert widgets.landmarks.GetEnabled() == (key == "4")
        assert widgets.cages.is_shown == (key == "2")
    bench.type("c")
    assert widgets.cages.is_shown
    bench.type("1", "c")
    assert not widgets.cages.is_shown
    bench.type("4", "o")
    assert widgets.overlay.is_shown
    bench.type("1")
    assert not widgets.overlay.is_shown  # painting hides the overlay
    bench.type("4")
    assert widgets.overlay.is_shown


def test_regions_are_filled_only_where_they_are_painted_and_outlined_on_demand(bench):
    widgets, regions = bench.editor.widgets, bench.session.regions.n_regions
    free = np.setdiff1d(np.arange(bench.session.mesh.n_vertices), bench.session.fixed)
    free = np.setdiff1d(free, np.concatenate([*bench.session.handles.values()]))

    def n_colours():
        colours = vtk_to_numpy(widgets.surface.polydata.GetPointData().GetScalars())
        return len(np.unique(colours[free], axis=0))

    for mode in Mode:
        bench.editor.mode = mode
        bench.settle()
        View.render(bench.view)
        assert (n_colours() > 1) == (mode is Mode.REGIONS)
        assert (widgets.outlines.n_numbers > 0) == (mode is Mode.REGIONS)
    before = picture(bench.view)
    bench.hand.types("shift+g")
    assert (picture(bench.view) != before).any()
    assert 0 < widgets.outlines.n_numbers <= regions
    camera = bench.view.camera
    place, focus = np.array(camera.GetPosition()), np.array(camera.GetFocalPoint())
    camera.SetFocalPoint(2 * place - focus)  # the mesh is behind it
    bench.view.window.Render()
    assert widgets.outlines.n_numbers == 0
    camera.SetFocalPoint(focus)
    bench.hand.types("shift+g")
    bench.editor.controller.messages.clear()
    bench.editor.controller.refresh()
    assert_array_equal(picture(bench.view), before)


def test_a_held_key_shows_the_mesh_at_rest_and_its_release_the_pose(bench):
    bench.editor.mode = Mode.DEFORM
    bench.settle()
    session, surface = bench.session, bench.editor.widgets.surface
    session.drag(session.vertices[np.concatenate([*session.handles.values()])] + [0.1, 0.0, 0.0])
    session.commit()
    bench.settle()
    state, posed = session.state, session.vertices.copy()
    for event in ("KeyPressEvent", "KeyReleaseEvent", "KeyPressEvent"):  # a key that repeats
        bench.hand.event(event, key="backslash")
        assert_array_equal(surface.points, session.mesh.vertices)
        assert not any(widget.GetEnabled() for widget in bench.editor.widgets.interactive)
    bench.hand.tick()
    assert_array_equal(surface.points, session.mesh.vertices)
    bench.hand.event("KeyReleaseEvent", key="backslash")
    bench.hand.tick()
    assert_array_equal(surface.points, posed)
    assert bench.editor.widgets.dragger.GetEnabled()
    assert session.state is state
    bench.hand.event("KeyPressEvent", key="backslash")
    bench.type("1")  # any other action shows the pose as well
    assert_array_equal(surface.points, posed)


def test_a_tap_on_the_key_of_the_mesh_at_rest_ends_with_it_whatever_follows(bench):
    bench.editor.mode = Mode.DEFORM
    bench.settle()
    bench.session.move_handle("handle 1", np.eye(4) + 0.1 * np.eye(4, k=3))
    bench.session.commit()
    bench.settle()
    bench.hand.event("KeyPressEvent", key="backslash")
    assert "at rest, while held" in bench.editor.status
    bench.hand.event("KeyReleaseEvent", key="backslash")
    bench.type("comma")  # before the release is known to be no repetition
    bench.hand.tick(3)
    assert bench.editor.widgets.surface.instead is None


@pytest.mark.parametrize(
    ("mode", "preset"), [(mode, ("pyvista", "Blender")[k % 2]) for k, mode in enumerate(Mode)]
)
def test_no_key_edits_anything_after_a_press_beside_the_mesh(bench, mode, preset):
    editor, session = bench.editor, bench.session
    editor.keys = preset
    editor.mode = mode
    bench.settle()
    session.handles.set_pivot("handle 1", session.mesh.vertices[0])
    session.handles.set_pivot("handle 1", session.mesh.vertices[1])
    session.undo()
    selector = editor.widgets.selector
    before = session.state, session.history.labels, session.options, selector.tool, selector.paints
    bench.hand.press((4, 4))
    bench.hand.move((9, 6))
    for key in sorted({key for binding in editor.keys.bindings for key in binding.keys}):
        if key != "escape":
            bench.hand.types(key)
            assert "Nothing is grabbed" in editor.status or key.startswith("bracket"), key
            editor.controller.messages.clear()
    bench.hand.release((9, 6))
    now = session.state, session.history.labels, session.options, selector.tool, selector.paints
    assert now == before
    assert (editor.mode, editor.is_busy) == (mode, False)


def test_one_key_cycles_through_shaded_edges_and_wireframe(bench):
    shaded, seen = bench.editor.widgets.surface.style, []
    for _ in SurfaceStyle:
        bench.hand.types("w")
        seen.append((bench.editor.widgets.surface.style, picture(bench.view)))
    assert [style for style, _ in seen] == [SurfaceStyle.EDGES, SurfaceStyle.WIREFRAME, shaded]
    for k in range(3):
        assert np.mean(np.any(seen[k][1] != seen[k - 1][1], axis=2)) > 0.02


def test_a_pose_that_new_cages_cannot_have_is_reset_and_that_is_said(bench, monkeypatch):
    session = bench.session
    session.move_handle(next(iter(session.handles)), np.diag([1.0, 1.0, 1.2, 1.0]))
    session.commit()
    far = 1e6 * session.mesh.diagonal
    monkeypatch.setattr(
        solving, "carried", lambda _, state, *__: [cage.vertices + far for cage in state.cages]
    )
    bench.type("f")
    assert session.state.pose is None
    assert "The pose was reset; Ctrl+Z brings it back" in bench.editor.status


def test_a_stroke_paints_a_handle_once_something_is_fixed(bench):
    session, selector = bench.session, bench.editor.widgets.selector
    bench.type("3", "s", "2", "3")
    assert selector.paints is Paint.FIXED  # as before, since there is a handle
    session.handles.remove(next(iter(session.handles)))
    for fixed, paints in ((session.fixed, Paint.HANDLE), ([], Paint.FIXED)):
        session.set_fixed(fixed)
        bench.type("2", "3")
        assert selector.paints is paints


def test_keys_select_the_target_of_painting(bench):
    selector = bench.editor.widgets.selector
    tools = {"l": Tool.LASSO, "t": Tool.RECTANGLE, "k": Tool.COMPONENT, "b": Tool.BRUSH}
    for key, tool in tools.items():
        bench.type(key)
        assert selector.tool is tool
    assert selector.paints is Paint.REGION
    bench.type("n")
    assert "region 2" in bench.editor.status
    bench.type("n", "a")
    assert "region 3 (new)" in bench.editor.status
    bench.type("3", "s")
    assert selector.paints is Paint.FIXED
    bench.type("d", "n")
    assert "handle 1" in bench.editor.status
    bench.type("a")
    assert "paint new handle" in bench.editor.status
    radius = selector.radius
    bench.hand.hover(bench.hand.at([0.0, -0.8, 0.0]))
    bench.type("bracketright")
    assert selector.radius > radius


def test_without_regions_painting_splits_the_mesh_into_the_stroke_and_the_rest(bare):
    bare.type("g", "n", "n", "ctrl+z")
    assert bare.session.regions is None
    bare.hand.click(bare.hand.at([-2.0, 0.0, 0.0]))
    everything, painted = bare.session.regions.membership
    assert everything.all()
    assert 0 < np.count_nonzero(painted) < len(painted)
    assert "region 2" in bare.editor.status
    bare.type("g", "a", "ctrl+z", "ctrl+z")  # undo to a session without regions
    assert "No regions yet" in bare.editor.status
    bare.hand.click(bare.hand.at([2.0, 0.0, 0.0]))
    assert bare.session.regions.n_regions == 2
    assert bare.hand.failures == []


def test_a_key_that_needs_something_else_first_names_it(bare):
    for keys, says in (
        ("m", "No regions to merge yet. Press G"),
        ("x", "No regions to split yet. Press G"),
        ("c", "No cages to show yet. Press F"),
        ("f", "No regions to fit cages to. Press G"),
        ("3n", "No handle yet"),
    ):
        bare.type("1", *keys)
        assert says in bare.editor.status, keys
        bare.type("1", "3", "Delete")
        assert "No handle yet" in bare.editor.status


def test_the_status_line_reports_vertices_that_a_stroke_left_unchanged(bench):
    hand, held = bench.hand, bench.session.regions.membership.sum(axis=0)
    size = np.count_nonzero(bench.session.regions.membership[0])
    bench.type("t", "v")  # a rectangle with X-ray
    hand.drag([(2, 40), (398, 398)], control=True)
    left = np.count_nonzero(bench.session.regions.membership[0])
    assert 0 < left < size
    assert f"{left} vertices skipped: in no other region" in bench.editor.status
    assert left == np.count_nonzero(held[bench.session.regions.membership[0]] == 1)


def test_painting_a_region_in_a_pose_resets_it_and_says_so(bench):
    bench.type("4")
    pull_handle(bench)
    bench.type("1", "plus")
    assert bench.session.state.pose is None
    assert "Pose reset" in bench.editor.status
    bench.type("ctrl+z")
    assert bench.session.state.pose is not None
    assert "Pose reset" not in bench.editor.status


def test_keys_make_a_pull_more_or_less_local(bench):
    puller = bench.editor.widgets.puller
    bench.type("0", "plus")
    assert puller.locality == pytest.approx(LOCALITY + 0.1)
    bench.type("minus", "minus")
    assert puller.locality == pytest.approx(LOCALITY - 0.1)
    assert f"Locality: {100 * (LOCALITY - 0.1):.0f} %" in bench.editor.status
    bench.type(*["minus"] * 11)
    assert puller.locality == 0.0
    bench.type("a")
    assert puller.locality is None
    assert "Locality: auto" in bench.editor.status


SAID = [
    ("c", "Cages shown"), ("c", "Cages hidden"), ("shift+g", "Regions shown"),
    ("shift+g", "Regions hidden"), ("w", "Shaded with edges"), ("w", "Wireframe"), ("w", "Shaded"),
    ("KP_5", "Orthographic"), ("KP_5", "Perspective"), ("p", "Volume preservation off"),
    ("p", "Volume preservation on from the next move"), ("v", "Brush: paint region 1 (X-ray)"),
    ("i", "The mesh is closed and exactly as given: nothing to show"),
    ("v", "Visible surface only"), ("x", "Split region 1"), ("ctrl+z", "Undo: split region 1"),
    ("ctrl+y", "Redo: split region 1"), ("4", "No cages yet. Press F"),
    ("l", "Axes: local"), ("l", "Axes: global"), ("Home", "Pose reset"),
    ("0", "Drag the surface. Shift-click pins. [ or ]: limb. Shift+wheel: radius (5 %)"),
]  # fmt: skip


def test_each_key_says_what_it_has_done(bench):
    bench.editor.widgets.puller.radius = 0.05 * bench.session.mesh.diagonal
    for key, said in SAID:
        bench.type(key)
        assert bench.editor.status.startswith(said), key
    bench.hand.wheel(1, bench.hand.at([0.0, 0.0, 0.0]), shift=True)
    share = 100.0 * bench.editor.widgets.puller.radius / bench.session.mesh.diagonal
    assert f"radius ({share:.1f} %)" in bench.editor.status
    bench.hand.click(bench.hand.at([0.0, 0.0, 0.0]), shift=True)
    bench.type("u")
    assert "Removed 1 point" in bench.editor.status
    assert list(bench.session.handles) == ["handle 1"]


def test_keys_for_axes_the_pivot_and_pins(bench):
    session, dragger, hand = bench.session, bench.editor.widgets.dragger, bench.hand
    bench.type("4", "l")
    assert dragger.local
    hand.hover(hand.at([0.0, 0.0, 0.0]))
    assert "Local axes (L)" in bench.editor.status
    bench.type("l", "v")
    assert not dragger.local
    x, _, z = dragger.gizmo.centre
    assert np.hypot(x, z) < 0.05
    hand.hover((3, 3))
    bench.type("v")
    middle = session.mesh.vertices[session.handles["handle 1"]].mean(axis=0)
    assert np.allclose(dragger.gizmo.centre, middle)
    before, ball = session.state, np.array(hand.at(middle))
    for key in ("", "Escape"):  # the ball with Shift: the pivot moves, and nothing else
        hand.press(ball, shift=True)
        for step in (5.0, 12.0):
            hand.move(ball + step, shift=True)
            assert np.allclose(hand.at(dragger.gizmo.centre), ball + step, atol=0.5)
        assert session.state.pose is None
        if key:
            hand.key(key)
        hand.release()
        if not key:
            assert session.history.undo_label == "move the pivot of handle 1"
            assert np.allclose(hand.at(session.handles.pivot("handle 1")), ball + 12.0, atol=0.5)
            for _ in range(2):
                hand.click(ball + 12.0)
            assert session.history.undo_label == "reset the pivot of handle 1"
        assert np.allclose(dragger.gizmo.centre, middle)
        assert not session.state.pivots
    assert session.undo() == "reset the pivot of handle 1"
    assert session.undo() == "move the pivot of handle 1"
    assert session.state is before
    bench.type("v")
    assert "Point at the surface" in bench.editor.status
    hand.failures.clear()
    bench.type("m")
    assert len(session.handles["pin 1"]) == 1
    bench.type("0", "m")
    assert "Point at a pin" in bench.editor.status
    hand.failures.clear()
    hand.click(hand.at([0.0, 0.0, 0.0]), shift=True)
    bench.type("m")
    assert len(session.handles["handle 1"]) > 3
    assert list(map(str, (session.undo(), session.undo(), session.undo()))) == [
        "convert pin 2 to handle 1",
        "pin",
        "convert handle 1 to pin 1",
    ]


def test_z_constrains_while_a_handle_is_dragged_and_ctrl_z_undoes(bench):
    bench.type("4")
    before = bench.session.state
    handle = bench.session.handles["handle 1"]
    middle = bench.session.vertices[handle].mean(axis=0)
    x, y = bench.hand.at(middle)
    bench.hand.press((x, y))
    bench.hand.move((x + 10, y + 10))
    bench.hand.key("z")
    bench.hand.move((x + 20, y + 30))
    assert bench.session.is_dragging
    moved = bench.session.targets["handle 1"] - bench.session.mesh.vertices[handle]
    assert np.abs(moved[:, :2]).max() < 1e-9 < moved[:, 2].min()
    bench.hand.release((x + 20, y + 30))
    bench.type("ctrl+z")
    assert not bench.session.state.changes(before)


def test_a_key_of_another_mode_is_explained_and_withheld_from_vtk(bench):
    heard = []
    bench.view.interactor.AddObserver("CharEvent", lambda *_: heard.append("char"), -1.0)
    bench.editor.mode = Mode.CAGES
    bench.type("s")  # surface, to VTK
    assert heard == []
    said = "S works in mode 1 (Paint stiffness or regions), 3 (Paint fixed vertices)"
    assert said in bench.editor.status
    bench.type("j")
    assert heard == ["char"]


def test_without_numba_the_status_line_says_so_until_the_first_action(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "numba" else name)
    made = Bench(plain_view((500, 400)), sausage(is_coarse=True).mesh, mode=None)
    said = "numba is not installed: frames take 3 to 6 times as long. pip install numba"
    assert made.editor.status.startswith(said)
    made.type("1")
    assert made.editor.status
    assert "numba" not in made.editor.status
    made.editor.remove()


def test_a_file_that_is_neither_a_mesh_nor_a_session_is_told_the_formats(tmp_path):
    (tmp_path / "grid.vts").write_text('<VTKFile type="StructuredGrid">')
    with pytest.raises(MeshError, match=r"\.vts files cannot be read; use one of .*\.vtu"):
        read_session(tmp_path / "grid.vts", lambda *_: None)
    save_session(tmp_path / "work.segdeform", Session(models.sphere(100)))
    (tmp_path / "work.segdeform").rename(tmp_path / "work.backup")
    assert read_session(tmp_path / "work.backup", lambda *_: None).mesh.n_vertices == 100


def test_the_first_run_says_that_it_compiles(monkeypatch):
    monkeypatch.setattr(controller, "is_compiling", lambda: True)
    made = Bench(plain_view((500, 400)), sausage(is_coarse=True).mesh, mode=None)
    assert made.editor.status.startswith("First run: compiling")
    made.editor.remove()


def test_an_error_is_shown_until_an_action_succeeds(bench):
    bench.hand.click(
        bench.hand.at([-2.0, 0.0, 0.0]), control=True
    )  # erase where there is only one region
    assert "are only in region 1" in bench.editor.status
    assert [type(failure).__name__ for failure in bench.hand.failures] == ["RegionError"]
    bench.hand.failures.clear()
    bench.hand.hover((5, 5))
    assert "are only in region 1" in bench.editor.status
    bench.hand.click(bench.hand.at([1.0, -0.7, 0.0]))
    assert bench.session.history.undo_label == "paint region 1"
    assert bench.editor.status.startswith("Brush: paint region 1.")
    bench.hand.hover((5, 5))
    bench.type("m")  # the pointer is beside the mesh
    assert "Point at the region" in bench.editor.status
    assert len(bench.hand.failures) == 1
    bench.hand.failures.clear()


def test_an_internal_error_is_shown_too(bench):
    bench.session.on_change(lambda change: 1 // 0)
    bench.type("2", "ctrl+z")
    assert "Nothing to undo" in bench.editor.status
    bench.type("p")
    assert "ZeroDivisionError" in bench.editor.status
    assert bench.hand.failures
    bench.hand.failures.clear()


def test_do_returns_the_error_of_an_action_or_none(bench):
    def fail(controller):
        raise CageError("no room for it")

    assert bench.editor.do(actions.undo) is None
    error = bench.editor.do(fail)
    assert isinstance(error, CageError)
    assert bench.hand.failures == [error]
    assert bench.editor.status == "no room for it"
    bench.editor.controller.start("Counting", lambda _: time.sleep(0.05), lambda _: None)
    refusal = bench.editor.do(actions.undo)
    assert str(refusal).startswith("Busy. Counting")
    assert bench.editor.do(lambda controller: controller.show_keys(), while_busy=True) is None
    bench.settle()
    bench.hand.failures.clear()


def test_the_status_line_does_not_repeat_a_result_that_the_hint_contains(bench):
    bench.type("4", "p")
    assert bench.editor.status.count("Volume preservation off") == 1
    bench.type("1", "p", "p")
    assert bench.editor.status.startswith("Volume preservation off · Brush")


def test_the_hint_says_that_a_stroke_resets_the_pose_and_which_handle_cannot_be_moved(bench):
    bench.type("4")
    (name,) = bench.session.handles
    for change, word in ((bench.editor.widgets.dragger.set_locked, "locked"),
                         (bench.editor.widgets.dragger.set_hidden, "hidden")):  # fmt: skip
        change(name, True)
        bench.editor.controller.refresh()
        assert f"{name} is {word}. " in bench.editor.status
        change(name, False)
        bench.editor.controller.refresh()
        assert "Move or rotate a handle" in bench.editor.status
    bench.type("1")
    assert "resets the pose" not in bench.editor.status
    bench.session.move_handle(name, np.eye(4) + 0.01 * np.eye(4, k=3))
    bench.session.commit()
    bench.editor.controller.refresh()
    assert "Painting resets the pose" in bench.editor.status


# Jobs.


def test_during_a_job_only_the_camera_works(bare):
    bare.hand.key("g")
    assert bare.editor.is_busy
    assert "Detecting regions" in bare.editor.status
    assert "Esc to cancel" in bare.editor.status
    camera = bare.view.camera.GetPosition()
    middle = bare.hand.at([0.0, -0.8, 0.0])
    bare.hand.drag([middle, (middle[0] + 30, middle[1] + 20)])
    assert bare.view.camera.GetPosition() != camera
    bare.hand.key("f")
    bare.hand.key("3")
    assert bare.editor.mode is Mode.REGIONS
    assert bare.editor.status.startswith("Busy. Detecting regions")
    assert bare.session.regions is None
    bare.settle()
    assert bare.session.regions is not None
    assert "1 region found · Brush: paint region 1." in bare.editor.status
    assert bare.hand.failures == []


@contextmanager
def until_cancelled():
    """Let no job continue beyond its first report of progress before it is cancelled."""
    report = _Shared.report

    def waiting(shared, fraction, text):
        end = time.monotonic() + 20.0
        while not shared.is_cancelled:
            assert time.monotonic() < end, "the job was not cancelled"
            time.sleep(0.001)
        report(shared, fraction, text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_Shared, "report", waiting)
        yield


def test_escape_cancels_a_job_and_nothing_is_changed(bare):
    with until_cancelled():
        bare.hand.key("g")
        bare.hand.key("Escape")
        bare.settle()
    assert bare.session.regions is None
    assert not bare.session.history.can_undo
    assert "Cancelled" in bare.editor.status
    assert bare.hand.failures == []
    bare.hand.click(bare.hand.at([0.0, -0.8, 0.0]))  # the brush works again
    assert bare.session.history.undo_label == "paint region 2"
    bare.type("g")
    assert bare.session.regions is not None


def test_a_second_escape_does_not_restart_a_cancelled_job(bench):
    with until_cancelled():
        bench.hand.key("4")
        assert bench.editor.is_busy
        for _ in range(3):
            bench.hand.key("Escape")
            bench.settle()
    bench.hand.key("h")
    assert not bench.editor.is_busy
    assert not bench.session.is_bound
    bench.type("4")
    assert bench.session.is_bound


def test_cages_fitted_to_outdated_regions_are_rejected(bare):
    bare.session.change_options(n_cage_vertices=40)
    bare.type("g")
    bare.settle()
    bare.hand.key("f")
    assert bare.editor.is_busy
    bare.session.painting.paint(bare.session.regions.n_regions, np.arange(40))
    bare.settle()
    assert not bare.session.cages
    assert isinstance(bare.hand.failures.pop(), RegionError)
    assert "regions changed while cages were being fitted" in bare.editor.status
    bare.type("f")
    bare.settle()
    assert len(bare.session.cages) == bare.session.regions.n_regions


def test_switching_off_or_removing_the_editor_cancels_its_job(bare):
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


def test_a_posed_session_is_bound_as_it_is_read_and_not_by_the_first_drag(bench, tmp_path):
    bench.type("4")
    pull_handle(bench)
    bench.editor.save(tmp_path / "posed.segdeform")
    stages = []
    read = read_session(tmp_path / "posed.segdeform", lambda _, stage: stages.append(stage))
    assert read.is_bound
    assert stages  # which the window shows
    assert_array_equal(read.vertices, bench.session.vertices)


def test_another_session_can_be_opened_and_edited(bench, tmp_path):
    bench.type("4")
    pull_handle(bench)
    path = tmp_path / "posed.segdeform"
    bench.editor.save(path)
    posed = bench.session.vertices
    bench.type("home")
    first = bench.session
    bench.type("ctrl+o")
    assert "Unsaved changes will be lost. Open again" in bench.editor.status
    assert bench.session is first
    shown = bench.view.renderer.GetViewProps().GetNumberOfItems()
    bench.type("ctrl+o")
    assert bench.view.renderer.GetViewProps().GetNumberOfItems() == shown
    assert bench.session is not first
    assert "Opened" in bench.editor.status
    assert_array_equal(bench.editor.widgets.surface.points, posed)
    assert not bench.session.history.can_undo
    first.set_fixed([])  # no longer observed
    assert "Opened" in bench.editor.status
    pull_handle(bench, (0, -20))
    assert bench.session.history.can_undo
    assert not first.is_dragging


def test_tools_and_display_options_survive_opening_another_session(bench, tmp_path):
    half = sausage(is_coarse=True).transformed(scale=0.5).mesh
    path = tmp_path / "half.segdeform"
    save_session(path, Session(half))
    bench.type("3", "t", "v", "c", "4", "o", "3")
    bench.editor.widgets.selector.radius = 0.07 * bench.session.mesh.diagonal
    before = bench.editor.widgets
    bench.editor.path = path
    bench.type("ctrl+o", "ctrl+o")
    widgets = bench.editor.widgets
    assert widgets is not before
    assert bench.editor.mode is Mode.HANDLES
    assert (widgets.selector.tool, widgets.selector.through) == (Tool.RECTANGLE, True)
    assert widgets.selector.radius == pytest.approx(0.07 * half.diagonal)
    assert widgets.cages.is_shown
    bench.type("4")
    assert widgets.overlay.is_shown


def test_local_volumes_are_measured_in_a_job_in_cage_mode_too(bench, monkeypatch):
    threads = []

    def prepare(overlay):
        threads.append(threading.current_thread())
        own(overlay)

    own = VolumeOverlay.prepare
    monkeypatch.setattr(VolumeOverlay, "prepare", prepare)
    bench.type("2")
    bench.hand.key("o")
    assert bench.editor.is_busy
    assert "Computing local volume change" in bench.editor.status
    assert not bench.editor.widgets.overlay.is_shown
    bench.settle()
    assert bench.editor.widgets.overlay.is_shown
    assert bench.editor.widgets.cages.GetEnabled()
    assert threads != []
    assert threading.main_thread() not in threads


def test_opening_asks_again_after_another_action(bench, tmp_path):
    bench.editor.save(tmp_path / "one.segdeform")
    first = bench.session
    bench.type("x", "ctrl+o", "n", "ctrl+o")
    assert bench.session is first
    bench.type("ctrl+z", "ctrl+o")  # the saved state: no unsaved changes
    assert bench.session is not first


def test_another_existing_file_is_replaced_only_if_confirmed(bench, tmp_path):
    path = tmp_path / "other.segdeform"
    path.write_text("something dear")
    bench.editor.path = path
    bench.type("ctrl+s")
    assert path.read_text() == "something dear"
    assert "again to replace it" in bench.editor.status
    bench.type("ctrl+s")
    assert_array_equal(load_session(path).fixed, bench.session.fixed)
    assert "Saved to" in bench.editor.status
    bench.type("n", "ctrl+s")
    assert "Saved to" in bench.editor.status


def test_opening_an_invalid_file_changes_nothing(bench, tmp_path):
    path = tmp_path / "noise.segdeform"
    path.write_bytes(b"noise")
    first = bench.session
    bench.editor.path = path
    bench.type("ctrl+o")
    assert bench.session is first
    assert "not a readable session" in bench.editor.status
    assert len(bench.hand.failures) == 1
    bench.hand.failures.clear()
    with pytest.raises(Exception, match="not a readable session"):
        bench.editor.load(path)
    assert bench.session is first
    bench.type("4")
    pull_handle(bench)


def test_a_session_of_another_mesh_is_framed_by_the_camera(bench, tmp_path):
    path = tmp_path / "sphere.segdeform"
    sphere = models.sphere(200)
    save_session(path, Session(sphere.with_vertices(20.0 * sphere.vertices + [50.0, 0.0, 0.0])))
    bench.editor.load(path)
    assert bench.editor.widgets.surface.points.shape == bench.session.mesh.vertices.shape
    seen = bench.view.to_display(bench.session.mesh.vertices)[:, :2]
    assert ((seen > 0) & (seen < [500, 400])).all()


# Removing and switching off.


def test_removing_the_editor_restores_the_view():
    any_view, heard = plain_view((400, 400)), []
    interactor, style = any_view.interactor, any_view.interactor.GetInteractorStyle()
    interactor.AddObserver("KeyPressEvent", lambda *_: heard.append(interactor.GetKeySym()), 0.5)
    blank = picture(any_view)
    layers = any_view.window.GetNumberOfLayers()
    bench = Bench(any_view, models.sphere(200))
    bench.type("n")
    assert heard == []
    assert (picture(any_view) != blank).any()
    bench.editor.remove()
    assert_array_equal(picture(any_view), blank)
    assert any_view.window.GetNumberOfLayers() == layers
    assert interactor.GetInteractorStyle() is style
    bench.hand.key("n")
    assert heard == ["n"]
    session = bench.editor.session
    session.segment(2)  # no longer observed
    assert_array_equal(picture(any_view), blank)
    assert bench.hand.failures == []


def test_off_ignores_keys_and_on_responds_again(bench):
    bench.type("2")
    bench.editor.Off()
    assert bench.editor.status == ""
    bench.type("4")
    assert bench.editor.mode is Mode.CAGES
    assert not any(widget.GetEnabled() for widget in bench.editor.widgets.interactive)
    bench.editor.SetEnabled(True)
    assert bench.editor.GetEnabled()
    assert bench.editor.widgets.cages.GetEnabled()


def test_only_a_mode_is_accepted(bench):
    for mode in ("deform", 4, None):
        with pytest.raises(ValueError, match="mode must be one of"):
            bench.editor.mode = mode
    bench.type("3")
    assert bench.editor.mode is Mode.HANDLES


def test_only_a_session_or_a_mesh_can_be_edited():
    with pytest.raises(ValueError, match="a Session, a Surface or a Mesh; got 'cactus"):
        DeformEditor(plain_view(), "cactus.obj")


def test_a_window_of_one_pixel_is_drawn_without_warnings(bench, capfd):
    bench.type("4", "o")
    View.render(bench.view)
    bench.type("h")
    for size in ((1, 300), (300, 1), (1, 1), (300, 300)):
        if size == (300, 300):
            bench.type("Escape")  # laying out the card takes most of the time
        bench.view.window.SetSize(*size)
        View.render(bench.view)
    assert capfd.readouterr() == ("", "")
