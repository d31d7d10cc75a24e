"""The editor for Qt applications: a widget with a view and a panel, or a panel for a view of yours.

    widget = DeformWidget(mesh)                  # put it wherever a QWidget goes
    widget.deformed.connect(...)
    window.addDockWidget(area, deform_dock(plotter, mesh))   # plotter: a QtInteractor of yours

The application chooses Qt's binding, as QtPy tells: by what it imports first, or by ``QT_API``.
Call `DeformWidget.close` in the ``closeEvent`` of your window, as with pyvistaqt's own widgets.
"""

from __future__ import annotations

from typing import Any

import pyvista
import pyvistaqt
from qtpy import QtWidgets

from vtk_segdeform.checks import require
from vtk_segdeform.session import Session

from .. import plugin  # gives plotters `segdeform`, also where entry points do not work
from ..editor import DeformEditor
from ..scene import View
from .panel import DeformPanel


class DeformWidget(QtWidgets.QWidget):
    """A view of a mesh with the editor in it, and a panel beside it.

    Parameters
    ----------
    mesh : Mesh, pyvista.PolyData or Session
        What to edit.
    parent : QWidget, optional
        As ever in Qt.

    Attributes
    ----------
    plotter : pyvistaqt.QtInteractor
        The view; whatever pyvista draws can be added to it.
    editor : DeformEditor
        What works in the view.
    panel : DeformPanel
        What is beside it.
    deformed, regions_changed, session_changed, error : signals
        Those of the panel.
    """

    def __init__(self, mesh: Any, parent: Any = None) -> None:
        session = plugin.session_of(mesh)
        super().__init__(_checked(parent))
        self._is_closed = False
        self.plotter = pyvistaqt.QtInteractor(self, auto_update=False, off_screen=False)
        self.plotter.setAcceptDrops(False)  # it would add the mesh beside the one that is edited
        self.editor: DeformEditor = self.plotter.segdeform.edit(session)
        self.editor.desk.file.surface = plugin.surface_of(mesh)
        self._aimed: tuple[float, ...] | None = tuple(self.plotter.camera.position)
        self.panel = DeformPanel(self.editor, self)
        self.deformed, self.regions_changed = self.panel.deformed, self.panel.regions_changed
        self.session_changed, self.error = self.panel.session_changed, self.panel.error
        halves = QtWidgets.QSplitter(self)
        halves.addWidget(self.plotter)
        halves.addWidget(self.panel)
        halves.setStretchFactor(0, 1)  # what a wider window has is the view's
        halves.setCollapsible(0, False)
        layout = QtWidgets.QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(halves)
        self.setFocusProxy(self.plotter)
        application = QtWidgets.QApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self.close)

    @property
    def session(self) -> Session:
        """What is edited; another one after `session_changed`."""
        return self.editor.session

    def deformed_polydata(self) -> pyvista.PolyData:
        """Return the mesh as it is now, with the arrays and polygons that it came with.

        Those of the PolyData that was given, or of the file that was opened; normals anew.
        """
        return self.editor.desk.file.deformed(self.session)

    def showEvent(self, event: Any) -> None:  # noqa: N802 - Qt's word
        """Aim the camera, once it is known how wide the view is, unless somebody has aimed it."""
        super().showEvent(event)
        if self._aimed == tuple(self.plotter.camera.position):
            self.plotter.reset_camera()
        self._aimed = None

    def closeEvent(self, event: Any) -> None:  # noqa: N802
        """Free everything; the session stays as it is."""
        if not self._is_closed:
            self._is_closed = True
            self.panel.stop()
            self.plotter.close()  # which removes the editor first
        super().closeEvent(event)


class DeformDock(QtWidgets.QDockWidget):
    """A panel for a view of somebody else's; see `deform_dock`.

    Closing it hides it; ``dock.editor.remove()`` takes the editor out of the view.

    Parameters
    ----------
    editor : DeformEditor
        What works in the view.
    parent : QWidget, optional
        As ever in Qt.

    Attributes
    ----------
    deformed, regions_changed, session_changed, error : signals
        Those of the panel.
    """

    def __init__(self, editor: DeformEditor, parent: Any = None) -> None:
        require(editor, DeformEditor, "editor")
        super().__init__("Deform", _checked(parent))
        self.editor = editor
        self.panel = DeformPanel(editor, self)
        self.setObjectName("segdeform dock")  # for QMainWindow.saveState
        self.setWidget(self.panel)
        self.deformed, self.regions_changed = self.panel.deformed, self.panel.regions_changed
        self.session_changed, self.error = self.panel.session_changed, self.panel.error

    @property
    def session(self) -> Session:
        """What is edited; another one after `session_changed`."""
        return self.editor.session

    def deformed_polydata(self) -> pyvista.PolyData:
        """Return the mesh as it is now; see `DeformWidget.deformed_polydata`."""
        return self.editor.desk.file.deformed(self.session)


def deform_dock(view: Any, mesh: Any, parent: Any = None) -> DeformDock:
    """Put the editor into a view that is there, and return a dock with its panel.

    Parameters
    ----------
    view : pyvistaqt.QtInteractor, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where to edit.  The editor goes when a plotter closes; else call ``dock.editor.remove()``
        before its window does.
    mesh : Mesh, pyvista.PolyData or Session
        What to edit.
    parent : QWidget, optional
        As ever in Qt.
    """
    View.of(view)  # checks it, which a plotter's tools do not
    _checked(parent)
    if hasattr(view, "segdeform"):
        editor = view.segdeform.edit(mesh)
    else:
        editor = DeformEditor(view, plugin.session_of(mesh))
        editor.desk.file.surface = plugin.surface_of(mesh)
        editor.On()
    return DeformDock(editor, parent)


def _checked(parent: Any) -> Any:
    return None if parent is None else require(parent, QtWidgets.QWidget, "parent")
