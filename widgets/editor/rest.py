"""What waits until the hand has rested, because it would hold up the next press."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..scene import Stop, View

_PERIOD = 100  # milliseconds between two checks


class Rest:
    """Calls *act* some time after `begin`, once nothing has happened for a while.

    Parameters
    ----------
    view : View
        Provides the timer.
    seconds : float
        For how long nothing must have happened.
    is_free : callable
        Returns whether nothing happens at present.
    act : callable
        Returns whether it is too early; then it is called again at the next check.
    """

    def __init__(
        self,
        view: View,
        seconds: float,
        is_free: Callable[[], bool],
        act: Callable[[], object],
    ) -> None:
        self._view, self._seconds, self._is_free, self._act = view, seconds, is_free, act
        self._since = 0.0
        self._stop_checking: Stop | None = None

    @property
    def is_pending(self) -> bool:
        """Whether *act* will be called."""
        return self._stop_checking is not None

    def begin(self) -> None:
        """Wait, from now on."""
        self._since = time.monotonic()
        if self._stop_checking is None:
            self._stop_checking = self._view.every(_PERIOD, self._check)

    def stop(self) -> None:
        """Wait no longer, and do not act."""
        if self._stop_checking is not None:
            self._stop_checking()
            self._stop_checking = None

    def _check(self) -> None:
        if not self._is_free():
            self._since = time.monotonic()
        if time.monotonic() - self._since >= self._seconds and not self._act():
            self.stop()
