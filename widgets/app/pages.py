"""What fills the window: the page to start from, the page to wait at, or a `DeformWidget`."""

from __future__ import annotations

import gc

from qtpy import QtCore, QtOpenGLWidgets, QtWidgets

from .opening import WaitingPage
from .start_page import StartPage

_DELETE = QtCore.QEvent.Type.DeferredDelete
_OURS = 2  # pages that are always there


class Pages(QtWidgets.QStackedWidget):
    """One page at a time.

    Attributes
    ----------
    start : StartPage
        Before there is a mesh.
    waiting : WaitingPage
        While one is read.
    """

    def __init__(self) -> None:
        super().__init__()
        # Without one from the start, Qt makes the window anew when the first view comes.
        QtOpenGLWidgets.QOpenGLWidget(self).hide()
        self.start, self.waiting = StartPage(), WaitingPage()
        self.addWidget(self.start)
        self.addWidget(self.waiting)

    def delete_views(self) -> None:
        """Delete every other page, at once and with all that it holds.

        PySide would take what Qt makes later, in the same place, for what a view remembers; so
        nothing of a view is to outlive it, not even until the next collection of garbage.
        """
        if self.count() == _OURS:
            return
        while self.count() > _OURS:
            page = self.widget(_OURS)
            self.removeWidget(page)
            page.deleteLater()
            QtCore.QCoreApplication.sendPostedEvents(page, getattr(_DELETE, "value", _DELETE))
        page = None
        gc.collect()
