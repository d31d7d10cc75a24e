"""The pictures of the tutorial by hand: the editor, worked by the mouse and the keys it tells of.

Events come from a recording, as `vtk_segdeform.widgets.replay` takes it; what the pictures show
is what a reader sees who does the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from making.made import FIGURES as FOLDER
from vtk_segdeform.widgets import DeformEditor, replay

PICTURES = (
    "hand-open", "hand-regions", "hand-cages", "hand-stays", "hand-dragged", "hand-bent",
    "hand-volume", "hand-painted", "hand-cage-vertex", "hand-keys",
)  # fmt: skip
"""All of them, in the order in which they are drawn."""


class Hand:
    """A hand in a window of its own.

    Parameters
    ----------
    mesh : Mesh
        What it works on.
    """

    def __init__(self, mesh: sd.Mesh) -> None:
        self.plotter = pv.Plotter(off_screen=True, window_size=(1000, 680))
        self.plotter.set_background("white")
        self.editor = DeformEditor(self.plotter, mesh)
        self.editor.On()
        self.plotter.camera_position = [(0.4, -2.4, 0.85), (0.05, 0.0, 0.47), (0.0, 0.0, 1.0)]
        self.plotter.show(interactive=False, auto_close=False)

    def plays(self, *lines: str) -> None:
        """Do what lines of a recording say."""
        replay(
            self.plotter, ["vtk_segdeform recording 1", *lines], busy=lambda: self.editor.is_busy
        )

    def types(self, *keys: str) -> None:
        """Press keys, one after the other, and wait for what they begin."""
        self.plays(*(f"0.0 KeyPress 5 300 key={key}" for key in keys), "0.0 Timer 1")

    def drags(self, places: Iterable[Any]) -> None:
        """Press at the first of some pixels, go on to the last and release there."""
        seen = [f"{x:.0f} {y:.0f}" for x, y in places]
        self.plays(
            f"0.0 MouseMove {seen[0]}",
            f"0.0 LeftButtonPress {seen[0]}",
            *(f"0.0 MouseMove {place}" for place in seen[1:]),
            f"0.0 LeftButtonRelease {seen[-1]}",
            "0.0 Timer 80",  # and what is left to refine
        )

    def at(self, points: Any) -> Any:
        """Return the pixels (k, 2) of points (k, 3)."""
        return self.editor.view.to_display(np.asarray(points))[:, :2]

    def around(self, vertices: Any) -> Any:
        """Return two corners of a rectangle around some vertices."""
        seen = self.at(self.editor.session.vertices[vertices])
        return seen.min(axis=0) - 3.0, seen.max(axis=0) + 3.0

    def shows(self, name: str) -> None:
        """Keep what is seen."""
        self.plotter.screenshot(FOLDER / f"{name}.png")


def bend(hand: Hand) -> None:
    """Do what the tutorial tells: from a bare mesh to a bent one."""
    height = hand.editor.session.mesh.vertices[:, 2]
    hand.shows("hand-open")
    hand.types("g")
    hand.shows("hand-regions")
    hand.types("f", "2")
    hand.shows("hand-cages")
    hand.types("3", "t", "v", "s")
    hand.drags(hand.around(height < 0.08))
    hand.shows("hand-stays")
    hand.types("d")
    hand.drags(hand.around(height > 0.92))
    hand.shows("hand-dragged")
    hand.types("4")
    centre, _ = gizmo_of(hand)
    hand.drags(centre + t * np.array([170.0, -75.0]) for t in np.linspace(0.0, 1.0, 20))
    centre, radius = gizmo_of(hand)
    ring = np.linspace(2.2, 1.0, 16)
    hand.drags(centre + radius * np.array([np.cos(t), np.sin(t)]) for t in ring)
    hand.shows("hand-bent")
    hand.types("o")
    hand.plays("0.0 Timer 80")
    hand.shows("hand-volume")


def gizmo_of(hand: Hand) -> tuple[Any, float]:
    """Return where the gizmo's middle is, and how far from it the ring is, in pixels."""
    gizmo = hand.editor.widgets.dragger.gizmo
    view = hand.editor.view
    return hand.at(gizmo.centre[None])[0], 1.15 * gizmo.radius / view.pixel_at(gizmo.centre)


def paint(hand: Hand) -> None:
    """Paint a region, pull at a cage, and ask for the keys."""
    mesh = hand.editor.session.mesh
    hand.types("g", "a", "bracketright", "bracketright")
    place = hand.at([[0.0, -0.1, 0.62], [0.02, -0.1, 0.78]])
    hand.drags([place[0] + t * (place[1] - place[0]) for t in np.linspace(0.0, 1.0, 12)])
    hand.shows("hand-painted")
    hand.types("z", "f", "2")
    cage = hand.editor.session.cages[0].vertices
    top = cage[np.argmax(cage @ [0.4, -0.4, 1.0])]
    start = hand.at(top[None])[0]
    hand.drags(start + t * np.array([70.0, 40.0]) for t in np.linspace(0.0, 1.0, 12))
    hand.shows("hand-cage-vertex")
    hand.types("h")
    hand.shows("hand-keys")
    if np.allclose(hand.editor.session.vertices, mesh.vertices):
        raise RuntimeError("the cage vertex was not where the mouse was")


if __name__ == "__main__":
    for story in (bend, paint):
        hand = Hand(sd.models.cactus(4000))
        story(hand)
        hand.plotter.close()
