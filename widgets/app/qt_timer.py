"""A timer of Qt for background jobs."""

from __future__ import annotations

from typing import Any

from qtpy import QtCore

from ..editor import Job, Timer
from ..scene import Stop


def qt_timer(parent: Any, milliseconds: int) -> Timer:
    """Return a timer that polls a job every so many *milliseconds*.

    It stops when Qt deletes *parent*; the job then delivers nothing.
    """

    def start(job: Job[Any]) -> Stop:
        def poll() -> None:
            job.report()
            job.deliver()

        def stop() -> None:
            timer.stop()
            timer.timeout.disconnect()
            timer.deleteLater()

        timer = QtCore.QTimer(parent)
        timer.timeout.connect(poll)
        timer.start(milliseconds)
        return stop

    return start
