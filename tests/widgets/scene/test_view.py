"""The interface to VTK: projection, delivery of events, exceptions, rendering."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from hands import Hand, picture, plain_view
from scenes import sausage
from solids import icosphere
from vtkmodules.vtkRenderingCore import vtkRenderer

from vtk_segdeform import Mesh, Session, models
from vtk_segdeform.arrays import bounds_of
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.widgets.scene import viewpoint
from vtk_segdeform.widgets.scene.gestures import Gesture, Phase, Pointer
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay
from vtk_segdeform.widgets.scene.view import View
from vtk_segdeform.widgets.scene.widget import Widget


class Scribble(Widget):
    """A widget that draws strokes in the left half of the view and records its input."""

    def __init__(self, view, session):
        super().__init__(view, session)
        self.strokes, self.keys = [], []
        self.fail_on = None

    def on_press(self, press: Pointer) -> Gesture | None:
        return self._stroke(press) if press.x < 200 else None

    def on_key(self, key, pointer):
        self.keys.append(key)
        return key == "w"

    def remove(self):
        self.Off()

    def _stroke(self, press):
        places = [press.position]
        while (pointer := (yield)).phase is Phase.MOVE:
            if pointer.x == self.fail_on:
                raise RuntimeError("out of ink")
            places.append(pointer.position)
        if pointer.phase is Phase.RELEASE:
            self.strokes.append(len(places))


@pytest.fixture
def scribble():
    view = plain_view()
    session = Session(Mesh(*icosphere(2)))
    surface = SurfaceDisplay(view, session)
    view.renderer.ResetCamera()
    view.render()
    widget = Scribble(view, session)
    widget.On()
    yield widget
    widget.remove()
    surface.remove()


@pytest.mark.parametrize("parallel", [False, True])
def test_to_display_and_to_world_are_inverses(parallel, rng):
    view = plain_view((320, 240))
    SurfaceDisplay(view, Session(models.sphere(200)))
    view.camera.SetParallelProjection(parallel)
    view.camera.SetPosition(3.0, 2.0, 1.0)
    view.renderer.ResetCamera()
    points = rng.normal(size=(20, 3)) * 0.5
    there = view.to_display(points)
    assert np.allclose(view.to_world(there), points, atol=1e-9)
    view.renderer.SetWorldPoint(*points[0], 1.0)
    view.renderer.WorldToDisplay()
    assert np.allclose(there[0], view.renderer.GetDisplayPoint(), atol=1e-6)  # VTK's own projection


@pytest.mark.parametrize("parallel", [False, True])
def test_the_line_of_sight_does_not_depend_on_the_clipping_range_to_the_bit(parallel):
    """Other hosts draw other frames of the same input, and each frame sets that range."""
    view, found = plain_view((320, 240)), []
    view.camera.SetParallelProjection(parallel)
    view.camera.SetPosition(3.0, 2.0, 1.0)
    for near, far in ((0.1, 10.0), (1.37, 5.3)):
        view.camera.SetClippingRange(near, far)
        found.append(np.concatenate(view.line_of_sight(Pointer(Phase.MOVE, 71.0, 133.0))))
    assert np.array_equal(*found)
    near, far = view.ray(Pointer(Phase.MOVE, 71.0, 133.0))
    assert np.allclose(np.cross(far - near, found[0][3:]), 0.0, atol=1e-9)


@pytest.mark.parametrize("parallel", [False, True])
def test_the_length_of_a_pixel_agrees_with_the_projection(parallel):
    view = plain_view((300, 300))
    SurfaceDisplay(view, Session(models.sphere(200)))
    view.camera.SetParallelProjection(parallel)
    view.renderer.ResetCamera()
    point = np.array([0.1, 0.2, 0.3])
    here = view.to_display(point[None])
    beside = view.to_world(here + [1.0, 0.0, 0.0])[0]
    assert view.pixel_at(point) == pytest.approx(np.linalg.norm(beside - point), rel=1e-6)


def test_a_view_is_made_from_a_plotter_or_a_renderer_and_interactor_only():
    plotter = pv.Plotter(off_screen=True)
    try:
        view = View.of(plotter)
        assert view.renderer is plotter.renderer
        assert View.of(view) is view
        assert View.of((view.renderer, view.interactor)).renderer is view.renderer
        with pytest.raises(ArgumentError, match="view must be a pyvista plotter"):
            View.of("window")
        with pytest.raises(
            ArgumentError, match=r"must be \(vtkRenderer, vtkRenderWindowInteractor\)"
        ):
            View.of((view.renderer, None))
        with pytest.raises(ValueError, match="AddRenderer"):
            View.of((vtkRenderer(), view.interactor))
    finally:
        plotter.close()


def test_a_gesture_receives_all_events_from_press_to_release_and_the_camera_none(scribble):
    hand = Hand(scribble.view)
    camera = scribble.view.camera.GetPosition()
    hand.drag([(50, 50), (60, 60), (300, 70)])
    assert scribble.strokes == [3]
    assert scribble.view.camera.GetPosition() == camera
    hand.drag([(300, 50), (320, 60), (340, 90)])  # outside the widget's half
    assert scribble.strokes == [3]
    assert scribble.view.camera.GetPosition() != camera
    assert not hand.failures


def test_escape_and_the_right_button_cancel(scribble):
    hand = Hand(scribble.view)
    for cancel in (lambda: hand.key("Escape"), lambda: hand.event("RightButtonPressEvent")):
        hand.press((50, 50))
        assert scribble.is_grabbing
        cancel()
        assert not scribble.is_grabbing
        hand.release((60, 60))
    assert scribble.strokes == []


def test_a_press_without_a_previous_release_finishes_the_gesture(scribble):
    hand = Hand(scribble.view)
    hand.press((50, 50))
    hand.move((60, 60))
    hand.drag([(70, 70), (80, 80), (90, 90)])
    assert scribble.strokes == [3, 3]  # each press is preceded by a move


@pytest.mark.parametrize("end", ["finish", "Off"])
def test_a_gesture_ended_from_outside_is_finished_and_not_cancelled(scribble, end):
    hand = Hand(scribble.view)
    hand.press((50, 50))
    hand.move((60, 60))
    getattr(scribble, end)()
    assert not scribble.is_grabbing
    hand.move((70, 70))
    hand.release((70, 70))
    assert scribble.strokes == [2]
    assert not scribble.finish()
    assert hand.failures == []


def test_off_succeeds_even_if_finishing_the_gesture_raises(scribble):
    hand = Hand(scribble.view)

    def stroke(press):
        yield
        raise RuntimeError("out of ink")

    scribble.on_press = stroke
    hand.press((50, 50))
    with pytest.raises(RuntimeError, match="out of ink"):
        scribble.Off()
    assert not scribble.GetEnabled()
    assert not scribble.is_grabbing


def test_interaction_events_come_in_the_order_of_vtk(scribble):
    said = []
    for event in ("StartInteractionEvent", "InteractionEvent", "EndInteractionEvent"):
        scribble.AddObserver(event, lambda widget, name: said.append(name))
    hand = Hand(scribble.view)
    hand.drag([(50, 50), (60, 60), (70, 70)])
    assert [name.removesuffix("InteractionEvent") for name in said] == ["Start", "", "", "End"]


def test_an_exception_reaches_the_listener_and_ends_the_gesture(scribble):
    hand = Hand(scribble.view)
    scribble.fail_on = 60
    hand.press((50, 50))
    hand.move((60, 60))
    assert [str(failure) for failure in hand.failures] == ["out of ink"]
    assert not scribble.is_grabbing
    scribble.fail_on = None
    hand.release((60, 60))
    hand.drag([(50, 50), (60, 60)])
    assert scribble.strokes == [2]


def test_an_event_inside_an_event_is_queued(scribble):
    """As if a listener runs the event loop, which delivers moves and the release."""
    hand = Hand(scribble.view)
    seen, inside = [], {20: ("move", 30), 40: ("release", 40), 50: ("press", 70)}

    def stroke(press):
        while (pointer := (yield)).phase is Phase.MOVE:
            seen.append(pointer.x)
            if pointer.x in inside:
                what, x = inside[pointer.x]
                getattr(hand, what)((x, 50))
                assert scribble.is_grabbing
        seen.append(pointer.phase)

    scribble.on_press = stroke
    hand.press((10, 50))
    hand.move((20, 50))
    assert seen == [20, 30]
    hand.move((40, 50))
    assert seen == [20, 30, 40, Phase.RELEASE]
    assert not scribble.is_grabbing
    hand.press((10, 50))
    hand.move((50, 50))
    assert seen[4:] == [50, 70, Phase.RELEASE]  # a press means that the release was lost
    assert not scribble.is_grabbing
    assert hand.failures == []


def test_of_several_moves_inside_an_event_only_the_last_is_handled(scribble):
    hand, seen = Hand(scribble.view), []

    def stroke(press):
        while (pointer := (yield)).phase is Phase.MOVE:
            seen.append(pointer.x)
            if pointer.x == 20:
                for x in (30, 40, 50):
                    hand.move((x, 50))

    scribble.on_press = stroke
    hand.press((10, 50))
    hand.move((20, 50))
    assert seen == [20, 50]
    hand.release((50, 50))
    assert hand.failures == []


def test_escape_ends_even_a_gesture_that_ignores_it(scribble):
    hand, closed = Hand(scribble.view), []

    def stroke(press):
        try:
            while True:
                yield
        finally:
            closed.append("closed")

    scribble.on_press = stroke
    hand.press((10, 50))
    hand.key("Escape")
    assert closed == ["closed"]
    assert not scribble.is_grabbing


def test_only_keys_that_no_widget_handles_reach_the_camera(scribble):
    hand = Hand(scribble.view)
    heard = []
    scribble.view.interactor.AddObserver("CharEvent", lambda *_: heard.append("char"), -1.0)
    hand.key("w")  # VTK would switch to wireframe
    assert heard == []
    hand.key("s")
    assert heard == ["char"]
    assert scribble.keys == ["w", "s"]


def test_a_closed_window_is_none_and_drawing_in_it_does_nothing():
    plotter = pv.Plotter(off_screen=True)
    view = View.of(plotter)
    assert view.window is not None
    plotter.show(auto_close=False, interactive=False)
    assert view.window is not None
    plotter.close()
    assert view.window is None
    view.render()
    view.request_render()


def test_a_widget_that_is_off_receives_no_events(scribble):
    scribble.Off()
    Hand(scribble.view).drag([(50, 50), (60, 60)])
    assert scribble.strokes == []
    assert not scribble.GetEnabled()


def test_the_surface_follows_the_pose_in_place():
    view = plain_view()
    scene = sausage(is_coarse=True)
    session = scene.session()
    surface = SurfaceDisplay(view, session)
    before, memory = picture(view), surface.points
    session.drag(scene.turned(30.0), max_steps=5)
    assert surface.points is memory
    assert np.array_equal(surface.points, session.vertices)
    assert np.array_equal(session.mesh.vertices, scene.mesh.vertices)
    assert (picture(view) != before).any()
    session.undo()  # which commits the drag first
    assert np.array_equal(surface.points, scene.mesh.vertices)
    surface.remove()


def test_one_event_draws_once_whatever_it_changes(scribble):
    drawn = []
    scribble.view.renderer.AddObserver("EndEvent", lambda *_: drawn.append("once"))
    scribble.view.request_render()  # outside an event: draws at once
    assert len(drawn) == 1

    def on_key(key, pointer):
        for _ in range(3):
            scribble.view.request_render()
        return True

    scribble.on_key = on_key
    scribble.view.before_render(scribble.view.request_render)  # must not render endlessly
    hand = Hand(scribble.view)
    hand.event("KeyPressEvent", key="a")
    assert len(drawn) == 2
    hand.event("KeyReleaseEvent", key="a")
    hand.hover((300, 50))
    assert len(drawn) == 2  # the request before rendering does not cause another picture


def test_an_event_inside_an_event_does_not_draw_on_its_own(scribble):
    """As if the callback of a move runs the event loop, which fires a timer."""
    view, drawn = scribble.view, []
    hand = Hand(view)
    view.renderer.AddObserver("EndEvent", lambda *_: drawn.append(len(calls)))
    calls = []

    def timer():
        calls.append("timer")
        view.request_render()

    def move():
        calls.append("move")
        view.request_render()
        hand.tick()
        calls.append("end of move")
        view.request_render()

    stops = [view.every(20, timer), view.observe("MouseMoveEvent", move)]
    hand.hover((300, 50))
    assert calls == ["move", "timer", "end of move"]
    assert drawn == [3]  # once, at the end of the outer event
    stops[1]()
    hand.hover((310, 50))
    assert drawn == [3]  # nothing more was requested
    hand.tick()
    assert drawn == [3, 4]
    stops[0]()
    assert hand.failures == []


def test_the_newest_layer_of_colours_is_seen():
    view = plain_view((60, 60))
    session = Session(models.sphere(200))
    surface = SurfaceDisplay(view, session)
    view.renderer.ResetCamera()

    def middle():
        return picture(view)[30, 30].astype(int)

    n = session.mesh.n_vertices
    surface.set_colours("regions", np.tile(np.uint8([0, 200, 0]), (n, 1)))
    assert middle()[1] > 3 * middle()[0]
    surface.set_colours("volume", np.tile(np.uint8([200, 0, 0]), (n, 1)))
    assert middle()[0] > 3 * middle()[1]
    surface.set_colours("volume", None)
    assert middle()[1] > 3 * middle()[0]
    surface.remove()


def test_actors_in_the_foreground_are_never_hidden():
    view = plain_view((60, 60))
    session = Session(models.sphere(200))
    surface = SurfaceDisplay(view, session)
    view.renderer.ResetCamera()
    inner = SurfaceDisplay(
        View(view.foreground, view.interactor),
        Session(Mesh(0.2 * session.mesh.vertices, session.mesh.faces)),
    )
    inner.set_colours("all", np.tile(np.uint8([200, 0, 0]), (session.mesh.n_vertices, 1)))
    pixel = picture(view)[30, 30].astype(int)
    assert pixel[0] > 3 * pixel[1]
    view.remove_foreground()
    pixel = picture(view)[30, 30].astype(int)
    assert pixel[0] < 2 * pixel[1]
    surface.remove()


def test_the_foreground_follows_viewport_and_camera():
    view = plain_view((80, 60))
    front = view.foreground
    view.renderer.SetViewport(0.5, 0.0, 1.0, 1.0)
    view.camera.SetPosition(1.0, 2.0, 3.0)
    view.camera.ParallelProjectionOn()
    view.render()
    assert front.GetViewport() == (0.5, 0.0, 1.0, 1.0)
    assert front.GetActiveCamera().GetPosition() == (1.0, 2.0, 3.0)
    assert front.GetActiveCamera().GetParallelProjection()


def test_of_many_points_some_are_framed_with_the_outermost(monkeypatch):
    monkeypatch.setattr(viewpoint, "_MOST_FRAMED", 50)
    points = np.random.default_rng(5).normal(size=(1000, 3))
    some = viewpoint._outermost(points)
    assert len(some) < 100
    assert np.array_equal(bounds_of(some), bounds_of(points))
    assert len(viewpoint._outermost(points[:90])) == 90
