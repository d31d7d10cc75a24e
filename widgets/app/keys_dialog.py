"""The dialog in which keys are assigned to actions, and the settings that store them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.errors import ArgumentError

from ..editor import PRESETS, Keys, Mode, key_cap, key_name, keys_of

Qt = QtCore.Qt
_SETTING = "keys"
_ACTION, _MODES, _KEYS = range(3)
_HOW = "Select an action and press Enter, then its new key"
_NUMBER = {*"0123456789", "period", "minus", "backspace"}  # with Enter, the amount of a drag
_NUMBER_LABEL, _NUMBER_MODES = (
    "While dragging: type the amount",
    frozenset({Mode.PULL, Mode.DEFORM}),
)
_ALONE = (Qt.Key.Key_Shift, Qt.Key.Key_Control, Qt.Key.Key_Alt, Qt.Key.Key_Meta, Qt.Key.Key_AltGr)


def read_keys(settings: Any) -> tuple[Keys, str]:
    """Return the stored keys, and why the default ones are used instead, or ""."""
    stored = settings.value(_SETTING) or "{}"
    try:
        return keys_of(json.loads(stored)), ""
    except (ValueError, TypeError) as fault:  # an ArgumentError is a ValueError
        return keys_of("pyvista"), f"Default keys are used; the stored ones are invalid: {fault}"


def write_keys(settings: Any, keys: Keys) -> None:
    """Store the keys."""
    settings.setValue(_SETTING, json.dumps(keys.changes))
    settings.sync()


def choose_keys(parent: Any, keys: Keys, taken: Mapping[str, str]) -> Keys | None:
    """Ask for other keys; None if the user cancels.  *taken* are keys of menus, with labels."""
    dialog = KeysDialog(parent, keys, taken)
    accepted = dialog.exec() == QtWidgets.QDialog.DialogCode.Accepted
    dialog.deleteLater()
    return dialog.keys if accepted else None


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


class KeysDialog(QtWidgets.QDialog):
    """A table of the actions and their keys; below them the keys that are fixed.

    Parameters
    ----------
    parent : QWidget
        The window.
    keys : Keys
        The keys at first.
    taken : mapping of str to str
        Keys of the menus, which no action can have, with labels.

    Attributes
    ----------
    keys : Keys
        The chosen keys.
    table, preset, message : QTreeWidget, QComboBox, QLabel
        The actions; the presets; what to do next, or which action has lost its key.
    """

    def __init__(self, parent: Any, keys: Keys, taken: Mapping[str, str]) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys")
        self.keys = keys
        self._taken = taken
        self._is_waiting = False  # for the new key
        self.table = QtWidgets.QTreeWidget()
        self.table.setHeaderLabels(["Action", "Modes", "Keys"])
        self.table.setRootIsDecorated(False)
        self.table.setTabKeyNavigation(False)  # Tab leaves the table
        self.table.installEventFilter(self)
        self.table.itemDoubleClicked.connect(lambda *_: self._wait())
        for binding in keys.bindings:
            if binding.name:
                QtWidgets.QTreeWidgetItem(self.table, [binding.label, _where(binding.modes), ""])
        for label, where, caps in self._fixed():
            fixed = QtWidgets.QTreeWidgetItem(self.table, [label, where, f"{caps} (fixed)"])
            fixed.setFlags(Qt.ItemFlag.NoItemFlags)
        self._names = [binding.name for binding in keys.bindings if binding.name]
        self.table.setCurrentItem(self.table.topLevelItem(0))
        self.message = QtWidgets.QLabel(_HOW)
        self.message.setWordWrap(True)
        self.preset = QtWidgets.QComboBox()
        self.preset.addItems([*PRESETS])
        changes = [list(preset.items()) for preset in PRESETS.values()]
        mine = sorted(keys.changes.items())
        self.preset.setCurrentIndex(
            next((k for k, c in enumerate(changes) if sorted(c) == mine), 0)
        )
        self.preset.setToolTip("The keys that Reset assigns")
        self.reset = QtWidgets.QPushButton("Reset to preset")
        self.reset.clicked.connect(self._reset)
        self.remove = QtWidgets.QPushButton("Remove key")
        self.remove.clicked.connect(self._remove)
        standard = QtWidgets.QDialogButtonBox.StandardButton
        self.buttons = QtWidgets.QDialogButtonBox(standard.Ok | standard.Cancel)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        for button in (self.reset, self.remove):
            button.setAutoDefault(False)
        row = QtWidgets.QHBoxLayout()
        for widget in (self.remove, self.preset, self.reset):
            row.addWidget(widget)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(self.table, 1)
        layout.addWidget(self.message)
        layout.addLayout(row)
        layout.addWidget(self.buttons)
        self.resize(460, 560)
        self._show()
        for column in range(3):
            self.table.resizeColumnToContents(column)
        self.table.setFocus()

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """Begin to wait for a key at Enter; then assign the next one, unless it is Escape."""
        kinds = QtCore.QEvent.Type
        if watched is not self.table or event.type() not in (
            kinds.KeyPress,
            kinds.ShortcutOverride,
        ):
            return False
        if not self._is_waiting:
            enter = event.type() == kinds.KeyPress and event.key() in (
                Qt.Key.Key_Return,
                Qt.Key.Key_Enter,
            )
            if enter:
                self._wait()
            return bool(enter)
        if event.type() == kinds.ShortcutOverride:
            event.accept()  # otherwise a shortcut of the window would run
        elif event.key() not in _ALONE:
            self._is_waiting = False
            self.message.setText(_HOW)
            if event.key() != Qt.Key.Key_Escape:
                self._press(event)
        return True

    def assign(self, name: str, key: str) -> None:
        """Assign *key* to the action *name*, instead of its keys; another action loses *key*."""
        cap, others = key_cap(key), self.keys.conflicts(name, key)
        reserved = [other.label for other in others if not other.name]
        if key in self._taken and name not in ("open", "save"):
            reserved.append(self._taken[key])
        if reserved:
            self.message.setText(f"{cap} is used by: {reserved[0]}. Choose another key")
            return
        changes = dict(self.keys.changes)
        for other in others:
            changes[other.name] = tuple(each for each in other.keys if each != key)
        changes[name] = (key,)
        self.keys = keys_of(changes)
        lost = [
            f"{other.label} has {'no key' if not changes[other.name] else 'other keys'} now"
            for other in others
        ]
        uses = self.keys.fixed_uses(name, key)
        if key in _NUMBER and self.keys[name].modes & _NUMBER_MODES:
            uses.append(_NUMBER_LABEL)
        said = [f"{cap} was the key of another action: {'; '.join(lost)}"] if lost else []
        said += [f"{cap} also has a fixed use. {use}" for use in uses]
        self.message.setText(". ".join(said) or _HOW)
        self._show()

    # Pieces.

    def _fixed(self) -> list[tuple[str, str, str]]:
        """Return label, modes and keys of what is fixed: keys of widgets, and of the menus."""
        rows = [
            (binding.label, _where(binding.modes), "  ".join(map(key_cap, binding.keys)))
            for binding in self.keys.bindings
            if not binding.name
        ]
        rows.append((_NUMBER_LABEL, _where(_NUMBER_MODES), "0 ... 9  .  -"))
        menus = [(label, key_cap(key)) for key, label in self._taken.items()]
        return rows + [(label[:1].upper() + label[1:], "Menus", cap) for label, cap in menus]

    def _show(self) -> None:
        for row, name in enumerate(self._names):
            caps = "  ".join(map(key_cap, self.keys[name].keys))
            self.table.topLevelItem(row).setText(_KEYS, caps)

    @property
    def _selected(self) -> str:
        row: int = self.table.indexOfTopLevelItem(self.table.currentItem())
        return self._names[row]

    def _wait(self) -> None:
        self._is_waiting = True
        label = self.keys[self._selected].label
        self.message.setText(f"Press the new key of: {label}. Esc to cancel")
        self.table.setFocus()

    def _press(self, event: Any) -> None:
        """Assign the key of *event* to the selected action."""
        pad = Qt.KeyboardModifier.KeypadModifier
        text = QtGui.QKeySequence(event.key()).toString(
            QtGui.QKeySequence.SequenceFormat.PortableText
        )
        on_pad = bool(event.modifiers() & pad)
        try:
            key = key_name(f"Num {text}" if on_pad and text.isdigit() else text)
        except ArgumentError:
            self.message.setText("This key cannot be assigned. Choose another key")
            return
        held = {
            "Ctrl": Qt.KeyboardModifier.ControlModifier,
            "Alt": Qt.KeyboardModifier.AltModifier,
            "Shift": Qt.KeyboardModifier.ShiftModifier,
        }
        modifiers = [f"{name}+" for name, flag in held.items() if event.modifiers() & flag]
        self.assign(self._selected, key_name("".join(modifiers) + key))

    def _remove(self) -> None:
        self.keys = keys_of({**self.keys.changes, self._selected: ()})
        self._show()

    def _reset(self) -> None:
        self.keys = keys_of(self.preset.currentText())
        self.message.setText(_HOW)
        self._show()


def _where(modes: frozenset[Mode]) -> str:
    """Return *modes* by their keys."""
    numbers = [str(mode.value) for mode in Mode if mode in modes]
    return "All" if len(numbers) == len(Mode) else ", ".join(numbers)
