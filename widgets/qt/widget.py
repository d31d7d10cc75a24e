"""The editor for Qt: a widget with a view and a panel, or a panel for an existing view.

    widget = DeformWidget(mesh)                  # a QWidget
    widget.deformed.connect(...)
    window.addDockWidget(area, deform_dock(plotter, mesh))   # plotter: an existing QtInteractor

The application chooses the Qt binding as described by QtPy: the one it imports first, or
``QT_API``.  Call `DeformWidget.close` in the ``closeEvent`` of your window, as for pyvistaqt's own
widgets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import pyvista
import pyvistaqt
from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.checks import require
from vtk_segdeform.session import Session

from .. import plugin  # noqa: F401 - registers `segdeform` on plotters even without entry points
from ..editor import DeformEditor, Keys
from ..hosting import session_of
from ..scene import View, set_background, set_lights
from .controls import shortcut
from .keys_dialog import KeysDialog
from .panel import DeformPanel

_NARROW = 1000  # pixels: in a widget that is less wide, the panel would take half of it
_PANEL_KEY = "F9"
_DARK = 128  # lightness of a window, 0 to 255, below which its palette is dark


class DeformWidget(QtWidgets.QWidget):
    """A toolbar, a view with the editor in it, the panel beside it, and the status below.

    In a narrow widget the panel is closed at first, and opens over the view.  The button *Panel* of
    the toolbar and F9 open and close it.

    Parameters
    ----------
    mesh : pyvista.PolyData, pyvista.MultiBlock, Surface, Mesh or Session
        What to edit.
    parent : QWidget, optional
        The parent widget.

    Attributes
    ----------
    plotter : pyvistaqt.QtInteractor
        The view; anything that pyvista draws can be added to it.
    editor : DeformEditor
        The editor in the view.
    panel : DeformPanel
        The panel beside it.
    panel_button : QToolButton
        Shows the panel while it is down.
    taken_keys : callable
        Returns the keys that no action can have, with labels; the application's menus have them.
    keys_changed : signal
        Other keys were assigned: ``editor.keys``.
    deformed, regions_changed, session_changed, error : signals
        The signals of the panel.
    """

    keys_changed = QtCore.Signal()

    def __init__(self, mesh: Any, parent: Any = None) -> None:
        session = session_of(mesh)
        super().__init__(_checked(parent))
        self._is_closed = False
        # Without a parent: pyvistaqt would close it once its parent is destroyed, which crashes.
        self.plotter = pyvistaqt.QtInteractor(auto_update=False, off_screen=False)
        self.plotter.setAcceptDrops(False)  # it would add a second mesh to the view
        set_lights(self.plotter.renderer)
        self._set_background()
        self.editor: DeformEditor = self.plotter.segdeform.edit(session)
        self.destroyed.connect(_switch_off(self.editor, self.plotter))
        self.taken_keys: Callable[[], Mapping[str, str]] = dict
        self.editor.controller.show_keys = self.show_keys
        self._camera_position: tuple[float, ...] | None = tuple(self.plotter.camera.position)
        self.panel = DeformPanel(self.editor, self)
        self.deformed, self.regions_changed = self.panel.deformed, self.panel.regions_changed
        self.session_changed, self.error = self.panel.session_changed, self.panel.error
        self._halves = QtWidgets.QSplitter(self)
        self._halves.addWidget(self.plotter)
        self._halves.addWidget(self.panel)
        self._halves.setStretchFactor(0, 1)  # a wider window enlarges the view
        self._halves.setCollapsible(0, False)
        self.panel.setAutoFillBackground(True)  # it may lie over the view
        self._is_narrow = False
        self._layout = QtWidgets.QGridLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(0)
        self._layout.addWidget(self.panel.toolbar, 0, 0)
        self._layout.addWidget(self._halves, 1, 0)
        self._layout.addWidget(self.panel.status, 2, 0)
        self._layout.setRowStretch(1, 1)
        self.panel_button = self.panel.toolbar.add_toggle("panel", "Panel", _PANEL_KEY)
        self.panel_button.setChecked(True)
        self.panel_button.toggled.connect(self.panel.setVisible)
        shortcut(_PANEL_KEY, self, self.panel_button.click)
        self.panel.status.lie_down()
        self.setFocusProxy(self.plotter)
        application = QtWidgets.QApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self.close)

    @property
    def session(self) -> Session:
        """The session being edited; another one after `session_changed`."""
        return self.editor.session

    def show_keys(self) -> None:
        """Show the keys of all actions in a dialog, in which they can be changed, or close it."""
        for shown in self.findChildren(KeysDialog):
            shown.reject()
            return
        taken = {_PANEL_KEY.lower(): "Panel", **self.taken_keys()}
        dialog = KeysDialog(self, self.editor.keys, taken)
        dialog.accepted.connect(lambda: self._use_keys(dialog.keys))
        dialog.show()  # not modal: a drag may be going on

    def _use_keys(self, keys: Keys) -> None:
        if keys.changes != self.editor.keys.changes:
            self.editor.keys = keys
            self.keys_changed.emit()

    def deformed_polydata(self) -> pyvista.PolyData:
        """Return the surface in the current pose, as it was given apart from coordinates.

        Normals follow.  For a `Mesh` it has the triangles of that.
        """
        return self.session.deformed

    def showEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Reset the camera once the size of the view is known, unless it has been moved."""
        super().showEvent(event)
        if self._camera_position == tuple(self.plotter.camera.position):
            self.editor.controller.camera.viewpoint.frame(animate=False)
        self._camera_position = None

    def resizeEvent(self, event: Any) -> None:  # noqa: N802
        """Move the panel over the view of a narrow widget, closed, or back beside it."""
        super().resizeEvent(event)
        is_narrow = self.width() < _NARROW
        if is_narrow == self._is_narrow or self._is_closed:
            return
        self._is_narrow = is_narrow
        if is_narrow:
            self._layout.addWidget(self.panel, 1, 0, QtCore.Qt.AlignmentFlag.AlignRight)
            self.panel.raise_()
        else:
            self._halves.addWidget(self.panel)
        self.panel_button.setChecked(not is_narrow)
        self.panel.setVisible(not is_narrow)

    def changeEvent(self, event: Any) -> None:  # noqa: N802
        """Use the background for a new palette, light or dark."""
        super().changeEvent(event)
        if event.type() == QtCore.QEvent.Type.PaletteChange and not self._is_closed:
            self._set_background()
            self.editor.view.request_render()

    def _set_background(self) -> None:
        window = self.palette().color(QtGui.QPalette.ColorRole.Window)
        set_background(self.plotter.renderer, dark=window.lightness() < _DARK)

    def closeEvent(self, event: Any) -> None:  # noqa: N802
        """Release all resources; the session is unchanged."""
        if not self._is_closed:
            self._is_closed = True
            self.panel.stop()
            close_view(self.plotter)  # which removes the editor first
        super().closeEvent(event)


def close_view(plotter: Any) -> None:
    """Close a `pyvistaqt.QtInteractor`, which then forgets its OpenGL context.

    Qt deletes the surface of the context with the view, and PySide does not notice: as long as the
    surface is remembered, a new object at its address would be taken for it, which may crash.
    """
    plotter.close()
    _forget_context(plotter)


def _forget_context(plotter: Any) -> None:
    plotter._ctx = plotter._surface = None


def _switch_off(editor: DeformEditor, plotter: Any) -> Callable[[], None]:
    """Return a function that switches *editor* off after Qt has deleted its widget.

    Its actors stay: OpenGL would release them in the context of another window.
    """

    def switch_off() -> None:
        with suppress(RuntimeError):  # from objects that Qt has deleted
            editor.Off()
        _forget_context(plotter)

    return switch_off


class DeformDock(QtWidgets.QDockWidget):
    """A dock with a panel for an existing view; see `deform_dock`.

    Closing the dock hides it; ``dock.editor.remove()`` removes the editor from the view.

    Parameters
    ----------
    editor : DeformEditor
        The editor in the view.
    parent : QWidget, optional
        The parent widget.

    Attributes
    ----------
    deformed, regions_changed, session_changed, error : signals
        The signals of the panel.
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
        """The session being edited; another one after `session_changed`."""
        return self.editor.session

    def deformed_polydata(self) -> pyvista.PolyData:
        """Return the deformed surface; see `DeformWidget.deformed_polydata`."""
        return self.session.deformed


def deform_dock(view: Any, mesh: Any, parent: Any = None) -> DeformDock:
    """Add the editor to an existing view, and return a dock with its panel.

    Parameters
    ----------
    view : pyvistaqt.QtInteractor, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where to edit.  A plotter removes the editor when it closes; for any other view call
        ``dock.editor.remove()`` before its window closes.
    mesh : pyvista.PolyData, pyvista.MultiBlock, Surface, Mesh or Session
        What to edit.
    parent : QWidget, optional
        The parent widget.
    """
    View.of(view)  # checks the type, which a plotter's tools do not
    _checked(parent)
    if hasattr(view, "segdeform"):
        editor = view.segdeform.edit(mesh)
    else:
        editor = DeformEditor(view, session_of(mesh))
        editor.On()
    return DeformDock(editor, parent)


def _checked(parent: Any) -> Any:
    return None if parent is None else require(parent, QtWidgets.QWidget, "parent")
