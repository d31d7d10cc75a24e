"""The menus of the window; what keys of the view do is done by those, and only told of here."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.version import __version__

from ..editor import actions
from . import saving
from .asking import tell_about
from .start_page import home_as_tilde

_FOLDER = 300  # points at most
_Keys = QtGui.QKeySequence.StandardKey


class Menus:
    """File, Edit, View and Help.

    Parameters
    ----------
    window : Window
        Whose.
    """

    def __init__(self, window: Any) -> None:
        self._window = window
        self._need_mesh: list[Any] = []
        self._file()
        self._edit()
        self._view()
        self._help()
        self.refresh()

    def refresh(self) -> None:
        """Allow what can be done now."""
        for action in self._need_mesh:
            action.setEnabled(self._window.has_mesh)

    def _file(self) -> None:
        window, menu = self._window, self._menu("&File")
        self._add(menu, "&Open ...", window.ask_and_open, _Keys.Open)
        self.recent = menu.addMenu("Open &recent")
        self.recent.aboutToShow.connect(self._show_recent)
        recover = self._add(menu, "Recover &unsaved work ...", window.recover)
        menu.aboutToShow.connect(lambda: recover.setEnabled(window.autosaves.has_left))
        menu.addSeparator()
        for text, save, keys in (
            ("&Save session", saving.save_session, _Keys.Save),
            ("Save session &as ...", saving.save_session_as, "Ctrl+Shift+S"),
            ("Save &mesh", saving.save_mesh, None),
            ("Save m&esh as ...", saving.save_mesh_as, "Ctrl+Shift+M"),
            ("Export &picture ...", saving.export_picture, None),
        ):
            self._need_mesh.append(self._add(menu, text, _calling(save, window), keys))
        menu.addSeparator()
        self._add(menu, "&Quit", window.close, _Keys.Quit).setMenuRole(_role("QuitRole"))

    def _edit(self) -> None:
        menu = self._menu("&Edit")
        self._undo = self._add(menu, "Undo", self._doing(actions.undo))
        self._redo = self._add(menu, "Redo", self._doing(actions.redo))
        menu.aboutToShow.connect(self._show_steps)

    def _view(self) -> None:
        menu = self._menu("&View")
        self._cages = self._add(menu, "&Cages\tC", self._doing(actions.toggle_cages))
        self._overlay = self._add(menu, "&Volume change\tO", self._doing(actions.toggle_overlay))
        for action in (self._cages, self._overlay):
            action.setCheckable(True)
        self._need_mesh.append(self._add(menu, "&Whole mesh", self._show_whole))
        menu.aboutToShow.connect(self._show_what_is_shown)

    def _help(self) -> None:
        menu = self._menu("&Help")
        keys = self._add(menu, "&Keys\tH", self._doing(actions.toggle_help))
        self._need_mesh.append(keys)
        self._add(menu, "&About segdeform", self._tell_about).setMenuRole(_role("AboutRole"))

    def _show_whole(self) -> None:
        view = self._window.editor.view
        view.renderer.ResetCamera()
        view.render()

    def _tell_about(self) -> None:
        tell_about(self._window, __version__)

    # What is shown when a menu opens.

    def _show_recent(self) -> None:
        window, menu = self._window, self.recent
        menu.clear()
        for number, path in enumerate(window.recent.paths, 1):
            folder = menu.fontMetrics().elidedText(
                home_as_tilde(path.parent), QtCore.Qt.TextElideMode.ElideMiddle, _FOLDER
            )
            name = f"{path.name}    {folder}".replace("&", "&&")
            action = menu.addAction(f"&{number}  {name}")
            action.setEnabled(os.path.isfile(path))
            action.triggered.connect(_calling(window.open, path))
        menu.addSeparator()
        clear = menu.addAction("&Clear")
        clear.setEnabled(bool(window.recent.paths))
        clear.triggered.connect(lambda: window.clear_recent())

    def _show_steps(self) -> None:
        window = self._window
        session = window.session if window.has_mesh else None
        is_free = session is not None and not window.editor.is_busy
        for action, verb, label, keys in (
            (self._undo, "&Undo", session and session.undo_label, "Ctrl+Z"),
            (self._redo, "&Redo", session and session.redo_label, "Ctrl+Y"),
        ):
            name = str(label or "").replace("&", "&&")
            action.setText(f"{verb} {name}\t{keys}" if name else f"{verb}\t{keys}")
            action.setEnabled(is_free and bool(label))

    def _show_what_is_shown(self) -> None:
        window = self._window
        self._cages.setEnabled(window.has_mesh and bool(window.session.cages))
        self._overlay.setEnabled(window.has_mesh)
        if window.has_mesh:
            stage = window.editor.stage
            self._cages.setChecked(stage.cages.is_shown)
            self._overlay.setChecked(stage.overlay_wanted)

    # Pieces.

    def _menu(self, title: str) -> Any:
        return self._window.menuBar().addMenu(title)

    def _add(self, menu: Any, text: str, call: Callable[[], object], keys: Any = None) -> Any:
        action = menu.addAction(text)
        if keys is not None:
            action.setShortcut(QtGui.QKeySequence(keys))
        action.triggered.connect(lambda: call())
        return action

    def _doing(self, action: actions.Action) -> Callable[[], None]:
        while_busy = action is actions.toggle_help
        return lambda: self._window.editor.do(action, while_busy=while_busy)


def lead_panel(window: Any) -> None:
    """Have the buttons of the panel do what the menus do."""
    head = window.editor_widget.panel.head
    head.open.clicked.disconnect()
    head.open.clicked.connect(window.ask_and_open)
    saves = saving.save_session, saving.save_session_as, saving.save_mesh_as
    for action, save in zip(head.save.menu().actions(), saves, strict=True):
        action.triggered.disconnect()
        action.triggered.connect(_calling(save, window))


def _calling(call: Callable[[Any], object], argument: Any) -> Callable[[], None]:
    def do() -> None:
        call(argument)

    return do


def _role(name: str) -> Any:
    owner = getattr(QtGui, "QAction", None) or QtWidgets.QAction
    return getattr(owner.MenuRole, name)
