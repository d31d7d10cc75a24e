"""Files that are dropped on a window, wherever on it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qtpy import QtCore

_Event = QtCore.QEvent.Type


class Drops(QtCore.QObject):
    """Takes files of this machine for a window.

    Parameters
    ----------
    window : QWidget
        Where; what is in it is not to take drops itself.
    """

    held = QtCore.Signal(bool)
    """Files are held over the window, or no more."""
    dropped = QtCore.Signal(object)
    """This file was dropped, the first of several: a Path.  Whoever held it was let go."""

    def __init__(self, window: Any) -> None:
        super().__init__(window)
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, window: Any, event: Any) -> bool:  # noqa: N802 - Qt's word
        """See what is held over the window."""
        kind = event.type()
        if kind == _Event.DragEnter and _files(event):
            event.acceptProposedAction()
            self.held.emit(True)
            return True
        if kind == _Event.DragLeave:
            self.held.emit(False)
        elif kind == _Event.Drop and _files(event):
            path = _files(event)[0]
            event.acceptProposedAction()
            self.held.emit(False)
            QtCore.QTimer.singleShot(0, lambda: self.dropped.emit(path))
            return True
        return bool(super().eventFilter(window, event))


def _files(event: Any) -> list[Path]:
    urls = event.mimeData().urls()
    return [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
