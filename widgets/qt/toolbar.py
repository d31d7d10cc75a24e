"""The toolbar: files, undo and redo, the modes, the rest pose, what is shown, and help.

It has one row of icons with names, without some of the names where there is no room, and two rows
in a narrow panel.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import DeformEditor, actions, file_types
from ..panel import Field, toolbar, tooltip
from .controls import Press, highlighted, tool_button
from .icons import icon
from .view_menu import add_entry, add_view_entries

Qt = QtCore.Qt
_SESSIONS = "Sessions (*.segdeform)"
_HEIGHT = 32  # pixels of a row


class Toolbar(QtWidgets.QWidget):
    """The buttons that are the same in every mode.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    press : callable
        ``press(name, value)``, called when a button is used.

    Attributes
    ----------
    buttons : dict of str to QToolButton
        The buttons, by the names of their fields.
    asking : dict of str to callable
        What is called instead for fields that ask for a file, by their names; may be replaced.
    """

    def __init__(self, editor: DeformEditor, press: Press) -> None:
        super().__init__()
        self._editor, self._press = editor, press
        self.asking: dict[str, Callable[[], object]] = {
            "open": self.ask_and_open,
            "save.session": self.save_session,
            "save.session_as": self.ask_and_save,
            "save.mesh_as": self.ask_and_export,
        }
        self._modes = QtWidgets.QButtonGroup(self)
        self._toggles: dict[str, Any] = {}  # entries of menus, by name
        fields = toolbar(editor)
        self.buttons = {field.name: self._made(field) for field in fields}
        self._icons = {field.name: field.icon for field in fields}
        # Groups from left to right; in a narrow panel the modes have a row of their own.
        self._groups = [
            _group([self.buttons[field.name] for field in group])
            for _, group in groupby(fields, key=lambda field: field.group)
        ]
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
        for field in toolbar(self._editor):
            button = self.buttons[field.name]
            button.setEnabled(field.enabled)
            button.setToolTip(tooltip(field, self._editor.keys))
            if button.isCheckable():
                button.setChecked(field.value)
            for entry in filter(None, field.items):
                if entry.name in self._toggles:
                    self._toggles[entry.name].setChecked(entry.value)

    def add_toggle(self, name: str, label: str, key: str) -> Any:
        """Return a new button at the end, which stays down, with the icon of that *name*."""
        *_, last = self.buttons.values()
        button = self.buttons[name] = highlighted(tool_button(label))
        button.setToolTip(f"Show or hide: {label.lower()} ({key})")
        self._icons[name] = name
        button.setMinimumHeight(_HEIGHT - 4)
        self._groups[-1].layout().addWidget(button)
        self.setTabOrder(last, button)
        self._draw_icons()
        self._level = -1
        self._fit()
        return button

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

    def _made(self, field: Field) -> Any:
        """Return a new button for *field*."""
        button, name, press = tool_button(field.label), field.name, self._press
        if field.kind == "menu":
            menu = QtWidgets.QMenu(button)
            button.setMenu(menu)
            button.setPopupMode(QtWidgets.QToolButton.ToolButtonPopupMode.InstantPopup)
            if name == "view":
                add_view_entries(menu, lambda: self._editor)
            else:
                for entry in filter(None, field.items):
                    action = add_entry(menu, entry.label)
                    if entry.kind == "toggle":
                        action.setCheckable(True)
                        action.triggered.connect(lambda on, name=entry.name: press(name, on))
                        self._toggles[entry.name] = action
                    else:
                        action.triggered.connect(self._asker(entry.name))
        elif field.kind == "file":
            button.clicked.connect(self._asker(name))
        elif field.kind == "hold":
            button.pressed.connect(lambda: press(name, True))
            button.released.connect(lambda: press(name, False))
            button.clicked.connect(self.refresh)  # down while the mesh at rest is shown
            highlighted(button)
        else:
            button.clicked.connect(lambda: press(name))
        if field.value is not None and field.kind == "button":
            self._modes.addButton(highlighted(button))
        return button

    def _asker(self, name: str) -> Callable[[], None]:
        def ask() -> None:
            self.asking[name]()

        return ask

    def _draw_icons(self) -> None:
        for name, button in self.buttons.items():
            button.setIcon(icon(self._icons[name], self.palette()))

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
        styles, modes = Qt.ToolButtonStyle, self._modes.buttons()
        for button in self.buttons.values():
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
            self, "Open", str(self._editor.path.parent), file_types(sessions=True)
        )
        if path and self.may_discard():
            self._editor.do(actions.opening(Path(path)))

    def may_discard(self) -> bool:
        """Return whether the session may be closed; ask if it has unsaved changes."""
        if not self._editor.controller.is_modified:
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
            self._editor.do(actions.save)
        else:
            self.ask_and_save()

    def ask_and_save(self) -> None:
        """Ask for a file and save the session there."""
        path = self._path_to_write("Save session", str(self._editor.path), _SESSIONS)
        if path is not None:
            self._editor.do(actions.saving(path if path.suffix else path.with_suffix(".segdeform")))

    def ask_and_export(self) -> None:
        """Ask for a file and write the posed mesh there."""
        proposed = str(self._editor.path.with_suffix(".ply"))
        path = self._path_to_write("Save mesh", proposed, file_types(sessions=False))
        if path is not None:
            self._editor.do(actions.exporting(path if path.suffix else path.with_suffix(".ply")))

    def _path_to_write(self, title: str, proposed: str, kinds: str) -> Path | None:
        path, _ = QtWidgets.QFileDialog.getSaveFileName(self, title, proposed, kinds)
        return Path(path) if path else None


def _group(buttons: list[Any]) -> Any:
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
