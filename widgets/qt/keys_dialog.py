"""The dialog with the keys of all actions, in which other keys can be assigned to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.errors import ArgumentError

from ..editor import PRESETS, Keys, Mode, key_cap, key_name, keys_of

Qt = QtCore.Qt
_KEYS, _ACTION, _MODES = range(3)


class KeysDialog(QtWidgets.QDialog):
    """A table of the actions and their keys, and below them what is fixed.

    Parameters
    ----------
    parent : QWidget
        The window.
    keys : Keys
        The keys at first.
    taken : mapping of str to str
        Keys of menus, which no action can have, with labels.

    Attributes
    ----------
    keys : Keys
        The chosen keys.
    table, key, preset, message : QTreeWidget, QKeySequenceEdit, QComboBox, QLabel
        The actions; the new key of the selected one; the presets; why a key is refused.
    """

    def __init__(self, parent: Any, keys: Keys, taken: Mapping[str, str]) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("Keys")
        self.keys, self._taken = keys, taken
        self._names = [binding.name for binding in keys.bindings if binding.name]
        self.table = QtWidgets.QTreeWidget()
        self.table.setHeaderLabels(["Keys", "Action", "Modes"])
        self.table.setRootIsDecorated(False)
        self.table.setAlternatingRowColors(True)
        rows = [(b.keys, b.label, b.modes) for b in keys.bindings if b.name]
        rows += [(b.keys, b.label, b.modes) for b in keys.bindings if not b.name]
        for own, label, modes in rows:
            QtWidgets.QTreeWidgetItem(self.table, [_caps(own), label, _where(modes)])
        self._n_keys = len(rows)
        for button, label in keys.mouse:
            QtWidgets.QTreeWidgetItem(self.table, [button, label, "All"])
        self.table.currentItemChanged.connect(lambda *_: self._select())
        self.key = QtWidgets.QKeySequenceEdit()
        self.key.editingFinished.connect(self._press)
        self.remove = QtWidgets.QPushButton("Remove key")
        self.remove.clicked.connect(lambda: self._assign(self._selected, ()))
        self.preset = QtWidgets.QComboBox()
        self.preset.addItems([*PRESETS])
        self.preset.setToolTip("The keys that Reset assigns")
        self.reset = QtWidgets.QPushButton("Reset to preset")
        self.reset.clicked.connect(self._reset)
        self.message = QtWidgets.QLabel()
        self.message.setWordWrap(True)
        standard = QtWidgets.QDialogButtonBox.StandardButton
        self.buttons = QtWidgets.QDialogButtonBox(standard.Ok | standard.Cancel)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        for button in (self.reset, self.remove, *self.buttons.buttons()):
            button.setAutoDefault(False)  # Enter may be a key
        row = QtWidgets.QHBoxLayout()
        row.addWidget(QtWidgets.QLabel("New key"))
        for widget in (self.key, self.remove, self.preset, self.reset):
            row.addWidget(widget)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(self.table, 1)
        layout.addLayout(row)
        layout.addWidget(self.message)
        layout.addWidget(self.buttons)
        self.resize(620, 640)
        for column in (_KEYS, _ACTION):
            self.table.resizeColumnToContents(column)
        self.table.setCurrentItem(self.table.topLevelItem(0))
        self.table.setFocus()

    def assign(self, name: str, key: str) -> None:
        """Assign *key* to the action *name*, instead of its keys, unless something else has it."""
        if key in self._taken and name not in ("open", "save"):
            label = self._taken[key]
            self.message.setText(f"{key_cap(key)} is assigned to {label!r}; choose another key")
        else:
            self._assign(name, (key,))

    def _assign(self, name: str, keys: tuple[str, ...]) -> None:
        try:
            self.keys = keys_of({**self.keys.changes, name: keys})
            self.message.clear()
        except ArgumentError as error:
            self.message.setText(str(error).removeprefix("keys: "))
        self._show()

    def _reset(self) -> None:
        self.keys = keys_of(self.preset.currentText())
        self.message.clear()
        self._show()

    def _show(self) -> None:
        for row, name in enumerate(self._names):
            self.table.topLevelItem(row).setText(_KEYS, _caps(self.keys[name].keys))
        for row, (button, label) in enumerate(self.keys.mouse, self._n_keys):
            for column, text in ((_KEYS, button), (_ACTION, label)):
                self.table.topLevelItem(row).setText(column, text)

    @property
    def _selected(self) -> str:
        """The name of the selected action; "" for what is fixed."""
        row: int = self.table.indexOfTopLevelItem(self.table.currentItem())
        return self._names[row] if 0 <= row < len(self._names) else ""

    def _select(self) -> None:
        self.key.clear()
        for widget in (self.key, self.remove):
            widget.setEnabled(bool(self._selected))

    def _press(self) -> None:
        """Assign the first key that was pressed to the selected action."""
        text = self.key.keySequence().toString(QtGui.QKeySequence.SequenceFormat.PortableText)
        self.key.clear()
        if not text or not self._selected:
            return
        try:
            self.assign(self._selected, key_name(text.split(", ")[0]))
        except ArgumentError:
            self.message.setText("This key cannot be assigned; choose another key")


def menu_keys(bar: Any) -> dict[str, str]:
    """Return the keys of the entries of a menu bar, with the entries."""
    found = {}
    for top in bar.actions():
        before, _, after = top.text().partition("&")
        if after:
            found[key_name(f"Alt+{after[0]}")] = f"menu {before}{after}"
        for entry in top.menu().actions():
            for keys in entry.shortcuts():
                text = keys.toString(QtGui.QKeySequence.SequenceFormat.PortableText)
                found[key_name(text)] = entry.text().replace("&", "").removesuffix(" ...")
    return found


def _caps(keys: tuple[str, ...]) -> str:
    return "  ".join(map(key_cap, keys))


def _where(modes: frozenset[Mode]) -> str:
    """Return *modes* by their keys."""
    numbers = [str(mode.value) for mode in Mode if mode in modes]
    return "All" if len(numbers) == len(Mode) else ", ".join(numbers)
