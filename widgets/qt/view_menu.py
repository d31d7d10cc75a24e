"""Menus of the models: of the right button, and what is shown, with the views of the camera."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from qtpy import QtGui, QtWidgets

from ..editor import DeformEditor, Keys, key_cap, keys_of
from ..panel import Field, view_entries
from .controls import using

_Use = Callable[[str], object]
_DEFAULT = keys_of("pyvista")
# The letters that select entries while the menu is open.
_LETTERS = {
    "frame_all": "F", "frame_selection": "s", "viewpoint": "w", "orthographic": "O",
    "cube": "b", "front": "F", "back": "B", "right": "R", "left": "L", "top": "T", "bottom": "o",
    "home": "h", "iso": "I", "up_x": "X", "up_y": "Y", "up_z": "Z",
}  # fmt: skip


def add_view_entries(menu: Any, editor_of: Callable[[], DeformEditor | None]) -> None:
    """Add the entries to a QMenu.

    Parameters
    ----------
    menu : QMenu
        Where to add them.
    editor_of : callable
        Returns the editor to control; without one, the entries are disabled.
    """
    entries: dict[str, Any] = {}

    def use(name: str) -> None:
        editor = editor_of()
        if editor is not None:
            using(editor)(name)

    _add(menu, view_entries(None), entries, use)

    def update() -> None:
        editor = editor_of()
        _draw(entries, view_entries(editor), _DEFAULT if editor is None else editor.keys)

    update()
    menu.aboutToShow.connect(update)


def context_menu(parent: Any, fields: Iterable[Field | None], keys: Keys, use: _Use) -> Any:
    """Return a QMenu of *fields*, which calls *use* with the name of what is chosen."""
    menu, entries = QtWidgets.QMenu(parent), dict[str, Any]()
    fields = tuple(fields)
    _add(menu, fields, entries, use)
    _draw(entries, fields, keys)
    menu.aboutToHide.connect(menu.deleteLater)
    return menu


def name_keys(entries: Iterable[tuple[Any, str, str]], keys: Keys) -> None:
    """Show beside each entry the first key of its action; *entries* are (entry, text, action)."""
    for entry, text, action in entries:
        key = keys[action].keys[:1]
        entry.setText(f"{text}\t{key_cap(key[0])}" if key else text)


def add_entry(menu: Any, text: str) -> Any:
    """Add an action to a QMenu and return it.

    For the action of ``menu.addAction(text)`` PySide may return the wrapper of a deleted object
    that had its address.
    """
    action = QtGui.QAction(text, menu)
    menu.addAction(action)
    return action


def _add(menu: Any, fields: Iterable[Field | None], entries: dict[str, Any], use: _Use) -> None:
    """Add the entries of *fields* to a menu and to *entries*, by their names."""
    for field in fields:
        if field is None:
            menu.addSeparator()
        elif field.kind == "menu":
            entries[field.name] = menu.addMenu(_text(field))
            _add(entries[field.name], field.items, entries, use)
        else:
            entry = entries[field.name] = add_entry(menu, _text(field))
            entry.setCheckable(field.kind == "toggle")
            entry.triggered.connect(lambda *_, name=field.name: use(name))


def _draw(entries: dict[str, Any], fields: Iterable[Field | None], keys: Keys) -> None:
    for field in filter(None, fields):
        entry = entries[field.name]
        entry.setEnabled(field.enabled)
        if field.kind == "toggle":
            entry.setChecked(field.value)
        if field.action:
            name_keys([(entry, _text(field), field.action)], keys)
        _draw(entries, field.items, keys)


def _text(field: Field) -> str:
    """Return the label of *field* with the mark of its letter."""
    letter = _LETTERS.get(field.name.removeprefix("view."), "")
    return field.label.replace(letter, f"&{letter}", 1) if letter else field.label
