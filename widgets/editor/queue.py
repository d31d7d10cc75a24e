"""Everything that an editor does in the background, or later: one queue.

Of the tasks that may begin, the one of the first kind begins first:

    JOB       an action of the user; begins at once, and the widgets are off meanwhile
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
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from vtk_segdeform.errors import SessionError
from vtk_segdeform.progress import Progress

from ..scene import Stop, View
from .job import Job, view_timer

_PERIOD = 100  # milliseconds between two checks of what may begin
_STEP = 0.05  # the fraction that is shown is a multiple of this: each change draws the view
_SHOWN_AFTER = 0.5  # seconds; a pose often settles sooner

Work = Callable[[Progress], Any]


class Kind(enum.IntEnum):
    """What a task is for, in the order in which tasks begin."""

    JOB = 0
    SAVE = 1
    SETTLE = 2
    PREPARE = 3
    FINISH = 4
    CHECK = 5
    LOAD = 6


_BY_THE_WORKER = Kind.PREPARE, Kind.FINISH, Kind.CHECK


def _always() -> bool:
    return True


@dataclass(eq=False, kw_only=True)
class Task:
    """Something to do, now or later.

    Parameters
    ----------
    kind : Kind
        What it is for.
    begin : callable
        ``begin()``, called once it begins, may do it, or return the work for another thread.
    done, failed : callable, optional
        As those of a `Job`, for the work.
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
    may_begin: Callable[[], bool] = _always
    may_end: Callable[[], bool] = _always
    rest: float = 0.0
    job: Job[Any] | None = field(default=None, init=False)
    """The thread, once it has begun."""
    since: float = field(default=0.0, init=False)
    fraction: float = field(default=0.0, init=False)


class Queue:
    """The tasks of an editor that are running, or waiting.

    Parameters
    ----------
    view : View
        Provides the timers.
    changed : callable
        Called when one has begun, made progress or ended.
    """

    def __init__(self, view: View, changed: Callable[[], object]) -> None:
        self._view, self._changed = view, changed
        self._tasks: list[Task] = []
        self._cancelled: list[Job[Any]] = []  # whose threads may still run
        self._stop_checking: Stop | None = None
        self._has_refused = False

    # What is running, and what comes next.

    def task(self, kind: Kind) -> Task | None:
        """Return the first task of a kind; None if there is none."""
        return next((task for task in self._tasks if task.kind is kind), None)

    def fraction(self, kind: Kind) -> float | None:
        """Return the completed fraction of the running task of a kind, 0..1, coarsely, or None."""
        task = self.task(kind)
        return None if task is None or task.job is None else task.fraction

    @property
    def job(self) -> Job[Any] | None:
        """The running action of the user, if any."""
        task = self.task(Kind.JOB)
        return None if task is None else task.job

    @property
    def text(self) -> str:
        """Name and current step of `job`, after "Busy" if an action was refused meanwhile."""
        task = self.task(Kind.JOB)
        if task is None or task.job is None:
            return ""
        name = f"Busy. {task.name}" if self._has_refused else task.name
        return ": ".join(filter(None, (name, task.job.text)))

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
        task = self.task(Kind.JOB)
        return f"Busy. {task.name if task else ''}: wait, or press Esc to cancel"

    def refuse(self) -> None:
        """Mark the job as the reason why an action was refused; see `text`."""
        self._has_refused = True

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
        self._tasks.append(task)
        self._tasks.sort(key=lambda each: each.kind)
        self._advance()

    def hurry(self, kind: Kind) -> None:
        """Begin all waiting tasks of a kind now; an error in one is passed to the view."""
        for task in [each for each in self._tasks if each.kind is kind and each.job is None]:
            with self._view.guarded():
                self._begin(task)

    def delay(self, kind: Kind) -> None:
        """Restart the waiting time of the tasks of a kind."""
        for task in self._tasks:
            if task.kind is kind:
                task.since = time.monotonic()

    def cancel(self, *kinds: Kind) -> bool:
        """Drop the tasks of some *kinds*; return whether one was running.

        Nothing of them is called any more, except that a job ends when its thread does.
        """
        was_running = False
        for task in [each for each in self._tasks if each.kind in kinds]:
            was_running |= task.job is not None
            if task.job is not None and task.kind is Kind.JOB:
                task.job.cancel()
                continue
            self._tasks.remove(task)
            if task.job is not None:
                task.job.abandon()
                self._cancelled.append(task.job)
        if was_running:
            self._changed()
        return was_running

    def wait(self, kind: Kind) -> None:
        """Block until no task of a kind is left, or its result is not due."""
        self.hurry(kind)
        while (task := self.task(kind)) is not None and task.job is not None:
            task.job.wait()
            if task.job.is_running:
                return

    def stop(self) -> None:
        """Drop everything."""
        self.cancel(*Kind)
        self.wait(Kind.JOB)
        self._stop_timer()

    def _advance(self) -> None:
        """Begin what may begin."""
        now = time.monotonic()
        for task in [each for each in self._tasks if each.job is None]:
            if task not in self._tasks:
                continue  # cancelled by another one
            if not task.may_begin():
                if task.rest:
                    task.since = now
            elif now - task.since >= task.rest and not self._is_taken(task.kind):
                self._begin(task)
        if all(task.job is not None for task in self._tasks):
            self._stop_timer()
        elif self._stop_checking is None:
            self._stop_checking = self._view.every(_PERIOD, self._advance)

    def _is_taken(self, kind: Kind) -> bool:
        """Return whether the worker, if a task of this *kind* needs it, is working."""
        self._cancelled = [job for job in self._cancelled if job.is_working]
        running = [task.job for task in self._tasks if task.job and task.kind in _BY_THE_WORKER]
        return kind in _BY_THE_WORKER and any(job.is_working for job in running + self._cancelled)

    def _begin(self, task: Task) -> None:
        self._tasks.remove(task)
        work = task.begin()
        if work is None:
            return
        self._tasks.append(task)
        self._tasks.sort(key=lambda each: each.kind)
        task.job = Job(
            view_timer(self._view),
            work,
            done=task.done,
            failed=task.failed,
            watch=partial(self._watch, task),
            is_due=task.may_end,
        )
        self._changed()

    def _watch(self, task: Task, job: Job[Any]) -> None:
        before, task.fraction = task.fraction, _STEP * int(job.fraction / _STEP)
        if not job.is_running and task in self._tasks:
            self._tasks.remove(task)
        if task.kind is Kind.JOB or not job.is_running or task.fraction != before:
            self._changed()

    def _stop_timer(self) -> None:
        if self._stop_checking is not None:
            self._stop_checking()
            self._stop_checking = None
