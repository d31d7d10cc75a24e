"""Waiting until the session can be pulled; a stand-in follows the pointer in the meantime.

Its poses are drawn only: they change neither the session nor its history.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.session import StandIn

from ..scene import Stop, SurfaceDisplay

_POLL = 40  # milliseconds
_PAUSE = 3.0  # between two poses, in times that one takes


class Preview:
    """Draws the poses of a stand-in, and leaves most of the time to another thread.

    Parameters
    ----------
    surface : SurfaceDisplay
        Draws them.
    poll : callable
        Called while waiting; returns whether the session is ready.
    changed : callable
        Called when waiting begins or ends, when a stand-in is shown first, and when it is hidden.

    Attributes
    ----------
    stand_in : callable
        Returns what is pulled, or None if there is nothing yet.
    """

    def __init__(
        self, surface: SurfaceDisplay, poll: Callable[[], bool], changed: Callable[[], object]
    ) -> None:
        self.stand_in: Callable[[], StandIn | None] = lambda: None
        self._surface, self._poll, self._changed = surface, poll, changed
        self._shown: StandIn | None = None
        self._wanted: Callable[[StandIn], FloatArray] | None = None  # the pose to show next
        self._next = -math.inf  # when
        self._stop: Stop | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether a pull waits for the session."""
        return self._stop is not None

    def wait(self) -> None:
        """Wait, and show the wanted poses meanwhile."""
        if self._stop is None:
            self._stop = self._surface.view.every(_POLL, self._tick)
            self._changed()

    def _tick(self) -> None:
        if not self._poll():
            self._update()

    def stop_waiting(self) -> None:
        """Wait no longer; the last pose stays until `hide`."""
        if self._stop is not None:
            self._stop()
            self._stop = None
            self._changed()

    @property
    def is_shown(self) -> bool:
        """Whether a pose of a stand-in is shown."""
        return self._shown is not None

    def pull(self, vertex: int, to: FloatArray, radius: float, locality: float | None) -> None:
        """Show the pose for this pull, now or while waiting."""
        self._wanted = partial(
            StandIn.pulled, vertex=vertex, to=to, radius=radius, locality=locality
        )
        self._update()

    def _update(self) -> None:
        """Show the last pose that was wanted, if there is a stand-in and time for it."""
        stand_in, began = self.stand_in(), time.perf_counter()
        if self._wanted is None or stand_in is None or began < self._next:
            return
        pose, self._wanted = self._wanted, None
        is_first, self._shown = self._shown is None, stand_in
        self._surface.draw(pose(stand_in))
        now = time.perf_counter()
        self._next = now + _PAUSE * (now - began)
        if is_first:
            self._changed()
            self._surface.view.render()  # at once, as this is what the user has waited for

    def hide(self) -> None:
        """Show the pose of the session again, and want no other one."""
        self._wanted = None
        if self._shown is not None:
            self._shown.release()
            self._shown = None
            self._surface.update()
            self._changed()
