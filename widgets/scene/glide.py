"""A glide from one pose to the next: the surface is drawn between them for a moment.

    x(t) = a + s(t) (b - a),    s(t) = 3 t^2 - 2 t^3,    t from 0 to 1

Only the drawing is between them: the session is in the pose b from the start.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from vtk_segdeform.arrays import FloatArray

from .surface_display import SurfaceDisplay
from .view import Stop, View

SECONDS = 0.3
_PERIOD = 15  # milliseconds between two pictures
_ABOVE_WIDGETS = 2.0  # priority: above all widgets, which pick the surface that is drawn
_ENDING = (
    "LeftButtonPressEvent",
    "MiddleButtonPressEvent",
    "RightButtonPressEvent",
    "MouseWheelForwardEvent",
    "MouseWheelBackwardEvent",
    "KeyPressEvent",
)


class Glide:
    """Draws a surface between two poses; any press, key or motion of the camera ends it."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._stops: list[Stop] = []
        self._restore: Callable[[], None] | None = None

    @property
    def is_running(self) -> bool:
        """Whether a pose between the two is drawn."""
        return self._restore is not None

    def begin(self, surface: SurfaceDisplay, before: FloatArray) -> None:
        """Draw *surface* from the pose *before* (n, 3) on to the current one of its session."""
        self.end()
        if surface.instead is not None:
            return
        change = surface.session.vertices - before
        began, camera = time.monotonic(), self._camera()

        def draw() -> None:
            t = (time.monotonic() - began) / SECONDS
            if t >= 1.0 or self._camera() != camera or surface.instead is not None:
                self.end()
            else:
                surface.draw(before + t * t * (3.0 - 2.0 * t) * change)

        self._restore = surface.update
        observed = [self._view.observe(event, self.end, _ABOVE_WIDGETS) for event in _ENDING]
        self._stops = [self._view.every(_PERIOD, draw), *observed]
        surface.draw(before)

    def _camera(self) -> tuple[object, ...]:
        """Return where the camera is and what it sees, apart from its clipping planes."""
        camera = self._view.renderer.GetActiveCamera()
        places = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
        return *places, camera.GetViewAngle(), camera.GetParallelScale()

    def end(self) -> None:
        """Draw the final pose, if a glide is running."""
        stops, self._stops = self._stops, []
        for stop in stops:
            stop()
        restore, self._restore = self._restore, None
        if restore is not None:
            restore()
