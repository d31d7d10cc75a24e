"""A document read in another thread, while the window says so and goes on."""

from __future__ import annotations

from concurrent import futures
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.errors import Cancelled

from .autosave import Slot
from .documents import Opened, Reader, words

Qt = QtCore.Qt
_PERIOD = 30  # milliseconds between two looks


@dataclass(frozen=True)
class Request:
    """What is to be opened."""

    name: str
    """For people."""
    reader: Reader
    """``reader(progress)`` reads it, in another thread."""
    path: Path | None = None
    """The file, if it is one that somebody chose."""
    slot: Slot | None = None
    """Where it is kept, if it is unsaved work."""


class Opening(QtCore.QObject):
    """One document on its way.

    Parameters
    ----------
    request : Request
        Which.
    parent : QObject
        The window.
    """

    opened = QtCore.Signal(object, object)
    """It is there: the request, and (document, session)."""
    failed = QtCore.Signal(object, str)
    """It is not: the request, and why, in words."""
    got_on = QtCore.Signal(float, str)
    """How much is done, 0..1, and what is being done."""

    def __init__(self, request: Request, parent: Any) -> None:
        super().__init__(parent)
        self.request = request
        self._work = _Work()
        thread = futures.ThreadPoolExecutor(1, "segdeform opening")
        self._future: futures.Future[Opened] = thread.submit(request.reader, self._work.report)
        thread.shutdown(wait=False)
        self._timer = QtCore.QTimer(self)
        self._timer.timeout.connect(self._look)
        self._timer.start(_PERIOD)

    def cancel(self) -> None:
        """Want it no more; the thread ends when it notices, and is not waited for."""
        self._work.is_unwanted = True
        self._timer.stop()
        if self.request.slot is not None:
            self.request.slot.release()

    def _look(self) -> None:
        if not self._future.done():
            self.got_on.emit(*self._work.news)
            return
        self._timer.stop()
        error = self._future.exception()
        if error is None:
            self.opened.emit(self.request, self._future.result())
        else:
            self.failed.emit(self.request, words(error))


class _Work:
    """What both threads know; nothing of Qt's is to end in the other one."""

    def __init__(self) -> None:
        self.news = 0.0, ""
        self.is_unwanted = False

    def report(self, fraction: float, text: str) -> None:
        """Be the reader's progress."""
        if self.is_unwanted:
            raise Cancelled("cancelled; nothing was changed")
        self.news = fraction, text


class WaitingPage(QtWidgets.QWidget):
    """What the window shows meanwhile: what is being opened, how far, and a way out."""

    cancelled = QtCore.Signal()
    """Nobody wants to wait for it."""

    def __init__(self) -> None:
        super().__init__()
        self.label, self.bar = QtWidgets.QLabel(), QtWidgets.QProgressBar()
        self.cancel = QtWidgets.QPushButton("Cancel")
        self.cancel.clicked.connect(self.cancelled)
        self.bar.setTextVisible(False)
        self.label.setWordWrap(True)
        self.label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        inside = QtWidgets.QWidget()
        inside.setFixedWidth(48 * self.fontMetrics().averageCharWidth())
        column = QtWidgets.QVBoxLayout(inside)
        column.addWidget(self.label)
        column.addWidget(self.bar)
        column.addWidget(self.cancel, 0, Qt.AlignmentFlag.AlignCenter)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(inside, 0, Qt.AlignmentFlag.AlignCenter)

    def begin(self, name: str) -> None:
        """Say that *name* is being opened."""
        self._name = name
        self.show_progress(0.0, "")

    def show_progress(self, fraction: float, text: str) -> None:
        """Say how far it is."""
        doing = f"Opening {self._name} ..."
        self.label.setText(f"{doing}\n{text}" if text else f"{doing}\n")
        self.bar.setRange(0, 1000 if fraction else 0)  # where nothing is known, it only moves
        self.bar.setValue(round(1000.0 * fraction))
