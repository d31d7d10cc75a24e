"""Work done in another thread, while the window goes on and can stop it.

    Job(view, lambda progress: fit_cages(mesh, regions, progress=progress), done=keep)

A timer of the view looks after the work: it hands the thread some time and tells whoever watches
how far the work is, also while the camera is dragged; and, when it has ended and the camera is
left alone, delivers what it returned or raises what it raised.  So all but *work* itself happens
in the thread of the window, and a failure reaches `View.on_failure`.

A VTK loop that waits for events keeps Python's lock; without the timer other threads would stand
still.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent import futures
from contextlib import ExitStack
from typing import Generic, TypeVar

from vtk_segdeform.errors import Cancelled
from vtk_segdeform.progress import Progress

from ..scene import View

T = TypeVar("T")

_log = logging.getLogger(__name__)

_PERIOD = 20  # milliseconds between two looks
_SHARE = 0.01  # seconds of each period that are the thread's, whatever else goes on
_NEWS = 0.1  # seconds, at least, between two times that watchers are told


class Job(Generic[T]):
    """A piece of work, begun at once.

    Parameters
    ----------
    view : View
        Its timer looks after the work, its listeners hear of a failure.
    work : callable
        ``work(progress)``, called in another thread; calls ``progress(fraction, text)`` now and
        then, which raises `Cancelled` once the job is to stop.
    done : callable
        ``done(result)``, called in the window's thread with what *work* returned.
    watch : callable, optional
        ``watch(job)``, called there as well when `fraction` or `text` changed, and when the job
        has ended, before *done*.

    Examples
    --------
    Where there is no event loop, `wait` does what the timer would.

    >>> from vtkmodules.vtkRenderingCore import vtkRenderer
    >>> from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor
    >>> view = View(vtkRenderer(), vtkGenericRenderWindowInteractor())
    >>> Job(view, lambda progress: 6 * 7, done=print).wait()
    42
    """

    def __init__(
        self,
        view: View,
        work: Callable[[Progress], T],
        *,
        done: Callable[[T], object],
        watch: Callable[[Job[T]], object] | None = None,
    ) -> None:
        self._done, self._watch = done, watch
        self._news = 0.0, ""
        self._told = self._news
        self._told_at = time.monotonic()
        self._stopping = self._ended = False
        thread = futures.ThreadPoolExecutor(1, "segdeform job")
        self._future = thread.submit(work, self._report)
        thread.shutdown(wait=False)  # the thread goes when the work is done
        self._stops = view.pulse(self._attend), view.every(_PERIOD, self._look)

    @property
    def fraction(self) -> float:
        """How much is done, 0..1."""
        return self._news[0]

    @property
    def text(self) -> str:
        """What is being done."""
        return self._news[1]

    @property
    def is_running(self) -> bool:
        """Whether the work has not been delivered yet."""
        return not self._ended

    @property
    def error(self) -> BaseException | None:
        """What the work raised, once the job has ended."""
        return self._future.exception() if self._ended else None

    @property
    def is_cancelled(self) -> bool:
        """Whether the job was asked to stop; until it does, it is still running."""
        return self._stopping

    def cancel(self) -> None:
        """Have the work stop at its next report; nothing is then delivered, nor raised."""
        self._stopping = True

    def wait(self) -> None:
        """Stand still until the work has ended, and deliver it.

        Raises
        ------
        Exception
            What the work raised; nothing if the job was cancelled.
        """
        if not self._ended:
            futures.wait([self._future])
            self._look()

    def _report(self, fraction: float, text: str) -> None:
        """Be the work's progress; in its thread."""
        if self._stopping:
            raise Cancelled("cancelled; nothing was changed")
        self._news = fraction, text

    def _attend(self) -> None:
        futures.wait([self._future], timeout=_SHARE)
        is_news = self._news != self._told and time.monotonic() - self._told_at > _NEWS
        if is_news and not self._ended:
            self._tell()

    def _look(self) -> None:
        if self._future.done():
            self._deliver()

    def _deliver(self) -> None:
        if self._ended:  # the timer fires once more while `done` waits for something
            return
        for stop in self._stops:
            stop()
        self._ended = True
        error = self._future.exception()
        self._stopping |= isinstance(error, Cancelled)
        with ExitStack() as told:  # the result is delivered even if a watcher raises
            told.callback(self._hand_over, error)
            self._tell()

    def _hand_over(self, error: BaseException | None) -> None:
        if not self._stopping:
            self._done(self._future.result())  # or raises what the work raised
        elif error is not None and not isinstance(error, Cancelled):
            _log.info("a cancelled job failed", exc_info=error)

    def _tell(self) -> None:
        self._told, self._told_at = self._news, time.monotonic()
        if self._watch is not None:
            self._watch(self)
