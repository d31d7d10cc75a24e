"""Pulling the surface with the mouse: volume, undo, pins, numbers, turning, waiting."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, draw_seldom, picture, plain_view
from scenes import sausage
from solids import icosphere

from vtk_segdeform import Session
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.mesh import Mesh, SurfacePoint
from vtk_segdeform.widgets.picking.surface_ring import SurfaceRing
from vtk_segdeform.widgets.puller.puller import Puller
from vtk_segdeform.widgets.scene.gestures import Phase, Pointer
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("bound_once")

SCENE = sausage(is_coarse=True)
SIZE = SCENE.mesh.diagonal
UP = np.array([0.0, 0.0, 1.0])


class Bench:
    """A session, a puller that is on, seen from the front with z up, and a hand."""

    def __init__(self, *, has_cages=True):
        self.session = Session(SCENE.mesh)
        if has_cages:
            self.prepare()
        self.view = plain_view()
        self.puller = Puller(self.view, self.session)
        self.view.camera.SetPosition(0.0, -12.0, 0.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.view.renderer.ResetCamera()
        self.view.camera.Zoom(0.7)
        self.view.render()
        draw_seldom(self.view)
        self.puller.On()
        self.hand = Hand(self.view)

    def prepare(self):
        self.session.set_regions(SCENE.regions)
        self.session.set_cages(SCENE.cages)

    def on(self, x=2.0):
        """Return a pixel on the front of the body, and the vertex nearest to it."""
        front = SCENE.mesh.vertices[:, 1] < 0.0
        away = np.linalg.norm(self.session.vertices[:, ::2] - [x, 0.0], axis=1)
        vertex = int(np.where(front, away, np.inf).argmin())
        return np.round(self.hand.at(self.session.vertices[vertex])), vertex

    @property
    def target(self):
        (point,) = self.session.targets["pull 1"]
        return point


@pytest.fixture
def bench():
    made = Bench()
    yield made
    assert made.hand.failures == []
    made.puller.remove()
    assert made.view.renderer.GetViewProps().GetNumberOfItems() == 0


def test_a_pull_is_one_step_and_every_frame_has_the_volume(bench):
    session, hand = bench.session, bench.hand
    before = session.history.undo_label
    place, _ = bench.on()
    hand.press(place)
    hand.move(place + [1, 1])
    hand.release(place)
    assert session.state.pose is None  # a click pulls nothing
    assert session.history.undo_label == before
    hand.press(place)
    for k in range(1, 6):
        hand.move(place + [0, 8 * k])
        assert abs(session.volume_change) < 1e-12
        hand.tick()
        assert abs(session.volume_change) < 1e-12
    hand.release()
    assert session.history.undo_label == "pull"
    assert (session.vertices - SCENE.mesh.vertices)[:, 2].max() > 0.2
    assert session.undo() == "pull"
    assert (session.state.pose, session.history.undo_label) == (None, before)
    hand.press(place)
    hand.move(place + [0, 20])
    hand.key("Escape")
    hand.release()
    assert session.state.pose is None


def test_the_point_under_the_pointer_is_pulled_also_between_vertices(bench):
    session, hand = bench.session, bench.hand
    place = bench.on()[0] + [9, 4]
    hit = bench.puller._picker.hit(Pointer(Phase.HOVER, *place))
    corners = session.mesh.faces[hit.face]
    point = SurfacePoint.in_face(session.vertices, corners, hit.point)
    assert len(point.corners) == 3
    hand.press(place)
    hand.move(place + [0, 40])
    while bench.puller.is_refining:
        hand.tick()
    assert np.abs(hand.at(point.at(session.vertices)) - place - [0, 40]).max() < 1.0
    assert session.state.locality.point.corners == point.corners
    hand.release()
    bench.puller.radius = 1e-3 * session.mesh.diagonal
    hand.press(bench.on(0.0)[0] + [5, 3])
    assert session.history.undo_label == "pull"
    hand.release()
    assert "subdivide the mesh" in bench.puller.remark


def test_a_press_just_beside_the_surface_grabs_its_edge(bench):
    session, hand = bench.session, bench.hand
    edge = int(session.vertices[:, 0].argmax())
    seen = np.array(hand.at(session.vertices[edge]))
    for aside, is_grabbed in ((7.0, False), (3.0, True)):
        assert (
            bench.puller._hit(Pointer(Phase.HOVER, *seen + [aside, 0.0])) is not None
        ) is is_grabbed
    hand.press(np.round(seen + [3.0, 0.0]))
    hand.move(np.round(seen + [3.0, 30.0]))
    hand.release()
    assert session.handles["pull 1"].tolist() == [edge]
    moved = hand.at(bench.target) - seen
    assert np.abs(moved - [0.0, 30.0]).max() < 0.5  # without a jump to the pointer


def test_shift_click_pins_and_unpins_and_markers_are_grabbed(bench):
    session, hand = bench.session, bench.hand
    place, _ = bench.on(0.5)
    hand.click(place, shift=True)
    assert list(session.handles) == ["pin 1"]
    assert session.history.undo_label == "pin"
    hand.press(place + [4, 0])  # near it
    hand.move(place + [4, 25])
    assert list(session.handles) == ["pin 1"]
    hand.release()
    assert session.history.undo_label == "pull"
    place = np.array(hand.at(session.vertices[session.handles["pin 1"]][0]))
    hand.click(place + [0, 5], shift=True)
    assert session.handles == {}
    assert bench.puller.marked == ()
    session.undo()
    assert bench.puller.marked == ("pin 1",)


@pytest.mark.parametrize(
    ("keys", "shift"),
    [(["x"], [-0.75, 0.0, 0.0]), (["x", "x"], [0.0, 0.0, -0.75]), ([], [0.0, 0.0, -0.75])],
)
def test_a_typed_number_pulls_exactly_that_far(bench, keys, shift):
    place, vertex = bench.on()
    start = bench.session.vertices[vertex]
    bench.hand.press(place)
    bench.hand.move(place + [0, 30])
    for key in [*keys, "period", "7", "9", "BackSpace", "5", "minus"]:
        bench.hand.key(key)
    bench.hand.move(place + [70, 70])  # ignored from now on
    bench.hand.key("Return")
    assert not bench.puller.is_grabbing
    bench.hand.release()
    np.testing.assert_allclose(bench.target - start, shift, atol=1e-9)


def test_a_number_that_is_too_large_can_be_corrected():
    bench = Bench()
    place, vertex = bench.on()
    start = bench.session.vertices[vertex]
    bench.hand.press(place)
    for key in ["z", "9", "9", "9"]:
        bench.hand.key(key)
    assert "mesh diagonals away" in str(bench.hand.failures[-1])
    bench.hand.key("Return")  # refused, too
    assert bench.puller.is_grabbing
    assert bench.session.state.pose is not None  # 9 was no error
    for key in ["BackSpace", "BackSpace", "BackSpace", "period", "5", "Return"]:
        bench.hand.key(key)
    np.testing.assert_allclose(bench.target - start, [0.0, 0.0, 0.5], atol=1e-9)
    assert not bench.puller.is_grabbing
    assert bench.session.history.undo_label == "pull"


def test_r_turns_about_the_point_and_a_number_is_degrees(bench):
    place, vertex = bench.on(2.6)
    bench.hand.press(place)
    bench.hand.key("r")
    bench.hand.key("y")
    for key in "30":
        bench.hand.key(key)
    bench.hand.key("Return")
    ids = bench.session.handles["pull 1"]
    assert len(ids) > 3
    before = SCENE.mesh.vertices[ids] - SCENE.mesh.vertices[vertex]
    after = bench.session.targets["pull 1"]
    after = after - after[ids == vertex]  # the centre is the point under the pointer
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    np.testing.assert_allclose(after, before @ [[c, 0, -s], [0, 1, 0], [s, 0, c]], atol=1e-9)
    assert bench.session.history.undo_label == "pull"


def test_r_leaves_the_surface_as_it_has_turned_by_itself(bench):
    place, vertex = bench.on(2.6)
    rest = SCENE.mesh.vertices
    bench.hand.press(place)
    for k in range(1, 13):
        bench.hand.move(place + [-4 * k, 12 * k])
    near = np.linalg.norm(rest - rest[vertex], axis=1) < 0.4 * bench.puller.radius

    def turned():
        return rigid_fit(rest[near], bench.session.vertices[near])[0]

    before = turned()
    assert (np.trace(before) - 1.0) / 2.0 < np.cos(0.5)  # the end of the body has bent
    bench.hand.key("r")
    assert (np.trace(before.T @ turned()) - 1.0) / 2.0 > np.cos(0.1)  # at once
    bench.hand.release()


def test_shift_and_the_wheel_change_the_radius(bench):
    puller, hand = bench.puller, bench.hand
    place, _ = bench.on()
    before, camera = puller.radius, bench.view.camera.GetDistance()
    hand.wheel(2, place, shift=True)
    assert puller.radius == pytest.approx(1.1**2 * before)
    hand.wheel(-1, place, shift=True)
    assert puller.radius == pytest.approx(1.1 * before)
    assert bench.view.camera.GetDistance() == camera
    hand.wheel(1, place)  # zooms
    assert bench.view.camera.GetDistance() < camera
    assert puller.radius == pytest.approx(1.1 * before)
    puller.radius = 100.0 * SIZE
    assert puller.radius == SIZE
    with pytest.raises(ArgumentError, match="radius must be above 0"):
        puller.radius = np.nan
    with pytest.raises(ConstraintError, match="locality must be a number from 0 to 1"):
        puller.locality = 2.0


def test_fixed_points_are_refused_with_advice(bench):
    place, vertex = bench.on()
    bench.session.set_fixed([vertex])
    camera = bench.view.camera.GetPosition()
    bench.hand.drag([place, place + [0, 30]])
    assert "This point is fixed" in bench.puller.remark
    assert bench.session.state.pose is None
    assert bench.view.camera.GetPosition() == camera


def test_a_locked_point_stays_and_the_reason_is_said(bench):
    place, _ = bench.on()
    (name,) = [bench.session.handles.pin(bench.on()[1])]
    bench.puller.is_locked = lambda each: each == name
    bench.hand.drag([place, place + [0, 30]])
    assert bench.puller.remark == f"{name} is locked. Clear Lock in the list of handles to move it"
    bench.puller.is_hidden = bench.puller.is_locked  # without a dot the surface there is grabbed
    bench.hand.drag([place, place + [0, 30]])
    assert bench.session.state.pose is None
    bench.puller.is_locked = bench.puller.is_hidden = lambda _: False
    bench.hand.drag([place, place + [0, 30]])
    assert bench.session.history.undo_label == "pull"


def test_a_hidden_point_is_not_drawn_and_the_surface_there_is_pulled(bench):
    place, vertex = bench.on()
    name = bench.session.handles.pin(vertex)
    View.render(bench.view)
    pinned = picture(bench.view)
    bench.puller.is_hidden = lambda each: each == name
    assert (picture(bench.view) != pinned).any()
    bench.hand.hover(place)
    assert bench.puller.marker_under_pointer() is None
    bench.hand.drag([place, place + [0, 30]])
    assert bench.session.history.undo_label == "pull"


@pytest.mark.parametrize("released", [False, True])
def test_a_pull_before_the_cages_are_there_begins_as_soon_as_they_are(released):
    bench = Bench(has_cages=False)
    place, vertex = bench.on()
    bench.hand.press(place)
    bench.hand.move(place + [0, 30])
    if released:
        bench.hand.release()
        assert "Preparing" in bench.puller.remark
    bench.hand.tick()
    assert bench.puller.waiting.is_active
    bench.prepare()
    bench.hand.tick()
    assert not bench.puller.waiting.is_active
    assert (bench.target - SCENE.mesh.vertices[vertex])[2] > 0.2
    bench.hand.release()
    assert bench.session.history.undo_label == "pull"
    assert bench.hand.failures == []
    bench.puller.remove()


@pytest.mark.parametrize("scale", [1e-7, 1e6])
def test_the_ring_has_the_radius_at_any_scale_and_place(scale):
    mesh = SCENE.mesh.with_vertices(scale * (SCENE.mesh.vertices + [1e6, 0.0, 0.0]))
    view = plain_view()
    puller = Puller(view, Session(mesh))
    view.camera.SetPosition(scale * 1e6, -12.0 * scale, 0.0)
    view.camera.SetFocalPoint(scale * 1e6, 0.0, 0.0)
    view.camera.SetViewUp(0.0, 0.0, 1.0)
    view.renderer.ResetCamera()
    puller.On()
    hand = Hand(view)
    hand.hover((200, 200))
    (hit,) = puller._picker.hits(view.pointer(None))[:1]
    for share in (0.15, 1e-4):  # the second one is smaller than a triangle
        ring = puller._picker.ring(hit, share * mesh.diagonal)
        assert len(ring) > 20
        away = np.linalg.norm(ring - hit.point, axis=2) / mesh.diagonal
        # Along the surface; the straight way is shorter over a bent one.
        assert 0.85 * share < away.min()
        assert away.max() < 1.02 * share
    puller.remove()
    assert hand.failures == []


def test_the_ring_is_on_the_part_below_the_pointer_alone():
    sphere, faces = icosphere(3)
    both = np.concatenate([sphere, sphere + [2.02, 0.0, 0.0]])
    mesh = Mesh(both, np.concatenate([faces, faces + len(sphere)]))
    face = int(np.argmax(sphere[faces].mean(axis=1)[:, 0]))  # beside the gap
    centre = sphere[faces[face]].mean(axis=0)
    ring = SurfaceRing(mesh).around(both, centre=centre, face=face, radius=0.8, sight=UP)
    np.testing.assert_allclose(np.linalg.norm(ring, axis=2), 1.0, atol=0.02)
    cosine = ring @ centre / np.linalg.norm(centre)
    np.testing.assert_allclose(np.arccos(np.clip(cosine, -1.0, 1.0)), 0.8, atol=0.04)


def test_the_ring_about_a_small_part_is_a_circle_that_faces_the_camera():
    ball, faces = icosphere(3)
    mesh = Mesh(0.1 * ball, faces)
    centre = mesh.vertices[faces[17]].mean(axis=0)
    half_way = 0.1 * np.pi  # to the opposite point, along the surface
    ring = SurfaceRing(mesh)
    for radius in (0.8 * half_way, 1.2 * half_way):
        segments = ring.around(mesh.vertices, centre=centre, face=17, radius=radius, sight=UP)
        assert len(segments) > 20
        on_ball = np.linalg.norm(segments, axis=2) < 0.11
        assert on_ball.all() == (radius < half_way)
    np.testing.assert_allclose(np.linalg.norm(segments - centre, axis=2), radius)
    np.testing.assert_allclose((segments - centre) @ UP, 0.0, atol=1e-12)


def test_a_pin_says_to_what_it_changes_the_locality():
    bench = Bench()
    place, _ = bench.on()
    bench.hand.click(place, shift=True)
    assert bench.puller.remark == "Added pin 1. Local is now 5 %"
    bench.hand.click(place, shift=True)
    assert bench.puller.remark == "Removed pin 1. Local is now 20 %"
    bench.puller.remove()
