"""The menus of the window.  Entries for keys of the view only show the key."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.version import __version__

from ..panel import press
from ..qt import add_entry, add_view_entries, name_keys
from . import saving
from .dialogs import show_about
from .start_page import home_as_tilde

_FOLDER = 300  # points at most
_Keys = QtGui.QKeySequence.StandardKey


class Menus:
    """File, Edit, View and Help.

    Parameters
    ----------
    window : Window
        The window to control.
    """

    def __init__(self, window: Any) -> None:
        self._window = window
        self._need_mesh: list[Any] = []
        # PySide6 before 6.11.2 drops a menu, with its entries, that was asked for from an action of
        # which no reference is left.
        self._kept: list[Any] = []
        self._file()
        self._edit()
        self._view()
        self._help()
        self.refresh()

    def refresh(self) -> None:
        """Enable the entries that are available."""
        for action in self._need_mesh:
            action.setEnabled(self._window.has_mesh)

    def _file(self) -> None:
        window, menu = self._window, self._menu("&File")
        self._add(menu, "&Open ...", window.ask_and_open, _Keys.Open)
        self.recent = self._kept_menu(menu, "Open &recent")
        self.recent.aboutToShow.connect(self._update_recent)
        repair = self._add(menu, "Re&pair and open ...", window.repair)
        self._need_mesh.append(repair)
        recover = self._add(menu, "Recover &unsaved work ...", window.recover)
        menu.aboutToShow.connect(lambda: recover.setEnabled(window.autosaves.has_abandoned))
        menu.addSeparator()
        for text, save, keys in (
            ("&Save session", saving.save_session, _Keys.Save),
            ("Save session &as ...", saving.save_session_as, "Ctrl+Shift+S"),
            ("Save &mesh", saving.save_mesh, None),
            ("Save m&esh as ...", saving.save_mesh_as, "Ctrl+Shift+M"),
            ("Export &picture ...", saving.export_picture, None),
        ):
            self._need_mesh.append(self._add(menu, text, _calling(save, window), keys))
        self._displacement = self._add(
            menu, "Meshes with &displacement", lambda: press(window.editor, "save.displacement")
        )
        self._displacement.setCheckable(True)
        self._need_mesh.append(self._displacement)
        menu.aboutToShow.connect(self._update_displacement)
        copy = self._add(
            menu,
            "&Copy poses of a session ...",
            lambda: window.editor_widget.panel.controls["poses.copy"].click(),
        )
        carry = self._add(
            menu,
            "Carry &files along ...",
            lambda: window.editor_widget.panel.controls["carried.add"].click(),
        )
        self._need_mesh += [copy, carry]
        menu.addSeparator()
        self._add(menu, "&Quit", window.close, _Keys.Quit).setMenuRole(_role("QuitRole"))

    def _edit(self) -> None:
        window, menu = self._window, self._menu("&Edit")
        self._undo = self._add(menu, "Undo", lambda: window.editor.run("undo"))
        self._redo = self._add(menu, "Redo", lambda: window.editor.run("redo"))
        menu.aboutToShow.connect(self._update_steps)

    def _view(self) -> None:
        menu = self._menu("&View")
        window = self._window
        add_view_entries(menu, lambda: window.editor if window.has_mesh else None)

    def _help(self) -> None:
        window, menu = self._window, self._menu("&Help")
        card = self._add(menu, "&Keys ...", lambda: window.editor.run("help"))
        self._need_mesh.append(card)
        named = [(card, card.text(), "help")]
        menu.aboutToShow.connect(lambda: name_keys(named, window.keys))
        self._add(menu, "&About segdeform", lambda: show_about(window, __version__)).setMenuRole(
            _role("AboutRole")
        )

    # Entries that are updated when a menu opens.

    def _update_recent(self) -> None:
        window, menu = self._window, self.recent
        menu.clear()
        for number, path in enumerate(window.recent.paths, 1):
            folder = menu.fontMetrics().elidedText(
                home_as_tilde(path.parent), QtCore.Qt.TextElideMode.ElideMiddle, _FOLDER
            )
            name = f"{path.name}    {folder}".replace("&", "&&")
            action = add_entry(menu, f"&{number}  {name}")
            action.setEnabled(os.path.isfile(path))
            action.triggered.connect(_calling(window.open, path))
        menu.addSeparator()
        clear = add_entry(menu, "&Clear list")
        clear.setEnabled(bool(window.recent.paths))
        clear.triggered.connect(lambda: window.clear_recent())

    def _update_displacement(self) -> None:
        window = self._window
        is_wanted = window.has_mesh and window.editor.controller.displacement is not None
        self._displacement.setChecked(is_wanted)

    def _update_steps(self) -> None:
        window = self._window
        history = window.editor.controller.history if window.has_mesh else None
        is_free = history is not None and not window.editor.is_busy
        for action, verb, label in (
            (self._undo, "undo", history and history.undo_label),
            (self._redo, "redo", history and history.redo_label),
        ):
            name = str(label or "").replace("&", "&&")
            name_keys([(action, f"&{verb.capitalize()} {name}".rstrip(), verb)], window.keys)
            action.setEnabled(is_free and bool(label))

    # Pieces.

    def _menu(self, title: str) -> Any:
        return self._kept_menu(self._window.menuBar(), title)

    def _kept_menu(self, parent: Any, title: str) -> Any:
        menu = parent.addMenu(title)
        self._kept.append(menu.menuAction())
        return menu

    def _add(self, menu: Any, text: str, call: Callable[[], object], keys: Any = None) -> Any:
        action = add_entry(menu, text)
        if keys is not None:
            action.setShortcut(QtGui.QKeySequence(keys))
        action.triggered.connect(lambda: call())
        return action


def connect_panel(window: Any) -> None:
    """Connect the file buttons of the panel to the functions of the menus; hide its View menu."""
    toolbar = window.editor_widget.panel.toolbar
    toolbar.buttons["view"].hide()  # the menu bar has the same entries
    toolbar.asking = {
        "open": window.ask_and_open,
        "save.session": _calling(saving.save_session, window),
        "save.session_as": _calling(saving.save_session_as, window),
        "save.mesh_as": _calling(saving.save_mesh_as, window),
    }


def _calling(call: Callable[[Any], object], argument: Any) -> Callable[[], None]:
    def do() -> None:
        call(argument)

    return do


def _role(name: str) -> Any:
    owner = getattr(QtGui, "QAction", None) or QtWidgets.QAction
    return getattr(owner.MenuRole, name)
