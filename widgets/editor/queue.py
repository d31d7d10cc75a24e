"""Everything that a window does in the background, or later: one queue.

Of the tasks that may begin, the one of the first kind begins first:

    JOB       an action of the user; begins at once, and the widgets are off meanwhile
    DOCUMENT  reading or repairing a file, in a program with documents
    AUTOSAVE  writing unsaved work: `autosaver`
    SAVE      saving a pose once it has settled
    SETTLE    the end of a pose that converges after its release
    PREPARE   what the first pull needs: `preparing`
    FINISH    a pose on the mesh itself, once the hand has rested: `finishing`
    CHECK     reading a written mesh again
    LOAD      loading kernels, once the hand has rested

PREPARE, FINISH and CHECK share one worker: each begins once the thread of the last one has ended,
even if that was cancelled.  Everything but the work itself happens in the window's thread, and no
result is delivered while the hand is active.
"""

from __future__ import annotations

import enum
import logging
import time
from bisect import insort
from collections.abc import Callable
from concurrent import futures
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from typing import Any, Protocol

from vtk_segdeform.errors import Cancelled, SessionError
from vtk_segdeform.kernels import quick_turns
from vtk_segdeform.progress import Progress

from ..scene import Stop

_PERIOD = 20  # milliseconds between two checks while a thread runs
_WAITING_PERIOD = 100  # and while there is none: all timers of a view have the shortest period
_SHARE = 0.01  # seconds of each tick in which the window's thread waits for the worker
_REPORT_INTERVAL = 0.25  # seconds, at least, between two reports of progress
_STEP = 0.05  # the fraction that is shown is a multiple of this: each change draws the view
_SHOWN_AFTER = 0.5  # seconds; a pose often settles sooner
_log = logging.getLogger(__name__)

Work = Callable[[Progress], Any]


class Kind(enum.IntEnum):
    """What a task is for, in the order in which tasks begin."""

    JOB = 0
    DOCUMENT = 1
    AUTOSAVE = 2
    SAVE = 3
    SETTLE = 4
    PREPARE = 5
    FINISH = 6
    CHECK = 7
    LOAD = 8


_BY_THE_WORKER = Kind.PREPARE, Kind.FINISH, Kind.CHECK
_JOINED = Kind.JOB, Kind.AUTOSAVE  # when cancelled, they remain until their thread has ended


class Ticker(Protocol):
    """The timers that a queue needs: those of a `View`, or of a toolkit."""

    def every(self, milliseconds: int, callback: Callable[[], None]) -> Stop:
        """Call *callback* repeatedly, until stopped."""

    def spare(self) -> Stop:
        """Leave most of the time to another thread, until stopped."""

    def guarded(self) -> AbstractContextManager[None]:
        """Report exceptions that are raised inside."""


@dataclass(eq=False, kw_only=True)
class Task:
    """Something to do, now or later.

    Parameters
    ----------
    kind : Kind
        What it is for.
    begin : callable
        ``begin()``, called once it begins, may do it, or return the work for another thread:
        ``work(progress)`` calls ``progress(fraction, text)`` now and then, which raises `Cancelled`
        once the task is cancelled.
    done : callable
        ``done(result)``, called in the window's thread with the return value of the work.
    failed : callable, optional
        ``failed(error)``, called there with an error of the work.  Without it the error is raised:
        by `Queue.wait`, or else into the timer of the window.
    name : str
        For the status line: "Fitting cages".
    may_begin, may_end : callable
        Whether it may begin now, and whether its result may be delivered.
    rest : float
        Seconds for which it must have been allowed to begin.
    """

    kind: Kind
    begin: Callable[[], Work | None]
    done: Callable[[Any], object] = lambda _: None
    failed: Callable[[BaseException], object] | None = None
    name: str = ""
    may_begin: Callable[[], bool] = lambda: True
    may_end: Callable[[], bool] = lambda: True
    rest: float = 0.0
    since: float = field(default=0.0, init=False)
    future: futures.Future[Any] | None = field(default=None, init=False)
    """The result of its thread, once that has begun."""
    _shared: _Shared = field(init=False)

    def __post_init__(self) -> None:
        self._shared = _Shared()

    @property
    def fraction(self) -> float:
        """Completed fraction of the work, 0..1."""
        return self._shared.progress[0]

    @property
    def text(self) -> str:
        """Current step of the work."""
        return self._shared.progress[1]

    @property
    def is_cancelled(self) -> bool:
        """Whether it was cancelled; its thread may still run."""
        return self._shared.is_cancelled

    @property
    def is_working(self) -> bool:
        """Whether its thread is running."""
        return self.future is not None and not self.future.done()

    def run(self, work: Work) -> None:
        """Begin *work* in another thread."""
        thread = futures.ThreadPoolExecutor(1, "segdeform job")
        self.future = thread.submit(quick_turns()(work), self._shared.report)
        thread.shutdown(wait=False)  # the thread ends with the work

    def cancel(self) -> None:
        """Stop the work at its next progress report; no result and no error is delivered."""
        self._shared.is_cancelled = True

    def hand_over(self) -> None:
        """Pass on the result or the error of the thread, which has ended."""
        assert self.future is not None
        error = self.future.exception()
        if self.is_cancelled or isinstance(error, Cancelled):
            if error is not None and not isinstance(error, Cancelled):
                _log.info("a cancelled job failed", exc_info=error)
        elif error is not None and self.failed is not None:
            self.failed(error)
        else:
            self.done(self.future.result())  # or raise the error of the work


class _Shared:
    """State shared by both threads; no widget may be garbage-collected in the worker's thread."""

    def __init__(self) -> None:
        self.progress = 0.0, ""
        self.is_cancelled = False

    def report(self, fraction: float, text: str) -> None:
        """Record the progress of the work, or stop it if the task was cancelled."""
        if self.is_cancelled:
            raise Cancelled("Cancelled. Nothing was changed")
        self.progress = fraction, text


class Queue:
    """The tasks of a window that are running, or waiting.

    Parameters
    ----------
    ticker : Ticker
        Provides the timers: usually a `View`.  A VTK event loop holds Python's lock while it waits
        for events, so each tick waits a moment for the worker, and pictures leave it most of the
        time.
    changed : callable
        Called when a task has begun, made progress or ended.
    """

    def __init__(self, ticker: Ticker, changed: Callable[[], object]) -> None:
        self._ticker, self._tell = ticker, changed
        self._tasks: list[Task] = []
        self._cancelled: list[Task] = []  # whose threads may still run
        self._period = 0  # of the timer, 0 if there is none
        self._stop_ticking: Stop | None = None
        self._stop_sparing: Stop | None = None
        self._told: list[object] = []  # the progress
        self._told_at = 0.0
        self._has_refused = False

    # What is running, and what comes next.

    def task(self, kind: Kind) -> Task | None:
        """Return the first task of a kind; None if there is none."""
        return next((task for task in self._tasks if task.kind is kind), None)

    def fraction(self, kind: Kind) -> float | None:
        """Return the completed fraction of the running task of a kind, 0..1, coarsely, or None."""
        task = self.task(kind)
        if task is None or task.future is None:
            return None
        return _STEP * int(task.fraction / _STEP)

    @property
    def job(self) -> Task | None:
        """The running action of the user, if any."""
        task = self.task(Kind.JOB)
        return None if task is None or task.future is None else task

    @property
    def text(self) -> str:
        """Name and current step of `job`, after "Busy" if an action was refused meanwhile."""
        if self.job is None:
            return ""
        name = f"Busy. {self.job.name}" if self._has_refused else self.job.name
        return ": ".join(filter(None, (name, self.job.text)))

    @property
    def aside(self) -> tuple[str, float | None]:
        """What runs beside the work of the hand, for the status line, and its fraction."""
        preparing, settling = self.fraction(Kind.PREPARE), self.task(Kind.SETTLE)
        if preparing is not None and preparing < 1.0:  # else it is not accepted yet
            return "Preparing", preparing
        if settling is not None and time.monotonic() >= settling.since + _SHOWN_AFTER:
            return "Saving" if self.task(Kind.SAVE) else "Settling", 0.0
        return "Finishing", self.fraction(Kind.FINISH)

    @property
    def refusal(self) -> str:
        """Why an action is refused while a job is running."""
        return f"Busy. {self.job.name if self.job else ''}: wait, or press Esc to cancel"

    def refuse(self) -> None:
        """Say that the job must end, or be cancelled, before anything else; see `text`."""
        self._has_refused = True
        self._changed()

    # Changes.

    def add(self, task: Task) -> None:
        """Begin a task, now or later.

        Raises
        ------
        SessionError
            If it is a job, and another one is running.
        """
        if task.kind is Kind.JOB:
            if self.job is not None:
                raise SessionError(self.refusal)
            self._has_refused = False
        task.since = time.monotonic()
        insort(self._tasks, task, key=lambda each: each.kind)
        self._advance()

    def hurry(self, kind: Kind) -> None:
        """Begin all waiting tasks of a kind now; an error in one is passed to the view."""
        for task in [each for each in self._tasks if each.kind is kind and each.future is None]:
            with self._ticker.guarded():
                self._begin(task)

    def delay(self, kind: Kind) -> None:
        """Restart the waiting time of the tasks of a kind."""
        for task in self._tasks:
            if task.kind is kind:
                task.since = time.monotonic()

    def cancel(self, *kinds: Kind) -> bool:
        """Drop the tasks of some *kinds*; return whether one was running.

        Nothing of them is called any more, and nobody waits for their threads, except that a job
        and an autosave end when their thread does.
        """
        dropped = [task for task in self._tasks if task.kind in kinds]
        for task in dropped:
            task.cancel()
            if task.future is None or task.kind not in _JOINED:
                self._tasks.remove(task)
                self._cancelled.append(task)
        was_running = any(task.future is not None for task in dropped)
        if dropped:
            self._adjust()
        if was_running:
            self._changed()
        return was_running

    def wait(self, kind: Kind) -> None:
        """Begin the tasks of a kind now, and block until none is left, or a result is not due.

        Raises
        ------
        Exception
            The error of the work, unless the task was cancelled or *failed* was given.
        """
        self.hurry(kind)
        while (task := self.task(kind)) is not None and task.future is not None:
            futures.wait([task.future])
            self._deliver(task)
            if task in self._tasks:
                return

    def stop(self) -> None:
        """Drop everything."""
        self.cancel(*Kind)
        for kind in _JOINED:
            self.wait(kind)

    def _tick(self) -> None:
        """Report progress, deliver what has ended, and begin what may begin."""
        futures.wait([task.future for task in self._computing if task.future], timeout=_SHARE)
        with self._ticker.guarded():
            self._report()
        for task in list(self._tasks):
            with self._ticker.guarded():
                self._deliver(task)
        self._advance()

    def _advance(self) -> None:
        now = time.monotonic()
        for task in [each for each in self._tasks if each.future is None]:
            if task not in self._tasks:
                continue  # cancelled by another one
            if not task.may_begin():
                if task.rest:
                    task.since = now
            elif now - task.since >= task.rest and not self._is_taken(task.kind):
                self._begin(task)
        self._adjust()

    def _is_taken(self, kind: Kind) -> bool:
        """Return whether the worker, if a task of this *kind* needs it, is working."""
        self._cancelled = [task for task in self._cancelled if task.is_working]
        threads = (*self._tasks, *self._cancelled)
        is_working = any(task.is_working and task.kind in _BY_THE_WORKER for task in threads)
        return kind in _BY_THE_WORKER and is_working

    def _begin(self, task: Task) -> None:
        self._tasks.remove(task)
        work = task.begin()
        if work is not None:
            insort(self._tasks, task, key=lambda each: each.kind)
            task.run(work)
            self._changed()
        self._adjust()

    def _deliver(self, task: Task) -> None:
        """Deliver the result or the error of a task whose thread has ended, if it is due."""
        if task not in self._tasks or task.future is None or task.is_working:
            return
        if not (task.is_cancelled or task.future.exception()) and not task.may_end():
            return
        self._tasks.remove(task)
        self._adjust()
        with ExitStack() as last:  # the result is delivered even if `changed` raises
            last.callback(task.hand_over)
            self._changed()

    @property
    def _computing(self) -> list[Task]:
        """The tasks with threads that compute; writing a file leaves the window its time."""
        return [task for task in self._tasks if task.is_working and task.kind is not Kind.AUTOSAVE]

    def _changed(self) -> None:
        self._told, self._told_at = self._progress(), time.monotonic()
        self._tell()

    def _progress(self) -> list[object]:
        return [(self.fraction(task.kind), task.text) for task in self._computing]

    def _report(self) -> None:
        if time.monotonic() >= self._told_at + _REPORT_INTERVAL and self._progress() != self._told:
            self._changed()

    def _adjust(self) -> None:
        """Run a timer while there are tasks, and leave time to threads that compute."""
        runs = any(task.future for task in self._tasks)
        period = _PERIOD if runs else _WAITING_PERIOD if self._tasks else 0
        if period != self._period:
            if self._stop_ticking is not None:
                self._stop_ticking()
            self._period = period
            self._stop_ticking = self._ticker.every(period, self._tick) if period else None
        if self._computing and self._stop_sparing is None:
            self._stop_sparing = self._ticker.spare()
        elif not self._computing and self._stop_sparing is not None:
            self._stop_sparing()
            self._stop_sparing = None
