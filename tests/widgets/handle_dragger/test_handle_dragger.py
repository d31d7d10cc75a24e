"""Moving and rotating handles with the mouse: targets, constraints, undo, refining."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, picture, plain_view
from scenes import sausage
from scipy.spatial.transform import Rotation
from solids import rotation
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform import Session
from vtk_segdeform.errors import CageError, ConstraintError
from vtk_segdeform.geometry.rotations import rigid_fit
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets.handle_dragger import live_solve
from vtk_segdeform.widgets.handle_dragger.gizmo_shapes import FREE, PARTS, Kind, Part
from vtk_segdeform.widgets.handle_dragger.handle_dragger import HandleDragger
from vtk_segdeform.widgets.handle_dragger.handle_motion import Grip, Motion
from vtk_segdeform.widgets.scene import draft
from vtk_segdeform.widgets.scene.gestures import Phase, Pointer
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("bound_once")

SCENE = sausage(is_coarse=True)
TIP, TOP = "handle 1", "handle 2"
LOOKS = [(10.0, -8.0, 6.0), (9.0, 7.0, 4.0), (-5.0, 6.0, -8.0)]
VIEW_RING = Part(Kind.ROTATION)


class Bench:
    """A session with two handles, a dragger that is on, and a hand."""

    def __init__(self, look=LOOKS[0], *, parallel=False, up=(0.0, 0.0, 1.0)):
        self.session = SCENE.caged()
        self.session.set_fixed(SCENE.fixed)
        x, _, z = SCENE.mesh.vertices.T
        self.session.handles.add(SCENE.handle)
        self.session.handles.add((np.abs(x) < 0.5) & (z > 0.6))
        self.view = plain_view()
        self.dragger = HandleDragger(self.view, self.session)
        self.gizmo = self.dragger.gizmo
        self.view.camera.SetParallelProjection(parallel)
        self.view.camera.SetPosition(*look)
        self.view.camera.SetViewUp(*up)
        self.view.renderer.ResetCamera()
        self.view.camera.Zoom(0.7)
        self.view.render()
        draw_seldom(self.view)
        self.dragger.On()
        self.hand = Hand(self.view)

    def targets(self, name=TIP):
        return self.session.targets[name]

    def shift(self, name=TIP):
        """Return the translation of the targets, (3,); it is the same for all."""
        away = self.targets(name) - SCENE.mesh.vertices[self.session.handles[name]]
        assert np.ptp(away, axis=0).max() < 1e-12
        return away[0]

    def aim(self, part):
        """Return a pixel at which a press grabs *part*."""
        line = self.gizmo.line(part)[:, :2]
        if part.kind is Kind.PLANE:
            line = np.concatenate([line[:4].mean(axis=0)[None], 0.5 * (line[:4] + line[1:])])
        elif part.kind is Kind.AXIS:
            line = line[0] + np.linspace(0.2, 0.9, 15)[:, None] * (line[1] - line[0])
        places = np.round(line[np.isfinite(line).all(axis=1)])
        places = places[:: 1 + len(places) // 10]
        places = places[np.argsort(np.abs(np.arange(len(places)) - len(places) // 2))]
        taken = (p for p in places if self.gizmo.part_at(Pointer(Phase.HOVER, *p)) == part)
        place = next(taken, None)
        assert place is not None, f"{part} is not to be seen"
        assert 20.0 < place.min() <= place.max() < 380.0
        return place

    @property
    def captions(self):
        """The visible texts of the gizmo."""
        View.render(self.view)
        texts = [p for p in self.view.foreground.GetViewProps() if isinstance(p, vtkTextActor)]
        return [text.GetInput() for text in texts if text.GetVisibility()]


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    assert not bench.hand.failures
    bench.dragger.remove()


@pytest.fixture
def roughly(monkeypatch):
    """Solve one step per event, far from convergence: for tests of targets, which are exact."""
    monkeypatch.setattr(live_solve, "STEPS", 1)


about_targets = pytest.mark.usefixtures("roughly")
each_view = pytest.mark.parametrize(
    ("look", "parallel"), every(2, [(LOOKS[0], False), (LOOKS[2], False), (LOOKS[1], True)])
)


def turned(bench):
    """Rotate the active handle slightly, switch to its local axes, and return them."""
    turn = np.eye(4)
    turn[:3, :3] = rotation([1.0, 2.0, 0.5], 0.2)
    centre = bench.targets().mean(axis=0)
    turn[:3, 3] = centre - turn[:3, :3] @ centre
    bench.session.move_handle(TIP, turn, max_steps=3)
    bench.session.commit()
    bench.dragger.local = True
    return turn[:3, :3].T


# Directions of motion.


@pytest.mark.parametrize(
    ("look", "parallel", "local"),
    every(3, [(LOOKS[1], True, True), (LOOKS[0], False, False), (LOOKS[2], False, True)]),
)
@about_targets
def test_every_part_moves_as_it_says(look, parallel, local):
    bench = Bench(look, parallel=parallel)
    axes = turned(bench) if local else np.eye(3)
    assert np.allclose(bench.gizmo.axes, axes, atol=1e-9)
    hand = bench.hand
    for way in (Kind.AXIS, Kind.PLANE, Kind.ROTATION):
        for axis in range(3):
            place = bench.aim(Part(way, axis))
            start, centre = bench.targets(), bench.gizmo.centre
            step = np.array([9.0, 7.0])
            if way is Kind.AXIS:
                step = np.diff(bench.gizmo.line(Part(way, axis))[:, :2], axis=0)[0]
                step *= 12.0 / np.linalg.norm(step)
            hand.press(place)
            hand.move(place + step)
            after = bench.targets()
            if way is Kind.ROTATION:
                R, shift = rigid_fit(start, after)
                assert np.allclose(R @ axes[axis], axes[axis], atol=1e-9)
                assert np.allclose(start @ R.T + shift, after, atol=1e-9)
                assert np.allclose(R @ centre + shift, centre, atol=1e-9)
                assert 0.01 < np.arccos((np.trace(R) - 1.0) / 2.0) < 2.0
            else:
                away = (after - start) @ axes.T
                assert np.ptp(away, axis=0).max() < 1e-12
                still = np.arange(3) != axis if way is Kind.AXIS else np.arange(3) == axis
                assert np.abs(away[:, still]).max() < 1e-12
                assert 0.02 < np.linalg.norm(away[0]) < 3.0
            hand.key("Escape")
            assert np.array_equal(bench.targets(), start)
    assert not hand.failures


@each_view
@about_targets
def test_the_grabbed_point_stays_under_the_pointer(look, parallel):
    bench = Bench(look, parallel=parallel)
    hand, view, centre = bench.hand, bench.view, bench.gizmo.centre
    for part, normal in ((FREE, view.view_direction), (Part(Kind.PLANE, 1), np.eye(3)[1])):
        place = bench.aim(part)
        near, far = view.ray(Pointer(Phase.PRESS, *place))
        grabbed = near + ((centre - near) @ normal) / ((far - near) @ normal) * (far - near)
        hand.press(place)
        hand.move(place + [-25.0, 31.0])
        assert np.allclose(hand.at(grabbed + bench.shift()), place + [-25.0, 31.0], atol=1e-6)
        assert abs(bench.shift() @ normal) < 1e-12
        hand.key("Escape")
    arrow = Part(Kind.AXIS, 2)
    start, end = bench.gizmo.line(arrow)[:, :2]
    place, along = bench.aim(arrow), (end - start) / np.linalg.norm(end - start)
    hand.press(place)
    hand.move(place + 30.0 * along)
    way = hand.at(centre + bench.shift()) - np.array(hand.at(centre))
    assert way @ along == pytest.approx(30.0, rel=0.15)  # perspective: its depth changes
    assert not hand.failures


@pytest.mark.parametrize(("ring", "parallel"), [(VIEW_RING, False), (Part(Kind.ROTATION, 1), True)])
@about_targets
def test_a_ring_rotates_by_the_angle_on_the_screen(ring, parallel):
    bench = Bench((0.0, -12.0, 0.0), parallel=parallel)
    hand, start, centre = bench.hand, bench.targets(), bench.gizmo.centre
    if not parallel:  # centred, so that its line of sight is y
        offset = np.array([centre[0], 0.0, centre[2]])
        bench.view.camera.SetPosition(*(offset + [0.0, -12.0, 0.0]))
        bench.view.camera.SetFocalPoint(*offset)
        View.render(bench.view)
    middle = bench.view.to_display(centre[None])[0, :2]
    place = bench.aim(ring)
    hand.press(place)
    for degrees in (20.0, 90.0, 150.0, 210.0):  # more than half a turn
        arm = rotation([0.0, 0.0, 1.0], np.radians(degrees))[:2, :2] @ (place - middle)
        there = np.round(middle + arm)
        a, b = place - middle, there - middle
        angle = np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)
        hand.move(there)
        R = rotation([0.0, -1.0, 0.0], angle)  # towards the viewer, counterclockwise
        assert np.allclose(bench.targets(), centre + (start - centre) @ R.T, atol=1e-9)
    hand.release(there)
    assert bench.session.history.undo_label == "rotate handle 1"
    assert not hand.failures


def turned_along(session, axis):
    """Return the angle about *axis* in which each slice of the body is turned, degrees."""
    x, y = SCENE.mesh.vertices, session.vertices
    slices = np.digitize(x[:, 0], np.linspace(-2.8, 2.8, 12))
    fits = (rigid_fit(x[slices == k], y[slices == k])[0] for k in range(slices.max() + 1))
    turns = [Rotation.from_matrix(R).as_rotvec() @ axis for R in fits]
    return np.degrees(np.unwrap(turns))


@pytest.mark.parametrize("degrees", ["180", "-180"])
def test_a_typed_turn_winds_the_body_in_its_direction(degrees):
    bench = Bench((0.0, -12.0, 0.0), parallel=True)
    hand, session = bench.hand, bench.session
    session.handles.remove(TOP)
    hand.press(bench.aim(VIEW_RING))
    for key in ("x", *degrees.replace("-", ""), *("minus" for _ in degrees if _ == "-")):
        hand.key(key)
    hand.key("Return")
    session.refine()
    along = turned_along(session, np.array([1.0, 0.0, 0.0]))
    assert along[-1] - along[0] == pytest.approx(float(degrees), abs=45.0)
    assert abs(session.volume_change) < 1e-12
    assert not hand.failures


def test_between_angles_half_a_turn_or_more_apart_there_are_stops(bench):
    grip = Grip(np.zeros(3), np.zeros(3), np.eye(3), 1.0, 0.1)
    press = Pointer(Phase.PRESS, 220.0, 190.0)
    motion = Motion(bench.view, Part(Kind.ROTATION, 2), grip, press)
    motion.exact(720.0)
    assert np.degrees(motion.turn) == pytest.approx(720.0)
    counts = [len(motion.stops(np.radians(since))) for since in (900, 720, 541, 540, 360, 0)]
    assert counts == [1, 0, 0, 1, 3, 7]
    (half,) = motion.stops(np.radians(540.0))
    assert np.allclose(half, motion.exact(630.0))
    motion.exact(0.0)
    assert len(motion.stops(2.0 * np.pi)) == 3
    shift = Motion(bench.view, Part(Kind.AXIS, 2), grip, press)
    shift.exact(1e3)
    assert (shift.turn, shift.stops(0.0)) == (0.0, [])


# Edge-on.


@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
@pytest.mark.parametrize("tilt", every(3, [0.0, 1e-9, 1.0, 0.19, 0.21]))
def test_every_motion_is_rigid_and_bounded(parallel, tilt):
    view = plain_view()
    view.camera.SetParallelProjection(parallel)
    view.camera.SetParallelScale(3.0)
    centre, axes = np.array([0.4, 0.3, 0.2]), rotation([1.0, 2.0, 3.0], 0.5).T
    grip = Grip(centre + 0.1, centre, axes, 0.7, 0.05)
    corners = [(x, y) for x in (0, 150, 399) for y in (0, 210, 399)]
    for axis, side in itertools.product(range(3), (-1.0, 1.0) if tilt else (1.0,)):
        look = axes[axis] + side * tilt * axes[axis - 1]
        view.camera.SetFocalPoint(*centre)
        view.camera.SetPosition(*(centre + 11.0 * look / np.linalg.norm(look)))
        view.camera.SetViewUp(*axes[axis - 2])
        view.camera.SetClippingRange(5.0, 20.0)
        window = 400.0 * view.pixel_at(centre)
        for part in PARTS:
            motion = Motion(view, part, grip, Pointer(Phase.PRESS, 220.0, 190.0))
            moves = np.array([motion.matrix(Pointer(Phase.MOVE, x, y)) for x, y in corners])
            turns = moves[:, :3, :3]
            assert np.allclose(turns @ turns.transpose(0, 2, 1), np.eye(3), atol=1e-12)
            assert np.linalg.det(moves) == pytest.approx(1.0)
            if part.kind is not Kind.ROTATION:
                farthest = {Kind.FREE: 1.0, Kind.AXIS: 5.0, Kind.PLANE: 5.0}[part.kind]
                assert np.linalg.norm(moves[:, :3, 3], axis=1).max() < farthest * window
            back = motion.matrix(Pointer(Phase.MOVE, 220.0, 190.0))
            if part.kind is not Kind.ROTATION:
                assert np.allclose(back, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
@about_targets
def test_the_front_of_a_ring_seen_edge_on_follows_the_pointer(axis):
    bench = Bench(12.0 * np.eye(3)[axis - 1], parallel=True, up=np.eye(3)[axis])
    ring = Part(Kind.ROTATION, axis)
    middle, place = np.array(bench.hand.at(bench.gizmo.centre)), bench.aim(ring)
    centre, start = bench.gizmo.centre, bench.targets()
    across = np.array([1.0, 0.0])  # the ring is level
    radius = bench.gizmo.radius / bench.view.pixel_at(centre)
    bench.hand.press(place)
    bench.hand.move(place + 45.0 * across)
    right = np.cross(np.eye(3)[axis], np.eye(3)[axis - 1])  # the viewer's right
    R = rotation(np.eye(3)[axis], 45.0 / radius)
    assert np.allclose(bench.targets(), centre + (start - centre) @ R.T, atol=1e-9)
    assert R @ np.eye(3)[axis - 1] @ right > 0.0
    assert abs((place - middle)[1]) < 8.0
    bench.hand.key("Escape")
    assert not bench.hand.failures


# Keys.


@about_targets
def test_keys_constrain_a_translation_to_an_axis_then_a_plane_then_not(bench):
    hand, place = bench.hand, bench.aim(FREE)
    hand.press(place)
    hand.move(place + [-30.0, 40.0])
    free = bench.shift()
    assert np.abs(free).min() > 1e-3
    for axis, key in enumerate("xyz"):
        others = np.arange(3) != axis
        hand.key(key)
        assert abs(bench.shift()[axis]) > 0.01
        assert np.array_equal(bench.shift()[others], [0.0, 0.0])
        hand.key(key)
        assert abs(bench.shift()[axis]) < 1e-12
        assert np.linalg.norm(bench.shift()[others]) > 0.01
        hand.key(key)
        assert np.allclose(bench.shift(), free, atol=1e-12)
    hand.key("x")
    hand.key("z")
    assert np.array_equal(bench.shift()[:2], [0.0, 0.0])
    hand.release(place + [-30.0, 40.0])
    assert bench.session.history.undo_label == "drag handle 1"


@about_targets
def test_keys_constrain_a_rotation_to_an_axis_then_to_its_own(bench):
    hand, place, start = bench.hand, bench.aim(VIEW_RING), bench.targets()
    hand.press(place)
    hand.move(place + [12.0, -30.0])
    own = bench.targets()
    for axis, key in enumerate("xyz"):
        hand.key(key)
        R, _ = rigid_fit(start, bench.targets())
        assert np.allclose(R @ np.eye(3)[axis], np.eye(3)[axis], atol=1e-9)
        assert np.trace(R) < 2.999
        hand.key(key)
        assert np.allclose(bench.targets(), own, atol=1e-12)


@pytest.mark.parametrize("change", ["set_hidden", "set_locked"])
def test_a_hidden_or_locked_handle_cannot_be_dragged_and_keeps_its_place(bench, change):
    place = bench.hand.at(bench.session.vertices[bench.session.handles[TOP]].mean(axis=0))
    before = picture(bench.view)
    getattr(bench.dragger, change)(TOP, True)
    bench.dragger.handle = TOP
    assert bench.gizmo.centre is None
    bench.dragger.handle = TIP
    bench.session.handles.rename(TOP, "hat")
    assert {*bench.dragger.hidden, *bench.dragger.locked} == {"hat"}
    assert (picture(bench.view) != before).any() == (change == "set_hidden")
    state = bench.session.state
    bench.hand.drag([place, np.add(place, [30.0, 30.0])])
    assert bench.session.state is state
    getattr(bench.dragger, change)("hat", False)
    bench.dragger.handle = "hat"
    assert bench.gizmo.centre is not None
    getattr(bench.dragger, change)("hat", True)
    ids = bench.session.handles["hat"]
    bench.session.handles.remove("hat")
    bench.session.handles.add(ids, "hat")  # another one of the same name
    assert not {*bench.dragger.hidden, *bench.dragger.locked}


def test_axis_keys_are_passed_on_while_nothing_is_dragged(bench):
    heard = []
    bench.view.interactor.AddObserver("KeyPressEvent", lambda *_: heard.append("key"), 0.5)
    bench.hand.key("x")
    bench.hand.press(bench.aim(FREE))
    bench.hand.key("x")
    bench.hand.key("z", control=True)  # undo, to an editor
    bench.hand.key("w")
    assert heard == ["key"] * 3


@about_targets
def test_shift_slows_the_motion_to_a_fifth_without_a_jump(bench):
    hand, place = bench.hand, bench.aim(Part(Kind.AXIS, 0))
    hand.press(place)
    hand.move(place + [40.0, 0.0])
    whole = bench.shift()
    hand.move(place + [40.0, 0.0], shift=True)
    assert np.allclose(bench.shift(), whole, atol=1e-12)  # no jump
    hand.move(place, shift=True)
    assert np.allclose(bench.shift(), 0.8 * whole, atol=1e-12)
    hand.move(place)
    assert np.allclose(bench.shift(), 0.8 * whole, atol=1e-12)
    hand.move(place + [-40.0, 0.0])
    assert bench.shift()[0] < 0.0


@about_targets
def test_a_slow_rotation_continues_past_half_a_turn_of_the_pointer():
    bench = Bench((0.0, -12.0, 0.0), parallel=True)
    middle, start = np.array(bench.hand.at(bench.gizmo.centre)), bench.targets()
    place = bench.aim(VIEW_RING)
    bench.hand.press(place, shift=True)
    for degrees in (-90.0, -170.0, -250.0, -340.0):
        arm = rotation([0.0, 0.0, 1.0], np.radians(degrees))[:2, :2] @ (place - middle)
        bench.hand.move(middle + arm, shift=True)
        R, _ = rigid_fit(start, bench.targets())
        assert np.allclose(R, rotation([0.0, -1.0, 0.0], np.radians(0.2 * degrees)), atol=0.005)
    assert not bench.hand.failures


@about_targets
def test_control_rotates_in_steps_of_five_degrees_and_with_shift_of_one():
    bench = Bench((0.0, -12.0, 0.0), parallel=True)
    middle, start = np.array(bench.hand.at(bench.gizmo.centre)), bench.targets()
    place = bench.aim(VIEW_RING)
    bench.hand.press(place, control=True)
    for seen, snapped in ((2.0, 0.0), (3.5, 5.0), (37.0, 35.0), (-8.0, -10.0)):
        arm = rotation([0.0, 0.0, 1.0], np.radians(seen))[:2, :2] @ (place - middle)
        bench.hand.move(middle + arm, control=True)
        R, _ = rigid_fit(start, bench.targets())
        assert np.allclose(R, rotation([0.0, -1.0, 0.0], np.radians(snapped)), atol=1e-9)
    bench.hand.move(middle + arm, control=True, shift=True)
    R, _ = rigid_fit(start, bench.targets())
    assert np.allclose(R, rotation([0.0, -1.0, 0.0], np.radians(-8.0)), atol=1e-9)
    assert not bench.hand.failures


@pytest.mark.parametrize("part", [FREE, Part(Kind.AXIS, 0), Part(Kind.PLANE, 2)])
@about_targets
def test_control_moves_in_whole_steps(part):
    bench = Bench(parallel=True)
    view, step = bench.view, 0.05  # about 1 % of the diagonal
    right = np.cross(view.view_direction, view.camera.GetViewUp())
    right /= np.linalg.norm(right)
    grid = {
        Kind.FREE: [right, np.cross(right, view.view_direction)],
        Kind.AXIS: [np.eye(3)[0]],
        Kind.PLANE: np.eye(3)[:2],
    }[part.kind]
    place = bench.aim(part)
    bench.hand.press(place)
    for k in (2, 7, 19):  # of which the first is less than half a step
        bench.hand.move(place + [k, -0.6 * k])
        free = bench.shift()
        bench.hand.move(place + [k, -0.6 * k], control=True)
        steps = np.array(grid) @ bench.shift() / step
        assert np.allclose(steps, np.round(np.array(grid) @ free / step), atol=1e-9)
        assert np.allclose(bench.shift(), step * steps @ grid, atol=1e-9)
    assert np.abs(steps).max() >= 1.0
    assert bench.captions[-1].endswith(", step 0.05")
    bench.hand.key("3")
    assert bench.captions[-1].endswith("3_")
    assert not bench.hand.failures


@about_targets
def test_typed_degrees_rotate_about_a_moved_pivot_and_escape_restores(bench):
    session, hand = bench.session, bench.hand
    pivot = bench.gizmo.centre + [0.3, -0.2, 0.1]
    session.handles.set_pivot(TIP, pivot)
    assert np.allclose(bench.gizmo.centre, pivot, atol=1e-12)
    start = bench.targets()
    for keys, degrees, caption in (
        (["1", "2", "5", "BackSpace", "minus"], -12.0, "z -12_°"),
        (["minus", "2", "period", "5"], -2.5, "z -2.5_°"),
    ):
        hand.press(bench.aim(VIEW_RING))
        hand.key("z")
        for key in keys:
            hand.key(key)
        hand.move((200, 200))  # ignored from now on
        assert bench.captions == [caption]
        R = rotation([0.0, 0.0, 1.0], np.radians(degrees))
        assert np.allclose(bench.targets(), (start - pivot) @ R.T + pivot, atol=1e-9)
        assert np.allclose(bench.gizmo.centre, pivot, atol=1e-9)
        hand.key("Escape")
        hand.release()
        assert np.array_equal(bench.targets(), start)
    hand.press(bench.aim(VIEW_RING))
    for key in ("z", "3", "Return"):
        hand.key(key)
    assert session.history.undo_label == "rotate handle 1"


@pytest.mark.parametrize("way", [1.0, -1.0])
@about_targets
def test_the_amount_along_an_axis_is_the_number_to_type(bench, way):
    hand, part = bench.hand, Part(Kind.AXIS, 2)
    start, end = bench.gizmo.line(part)[[0, -1], :2]
    place = bench.aim(part)
    hand.press(place)
    hand.move(place + way * 0.4 * (end - start))
    amount, dragged = bench.captions[-1].split()[-1], bench.shift()[2]
    assert way * dragged > 0.0
    hand.key("Escape")
    hand.release()
    hand.press(bench.aim(part))
    for character in amount:
        hand.key({"-": "minus", ".": "period"}.get(character, character))
    assert bench.shift()[2] == pytest.approx(dragged, rel=1e-2)


# Handles.


@pytest.mark.parametrize("part", [FREE, VIEW_RING])
def test_a_pulled_point_is_moved_by_a_pull_and_what_was_pulled_elsewhere_stays(bench, part):
    session, mesh = bench.session, SCENE.mesh
    session.handles.remove(TIP, TOP)
    session.set_fixed([])
    ends = [int(np.argmin(mesh.vertices @ way)) for way in ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0])]
    for vertex in ends:
        session.pull(vertex, mesh.vertices[vertex] + [0.0, 0.0, 1.0], locality=0.8)
        session.commit("pull")
    bench.dragger.pulls_with = lambda: {"radius": 0.15 * mesh.diagonal, "locality": 0.8}
    bench.dragger.handle = "pull 2"
    bench.view.camera.Zoom(0.8)
    View.render(bench.view)
    before, place = session.vertices, bench.aim(part)
    bench.hand.drag([place, place + [4, 4], place + [12, 8]])
    moved = np.linalg.norm(session.vertices - before, axis=1)
    is_far = np.linalg.norm(mesh.vertices - mesh.vertices[ends[1]], axis=1) > 0.5 * mesh.diagonal
    assert moved.max() > 0.01
    assert moved[is_far].max() < 0.05 * moved.max()
    assert session.state.pulls == ("pull 1", "pull 2")
    assert not bench.hand.failures


@about_targets
def test_a_press_on_the_vertices_of_a_handle_grabs_it_at_that_point(bench):
    hand, view = bench.hand, bench.view
    ids = bench.session.handles[TOP]
    vertex = ids[np.abs(SCENE.mesh.vertices[ids] - [0.0, -0.4, 0.7]).sum(axis=1).argmin()]
    point = SCENE.mesh.vertices[vertex]
    place = np.round(hand.at(point))
    assert bench.dragger.handle == TIP
    hand.press(place)
    assert bench.dragger.handle == TOP
    hand.move(place + [2.0, 0.0])  # within the click tolerance
    assert not bench.session.is_dragging
    hand.move(place + [30.0, 20.0])
    seen = hand.at(point + bench.shift(TOP))
    assert np.abs(seen - (place + [30.0, 20.0])).max() < 1.5
    assert abs(bench.shift(TOP) @ view.view_direction) < 1e-12
    hand.release(place + [30.0, 20.0])
    assert bench.session.history.undo_label == "drag handle 2"
    assert np.array_equal(bench.targets(TIP), SCENE.mesh.vertices[SCENE.handle])
    assert np.array_equal(bench.dragger._marks._dots[TOP]._points, bench.session.vertices[ids])


def test_a_click_activates_a_handle_and_makes_no_undo_step(bench):
    label = bench.session.history.undo_label
    top = SCENE.mesh.vertices[bench.session.handles[TOP]].mean(axis=0)
    bench.hand.click(bench.hand.at(top))
    assert bench.dragger.handle == TOP
    bench.hand.click(bench.aim(FREE))
    assert bench.session.history.undo_label == label
    assert np.allclose(bench.gizmo.centre, top)


def test_presses_on_hidden_handles_and_other_vertices_move_the_camera():
    bench = Bench((0.0, -3.0, -12.0))
    top = SCENE.mesh.vertices[bench.session.handles[TOP]].mean(axis=0)
    for place in (bench.hand.at(top), bench.hand.at([-1.0, 0.0, -0.8]), (5, 5)):
        camera = bench.view.camera.GetPosition()
        bench.hand.drag([place, np.array(place) + [30.0, 0.0]])
        assert bench.view.camera.GetPosition() != camera
        assert bench.dragger.handle == TIP
    assert bench.session.state.pose is None
    assert not bench.hand.failures


def test_when_the_active_handle_is_removed_the_next_one_is_active_and_a_renamed_one_stays(bench):
    session, dragger = bench.session, bench.dragger
    dragger.handle = TOP
    session.handles.rename(TOP, "back")
    assert dragger.handle == "back"
    session.handles.remove("back")
    assert dragger.handle == TIP
    session.handles.remove(TIP)
    assert dragger.handle is None
    assert bench.gizmo.centre is None
    session.undo()
    assert dragger.handle == TIP
    assert bench.gizmo.centre is not None
    with pytest.raises(ConstraintError, match="there is no handle 'nose'"):
        dragger.handle = "nose"
    dragger.handle = None
    assert bench.gizmo.centre is None


def test_removing_the_handle_during_a_drag_ends_it(bench):
    place = bench.aim(FREE)
    for end in (lambda: bench.session.handles.remove(TIP), bench.session.undo):
        bench.dragger.handle = TIP
        bench.hand.press(place)
        bench.hand.move(place + [20.0, 0.0])
        end()
        bench.hand.move(place + [30.0, 0.0])
        assert not bench.dragger.is_grabbing
        bench.hand.release(place)
        while bench.session.history.undo_label != "set handle 2":
            bench.session.undo()
    bench.hand.press(place)
    bench.session.handles.remove(bench.dragger.handle)
    bench.hand.move(place + [20.0, 0.0])
    assert not bench.dragger.is_grabbing


def test_without_cages_nothing_is_shown_or_grabbed():
    session, view = Session(SCENE.mesh), plain_view()
    session.handles.add(SCENE.handle)
    dragger, hand = HandleDragger(view, session), Hand(view)
    view.renderer.ResetCamera()
    before = picture(view)
    dragger.On()
    assert np.array_equal(picture(view), before)
    tip = hand.at(SCENE.mesh.vertices[SCENE.handle].mean(axis=0))
    camera = view.camera.GetPosition()
    hand.drag([tip, (200, 300)])
    assert view.camera.GetPosition() != camera
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    assert dragger.gizmo.centre is not None
    session.undo()
    assert dragger.gizmo.centre is None
    dragger.remove()
    assert not hand.failures


# Refining and cancelling.


def test_refining_ends_when_the_pose_has_converged(bench):
    hand, place = bench.hand, bench.aim(FREE)
    assert not bench.dragger.is_refining
    hand.press(place)
    hand.move(place + [-20.0, 30.0])
    assert bench.session.solution.status is Status.STEP_LIMIT
    assert bench.dragger.is_refining
    hand.tick(2)
    hand.release()
    assert bench.session.history.undo_label == "drag handle 1"
    assert not bench.session.is_dragging
    for _ in range(400):
        hand.tick()
        assert abs(bench.session.volume_change) <= 1e-12
        if not bench.dragger.is_refining:
            break
    assert bench.session.solution.status is Status.CONVERGED
    assert not bench.dragger.is_refining
    assert bench.session.solution.handle_error < 1e-3
    assert np.allclose(bench.gizmo.centre, bench.targets().mean(axis=0), atol=0.02)
    assert bench.session.undo() == "drag handle 1"  # a single undo step
    assert bench.session.state.pose is None


def test_no_timer_runs_after_undo_off_stop_refining_or_remove(bench):
    hand, place = bench.hand, bench.aim(FREE)

    def drag():
        hand.drag([place, place + [-40.0, 60.0]])

    drag()
    bench.session.undo()
    hand.tick()
    assert not bench.dragger.is_refining
    assert bench.session.state.pose is None
    drag()
    assert bench.dragger.is_refining
    bench.dragger.Off()
    assert not bench.dragger.is_refining
    bench.dragger.On()
    assert bench.dragger.is_refining
    bench.dragger.stop_refining()
    assert not bench.dragger.is_refining
    bench.session.undo()
    drag()
    assert bench.dragger.is_refining
    bench.dragger.remove()
    assert not bench.dragger.is_refining


def test_escape_and_the_right_button_restore_the_pose_before_the_press(bench):
    hand, place = bench.hand, bench.aim(FREE)
    bench.session.drag({TIP: bench.targets() + [0.0, 0.1, 0.2]})
    bench.session.commit("before")
    pose, place = bench.session.state.pose, bench.aim(FREE)
    for cancel in (lambda: hand.key("Escape"), lambda: hand.event("RightButtonPressEvent")):
        hand.press(place)
        hand.move(place + [-40.0, 60.0])
        hand.tick()
        assert bench.session.state.pose is not pose
        cancel()
        assert bench.session.state.pose is pose
        assert bench.session.history.undo_label == "before"
        assert not bench.dragger.is_refining
        hand.move(place)
        hand.release(place)
        assert bench.session.state.pose is pose
    assert np.allclose(hand.at(bench.gizmo.centre), place, atol=1.0)


def test_cancelling_keeps_an_earlier_unfinished_drag(bench):
    bench.session.drag({TIP: bench.targets() + [0.0, 0.1, 0.2]})
    pose, place = bench.session.state.pose, bench.aim(FREE)
    bench.hand.press(place)
    bench.hand.move(place + [-40.0, 60.0])
    bench.hand.key("Escape")
    assert bench.session.state.pose is pose
    assert bench.session.history.undo_label == "drag handle 1"


@pytest.mark.usefixtures("roughly")
def test_off_in_mid_drag_keeps_one_step_and_on_continues_refining(bench):
    place = bench.aim(FREE)
    bench.hand.press(place)
    bench.hand.move(place + [-40.0, 60.0])
    pose = bench.session.state.pose
    bench.dragger.Off()
    assert bench.session.state.pose is pose is not None
    assert not bench.session.is_dragging
    assert not bench.dragger.is_refining
    assert bench.gizmo.centre is None
    bench.dragger.On()
    assert bench.dragger.is_refining
    bench.hand.tick(60)
    assert not bench.dragger.is_refining
    assert bench.session.solution.status is Status.CONVERGED
    assert bench.session.undo() == f"drag {TIP}"
    assert bench.session.state.pose is None


@pytest.mark.usefixtures("roughly")
def test_a_pose_that_must_be_bound_first_is_not_refined(bench):
    place = bench.aim(FREE)
    bench.hand.drag([place, place + [-40.0, 60.0]])
    assert bench.dragger.is_refining
    pose = bench.session.state.pose
    bench.session.change_options(stretch=3.0)
    bench.hand.tick()
    assert not bench.dragger.is_refining
    assert not bench.session.is_bound
    assert bench.session.state.pose is pose
    bench.session.bind()
    bench.dragger.Off()
    bench.dragger.On()
    assert bench.dragger.is_refining
    bench.hand.tick(60)
    assert bench.session.solution.status is Status.CONVERGED
    assert bench.session.state.pose is not pose


@pytest.mark.usefixtures("roughly")
def test_slow_steps_are_taken_one_by_one_so_that_the_window_answers_in_between(bench, monkeypatch):
    place, session, took = bench.aim(FREE), bench.session, [0.0]
    bench.hand.drag([place, place + [-40.0, 60.0]])
    clock = SimpleNamespace(thread_time=lambda: sum(took))
    monkeypatch.setattr(live_solve, "time", clock)
    monkeypatch.setattr(live_solve, "STEPS", 8)
    seconds, counts = iter([0.01, 0.9, 0.04, 0.01, 0.01]), []

    def refine(max_steps):
        counts.append(max_steps)
        took.append(next(seconds))

    monkeypatch.setattr(session, "refine", refine)
    bench.hand.tick(5)
    assert counts == [1, 8, 1, 2, 8]


@pytest.mark.parametrize("fails", ["move_handle", "refine"])
def test_a_solve_that_fails_is_reported_and_the_drag_cancelled(fails, monkeypatch):
    bench = Bench()
    hand, place = bench.hand, bench.aim(FREE)
    hand.press(place)
    hand.move(place + [-20.0, 30.0])

    def fail(*_, **__):
        raise CageError("the cages do not fit")

    monkeypatch.setattr(bench.session, fails, fail)
    hand.move(place + [-40.0, 60.0])
    hand.tick()
    assert [str(failure) for failure in hand.failures] == ["the cages do not fit"]
    assert bench.session.state.pose is None
    assert not bench.dragger.is_grabbing
    assert not bench.dragger.is_refining
    monkeypatch.undo()
    hand.release(place)
    hand.drag([place, place + [-20.0, 30.0]])
    assert len(hand.failures) == 1
    assert bench.session.history.undo_label == "drag handle 1"


def test_targets_too_far_away_are_refused_and_the_drag_continues():
    bench = Bench(parallel=True)
    bench.view.camera.SetParallelScale(1e5)
    View.render(bench.view)
    place = bench.aim(FREE)
    bench.hand.press(place)
    bench.hand.move(place + [150.0, 0.0])
    assert len(bench.hand.failures) == 1
    assert "mesh diagonals away" in str(bench.hand.failures[0])
    assert bench.dragger.is_grabbing
    assert bench.session.state.pose is None
    for key in ["x", "9", "9", "9"]:
        bench.hand.key(key)
    assert len(bench.hand.failures) == 4  # also with x, 99 and 999
    bench.hand.key("Return")
    assert bench.dragger.is_grabbing
    bench.hand.key("BackSpace")
    bench.hand.key("BackSpace")
    start = bench.session.mesh.vertices[bench.session.handles["handle 1"]]
    bench.hand.key("Return")
    assert bench.session.history.undo_label == "drag handle 1"
    shift = bench.session.targets["handle 1"] - start
    np.testing.assert_allclose(shift, np.broadcast_to([9.0, 0.0, 0.0], shift.shape), atol=1e-9)


# Display.


# Poses that are shown.


def converged(session):
    """Return the converged pose for the targets of the session, (n, 3)."""
    other = Session(SCENE.mesh, state=session.state)
    other.refine()
    return other.vertices


def test_a_jerk_is_followed_and_ends_as_without_hurry(bench, monkeypatch):
    session, hand, window = bench.session, bench.hand, bench.view.window
    window.SetMultiSamples(4)
    monkeypatch.setattr(live_solve, "STEPS", 2)
    place, start, shown = bench.aim(FREE), bench.targets(), session.vertices
    hand.press(place)
    for way in (90.0, 90.0, -60.0, -60.0):
        hand.move(place + [0.3 * way, way])
        assert np.linalg.norm(bench.targets() - start, axis=1).min() > 0.5  # at the pointer
        assert abs(session.volume_change) < 1e-12
        assert window.GetMultiSamples() == 0
        assert session.vertices is not shown
        shown = session.vertices
        assert np.array_equal(bench.dragger._surface.points, shown)
    hand.release()
    assert session.history.undo_label == f"drag {TIP}"
    monkeypatch.setattr(draft, "_REST", 0.0)
    for _ in range(60):
        bench.view.interactor.TimerEvent()
    assert not bench.dragger.is_refining
    assert window.GetMultiSamples() == 4
    assert session.solution.status is Status.CONVERGED
    calm = Session(SCENE.mesh, state=replace(session.state, pose=None))
    for share in np.linspace(0.0, 1.0, 5)[1:]:
        calm.drag({TIP: start + share * (bench.targets() - start)})
    for vertices in (converged(session), calm.vertices):
        assert np.abs(vertices - session.vertices).max() < 1e-4 * SCENE.mesh.diagonal
    session.undo()
    assert session.state.pose is None
