"""How much a replay may do: a recording may come from anybody, and ask for years of work."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields

from vtk_segdeform.errors import ArgumentError, SessionError

LARGEST_FILE = 64 << 20  # bytes, some ten times what the events of the limit take


@dataclass(frozen=True)
class ReplayLimits:
    """How much a replay may do; more is refused, or ended, with a `SessionError`.

    Parameters
    ----------
    events : int
        Lines of the recording, and ticks of its timers.
    seconds : float
        From the first event to the last, by the clock.
    pixels : int
        Of a window, width times height.

    Raises
    ------
    ArgumentError
        If one is no number above 0.
    """

    events: int = 200_000
    seconds: float = 300.0
    pixels: int = 16_000_000

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
                raise ArgumentError(f"{field.name} must be a number above 0; got {value!r}")


class Clock:
    """Tells when a replay has taken too long.

    Parameters
    ----------
    seconds : float
        From now on.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._start = time.monotonic()

    def check(self) -> None:
        """Raise SessionError if the time is over."""
        if time.monotonic() - self._start > self._seconds:
            raise SessionError(
                f"the replay was stopped after {self._seconds:g} seconds, its limit; "
                "allow more seconds to see all of it"
            )

    def wait_while(self, busy: Callable[[], bool], tick: Callable[[], object]) -> None:
        """Have timers *tick* as long as it is *busy*; SessionError if the time is over."""
        while busy():
            self.check()
            tick()
            time.sleep(0.005)
