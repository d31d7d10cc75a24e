"""Opening a document in the background: the request, and the page shown meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import Slot
from .documents import Reader

Qt = QtCore.Qt


@dataclass(frozen=True)
class Request:
    """A document to open."""

    name: str
    """Its name for users."""
    reader: Reader
    """``reader(progress)`` reads it, in another thread."""
    path: Path | None = None
    """The file, if the user chose one."""
    slot: Slot | None = None
    """Where it was autosaved, if it is recovered work."""
    is_new: bool = False
    """Whether it has been made or recovered by the program, and is to be saved."""


class WaitingPage(QtWidgets.QWidget):
    """The page shown while a document is read: its name, the progress and a Cancel button."""

    cancelled = QtCore.Signal()
    """The Cancel button was clicked, or Escape was pressed."""

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
        """Show that *name* is being opened."""
        self._name = name
        self.show_progress(0.0, "")

    def showEvent(self, event: Any) -> None:  # noqa: N802
        """Take the keyboard."""
        super().showEvent(event)
        self.cancel.setFocus()

    def keyPressEvent(self, event: Any) -> None:  # noqa: N802
        """Cancel at Escape."""
        if event.key() == Qt.Key.Key_Escape:
            self.cancelled.emit()
        else:
            super().keyPressEvent(event)

    def show_progress(self, fraction: float, text: str) -> None:
        """Show the progress, 0..1, and the current step."""
        title = f"Opening {self._name} ..."
        self.label.setText(f"{title}\n{text}" if text else f"{title}\n")
        self.bar.setRange(0, 1000 if fraction else 0)  # an unknown fraction shows a busy bar
        self.bar.setValue(round(1000.0 * fraction))
