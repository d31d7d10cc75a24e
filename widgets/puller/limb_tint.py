"""The limb that a pull would move, tinted before the press; the tint fades at its joint.

To find a limb takes milliseconds, and to colour a large mesh tens of them, so both are done once
the pointer rests, and not in the event that moved it.
"""

from __future__ import annotations

from collections.abc import Callable

from vtk_segdeform.deformer import Limb
from vtk_segdeform.session import SurfacePoint

from ..scene import Stop, SurfaceDisplay

_REST = 100  # milliseconds; a pointer that has not moved between two ticks rests


class LimbTint:
    """Tints the limb under the pointer, once it rests.

    Parameters
    ----------
    surface : SurfaceDisplay
        The displayed mesh.
    limb_at : callable
        Returns the limb of a point that would move, or None.
    """

    def __init__(
        self, surface: SurfaceDisplay, limb_at: Callable[[SurfacePoint], Limb | None]
    ) -> None:
        self._surface, self._limb_at = surface, limb_at
        self._limb: Limb | None = None  # that is tinted
        self._point: SurfacePoint | None = None  # under the pointer
        self._has_rested = False  # since the last tick
        self._stop: Stop | None = None

    def follow(self, point: SurfacePoint | None) -> None:
        """Tint the limb of *point* once the pointer rests; at once nothing that it has left."""
        self._point, self._has_rested = point, False
        if self._limb is not None and (point is None or not self._limb.contains(point)):
            self._draw(None)
        if point is None:
            self._end()
        elif self._stop is None:
            self._stop = self._surface.view.every(_REST, self._tick)

    def show(self, point: SurfacePoint) -> None:
        """Tint the limb of *point* at once."""
        self._end()
        self._point = point
        self._draw(self._limb_at(point))

    def _tick(self) -> None:
        if self._has_rested and self._point is not None:
            self.show(self._point)
        self._has_rested = True

    def _draw(self, limb: Limb | None) -> None:
        self._limb = limb
        self._surface.tint(None if limb is None else limb.share)

    def _end(self) -> None:
        if self._stop is not None:
            self._stop()
            self._stop = None
