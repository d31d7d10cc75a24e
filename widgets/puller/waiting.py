"""Waiting until the session can be pulled; a stand-in follows the pointer in the meantime.

Its poses are drawn only: they change neither the session nor its history.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.session import StandIn, SurfacePoint

from ..scene import Stop, SurfaceDisplay

_POLL = 40  # milliseconds
_PAUSE = 1.5  # between two poses, in times that one takes: time for the thread that prepares

Pull = Callable[[], object]


class Waiting:
    """A pull that waits for its session, and the stand-in that follows.

    Parameters
    ----------
    surface : SurfaceDisplay
        Draws the poses of the stand-in.
    is_ready : callable
        Returns whether the session can be pulled.
    go_on : callable
        Called with the pull that was released meanwhile, or None, once the session is ready.
    changed : callable
        Called when waiting begins or ends, when a stand-in is shown first, and when it is hidden.

    Attributes
    ----------
    stand_in : callable
        Returns what is pulled, or None if there is nothing yet.
    is_coming : callable
        Returns whether the session is being prepared; if not, a released pull is given up.
    """

    def __init__(
        self,
        surface: SurfaceDisplay,
        is_ready: Callable[[], bool],
        go_on: Callable[[Pull | None], object],
        changed: Callable[[], object],
    ) -> None:
        self.stand_in: Callable[[], StandIn | None] = lambda: None
        self.is_coming: Callable[[], bool] = lambda: True
        self._surface, self._is_ready, self._go_on = surface, is_ready, go_on
        self._changed = changed
        self._pull: Pull | None = None  # that was released
        self._shown: StandIn | None = None
        self._wanted: Callable[[StandIn], FloatArray] | None = None  # the pose to show next
        self._next = -math.inf  # when
        self._stop: Stop | None = None

    @property
    def is_active(self) -> bool:
        """Whether a pull waits, held or released."""
        return self._stop is not None

    @property
    def has_pull(self) -> bool:
        """Whether a released pull waits."""
        return self._pull is not None

    @property
    def is_shown(self) -> bool:
        """Whether a pose of the stand-in is shown."""
        return self._shown is not None

    def begin(self, pull: Pull | None = None) -> None:
        """Wait, with a *pull* that was released."""
        self._pull = pull
        if self._stop is None:
            self._stop = self._surface.view.every(_POLL, self._tick)
            self._changed()

    def follow(
        self, point: SurfacePoint, to: FloatArray, radius: float, locality: float | None
    ) -> None:
        """Show the stand-in pulled like this, now or later; see `StandIn.pulled`."""
        self._wanted = partial(
            StandIn.pulled, vertex=point, to=to, radius=radius, locality=locality
        )
        self._update()

    def drop(self) -> None:
        """Wait no longer, give up the pull, and hide the stand-in."""
        self._pull = None
        self._end()
        self.hide()

    def hide(self) -> None:
        """Show the pose of the session again."""
        self._wanted = None
        if self._shown is not None:
            self._shown.release()
            self._shown = None
            self._surface.update()
            self._changed()

    def _tick(self) -> None:
        if not self._is_ready():
            if self.has_pull and not self.is_coming():
                self.drop()
            else:
                self._update()
            return
        pull, self._pull = self._pull, None
        self._end()
        try:
            self._go_on(pull)
        finally:
            if pull is not None:
                self.hide()

    def _update(self) -> None:
        stand_in, began = self.stand_in(), time.perf_counter()
        if stand_in is None:
            if self._shown is not None:
                self.hide()  # the preparation has failed, or its inputs have changed
        elif self._wanted is not None and began >= self._next:
            pose, self._wanted = self._wanted, None
            is_first, self._shown = self._shown is None, stand_in
            self._surface.draw(pose(stand_in))
            if is_first:
                self._changed()
            self._surface.view.render()  # at once: other pictures leave more time to the thread
            now = time.perf_counter()
            self._next = now + _PAUSE * (now - began)

    def _end(self) -> None:
        if self._stop is not None:
            self._stop()
            self._stop = None
            self._changed()
