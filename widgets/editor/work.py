"""What the editor is busy with: one job at a time, what it is called, and how it ended."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from vtk_segdeform.errors import SessionError
from vtk_segdeform.progress import Progress

from ..scene import View
from .jobs import Job
from .log import Log
from .voice import Voice, words_of


class Work:
    """At most one job.

    Parameters
    ----------
    view : View
        Whose timer looks after jobs.
    voice : Voice
        What says how one ended.
    log : Log
        Where that is written down.
    watch : callable
        Called when a job got on, or has ended.
    """

    def __init__(self, view: View, voice: Voice, log: Log, watch: Callable[[], object]) -> None:
        self._view, self._voice, self._log, self._watch = view, voice, log, watch
        self._began = 0.0
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
        self._called, self._insists, self._began = doing, False, time.monotonic()
        self.job = Job(
            self._view, work, done=lambda result: self._deliver(done, result), watch=self._look
        )

    def wait(self) -> None:
        """Stand still until there is no job any more; for scripts."""
        while self.job is not None:
            self.job.wait()

    def cancel(self) -> None:
        """Ask the job to stop, if there is one."""
        if self.job is not None:
            self.job.cancel()

    def insist(self) -> None:
        """Tell with emphasis that there is a job."""
        self._insists = True

    def _look(self, job: Job[Any]) -> None:
        if not job.is_running:
            self.job = None
            if job.is_cancelled:
                self._write("cancelled")
            elif job.error is not None:
                self._write(words_of(job.error))
        self._watch()

    def _deliver(self, done: Callable[[Any], object], result: Any) -> None:
        before, how = self._voice.noted, "failed"
        try:
            done(result)
            how = self._voice.noted if self._voice.noted != before else "done"
        finally:
            self._write(how)

    def _write(self, how: str) -> None:
        self._log.add_job(self._called, time.monotonic() - self._began, how)
