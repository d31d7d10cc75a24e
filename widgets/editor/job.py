"""Background work with progress and cancellation, while the window stays responsive.

    Job(view_timer(view), lambda progress: fit_cages(mesh, regions, progress=progress), done=show)

The work runs in another thread.  A timer of the window reports its progress and, once it has
ended, delivers its result or its error.  Everything except the work itself therefore happens in
the window's thread.  A `queue` decides which jobs of an editor run.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent import futures
from contextlib import ExitStack
from typing import Any, Generic, TypeVar

from vtk_segdeform.errors import Cancelled
from vtk_segdeform.kernels import quick_turns
from vtk_segdeform.progress import Progress

from ..scene import Stop, View

T = TypeVar("T")

Timer = Callable[["Job[Any]"], Stop]
"""``timer(job)`` calls `Job.report` and `Job.deliver` repeatedly until it is stopped."""

_log = logging.getLogger(__name__)

_PERIOD = 20  # milliseconds between two polls of a view's timer
_SHARE = 0.01  # seconds of each period in which the window's thread waits for the worker
_REPORT_INTERVAL = 0.25  # seconds, at least, between two reports of progress


def view_timer(view: View) -> Timer:
    """Return the timer of a *view*; an error in a job reaches `View.on_failure`.

    A VTK event loop holds Python's lock while it waits for events, so each tick waits a moment
    for the worker, and pictures leave it most of the time.
    """

    def start(job: Job[Any]) -> Stop:
        def tick() -> None:
            try:
                job.report(_SHARE)
            finally:
                job.deliver()

        stops = view.every(_PERIOD, tick), view.spare()

        def stop() -> None:
            for each in stops:
                each()

        return stop

    return start


class Job(Generic[T]):
    """A function that runs in another thread; it starts at once.

    Parameters
    ----------
    timer : callable
        Polls the job in the window's thread: `view_timer`, or a timer of another toolkit.
    work : callable
        ``work(progress)``, called in the other thread.  It calls ``progress(fraction, text)`` now
        and then, which raises `Cancelled` once the job is cancelled.
    done : callable
        ``done(result)``, called in the window's thread with the return value of *work*.
    failed : callable, optional
        ``failed(error)``, called there with an error of *work*.  Without it `deliver` and `wait`
        raise the error.
    watch : callable, optional
        ``watch(job)``, called there when `fraction` or `text` has changed, and once the job has
        ended, before *done* and *failed*.
    is_due : callable, optional
        ``is_due()``, called there: whether a result may be delivered now; by default always.

    Examples
    --------
    Without an event loop, `wait` does the work of the timer.

    >>> from vtkmodules.vtkRenderingCore import vtkRenderer
    >>> from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor
    >>> view = View(vtkRenderer(), vtkGenericRenderWindowInteractor())
    >>> Job(view_timer(view), lambda progress: 6 * 7, done=print).wait()
    42
    """

    def __init__(
        self,
        timer: Timer,
        work: Callable[[Progress], T],
        *,
        done: Callable[[T], object],
        failed: Callable[[BaseException], object] | None = None,
        watch: Callable[[Job[T]], object] | None = None,
        is_due: Callable[[], bool] | None = None,
    ) -> None:
        self._done, self._failed, self._watch, self._is_due = done, failed, watch, is_due
        self._shared = _Shared()
        self._reported = self._shared.progress
        self._reported_at = time.monotonic()
        self._ended = False
        thread = futures.ThreadPoolExecutor(1, "segdeform job")
        self._future = thread.submit(quick_turns()(work), self._shared.report)
        thread.shutdown(wait=False)  # the thread ends with the work
        self._stop = timer(self)

    @property
    def fraction(self) -> float:
        """Completed fraction of the work, 0..1."""
        return self._shared.progress[0]

    @property
    def text(self) -> str:
        """Current step of the work."""
        return self._shared.progress[1]

    @property
    def is_running(self) -> bool:
        """Whether the result has not been delivered yet."""
        return not self._ended

    @property
    def is_working(self) -> bool:
        """Whether the thread has not ended yet."""
        return not self._future.done()

    @property
    def error(self) -> BaseException | None:
        """The error that the work raised, once the job has ended."""
        return self._future.exception() if self._ended else None

    @property
    def is_cancelled(self) -> bool:
        """Whether the job was cancelled; it may still be running."""
        return self._shared.is_cancelled

    def cancel(self) -> None:
        """Stop the work at its next progress report; no result and no error is delivered."""
        self._shared.is_cancelled = True

    def abandon(self) -> None:
        """Cancel without waiting: nothing is called any more, not even *watch*."""
        self.cancel()
        if not self._ended:
            self._ended = True
            self._stop()

    def wait(self) -> None:
        """Block until the work has ended, and deliver it if it is due.

        Raises
        ------
        Exception
            The error of the work, unless the job was cancelled or *failed* was given.
        """
        if not self._ended:
            futures.wait([self._future])
            self.deliver()

    def report(self, wait: float = 0.0) -> None:
        """Report progress if there is any; first give the worker *wait* seconds."""
        futures.wait([self._future], timeout=wait)
        changed = self._shared.progress != self._reported
        if changed and not self._ended and self._seconds_since_report() > _REPORT_INTERVAL:
            self._call_watch()

    def deliver(self) -> None:
        """Deliver the result or the error if the work has ended."""
        # The timer fires once more while `done` runs an event loop of its own.
        if self._ended or not self._future.done() or not self._may_deliver():
            return
        self._stop()
        self._ended = True
        error = self._future.exception()
        if isinstance(error, Cancelled):
            self._shared.is_cancelled = True
        with ExitStack() as last:  # the result is delivered even if `watch` raises
            last.callback(self._hand_over, error)
            self._call_watch()

    def _hand_over(self, error: BaseException | None) -> None:
        if self.is_cancelled:
            if error is not None and not isinstance(error, Cancelled):
                _log.info("a cancelled job failed", exc_info=error)
        elif error is not None and self._failed is not None:
            self._failed(error)
        else:
            self._done(self._future.result())  # or raise the error of the work

    def _may_deliver(self) -> bool:
        is_result = not self.is_cancelled and self._future.exception() is None
        return not is_result or self._is_due is None or self._is_due()

    def _seconds_since_report(self) -> float:
        return time.monotonic() - self._reported_at

    def _call_watch(self) -> None:
        self._reported, self._reported_at = self._shared.progress, time.monotonic()
        if self._watch is not None:
            self._watch(self)


class _Shared:
    """State shared by both threads; no widget may be garbage-collected in the worker's thread."""

    def __init__(self) -> None:
        self.progress = 0.0, ""
        self.is_cancelled = False

    def report(self, fraction: float, text: str) -> None:
        """Record the progress of the work, or stop it if the job was cancelled."""
        if self.is_cancelled:
            raise Cancelled("Cancelled. Nothing was changed")
        self.progress = fraction, text
