"""Limits of a replay, as an untrusted recording could otherwise run for years."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields

from vtk_segdeform.arrays import is_number
from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError, SessionError

LARGEST_FILE = 64 << 20  # bytes, about ten times the default number of events


@dataclass(frozen=True)
class ReplayLimits:
    """Largest number of events, time and window size of a replay.

    A replay that exceeds them is refused or stopped with a `SessionError`.

    Parameters
    ----------
    events : int
        Lines of the recording plus timer ticks.
    seconds : float
        Wall-clock time from the first event to the last.
    pixels : int
        Width times height of the window.

    Raises
    ------
    ArgumentError
        If a limit is not a positive number.
    """

    events: int = 200_000
    seconds: float = 300.0
    pixels: int = 16_000_000

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (is_number(value) and value > 0):
                raise ArgumentError(f"{field.name} must be a positive number; got {shown(value)}")


class Clock:
    """Measures the time of a replay.

    Parameters
    ----------
    seconds : float
        Time limit, counted from now.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._start = time.monotonic()

    def check(self) -> None:
        """Raise SessionError if the time limit is exceeded."""
        if time.monotonic() - self._start > self._seconds:
            raise SessionError(
                f"the replay was stopped at its limit of {self._seconds:g} seconds; raise it to "
                "replay the whole recording"
            )

    def wait_while(self, busy: Callable[[], bool], tick: Callable[[], object]) -> None:
        """Call *tick* until no longer *busy*; SessionError if the time limit is exceeded."""
        while busy():
            self.check()
            tick()
            time.sleep(0.005)
