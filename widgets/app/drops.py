"""Files dropped on a window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qtpy import QtCore

_Event = QtCore.QEvent.Type


class Drops(QtCore.QObject):
    """Accept local files dropped anywhere on a window.

    Parameters
    ----------
    window : QWidget
        The window; its children must not accept drops themselves.
    """

    hovered = QtCore.Signal(bool)
    """Files are dragged over the window, or have left it."""
    dropped = QtCore.Signal(object)
    """A file was dropped: the Path of the first one.  Emitted after the drop has been accepted."""

    def __init__(self, window: Any) -> None:
        super().__init__(window)
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, window: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """Handle drag and drop events of the window."""
        kind = event.type()
        if kind == _Event.DragEnter and _files(event):
            event.acceptProposedAction()
            self.hovered.emit(True)
            return True
        if kind == _Event.DragLeave:
            self.hovered.emit(False)
        elif kind == _Event.Drop and _files(event):
            path = _files(event)[0]
            event.acceptProposedAction()
            self.hovered.emit(False)
            QtCore.QTimer.singleShot(0, lambda: self.dropped.emit(path))
            return True
        return bool(super().eventFilter(window, event))


def _files(event: Any) -> list[Path]:
    urls = event.mimeData().urls()
    return [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
