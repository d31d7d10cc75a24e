"""User callbacks that raise at any moment of a drag do not break the editor.

First comes a drag with a callback that raises, whose exception is reported; then a drag without it,
which works, preserves the volume exactly and can be undone.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, plain_view
from soaking import NAME, slender

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.scene.view import View

WAY = np.array([[0, 0], [5, 4], [14, 12]])


class Fault(Exception):
    """An exception raised by a user's callback."""


class Raiser:
    """A callback that always raises."""

    calls = 0

    def __call__(self, *_):
        self.calls += 1
        raise Fault(f"at call {self.calls}")


class Bench:
    """An editor in deform mode, and a hand."""

    def __init__(self) -> None:
        self.session = slender().session(NAME)
        self.view = plain_view((200, 160))
        self.editor = DeformEditor(self.view, self.session)
        self.widgets = self.editor.widgets
        self.dragger = self.widgets.dragger
        self.view.camera.SetPosition(0.0, -9.0, 2.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        draw_seldom(self.view)
        self.hand = Hand(self.view)
        self.editor.On()
        self.editor.mode = Mode.DEFORM
        self.editor.wait()
        self.require_works()

    def drags(self) -> None:
        """Drag the ball of the gizmo and refine the pose."""
        self.hand.drag(self.hand.at(self.dragger.gizmo.centre) + WAY)
        for _ in range(50):
            if self.dragger.is_refining:
                self.hand.tick()
        assert not self.dragger.is_refining

    def require_works(self) -> None:
        """Assert that a drag works and can be undone, and that no gesture is running."""
        session, before = self.session, self.session.vertices
        step, camera = session.history.undo_label, self.view.camera.GetPosition()
        assert not session.is_dragging
        assert not any(widget.is_grabbing for widget in self.widgets.interactive)
        self.hand.failures.clear()
        self.drags()
        assert session.history.undo_label == f"drag {NAME}"
        assert np.abs(session.vertices - before).max() > 0.01
        faces, rest = session.mesh.faces, session.mesh.vertices
        change = signed_volume(session.vertices, faces) / signed_volume(rest, faces) - 1.0
        assert abs(change) <= 1e-12
        self.require_seen()
        self.hand.key("z", control=True)
        assert np.array_equal(session.vertices, before)
        assert session.history.undo_label == step
        self.require_seen()
        self.hand.move((10, 10))
        assert self.view.camera.GetPosition() == camera
        assert self.hand.failures == []

    def require_seen(self) -> None:
        """Assert that the displayed mesh has the current pose, and the gizmo is at the handle."""
        View.render(self.view)
        x = self.session.vertices
        assert np.array_equal(self.widgets.surface.points, x)
        assert np.allclose(self.dragger.gizmo.centre, x[self.session.handles[NAME]].mean(axis=0))

    def has_reported(self) -> bool:
        """Return whether a fault reached the failure listeners, and clear the list."""
        found = any(isinstance(failure, Fault) for failure in self.hand.failures)
        self.hand.failures.clear()
        return found


@pytest.fixture(scope="module")
def bench():
    """Yield an editor shared by all tests; each must restore it."""
    made = Bench()
    yield made
    made.editor.remove()


def observer(event):
    """Return a function that adds an observer of *event* to the dragger."""

    def add(bench, callback):
        tag = bench.dragger.AddObserver(event, callback)
        return lambda: bench.dragger.RemoveObserver(tag)

    return add


PLACES = {
    "a listener of the session": lambda bench, call: bench.session.on_change(call),
    "an observer of the beginning": observer("StartInteractionEvent"),
    "an observer of the drag": observer("InteractionEvent"),
    "an observer of the end": observer("EndInteractionEvent"),
    "a callback before a picture": lambda bench, call: bench.view.before_render(call),
    "a callback of the mouse": lambda bench, call: bench.view.observe("MouseMoveEvent", call, 2.0),
    "a callback of the press": lambda bench, call: bench.view.observe(
        "LeftButtonPressEvent", call, 2.0
    ),
    "a callback of a timer": lambda bench, call: bench.view.every(20, call),
    "a listener of what is said": lambda bench, call: bench.editor.controller.messages.on_change(
        call
    ),
}


@pytest.mark.parametrize("place", every(3, PLACES))
def test_a_callback_that_raises_during_a_drag_does_not_affect_the_next_drag(bench, place):
    raiser = Raiser()
    stop = PLACES[place](bench, raiser)
    if "picture" in place:
        del bench.view.render  # drawn at every event
    try:
        bench.drags()
        assert raiser.calls
        assert bench.has_reported()
    finally:
        stop()
        draw_seldom(bench.view)
    if bench.session.history.undo_label == f"drag {NAME}":  # committed before the callback raised
        bench.session.undo()
    bench.require_works()


def test_an_observer_that_raises_does_not_suppress_the_others(bench):
    heard = []
    tags = [
        bench.dragger.AddObserver("EndInteractionEvent", call)
        for call in (Raiser(), lambda *_: heard.append("end"))
    ]
    bench.drags()
    for tag in tags:
        bench.dragger.RemoveObserver(tag)
    assert bench.has_reported()
    assert heard == ["end"]
    bench.session.undo()
    bench.require_works()
