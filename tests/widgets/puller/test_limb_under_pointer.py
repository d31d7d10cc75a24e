"""Limbs by real events: tinted before the press, chosen by keys, turned about their axes."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hands import Hand, draw_seldom, picture, plain_view
from numpy.testing import assert_allclose

from vtk_segdeform import Session
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.models.implicit import Limb, implicit_surface
from vtk_segdeform.session.pulls import middle_vertex
from vtk_segdeform.widgets.editor.editor import DeformEditor
from vtk_segdeform.widgets.panel.panel import press
from vtk_segdeform.widgets.scene.view import View

HAND, SHOULDER, BODY = [1.5, -0.1, 0.0], [0.5, 0.0, 0.0], [0.0, -0.5, 0.0]
pytestmark = pytest.mark.usefixtures("bound_once")


@functools.cache
def prepared() -> Session:
    """Return a ball with two arms, along x, which can be pulled."""
    arms = [Limb([(0, 0, 0), (x, 0, 0)], [0.12, 0.1]) for x in (1.6, -1.6)]
    parts = [Limb([(0, 0, -0.1), (0, 0, 0.1)], [0.5, 0.5]), *arms]
    box = np.array([[-1.8, -0.7, -0.7], [1.8, 0.7, 0.7]])
    mesh = implicit_surface(lambda x: np.min([part(x) for part in parts], axis=0), box, 1500)
    session = Session(mesh)
    assert session.accept(session.preparation())
    session.bind()
    return session


class Bench:
    """An editor in mode Pull, seen from the front with z up, and a hand."""

    def __init__(self):
        self.session = Session(prepared().mesh, state=prepared().state)
        self.session.bind()
        self.rest = self.session.mesh.vertices
        self.view = plain_view()
        self.editor = DeformEditor(self.view, self.session)
        self.view.camera.SetPosition(0.0, -5.0, 0.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        draw_seldom(self.view)
        self.hand = Hand(self.view)
        self.editor.On()
        self.puller = self.editor.widgets.puller

    def at(self, point):
        """Return the pixel of the vertex nearest to *point*."""
        vertex = np.linalg.norm(self.rest - point, axis=1).argmin()
        return np.round(self.hand.at(self.rest[vertex]))

    def hover(self, point):
        """Move the pointer there, and let it rest."""
        self.hand.hover(self.at(point))
        self.hand.tick(2)

    @property
    def tinted(self):
        """The vertices whose colour is not that of the body, (n,) bool."""
        colours = self.editor.widgets.surface.colours
        return np.any(colours != colours[np.abs(self.rest[:, 0]).argmin()], axis=1)

    def moved(self):
        """Return how far each vertex is from rest, as a share of the diagonal."""
        away = self.session.vertices - self.rest
        return np.linalg.norm(away, axis=1) / self.session.mesh.diagonal


@pytest.fixture
def bench():
    made = Bench()
    yield made
    assert made.hand.failures == []
    made.editor.remove()


def test_the_limb_is_tinted_once_the_pointer_rests_and_until_it_leaves(bench, monkeypatch):
    asked = []
    limb_of_pull = Deformer.limb_of_pull
    spy = lambda *given: asked.append(given) or limb_of_pull(*given)  # noqa: E731
    monkeypatch.setattr(Deformer, "limb_of_pull", spy)
    x = bench.rest[:, 0]
    for k in range(5):  # on its way
        bench.hand.hover(bench.at(HAND) + [-k, 0])
        bench.hand.tick()
        assert not asked
        assert not bench.tinted.any()
    bench.hand.tick()
    assert len(asked) == 1
    View.render(bench.view)
    tinted = picture(bench.view)
    assert bench.tinted[x > 1.0].all()
    assert not bench.tinted[x < 0.0].any()
    bench.hand.hover(bench.at(HAND) + [-9, 0])  # on the same limb
    assert bench.tinted[x > 1.0].all()
    bench.hand.hover(bench.at(BODY))
    assert not bench.tinted.any()
    View.render(bench.view)
    assert (picture(bench.view) != tinted).any()
    bench.hover(BODY)
    assert not bench.tinted.any()
    bench.hover(HAND)
    assert bench.tinted.any()
    bench.hand.hover((3, 3))
    assert not bench.tinted.any()
    bench.hover(HAND)
    bench.hand.drag([bench.at(HAND), bench.at(HAND) + [0, 20]])
    assert not bench.tinted.any()  # a dot marks the pulled point


def test_the_tint_fades_at_the_joint(bench):
    bench.hover(HAND)
    colours = bench.editor.widgets.surface.colours.astype(float)
    strength = np.abs(colours - colours[np.abs(bench.rest[:, 0]).argmin()]).sum(axis=1)
    share = strength / strength.max()
    joint = np.abs(bench.rest[:, 0] - 0.5) < 0.4
    assert ((share[joint] > 0.1) & (share[joint] < 0.9)).sum() > 10


def test_a_pull_moves_the_limb_and_the_chosen_one_by_keys_or_by_the_panel(bench):
    body, far = np.abs(bench.rest[:, 0]) < 0.2, bench.rest[:, 0] < -1.2
    drag = [bench.at(HAND), bench.at(HAND) + [0, 30], bench.at(HAND) + [0, 60]]
    bench.hover(HAND)
    bench.hand.drag(drag)
    assert bench.moved().max() > 0.1
    assert bench.moved()[body].max() < 0.005
    bench.session.undo()
    bench.hover(HAND)
    bench.hand.types("bracketright", bench.at(HAND))
    assert "Limb: whole body" in bench.editor.status
    assert bench.tinted[far].all() == bench.tinted.all()
    assert bench.puller.limb == 1
    bench.hand.drag(drag)
    assert bench.moved()[far].max() > 0.005
    bench.session.undo()
    press(bench.editor, "pull.limb", 1)
    assert bench.puller.limb == 0
    bench.hand.types("a", bench.at(HAND))
    assert bench.puller.limb is None
    bench.hand.types("bracketleft", bench.at(HAND))
    assert "Limb: 1 of 2" in bench.editor.status
    bench.hand.wheel(1, bench.at(HAND), shift=True, control=True)
    assert bench.puller.limb == 1
    assert "Limb: whole body" in bench.editor.status
    bench.hand.wheel(-1, bench.at(HAND), shift=True, control=True)
    assert bench.puller.limb == 0
    bench.hand.types("bracketleft", bench.at(BODY))
    assert "No limb here" in bench.editor.status
    bench.hand.types("bracketleft", (3, 3))
    assert "Point at the surface" in bench.editor.status


def test_a_hinge_by_the_key_or_by_the_panel_keeps_the_arm_straight(bench):
    arm = bench.rest[:, 0] > 0.8
    way = [bench.at(HAND) + [0, k] for k in range(0, 100, 20)]
    changes = []
    for _ in range(2):
        bench.hover(HAND)
        bench.hand.drag(way)
        turn, shift = rigid_fit(bench.rest[arm], bench.session.vertices[arm])
        away = bench.rest[arm] @ turn.T + shift - bench.session.vertices[arm]
        changes.append(np.linalg.norm(away, axis=1).max())
        bench.session.undo()
        bench.hand.types("b", bench.at(HAND))
        assert "Hinge: 50 %" in bench.editor.status or changes[1:]
    assert changes[1] < 0.5 * changes[0]
    assert bench.puller.hinge == 1.0
    press(bench.editor, "pull.hinge", 20.0)
    assert bench.editor.widgets.dragger.pulls_with()["hinge"] == pytest.approx(0.2)


def test_r_turns_the_limb_about_its_axis_then_in_the_view_then_moves(bench):
    vertex = int(np.linalg.norm(bench.rest - HAND, axis=1).argmin())
    place = bench.at(HAND)
    bench.hover(HAND)
    bench.hand.press(place)
    bench.hand.key("r")
    assert "Turning the limb about its axis" in bench.editor.status
    for key in "60":
        bench.hand.key(key)
    bench.hand.move(place + [0, 5])
    turned = bench.session.vertices[vertex]
    radii = np.linalg.norm([bench.rest[vertex][1:], turned[1:]], axis=1)
    assert radii[1] == pytest.approx(radii[0], abs=0.03)  # about the x axis
    assert turned[0] == pytest.approx(bench.rest[vertex][0], abs=0.03)
    angles = np.degrees(np.arctan2(*np.transpose([bench.rest[vertex][1:], turned[1:]])))
    assert abs((angles[1] - angles[0] + 180.0) % 360.0 - 180.0) == pytest.approx(60.0, abs=12.0)
    bench.hand.key("r")
    assert "Turning about the line of sight" in bench.editor.status
    bench.hand.move(place + [0, 9])
    assert np.abs(bench.session.vertices[vertex] - turned).max() < 0.02  # it turns on the spot
    bench.hand.key("r")
    assert "R: turn" in bench.editor.status
    bench.hand.move(place + [0, 40])
    assert (bench.session.vertices[vertex] - turned)[2] > 0.1
    bench.hand.release()
    assert bench.session.history.undo_label == "pull"
    assert bench.tinted.sum() < 10  # not the whole limb, which is a handle now
    bench.session.undo()
    bench.hand.press(bench.at(BODY))  # without a limb, as before
    bench.hand.key("r")
    assert "Turning about the line of sight" in bench.editor.status
    bench.hand.key("z")
    assert "Turning about the axis" in bench.editor.status
    bench.hand.key("Escape")
    bench.hand.release()


def test_r_turns_the_limb_of_a_handle_then_in_the_view_then_moves_and_adds_up(bench):
    session, hand = bench.session, bench.hand
    name = session.handles.add(np.linalg.norm(bench.rest - [1.6, 0.0, 0.0], axis=1) < 0.2)
    bench.editor.run("deform")
    start, place = session.targets[name], bench.at(HAND)
    hand.press(place)
    hand.key("r")
    assert "Turning the limb about its axis" in bench.editor.status
    hand.key("9")
    hand.key("0")
    hand.move(place + [0, 5])
    turned = session.targets[name]
    vertex = middle_vertex(session.mesh, session.handles[name])
    joint, axis = session.deformer.limbs(vertex)[0].axis(session.mesh, bench.rest)
    assert_allclose((turned - joint) @ axis, (start - joint) @ axis, atol=1e-9)
    across = np.cross(axis, start - joint)
    assert_allclose(turned - joint - np.outer((start - joint) @ axis, axis), across, atol=1e-9)
    hand.key("r")
    hand.key("x")
    assert "Turning about the axis" in bench.editor.status
    hand.key("r")
    assert "R: turn" in bench.editor.status
    hand.move(place + [0, 45])
    away = session.targets[name] - turned
    assert away[0][2] > 0.1
    assert_allclose(away, np.broadcast_to(away[0], away.shape), atol=1e-9)
    hand.release()
    assert session.history.undo_label == f"drag {name}"
    assert bench.editor.widgets.dragger.turning == ""
    session.undo()
    assert_allclose(session.targets[name], start)
    body = session.handles.add(np.linalg.norm(bench.rest - [0.0, 0.0, 0.5], axis=1) < 0.2)
    bench.editor.widgets.dragger.handle = body
    hand.press(bench.at([0.0, -0.1, 0.5]))
    hand.key("r")  # the ball has no limb there
    assert "Turning about the line of sight" in bench.editor.status
    hand.key("Escape")
    hand.release()


def test_a_field_that_is_left_in_the_meantime_takes_no_part_in_a_key():
    """The panel enters what is typed in a field when another value comes for it."""
    bench = Bench()
    bench.hover(HAND)
    bench.puller.AddObserver("ModifiedEvent", lambda *_: setattr(bench.puller, "_limb", 28))
    bench.hand.types("bracketright", bench.at(HAND))
    assert bench.hand.failures == []
    assert "Limb: whole body" in bench.editor.status
