"""Ten tasks, each by what a person presses: as many actions as the table in the documentation has.

An action is a drag, a key, a wheel turn or a field of the panel that is set; looking, and waiting
for a job, is none.  The bodies are made by code.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from hands import Hand, draw_seldom, plain_view
from limbed import limbed, torso
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from vtk_segdeform import Mesh, Session
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import Surface, convert, polydata_of
from vtk_segdeform.widgets import DeformEditor
from vtk_segdeform.widgets.editor import actions
from vtk_segdeform.widgets.panel import press

pytestmark = pytest.mark.campaign


class Person:
    """A hand on an editor, which counts what it does."""

    def __init__(self, given) -> None:
        view = plain_view((900, 700), is_own=True)
        self.editor = DeformEditor(view, given)
        self.rest = self.session.mesh.vertices
        self.volume = signed_volume(self.rest, self.session.mesh.faces)
        view.camera.SetPosition(0.0, -5.0, 0.0)
        view.camera.SetFocalPoint(0.0, 0.0, 0.0)
        view.camera.SetViewUp(0.0, 0.0, 1.0)
        view.renderer.ResetCamera()
        view.render()
        draw_seldom(view)
        self.hand, self.actions = Hand(view), 0
        self.editor.On()
        self.settle()
        self.began = time.perf_counter()

    @property
    def session(self) -> Session:
        return self.editor.session

    @property
    def moved(self):
        """(n,) float: how far each vertex is from rest, in diagonals."""
        away = np.linalg.norm(self.session.vertices - self.rest, axis=1)
        return away / self.session.mesh.diagonal

    def settle(self) -> None:
        """Wait until nothing is prepared, computed or refined."""
        end = time.monotonic() + 120.0
        widgets = self.editor.widgets
        while (
            self.editor.is_busy
            or self.editor.is_preparing
            or widgets.puller.is_refining
            or widgets.dragger.is_refining
        ):
            assert time.monotonic() < end, self.editor.status
            self.hand.tick()
            time.sleep(0.001)

    def drag(self, point, by, keys="", **held) -> None:
        """Press on the surface at *point*, drag by pixels, with *keys* on the way, release."""
        start = np.array(self.hand.at(point))
        path = [start + f * np.array(by, float) for f in np.linspace(0.0, 1.0, 9)]
        self.hand.press(path[0], **held)
        for key in keys:
            self.type(key)
        for place in path[1:]:
            self.hand.move(place, **held)
            self.hand.tick()
        for _ in range(60):
            self.hand.tick()
        self.hand.release(path[-1], **held)
        self.settle()
        self.actions += 1

    def type(self, *keys: str) -> None:
        for key in keys:
            self.hand.types(key)
            self.actions += 1
        if not self.editor.widgets.puller.is_grabbing:
            self.settle()

    def set(self, name: str, value=None) -> None:
        """Set a field of the panel, or click on a button of it."""
        error = press(self.editor, name, value)
        assert error is None, error
        self.settle()
        self.actions += 1

    def stroke(self, *corners) -> None:
        """Drag from one corner of a rectangle on the screen to the other."""
        self.hand.drag(corners)
        self.settle()
        self.actions += 1

    def done(self, task: str, actions: int, gained: float = 0.0) -> None:
        """Check that the volume is exact, but for what is *gained*, and the number of actions."""
        assert not self.hand.failures
        assert abs(self.session.volume("whole")[0] - gained - self.volume) < 1e-12 * self.volume
        seconds = time.perf_counter() - self.began
        print(f"\n{task}: {self.actions} actions, {seconds:.1f} s")
        assert self.actions == actions
        self.editor.remove()


@pytest.fixture(scope="module")
def body() -> Mesh:
    """Return a trunk with arms, legs and a head."""
    return torso(4)


def end_of(mesh: Mesh, direction):
    """Return the vertex that is farthest in a *direction*, and its position."""
    vertex = int((mesh.vertices @ np.array(direction, float)).argmax())
    return vertex, mesh.vertices[vertex]


ARM, LEG, HEAD = (0.9, 0.0, 0.3), (0.4, 0.0, -0.9), (0.0, 0.0, 1.0)


def test_raise_an_arm(body):
    person = Person(body)
    hand, place = end_of(body, ARM)
    person.drag(place, (-40, 120))
    assert person.session.vertices[hand, 2] > place[2] + 0.5
    assert person.moved[body.vertices[:, 0] < -0.3].max() < 0.02
    person.done("raise an arm", 1)


def test_nod(body):
    person = Person(body)
    head, place = end_of(body, HEAD)
    person.drag(place, (60, -40))
    assert person.moved[head] > 0.05
    assert person.moved[body.vertices[:, 2] < -0.5].max() < 0.02
    person.done("nod", 1)


def test_turn_a_head(body):
    person = Person(body)
    _, place = end_of(body, HEAD)
    person.drag(place - [0.0, 0.0, 0.05], (180, 0), keys="r")
    head = body.vertices[:, 2] > 1.25
    x, y = body.vertices[head], person.session.vertices[head]
    found, _ = Rotation.align_vectors(y - y.mean(axis=0), x - x.mean(axis=0))
    turn = found.as_rotvec(degrees=True)
    assert abs(turn[2]) > 15.0
    assert abs(turn[2]) > 0.8 * np.linalg.norm(turn)
    assert person.moved[body.vertices[:, 2] < 0.5].max() < 0.01
    person.done("turn the head", 2)


def test_spread_the_fingers_of_a_hand():
    """The two outer fingers, each by its tip."""
    fingers = [((np.sin(angle), 0.0, np.cos(angle)), 1.2, 90.0) for angle in (0.16, 0.5)]
    hand = limbed(fingers, 5)
    person = Person(hand.with_vertices(hand.vertices * [1.0, 0.4, 1.0]))
    for side in (1.0, -1.0):
        tip, place = end_of(person.session.mesh, (side * 0.5, 0.0, 0.88))
        person.drag(place, (side * 90, -20))
        assert side * (person.session.vertices[tip, 0] - place[0]) > 0.3
    wrist = hand.vertices[:, 2] < 0.0
    assert person.moved[wrist].max() < 0.02
    person.done("spread two fingers", 2)


def test_lengthen_a_leg(body):
    person = Person(body)
    foot, place = end_of(body, LEG)
    person.drag(place, (20, -70), keys="z")
    moved = person.session.vertices[foot] - place
    assert moved[2] < -0.3
    assert_allclose(moved[:2], 0.0, atol=0.01)
    person.done("lengthen a leg", 2)


def test_fatten_a_belly_by_a_fifth(body):
    person = Person(body)
    person.hand.move(person.hand.at(body.vertices[np.argmin(body.vertices[:, 1])]))
    person.type("e")
    (name, goal), *others = person.session.options.volumes
    assert goal == "+20%"
    assert not others
    volume, change = person.session.volume(name)
    assert change == pytest.approx(0.2, abs=1e-9)
    far = person.session.regions.labels != int(name.split()[1])
    assert np.quantile(person.moved[far], 0.5) < 1e-3
    person.done("fatten the belly", 1, gained=volume / 6.0)


def test_mirror_a_pull(body):
    person = Person(body)
    hand, place = end_of(body, ARM)
    person.set("volumes.symmetry", "x")
    person.drag(place, (-40, 120))
    person.type("shift+f")
    _, other = cKDTree(body.vertices).query(body.vertices * [-1.0, 1.0, 1.0])
    x = person.session.vertices
    assert person.moved[hand] > 0.1
    assert_allclose(x[other] * [-1.0, 1.0, 1.0], x, atol=1e-9)
    person.done("mirror a pull", 3)


def test_keep_a_ring_rigid(body):
    """A bracelet on an arm, painted by a rectangle through the body."""
    person = Person(body)
    ring = (np.abs(body.vertices[:, 0] - 1.3) < 0.12) & (body.vertices[:, 2] < 1.0)
    hand, place = end_of(body, ARM)
    person.type("1")
    person.set("paint.what", "inf")
    person.type("t", "v")
    seen = person.editor.view.to_display(body.vertices[ring])[:, :2]
    person.stroke(seen.min(axis=0) - 2.0, seen.max(axis=0) + 2.0)
    rigid = np.isinf(person.session.state.stiffness)
    assert rigid[ring].all()
    person.type("0")
    person.drag(place, (-40, 120))
    person.type("shift+f")
    x, y = body.vertices[rigid], person.session.vertices[rigid]
    turn, _ = Rotation.align_vectors(y - y.mean(axis=0), x - x.mean(axis=0))
    fitted = turn.apply(x - x.mean(axis=0)) + y.mean(axis=0)
    assert np.abs(fitted - y).max() < 1e-3 * body.diagonal
    assert person.moved[hand] > 0.1
    person.done("rigid ring", 8)


def test_pose_a_to_b(body):
    person, poses = Person(body), []
    for towards, by in ((ARM, (-40, 120)), (LEG, (60, 40))):
        person.drag(end_of(body, towards)[1], by)
        person.set("poses.save")
        poses.append(person.session.vertices)
    person.set("poses.list.select", ["pose 1"])
    assert_array_equal(person.session.vertices, poses[0])
    person.set("poses.first", "pose:pose 1")
    person.set("poses.second", "pose:pose 2")
    person.set("poses.share", 50.0)
    between = person.session.vertices
    assert all(np.linalg.norm(between - pose, axis=1).max() > 0.05 for pose in poses)
    person.done("poses A and B", 8)


def test_save_it_as_it_was(body, tmp_path):
    """Quads, names and numbers stay; only positions change."""
    path = tmp_path / "body.vtp"
    given = polydata_of(body.vertices, np.full(body.n_faces, 3), body.faces.ravel())
    given["names"] = np.arange(body.n_vertices)[::-1]
    convert.write_mesh(path, given)
    person = Person(Surface.read(path))
    person.drag(end_of(body, ARM)[1], (-40, 120))
    person.editor.do(actions.exporting(path))  # as the button *Save* of the program does
    person.settle()
    person.actions += 1
    saved = convert.read_polydata(path)
    assert_array_equal(saved["names"], given["names"])
    assert_array_equal(saved.faces, given.faces)
    assert_array_equal(saved.points, person.session.vertices)
    person.done("save", 2)
