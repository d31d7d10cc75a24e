"""The timers of an interactor without an event loop, fired by asyncio.

A vtkGenericRenderWindowInteractor announces each timer by ``CreateTimerEvent`` and
``DestroyTimerEvent``, and expects its host to fire it.  Nothing is scheduled while no timer runs.

Input comes first: while it arrives, repeating timers wait, though not for long.  A timer that
refines a pose would otherwise take as much time as solving for the moves of a drag.
"""

from __future__ import annotations

import asyncio
import math
from functools import partial
from typing import Any

_ONE_SHOT = 1  # type of a timer, as vtkRenderWindowInteractor numbers them
_LONGEST_WAIT = 1.0  # seconds that input may delay a timer, after its last tick


class Timers:
    """Fires all timers that *interactor* creates from now on, between `start` and `stop`."""

    def __init__(self, interactor: Any) -> None:
        self._interactor = interactor
        self._loop: asyncio.AbstractEventLoop | None = None
        self._periods: dict[int, tuple[float, bool]] = {}  # seconds, and whether it repeats
        self._handles: dict[int, asyncio.TimerHandle] = {}
        self._begun: dict[int, float] = {}  # when the period of each began, in the loop's time
        self._tags = [
            interactor.AddObserver("CreateTimerEvent", self._created),
            interactor.AddObserver("DestroyTimerEvent", self._destroyed),
        ]

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Fire timers in *loop* from now on."""
        self._loop = loop
        for timer in self._periods:
            self._schedule(timer)

    def postpone(self, pause: float = math.inf) -> None:
        """Let repeating timers wait for input: for their period, or *pause* seconds if less.

        Repeated calls cannot hold a timer back forever; see `_LONGEST_WAIT`.
        """
        for timer, handle in self._handles.items():
            seconds, is_repeating = self._periods[timer]
            if self._loop is not None and is_repeating:
                latest = self._begun[timer] + max(seconds, _LONGEST_WAIT)
                when = min(self._loop.time() + min(seconds, pause), latest)
                if when > handle.when():
                    handle.cancel()
                    self._handles[timer] = self._loop.call_at(when, partial(self._fire, timer))

    def stop(self) -> None:
        """Fire no timer any more."""
        for tag in self._tags:
            self._interactor.RemoveObserver(tag)
        for handle in self._handles.values():
            handle.cancel()
        self._tags, self._handles, self._periods, self._begun = [], {}, {}, {}

    def _created(self, *_: object) -> None:
        interactor = self._interactor
        seconds = interactor.GetTimerEventDuration() / 1000.0
        is_repeating = interactor.GetTimerEventType() != _ONE_SHOT
        timer = interactor.GetTimerEventPlatformId()
        self._periods[timer] = seconds, is_repeating
        self._schedule(timer)

    def _destroyed(self, *_: object) -> None:
        self._forget(self._interactor.GetTimerEventPlatformId())

    def _forget(self, timer: int) -> None:
        self._periods.pop(timer, None)
        self._begun.pop(timer, None)
        handle = self._handles.pop(timer, None)
        if handle is not None:
            handle.cancel()

    def _schedule(self, timer: int) -> None:
        if self._loop is not None:
            if timer in self._handles:
                self._handles[timer].cancel()
            seconds, _ = self._periods[timer]
            self._begun[timer] = now = self._loop.time()
            self._handles[timer] = self._loop.call_at(now + seconds, partial(self._fire, timer))

    def _fire(self, timer: int) -> None:
        assert self._loop is not None
        _, is_repeating = self._periods[timer]
        if is_repeating:
            self._schedule(timer)  # first: the observers may destroy it
        else:
            self._forget(timer)
        self._interactor.InvokeEvent("TimerEvent")
