"""The timers of Qt, for a queue beside those of the views."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from qtpy import QtCore

from ..scene import Stop


class QtTicker:
    """A `Ticker` that stops when Qt deletes *parent*, a QObject."""

    def __init__(self, parent: Any) -> None:
        self._parent = parent

    def every(self, milliseconds: int, callback: Callable[[], None]) -> Stop:
        """Call *callback* repeatedly, until stopped."""

        def stop() -> None:
            timer.stop()
            timer.timeout.disconnect()
            timer.deleteLater()

        timer = QtCore.QTimer(self._parent)
        timer.timeout.connect(callback)
        timer.start(milliseconds)
        return stop

    def pulse(self, callback: Callable[[], None]) -> Stop:  # noqa: ARG002 - nothing is withheld
        """Do nothing: `every` is enough, and Qt leaves other threads the interpreter."""
        return lambda: None

    def spare(self) -> Stop:
        """Do nothing, as `pulse`."""
        return lambda: None

    def guarded(self) -> AbstractContextManager[None]:
        """Leave exceptions to Qt."""
        return nullcontext()
