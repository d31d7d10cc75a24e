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
_ANGLES = np.roll(np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False), -1)
# The place at the upper right comes first, and the near places before the far ones.
_DISTANCES = np.repeat([_NEAR, _FAR], len(_ANGLES))
_DIRECTIONS = np.tile(np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)]), (2, 1))


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
        centres = at + (scale * _DISTANCES[:, None] + 0.5 * box) * _DIRECTIONS
        corners = np.clip(centres - 0.5 * box, low, np.maximum(low, high))
        middles, reach = corners + 0.5 * box, 0.5 * box + size / 4
        hidden = np.abs(across - middles[:, :1]) < reach[0]
        hidden &= np.abs(up - middles[:, 1:]) < reach[1]
        hides_point = (np.abs(at - middles) < 0.5 * (box + size)).all(axis=1)
        is_corner = (corners + box > [width - _CUBE, height - _CUBE]).all(axis=1)
        costs = _POINT * hidden.sum(axis=1) + _FARTHER * (_DISTANCES == _FAR)
        costs += _CORNER * is_corner + 1e6 * hides_point
        if self._last is not None:
            costs += _OTHER * (np.arange(len(costs)) != self._last)
        self._last = int(costs.argmin())
        x, y = corners[self._last]
        self._box = float(x), float(y), float(box[0]), float(box[1])
        self._plate.place(*self._box)
        self._words.place(x + 0.5 * size, y + 0.5 * box[1])
