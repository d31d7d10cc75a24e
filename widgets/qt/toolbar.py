"""The toolbar: files, undo and redo, the modes, the rest pose, what is shown, and help.

It has one row of icons with names, without some of the names where there is no room, and two rows
in a narrow panel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import (
    MESH_FILES,
    READABLE_FILES,
    DeformEditor,
    Mode,
    exporting,
    opening,
    save,
    saving,
    show_pose,
    show_rest,
)
from .controls import doing, highlighted, put, tool_button
from .icons import icon
from .view_menu import add_view_entries

Qt = QtCore.Qt
_SESSIONS = "Sessions (*.segdeform)"
_HEIGHT = 32  # pixels of a row


class Toolbar(QtWidgets.QWidget):
    """The buttons that are the same in every mode.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__()
        self._editor = editor
        self.open = tool_button("Open", "Open a mesh or a session", "open")
        self.save = tool_button("Save", "Save the session or the deformed mesh", "save")
        self.open.clicked.connect(self.ask_and_open)
        menu = self._menu(self.save)
        for text, do in (
            ("Save session", self.save_session),
            ("Save session as ...", self.ask_and_save),
            ("Save mesh as ...", self.ask_and_export),
        ):
            menu.addAction(text).triggered.connect(do)
        self.undo = doing(editor, tool_button("Undo", "Undo"), "undo")
        self.redo = doing(editor, tool_button("Redo", "Redo"), "redo")
        self.modes = {mode: self._mode_button(mode) for mode in Mode}
        self._group = QtWidgets.QButtonGroup(self)
        for button in self.modes.values():
            self._group.addButton(button)
        tip = "Show the mesh at rest while the button is held"
        self.compare = tool_button("Before/After", tip, "before_after")
        self.compare.pressed.connect(lambda: editor.do(show_rest))
        self.compare.released.connect(lambda: editor.do(show_pose, while_busy=True))
        self.view = tool_button("View", "What is shown")
        add_view_entries(self._menu(self.view), lambda: editor)
        self.help = doing(editor, tool_button("Keys", "Show keys", "help"), "help")
        self._icons = {
            "open": self.open, "save": self.save, "undo": self.undo, "redo": self.redo,
            "compare": self.compare, "view": self.view, "help": self.help,
            **{mode.name.lower(): button for mode, button in self.modes.items()},
        }  # fmt: skip
        # Groups from left to right; in a narrow panel the modes have a row of their own.
        groups = (
            (self.open, self.save, self.undo, self.redo),
            (*self.modes.values(),),
            (self.compare, self.view, self.help),
        )
        self._groups = [_group(buttons) for buttons in groups]
        self._grid = QtWidgets.QGridLayout(self)
        self._grid.setContentsMargins(4, 2, 4, 2)
        self._grid.setSpacing(2)
        self._grid.setColumnStretch(1, 1)
        self._level = -1
        self._arrange(0)
        self.setSizePolicy(_policy("Ignored"), _policy("Fixed"))
        self._draw_icons()

    def refresh(self) -> None:
        """Show the steps to undo and redo, and the mode."""
        session, busy, keys = self._editor.session, self._editor.is_busy, self._editor.keys
        for button, label, verb in (
            (self.undo, self._editor.controller.undo_label, "Undo"),
            (self.redo, session.redo_label, "Redo"),
        ):
            button.setEnabled(label is not None and not busy)
            text = (
                f"{verb}: {label} ({keys.cap(verb.lower())})"
                if label
                else f"Nothing to {verb.lower()}"
            )
            button.setToolTip(text)
        for each in (self.open, self.save, self.view, *self.modes.values()):
            each.setEnabled(not busy)
        self.compare.setEnabled(not busy and session.state.pose is not None)
        put(self.modes[self._editor.mode], True)

    def resizeEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Show as many names as there is room for."""
        super().resizeEvent(event)
        self._fit()

    def changeEvent(self, event: Any) -> None:  # noqa: N802
        """Draw the icons in the colours of a new palette."""
        super().changeEvent(event)
        if event.type() == QtCore.QEvent.Type.PaletteChange:
            self._draw_icons()
        elif event.type() == QtCore.QEvent.Type.FontChange:
            self._fit()

    # Pieces.

    def _mode_button(self, mode: Mode) -> Any:
        action = mode.name.lower()
        button = tool_button(mode.name.title(), self._editor.keys[action].label, action)
        return highlighted(doing(self._editor, button, action))

    def _menu(self, button: Any) -> Any:
        menu = QtWidgets.QMenu(button)
        button.setMenu(menu)
        button.setPopupMode(QtWidgets.QToolButton.ToolButtonPopupMode.InstantPopup)
        return menu

    def _draw_icons(self) -> None:
        for name, button in self._icons.items():
            button.setIcon(icon(name, self.palette()))

    def _fit(self) -> None:
        """Use the arrangement with the most names that fits."""
        for level in (3, 2, 1, 0):
            self._arrange(level)
            if level == 0 or self._grid.minimumSize().width() <= self.width():
                return

    def _arrange(self, level: int) -> None:
        """Arrange the buttons: 0, 1 in two rows, 2, 3 in one; 1, 2 with names of modes, 3 all."""
        if level == self._level:
            return
        self._level = level
        styles, modes = Qt.ToolButtonStyle, self.modes.values()
        for button in self._icons.values():
            named = level == 3 or (level > 0 and button in modes)
            style = styles.ToolButtonTextBesideIcon if named else styles.ToolButtonIconOnly
            button.setToolButtonStyle(style)
        files, choices, others = self._groups
        self._grid.addWidget(files, 0, 0)
        self._grid.addWidget(others, 0, 2)
        centre = Qt.AlignmentFlag.AlignHCenter
        if level < 2:
            self._grid.addWidget(choices, 1, 0, 1, 3)
        else:
            self._grid.addWidget(choices, 0, 1, centre)
        self._grid.invalidate()

    # Files.

    def ask_and_open(self) -> None:
        """Ask for a file and open it."""
        path, _ = QtWidgets.QFileDialog.getOpenFileName(
            self, "Open", self._folder(), READABLE_FILES
        )
        if path and self.may_discard():
            self._editor.do(opening(Path(path)))

    def may_discard(self) -> bool:
        """Return whether the session may be closed; ask if it has unsaved changes."""
        controller = self._editor.controller
        if not controller.file.is_modified(controller.session):
            return True
        buttons = QtWidgets.QMessageBox.StandardButton
        answer = QtWidgets.QMessageBox.question(
            self, "Unsaved changes", "Discard unsaved changes?",
            buttons.Discard | buttons.Cancel, buttons.Cancel,
        )  # fmt: skip
        return bool(answer == buttons.Discard)

    def save_session(self) -> None:
        """Save to the session's file; ask before another existing file is replaced."""
        if self._editor.controller.file.may_overwrite:
            self._editor.do(save)
        else:
            self.ask_and_save()

    def ask_and_save(self) -> None:
        """Ask for a file and save the session there."""
        path = self._path_to_write("Save session", str(self._editor.path), _SESSIONS)
        if path is not None:
            self._editor.do(saving(path if path.suffix else path.with_suffix(".segdeform")))

    def ask_and_export(self) -> None:
        """Ask for a file and write the posed mesh there."""
        proposed = str(self._editor.path.with_suffix(".ply"))
        path = self._path_to_write("Save mesh", proposed, MESH_FILES)
        if path is not None:
            self._editor.do(exporting(path if path.suffix else path.with_suffix(".ply")))

    def _path_to_write(self, title: str, proposed: str, kinds: str) -> Path | None:
        path, _ = QtWidgets.QFileDialog.getSaveFileName(self, title, proposed, kinds)
        return Path(path) if path else None

    def _folder(self) -> Any:
        return str(self._editor.path.parent)


def _group(buttons: tuple[Any, ...]) -> Any:
    """Return a widget with *buttons* side by side."""
    group = QtWidgets.QWidget()
    layout = QtWidgets.QHBoxLayout(group)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(1)
    for button in buttons:
        button.setMinimumHeight(_HEIGHT - 4)
        layout.addWidget(button)
    return group


def _policy(name: str) -> Any:
    return getattr(QtWidgets.QSizePolicy.Policy, name)
