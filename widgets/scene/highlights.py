"""Places of a mesh, marked in a view: loops of edges as thick lines, vertices as dots.

They are drawn on the surface, and once more, faintly, over everything else, so that places at the
back of a body are found without turning it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.pictures import COLOURS, INK, rgb

from .view import View
from .wireframe import Wireframe

LOOP, DOT = COLOURS[6], COLOURS[5]  # vermilion and blue: distinct for colour-blind people
_WIDE, _RIM, _DOT = 4.0, 2.5, 8.0  # pixels: a line, its dark rim on both sides together, a dot
_THROUGH = 0.4  # opacity of marks that the body hides


class Highlights:
    """Loops and vertices of one mesh; hidden until `show`."""

    def __init__(self, view: View) -> None:
        self.view = view
        self._frames: list[tuple[IntArray, Wireframe, bool]] = []

    @property
    def is_shown(self) -> bool:
        """Whether they are shown."""
        return bool(self._frames)

    def show(self, points: FloatArray, loops: Sequence[IntArray], dots: IntArray) -> None:
        """Mark closed *loops* (k,) and single *dots* (d,) of the vertices at *points* (n, 3)."""
        self.hide()
        tails = np.concatenate([np.empty(0, dtype=np.int64), *loops])
        heads = np.concatenate([np.empty(0, dtype=np.int64), *(np.roll(a, -1) for a in loops)])
        scale = self.view.scale
        none = np.empty(0, dtype=np.int64)
        if len(tails):
            edges = np.stack([tails, heads], axis=1)
            self._add(points, edges, none, INK, scale * (_WIDE + _RIM), rim=True)
            self._add(points, edges, tails, LOOP, scale * _WIDE)  # dots round the corners
        if len(dots):
            self._add(points, np.empty((0, 2), dtype=np.int64), dots, DOT, scale * _DOT)
        self.view.request_render()

    def move(self, points: FloatArray) -> None:
        """Set the positions of the vertices of the mesh, (n, 3)."""
        for used, frame, _ in self._frames:
            frame.move(points[used])

    def hide(self) -> None:
        """Hide them."""
        for _, frame, is_over in self._frames:
            (self.view.foreground if is_over else self.view.renderer).RemoveActor(frame.actor)
        if self._frames:
            self._frames = []
            self.view.request_render()

    def _add(
        self, points: FloatArray, edges: IntArray, dots: IntArray, colour: str, size: float,
        *, rim: bool = False,
    ) -> None:  # fmt: skip
        used, number = np.unique(np.concatenate([edges.ravel(), dots]), return_inverse=True)
        number = number.ravel()
        for is_over in (False, True):
            if rim and is_over:
                continue  # only the coloured line shows through
            ends, spheres = number[: edges.size].reshape(-1, 2), number[edges.size :]
            if is_over and len(ends):
                spheres = spheres[:0]  # translucent corners would be darker
            frame = Wireframe(points[used], ends, spheres)
            frame.set_style(rgb(colour), line_width=size, sphere_size=size)
            style = frame.actor.GetProperty()
            style.LightingOff()
            if is_over:
                style.SetOpacity(_THROUGH)
            (self.view.foreground if is_over else self.view.renderer).AddActor(frame.actor)
            self._frames.append((used, frame, is_over))
