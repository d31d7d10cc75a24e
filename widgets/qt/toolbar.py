"""The toolbar of the panel: files, undo and redo, and the four modes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qtpy import QtWidgets

from ..editor import (
    MESH_FILES,
    READABLE_FILES,
    DeformEditor,
    Mode,
    exporting,
    opening,
    save,
    saving,
)
from .controls import choice_button, column, key_button, push_button, put, row
from .view_menu import add_view_entries

_SESSIONS = "Sessions (*.segdeform)"


class Toolbar(QtWidgets.QWidget):
    """The buttons at the top of the panel, the same in every mode.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__()
        self._editor = editor
        self.open = push_button("Open ...", "Open a mesh or a session", "ctrl+o")
        self.save = push_button("Save", "Save the session or the deformed mesh", "ctrl+s")
        self.open.clicked.connect(self.ask_and_open)
        menu = QtWidgets.QMenu(self.save)
        for text, do in (
            ("Save session", self.save_session),
            ("Save session as ...", self.ask_and_save),
            ("Save mesh as ...", self.ask_and_export),
        ):
            menu.addAction(text).triggered.connect(do)
        self.save.setMenu(menu)
        self.view = push_button("View", "Views, up axis and projection")
        views = QtWidgets.QMenu(self.view)
        add_view_entries(views, lambda: editor)
        self.view.setMenu(views)
        self.undo = key_button(editor, "z", Mode.REGIONS, "Undo")
        self.redo = key_button(editor, "y", Mode.REGIONS, "Redo")
        self.modes = {
            mode: choice_button(editor, str(mode.value), mode, f"{mode.value} {mode.name.title()}")
            for mode in Mode
        }
        group = QtWidgets.QButtonGroup(self)
        for button in self.modes.values():
            group.addButton(button)
        column(
            self,
            row(self.open, self.save, self.undo, self.redo, self.view),
            row(*self.modes.values()),
        )
        self.layout().setContentsMargins(0, 0, 0, 0)

    def refresh(self) -> None:
        """Show the steps to undo and redo, and the mode."""
        session, busy = self._editor.session, self._editor.is_busy
        for button, label, verb, key in (
            (self.undo, self._editor.controller.undo_label, "Undo", "Z"),
            (self.redo, session.redo_label, "Redo", "Y"),
        ):
            button.setEnabled(label is not None and not busy)
            text = f"{verb}: {label} ({key})" if label else f"Nothing to {verb.lower()}"
            button.setToolTip(text)
        for each in (self.open, self.save, *self.modes.values()):
            each.setEnabled(not busy)
        put(self.modes[self._editor.mode], True)

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
