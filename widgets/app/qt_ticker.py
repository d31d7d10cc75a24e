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

    def spare(self) -> Stop:
        """Do nothing: while Qt waits for events, other threads have the interpreter."""
        return lambda: None

    def guarded(self) -> AbstractContextManager[None]:
        """Leave exceptions to Qt."""
        return nullcontext()
