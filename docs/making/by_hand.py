"""The pictures of the tutorial by hand, from the mouse and key events that the tutorial describes.

The events are those of VTK, so readers who do the same see the same.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from making.made import FIGURES as FOLDER
from vtk_segdeform.widgets import DeformEditor

PICTURES = (
    "hand-open", "hand-pulled", "hand-regions", "hand-cages", "hand-fixed", "hand-handle",
    "hand-bent", "hand-volume", "hand-painted", "hand-cage-vertex", "hand-keys", "hand-limb-1",
    "hand-limb-2",
)  # fmt: skip
"""In the order in which they are drawn."""


class Hand:
    """An editor in a window of its own, with methods that type and drag."""

    def __init__(self, mesh: sd.Mesh) -> None:
        self.plotter = pv.Plotter(off_screen=True, window_size=(1000, 680))
        self.plotter.set_background("white")
        self.editor = DeformEditor(self.plotter, mesh)
        self.editor.On()
        self.plotter.camera_position = [(0.4, -2.4, 0.85), (0.05, 0.0, 0.47), (0.0, 0.0, 1.0)]
        self.plotter.show(interactive=False, auto_close=False)

    def send(self, name: str, place: Any = (5, 300), key: str | None = None) -> None:
        """Send an event, as a device does, when no background work is running."""
        interactor = self.plotter.iren.interactor
        while self.editor.is_busy or self.editor.is_preparing:
            interactor.InvokeEvent("TimerEvent")
            time.sleep(0.005)
        x, y = (round(float(pixel)) for pixel in place)
        interactor.SetEventInformation(x, y, 0, 0, "\0", 0, key)
        interactor.InvokeEvent(name)

    def wait(self, ticks: int = 1) -> None:
        """Let timers fire, once background work has ended."""
        for _ in range(ticks):
            self.send("TimerEvent", self.plotter.iren.interactor.GetEventPosition())

    def press(self, *keys: str) -> None:
        """Press keys, one after the other, and wait for the jobs they start."""
        for key in keys:
            self.send("KeyPressEvent", key=key)
        self.wait()

    def drag(self, places: Iterable[Any]) -> None:
        """Press at the first of some pixels, move to the last and release there."""
        first, *others = places
        self.send("MouseMoveEvent", first)
        self.send("LeftButtonPressEvent", first)
        for place in others:
            self.send("MouseMoveEvent", place)
        self.send("LeftButtonReleaseEvent", others[-1])
        self.wait(80)  # to converge

    def at(self, points: Any) -> Any:
        """Return the pixels (k, 2) of points (k, 3)."""
        return self.editor.view.to_display(np.asarray(points))[:, :2]

    def around(self, vertices: Any) -> Any:
        """Return two corners of a rectangle around some vertices, in pixels."""
        pixels = self.at(self.editor.session.vertices[vertices])
        return pixels.min(axis=0) - 3.0, pixels.max(axis=0) + 3.0

    def save(self, name: str) -> None:
        """Save a picture of the window."""
        self.plotter.screenshot(FOLDER / f"{name}.png")


def bend(hand: Hand) -> None:
    """Follow the tutorial from a bare mesh to a bent one."""
    vertices = hand.editor.session.mesh.vertices
    height = vertices[:, 2]
    hand.save("hand-open")
    hand.wait()  # until pulls are prepared
    end = hand.at(vertices[[np.argmax(vertices[:, 0])]])[0] - [8.0, 0.0]
    hand.drag(end + t * np.array([80.0, 60.0]) for t in np.linspace(0.0, 1.0, 16))
    if np.allclose(hand.editor.session.vertices, vertices):
        raise RuntimeError("the pull missed the arm")
    hand.save("hand-pulled")
    hand.editor.run("undo")
    hand.press("1", "g")
    hand.save("hand-regions")
    hand.press("f", "2")
    hand.save("hand-cages")
    hand.press("3", "t", "v", "s")
    hand.drag(hand.around(height < 0.08))
    hand.save("hand-fixed")
    hand.press("d")
    hand.drag(hand.around(height > 0.92))
    hand.save("hand-handle")
    hand.press("4")
    centre, _ = gizmo_of(hand)
    hand.drag(centre + t * np.array([170.0, -75.0]) for t in np.linspace(0.0, 1.0, 20))
    centre, radius = gizmo_of(hand)
    ring = np.linspace(2.2, 1.0, 16)
    hand.drag(centre + radius * np.array([np.cos(t), np.sin(t)]) for t in ring)
    hand.save("hand-bent")
    hand.press("o")
    hand.wait(80)
    hand.save("hand-volume")


def gizmo_of(hand: Hand) -> tuple[Any, float]:
    """Return the centre of the gizmo and the radius of its ring, in pixels."""
    gizmo = hand.editor.widgets.dragger.gizmo
    view = hand.editor.view
    return hand.at(gizmo.centre[None])[0], 1.15 * gizmo.radius / view.pixel_at(gizmo.centre)


def paint(hand: Hand) -> None:
    """Paint a region, drag a cage vertex, and show the keys."""
    mesh = hand.editor.session.mesh
    hand.press("1", "g", "a", "bracketright", "bracketright")
    place = hand.at([[0.0, -0.1, 0.62], [0.02, -0.1, 0.78]])
    hand.drag([place[0] + t * (place[1] - place[0]) for t in np.linspace(0.0, 1.0, 12)])
    hand.save("hand-painted")
    hand.editor.run("undo")
    hand.press("f", "2")
    cage = hand.editor.session.cages[0].vertices
    top = cage[np.argmax(cage @ [0.4, -0.4, 1.0])]
    start = hand.at(top[None])[0]
    hand.drag(start + t * np.array([70.0, 40.0]) for t in np.linspace(0.0, 1.0, 12))
    hand.save("hand-cage-vertex")
    hand.press("h")
    hand.save("hand-keys")
    if np.allclose(hand.editor.session.vertices, mesh.vertices):
        raise RuntimeError("the drag missed the cage vertex")


def point(hand: Hand) -> None:
    """Let the pointer rest on a limb, and choose the next larger one."""
    x = hand.editor.session.mesh.vertices
    hand.wait()  # until pulls are prepared
    place = hand.at(x[[np.argmax(x @ [1.0, 0.0, 1.0])]])[0] - [8.0, 8.0]
    hand.send("MouseMoveEvent", place)
    hand.wait(3)
    hand.save("hand-limb-1")
    hand.send("KeyPressEvent", place, "bracketright")
    if hand.editor.widgets.puller.limb is None:
        raise RuntimeError("the pointer is not on a limb")
    hand.save("hand-limb-2")


if __name__ == "__main__":
    for story, body in (
        (bend, sd.models.cactus),
        (paint, sd.models.cactus),
        (point, sd.models.dinosaur),
    ):
        hand = Hand(body(4000))
        story(hand)
        hand.plotter.close()
