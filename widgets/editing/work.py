"""What the editor is busy with: one job at a time, and what it is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtk_segdeform.errors import SessionError
from vtk_segdeform.progress import Progress

from ..view import View
from .jobs import Job


class Work:
    """At most one job.

    Parameters
    ----------
    view : View
        Whose timer looks after jobs.
    watch : callable
        Called when a job got on, or has ended.
    """

    def __init__(self, view: View, watch: Callable[[], object]) -> None:
        self._view, self._watch = view, watch
        self._called, self._insists = "", False
        self.job: Job[Any] | None = None
        """The one that is running, if any."""

    @property
    def doing(self) -> str:
        """What it does, in words; "busy" before them if that was to be told with emphasis."""
        return "busy " * self._insists + self._called

    def start(
        self, doing: str, work: Callable[[Progress], Any], done: Callable[[Any], object]
    ) -> None:
        """Do *work* in another thread, and then *done*, in this one, with what it returned.

        Raises
        ------
        SessionError
            If there is another job.
        """
        if self.job is not None:
            raise SessionError(f"busy {self._called}; wait for it, or cancel it")
        self._called, self._insists = doing, False
        self.job = Job(self._view, work, done=done, watch=self._look)

    def wait(self) -> None:
        """Stand still until there is no job any more; for scripts."""
        while self.job is not None:
            self.job.wait()

    def insist(self) -> None:
        """Tell with emphasis that there is a job."""
        self._insists = True

    def _look(self, job: Job[Any]) -> None:
        if not job.is_running:
            self.job = None
        self._watch()
