"""The line of the axis, or the two lines of the plane, to which a pull is constrained."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import rgb

from ..handle_dragger import AXIS_COLOURS, Kind, Part
from ..scene import View, Wireframe

_HALF_LENGTH = 150.0  # pixels
_POINTS = 61
_EDGE = np.array([[0, 1]])
_NO_DOTS = np.empty(0, dtype=np.int64)


class Guide:
    """Thin lines over everything else; hidden until `show`.

    Parameters
    ----------
    view : View
        The view to draw in.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._lines = [Wireframe(np.zeros((2, 3)), _EDGE, _NO_DOTS) for _ in range(3)]
        for line, colour in zip(self._lines, AXIS_COLOURS, strict=True):
            line.set_style(rgb(colour), line_width=1.5, sphere_size=1.0)
            line.actor.GetProperty().LightingOff()
            line.actor.GetProperty().SetOpacity(0.6)
            line.actor.VisibilityOff()
            view.foreground.AddActor(line.actor)

    def show(self, part: Part | None, place: FloatArray | None) -> FloatArray:
        """Show the lines of *part* through *place* (3,), or none; return points on them (k, 3)."""
        axes: set[int] = set()
        if part is not None and part.axis is not None:
            axes = {0, 1, 2} - {part.axis} if part.kind is Kind.PLANE else {part.axis}
        for axis, line in enumerate(self._lines):
            line.actor.SetVisibility(axis in axes)
            if axis in axes and place is not None:
                along = _HALF_LENGTH * self._view.pixel_at(place) * np.eye(3)[axis]
                line.move(np.stack([place - along, place + along]))
        self._view.request_render()
        if place is None or not axes:
            return np.empty((0, 3))
        along = _HALF_LENGTH * self._view.pixel_at(place) * np.linspace(-1.0, 1.0, _POINTS)
        return np.concatenate([place + along[:, None] * np.eye(3)[axis] for axis in axes])

    def remove(self) -> None:
        """Remove the lines from the view permanently."""
        for line in self._lines:
            self._view.foreground.RemoveActor(line.actor)
