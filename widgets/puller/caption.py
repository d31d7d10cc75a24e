"""The amount of a pull: a small text beside the pulled point, where it covers least of the body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import INK, PAPER

from ..scene import Panel, Text, View

_SIZE = 15.0  # pixels, of the text
_NEAR, _FAR = 26.0, 75.0  # pixels from the point to the nearest edge of the text
_MARGIN, _FOOT = 6.0, 40.0  # pixels from the edges of the window, and above its status line
_DESIGN_HEIGHT = 600  # pixels; the text is larger in a higher window
_SAMPLES = 3000  # vertices, at most, that stand for the body
_CUBE = 110.0  # pixels, at the upper right: the orientation cube may be there
# Costs: a covered point of the body or of a line, the cube, the far place, a new place.
_POINT, _CORNER, _FARTHER, _OTHER = 1.0, 20.0, 0.5, 2.0
_ANGLES = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
# The place at the upper right comes first, and the near places before the far ones.
_PLACES = [
    (distance, (np.cos(angle), np.sin(angle)))
    for distance in (_NEAR, _FAR)
    for angle in np.roll(_ANGLES, -1)
]


class Caption:
    """A text beside a point; hidden until `show`.

    Parameters
    ----------
    view : View
        The view to draw in.
    body : callable
        Returns the current vertices of the body, (n, 3) float.
    """

    def __init__(self, view: View, body: Callable[[], FloatArray]) -> None:
        self._view, self._body = view, body
        self._text, self._point, self._lines = "", np.zeros(3), np.empty((0, 3))
        self._last: int | None = None  # the place of the last picture
        self._box = 0.0, 0.0, 0.0, 0.0
        self._plate = Panel(view.foreground, INK, opacity=0.88, layer=5)
        self._words = Text(view.foreground, PAPER, bold=True, layer=6)
        self._stop = view.before_render(self._lay_out)
        self.show("", None)

    @property
    def text(self) -> str:
        """The text that is shown, or ""."""
        return self._text

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, bottom, width and height in the last picture, pixels of the renderer."""
        return self._box

    def show(self, text: str, point: FloatArray | None, lines: FloatArray | None = None) -> None:
        """Show *text* beside *point* (3,), away from *lines* (k, 3); nothing without a point."""
        self._text = text if point is not None else ""
        if point is not None:
            self._point = point
            self._lines = np.empty((0, 3)) if lines is None else lines
        if not self._text:
            self._last = None
        self._plate.show(bool(self._text))
        self._words.show(bool(self._text))
        self._view.request_render()

    def remove(self) -> None:
        """Remove it from the view permanently."""
        self._stop()
        self._plate.remove()
        self._words.remove()

    def _lay_out(self) -> None:
        if not self._text:
            return
        width, height = self._view.renderer.GetSize()
        scale = float(np.clip(height / _DESIGN_HEIGHT, 0.8, 2.0))
        size = scale * _SIZE
        self._words.set_text(self._text, size)
        box = np.array([self._words.width() + size, 1.5 * size])
        body, origin = self._body(), self._view.renderer.GetOrigin()
        some = np.concatenate([body[:: 1 + len(body) // _SAMPLES], self._lines])
        across, up = (self._view.to_display(some)[:, :2] - origin).T.copy()
        at = self._view.to_display(self._point[None])[0, :2] - origin
        low, high = np.full(2, _MARGIN), np.array([width, height]) - _MARGIN - box
        low[1] += scale * _FOOT
        corners, costs = [], []
        for k, (distance, direction) in enumerate(_PLACES):
            centre = at + (scale * distance + 0.5 * box) * direction
            corner = np.clip(centre - 0.5 * box, low, np.maximum(low, high))
            middle, reach = corner + 0.5 * box, 0.5 * box + size / 4
            inside = (np.abs(across - middle[0]) < reach[0]) & (np.abs(up - middle[1]) < reach[1])
            hides_point = (np.abs(at - corner - 0.5 * box) < 0.5 * box + 0.5 * size).all()
            cost = _POINT * np.count_nonzero(inside) + _FARTHER * (distance == _FAR)
            cost += _CORNER * (corner + box > [width - _CUBE, height - _CUBE]).all()
            cost += _OTHER * (self._last not in (None, k)) + (1e6 if hides_point else 0.0)
            corners.append(corner)
            costs.append(cost)
        best = self._last = int(np.argmin(costs))
        x, y = corners[best]
        self._box = float(x), float(y), float(box[0]), float(box[1])
        self._plate.place(*self._box)
        self._words.place(x + 0.5 * size, y + 0.5 * box[1])
