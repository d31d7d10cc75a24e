"""The pages of the window: start page, waiting page, or a `DeformWidget`."""

from __future__ import annotations

import gc
from typing import Any

from qtpy import QtCore, QtOpenGLWidgets, QtWidgets

from .start_page import StartPage

Qt = QtCore.Qt
_DELETE = QtCore.QEvent.Type.DeferredDelete
_PERMANENT = 2  # number of pages that are never deleted


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


class Pages(QtWidgets.QStackedWidget):
    """The pages, one of them shown.

    Attributes
    ----------
    start : StartPage
        Shown until a document is open.
    waiting : WaitingPage
        Shown while a document is read.
    """

    def __init__(self) -> None:
        super().__init__()
        # Without an OpenGL widget from the start, Qt re-creates the window for the first view.
        QtOpenGLWidgets.QOpenGLWidget(self).hide()
        self.start, self.waiting = StartPage(), WaitingPage()
        self.addWidget(self.start)
        self.addWidget(self.waiting)

    def delete_views(self) -> None:
        """Delete every other page immediately, with all its objects.

        PySide would mistake objects that Qt creates later at the same address for those of a
        deleted view, so no reference may survive, not even until the next garbage collection.
        """
        if self.count() == _PERMANENT:
            return
        while self.count() > _PERMANENT:
            page = self.widget(_PERMANENT)
            self.removeWidget(page)
            page.deleteLater()
            QtCore.QCoreApplication.sendPostedEvents(page, getattr(_DELETE, "value", _DELETE))
        page = None
        gc.collect()
