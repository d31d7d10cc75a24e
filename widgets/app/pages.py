"""The pages of the window: start page, waiting page, or a `DeformWidget`."""

from __future__ import annotations

import gc

from qtpy import QtCore, QtOpenGLWidgets, QtWidgets

from .opening import WaitingPage
from .start_page import StartPage

_DELETE = QtCore.QEvent.Type.DeferredDelete
_PERMANENT = 2  # number of pages that are never deleted


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
