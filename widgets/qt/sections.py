"""A section of the panel: a box with the fields and tables of its model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import Keys
from ..panel import Field, Item, Section, Table, tooltip
from .controls import (
    Press,
    Slider,
    check_box,
    choice_box,
    column,
    folding_button,
    form,
    highlighted,
    number_box,
    push_button,
    row,
    with_figure,
)
from .tables import TableView

_NUMBERS = {"number", "integer", "slider"}
_IN_FORMS = _NUMBERS | {"choice", "label"}


class SectionBox(QtWidgets.QGroupBox):
    """A box that shows a `Section`.

    Parameters
    ----------
    section : Section
        What to show at first, with all fields that it may have.
    press : callable
        ``press(name, value)``, called when a control is used.

    Attributes
    ----------
    controls : dict of str to QWidget
        The control of each field and table, by its name.
    fold : QToolButton, optional
        Shows the controls of a section with an advice while it is down.
    """

    def __init__(self, section: Section, press: Press) -> None:
        super().__init__(section.title)
        self.controls: dict[str, Any] = {}
        self._press = press
        self._drawn: dict[str, tuple[Field, str]] = {}  # by name, with the tooltip
        self._labels: dict[str, Any] = {}  # of the controls in forms
        self._groups: dict[str, Any] = {}
        lines: list[Any] = []
        for is_form, group in groupby(section.items, key=_is_in_form):
            items = list(group)
            lines += [self._form(items)] if is_form else [self._line(item) for item in items]
        if section.advice:
            inside = QtWidgets.QWidget()
            column(inside, *lines)
            inside.layout().setContentsMargins(0, 0, 0, 0)
            self.fold = folding_button(section.advice, inside)
            lines = [self.fold, inside]
        column(self, *lines)

    def draw(self, section: Section, keys: Keys) -> None:
        """Show *section*, with *keys* in the tooltips."""
        for table in section.tables:
            self.controls[table.name].draw(table)
            self.controls[table.name].setVisible(table.visible)
        for field in section.fields:
            control, now = self.controls[field.name], (field, tooltip(field, keys))
            before = self._drawn.get(field.name)
            if now != before:
                self._drawn[field.name] = now
                _set_up(control, field, before and before[0])
                control.setEnabled(field.enabled)
                for each in filter(None, (control, self._labels.get(field.name))):
                    each.setToolTip(now[1])
                    each.setVisible(field.visible)
            _put(control, field)  # it may show a change that was refused

    def _form(self, fields: Sequence[Any]) -> Any:
        made = {field.name: self._made(field) for field in fields}
        places = [with_figure(each) if isinstance(each, Slider) else each for each in made.values()]
        layout = form(*((field.label, place) for field, place in zip(fields, places, strict=True)))
        self._labels |= zip(made, map(layout.labelForField, places), strict=True)
        return layout

    def _line(self, item: Any) -> Any:
        if isinstance(item, Table):
            self.controls[item.name] = TableView(item, self._press)
            return self.controls[item.name]
        return row(*map(self._made, item)) if isinstance(item, tuple) else self._made(item)

    def _made(self, field: Field) -> Any:
        """Return a new control for *field*."""
        control = self.controls[field.name] = _control(field, partial(self._press, field.name))
        if field.group:
            group = self._groups.setdefault(field.group, QtWidgets.QButtonGroup(self))
            group.addButton(highlighted(control))
        _set_up(control, field, None)
        return control


def _is_in_form(item: Item) -> bool:
    return isinstance(item, Field) and item.kind in _IN_FORMS


def _control(field: Field, press: Callable[..., object]) -> Any:
    """Return the control of the kind of *field*, which calls *press* with its value."""
    control: Any
    if field.kind == "button":
        control = push_button(field.label)
        control.clicked.connect(lambda: press())
    elif field.kind == "file":
        control = push_button(field.label)
        control.clicked.connect(lambda: _ask(control, field, press))
    elif field.kind == "toggle":
        control = check_box(field.label)
        control.clicked.connect(lambda on: press(on))
    elif field.kind == "choice":
        control = choice_box([])
        control.activated.connect(lambda place: press(control.itemData(place)))
    elif field.kind == "label":
        control = QtWidgets.QLabel()
    else:
        if field.kind == "slider":
            control = Slider(on_release=field.on_release)
        else:
            is_whole = field.kind == "integer"
            control = number_box(QtWidgets.QSpinBox() if is_whole else QtWidgets.QDoubleSpinBox())
        control.valueChanged.connect(lambda value: press(value))
    return control


def _ask(parent: Any, field: Field, press: Callable[..., object]) -> None:
    """Ask for the file of *field*, and use that."""
    title, every = field.label.rstrip(" ."), ";;All files (*)" * (not field.saves)
    kinds = f"{title} ({' '.join('*' + suffix for suffix in field.suffixes)}){every}"
    if field.saves:
        path, _ = QtWidgets.QFileDialog.getSaveFileName(parent, title, "", kinds)
    else:
        ask = QtWidgets.QFileDialog
        if field.several:
            paths, _ = ask.getOpenFileNames(parent, title, "", kinds)
            if paths:
                press([*map(Path, paths)])
            return
        path, _ = ask.getOpenFileName(parent, title, "", kinds)
    if path:
        chosen = Path(path)
        is_whole = chosen.suffix or not field.saves
        press(chosen if is_whole else chosen.with_suffix(field.suffixes[0]))


def _set_up(control: Any, field: Field, before: Field | None) -> None:
    """Show all of *field* but its value; it differs from *before*, which is shown."""
    if isinstance(control, QtWidgets.QAbstractButton):
        control.setText(field.label)
    elif field.kind == "choice" and (before is None or field.choices != before.choices):
        quiet = QtCore.QSignalBlocker(control)
        control.clear()
        for label, value in field.choices:
            control.addItem(label, value)
        quiet.unblock()
    elif field.kind in _NUMBERS and (before is None or _frame_of(field) != _frame_of(before)):
        quiet = QtCore.QSignalBlocker(control)
        whole = int if field.kind != "number" else float
        if field.kind == "number":
            control.setDecimals(field.decimals)
        control.setRange(whole(field.minimum), whole(field.maximum))
        control.setSingleStep(whole(field.step))
        if field.kind == "slider":
            control.setPageStep(round(field.page))
            control.set_unit(field.unit)
        else:
            control.setPrefix(f"{field.prefix} " if field.prefix else "")
            control.setSuffix(f" {field.unit}" if field.unit else "")
            control.setSpecialValueText(field.special)
        quiet.unblock()


def _frame_of(field: Field) -> tuple[object, ...]:
    """Return what a number is shown in; to set that again would discard what is being typed."""
    return (
        field.minimum, field.maximum, field.step, field.page, field.decimals,
        field.prefix, field.unit, field.special,
    )  # fmt: skip


def _put(control: Any, field: Field) -> None:
    """Show the value of *field*; emit no signals."""
    value: Any = field.minimum if field.special and field.value is None else field.value
    if field.kind in ("button", "file"):
        if value is not None:
            control.setChecked(value)  # only clicks trigger its action
        return
    quiet = QtCore.QSignalBlocker(control)
    if field.kind == "toggle":
        control.setChecked(value)
    elif field.kind == "choice":
        control.setCurrentIndex([choice for _, choice in field.choices].index(value))
    elif field.kind == "label":
        control.setText(value)
    elif field.kind == "slider":
        if not control.isSliderDown():
            control.setValue(round(value))
    elif not control.hasFocus() or not control.lineEdit().isModified():  # else the user types
        control.setValue(value if field.kind == "number" else round(value))
    quiet.unblock()
