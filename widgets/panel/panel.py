"""The sections of the panel, and the one way to use a control."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import as_flag, as_text, require, shown
from vtk_segdeform.errors import ArgumentError

from ..editor import DeformEditor, Mode, jumping_to, preview
from .carried import carried_section
from .fields import Field, Item, Section, Table
from .handles import handles_section
from .landmarks import landmarks_section
from .menu import menu
from .motion import motion_section
from .options import advanced_section, cages_section, deform_section
from .painting import painting_section
from .poses import poses_section
from .pulling import pull_section
from .regions import regions_section
from .status import history, status
from .toolbar import toolbar
from .volumes import bodies_section, volumes_section

# From the top of the panel, with the modes of each.
_SECTIONS: tuple[tuple[Callable[[DeformEditor], Section], set[Mode]], ...] = (
    (pull_section, {Mode.PULL}),
    (handles_section, {Mode.PULL, Mode.HANDLES, Mode.DEFORM}),
    (motion_section, {Mode.DEFORM}),
    (poses_section, {Mode.PULL, Mode.DEFORM}),
    (landmarks_section, {Mode.PULL, Mode.DEFORM}),
    (cages_section, {Mode.CAGES}),
    (deform_section, {Mode.DEFORM}),
    (volumes_section, {Mode.PULL, Mode.DEFORM}),
    (bodies_section, {Mode.PULL, Mode.DEFORM}),
    (carried_section, {Mode.PULL, Mode.DEFORM}),
    (regions_section, {Mode.REGIONS, Mode.CAGES, Mode.DEFORM}),
    (advanced_section, {Mode.DEFORM}),
    (painting_section, {Mode.REGIONS, Mode.HANDLES}),
)
_NUMBERS = ("number", "integer", "slider")
_last: WeakKeyDictionary[DeformEditor, tuple[Section, ...]] = WeakKeyDictionary()


def sections(editor: DeformEditor) -> tuple[Section, ...]:
    """Return the visible sections in the present mode of *editor*, from the top.

    During a job, which owns the session, they are the last ones, disabled.
    """
    require(editor, DeformEditor, "editor")
    if not editor.is_busy:
        now = (build(editor) for build, modes in _SECTIONS if editor.mode in modes)
        _last[editor] = tuple(section for section in now if section.visible)
        return _last[editor]
    return tuple(_disabled(section) for section in _last.get(editor, ()))


def all_sections(editor: DeformEditor) -> tuple[Section, ...]:
    """Return the sections of all modes; those of other modes are not visible.

    Not during a job, which owns the session.
    """
    return tuple(_one_by_one(editor))


def _one_by_one(editor: DeformEditor) -> Iterator[Section]:
    """Yield the sections of all modes, each built when it is asked for."""
    for build, modes in _SECTIONS:
        section = build(editor)
        yield replace(section, visible=section.visible and editor.mode in modes)


def press(editor: DeformEditor, name: str, value: Any = None) -> Exception | None:
    """Use the control *name* of *editor*: what a click on it does, or entering *value*.

    A control that is disabled or not shown does nothing; during a job that is all of a section.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    name : str
        The name of a `Field`, of a menu's entry, or what a `Table` describes.  "history" jumps to
        the state at a position, and "history.preview" shows that, or with None the current one.
    value : bool, int, float, str or sequence, optional
        The new value; without one, a toggle is flipped.

    Returns
    -------
    error : Exception or None
        Why it failed, which the status shows, too; None if it succeeded.

    Raises
    ------
    ArgumentError
        If there is no such control, the skin has to ask for a file first, or *value* is not one
        that the control can have.
    """
    require(editor, DeformEditor, "editor")
    as_text(name, "name")
    if name in ("history", "history.preview"):
        return _go_back(editor, name, value)
    for field in _with_entries((*toolbar(editor), status(editor).cancel)):
        if field.name == name:
            return _use(editor, field, value, is_shown=True)
    if editor.is_busy:  # the job owns the session
        return None
    for entry in menu(editor):
        if entry is not None and entry.name == name:
            return _use(editor, entry, value, is_shown=True)
    table_name, _, verb = name.rpartition(".")
    for section in _one_by_one(editor):
        for field in section.fields:
            if field.name == name:
                return _use(editor, field, value, is_shown=section.visible)
        for table in section.tables:
            if table.name == table_name and verb in table.acts:
                arguments = _arguments(table, verb, value)
                works = section.visible and table.visible and table.enabled
                return editor.do(table.acts[verb](*arguments)) if works else None
    raise ArgumentError(f"name: there is no control {shown(name)} in the panel")


def file_field(editor: DeformEditor, name: str) -> Field:
    """Return a control of the kind "file" of a section, disabled where it is not shown.

    Not during a job, which owns the session.

    Raises
    ------
    ArgumentError
        If there is no such control.
    """
    for section in _one_by_one(editor):
        for field in section.fields:
            if field.name == name and field.kind == "file" and field.act is not None:
                is_shown = section.visible and field.visible
                return field if is_shown else replace(field, enabled=False)
    raise ArgumentError(f"name: there is no control {shown(name)} that asks for a file")


def use_file(editor: DeformEditor, name: str, *paths: Path) -> Exception | None:
    """Use the control `file_field` with what the skin has asked for: one file, or `several`."""
    field = file_field(editor, name)
    assert field.act is not None
    chosen: Any = paths if field.several else paths[0]
    return editor.do(field.act(chosen)) if field.enabled else None


def checked(field: Field, value: Any) -> Any:
    """Return *value* as the control *field* has it; raise an ArgumentError if it cannot."""
    name = field.name
    if field.kind in _NUMBERS:
        return _number(field, value)
    if field.kind == "choice":
        choices = [choice for _, choice in field.choices]
        if not isinstance(value, str) or value not in choices:
            raise ArgumentError(f"{name} must be one of {choices}; got {shown(value)}")
        return value
    if field.kind in ("toggle", "hold"):
        return not field.value if value is None else as_flag(value, name)
    if field.kind in ("file", "menu", "label"):
        what = {"file": "asks for a file", "menu": "opens a menu", "label": "only shows a text"}
        raise ArgumentError(f"{name} {what[field.kind]}; it cannot be pressed here")
    if value is not None:
        raise ArgumentError(f"{name} is a button without a value; got {shown(value)}")
    return None


def _number(field: Field, value: Any) -> float | None:
    low, high, is_real = field.minimum, field.maximum, field.kind == "number"
    if field.special and (value is None or (is_number(value) and value == low)):
        return None
    if is_real and is_number(value, low) and value <= high:
        return float(value)
    if not is_real and is_whole(value, low, high):
        return int(value)
    kind = "a number" if is_real else "an integer"
    none = f', or None for "{field.special}"' if field.special else ""
    raise ArgumentError(
        f"{field.name} must be {kind} from {low:g} to {high:g}{none}; got {shown(value)}"
    )


def _use(editor: DeformEditor, field: Field, value: Any, *, is_shown: bool) -> Exception | None:
    value = checked(field, value)
    is_end = field.kind == "hold" and not value  # which may come at any time
    works = is_shown and field.visible and field.enabled
    if not (works or is_end) or (field.kind == "toggle" and value == field.value):
        return None
    if field.act is None:
        return editor.run(field.action)
    return editor.do(field.act(value), while_busy=field.while_busy or is_end)


def _with_entries(fields: Iterable[Field | None]) -> Iterator[Field]:
    """Yield *fields* and the entries of menus among them."""
    for field in fields:
        if field is not None:
            yield field
            yield from _with_entries(field.items)


def _arguments(table: Table, verb: str, value: Any) -> tuple[Any, ...]:
    """Return the arguments of what *verb* does in *table*; raise an ArgumentError if it cannot."""
    name, rows = f"{table.name}.{verb}", {row.key: row for row in table.rows}
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise ArgumentError(f"{name} must be a list; got {shown(value)}")
    if verb == "select":
        if not all(isinstance(key, str) and key in rows for key in value):
            raise ArgumentError(f"{name} must have keys of {[*rows]}; got {shown(value)}")
        if len(value) > 1 and not table.multiple:
            raise ArgumentError(f"{name}: select one row only; got {shown(value)}")
        return (list(value),)
    if len(value) != 2 or not isinstance(value[0], str) or value[0] not in rows:
        raise ArgumentError(f"{name} must be a key of {[*rows]} and a value; got {shown(value)}")
    key, new = value
    if verb == "rename":
        if not rows[key].renamable:
            raise ArgumentError(f"{name}: {rows[key].label} cannot be renamed")
        return key, as_text(new, name)
    place = [column.name for column in table.columns].index(verb)
    if rows[key].cells[place].checked is None:
        raise ArgumentError(f"{name}: {rows[key].label} has no check box there")
    return key, as_flag(new, name)


def _go_back(editor: DeformEditor, name: str, position: Any) -> Exception | None:
    """Jump to the state at *position*, or show it for a moment."""
    is_jump, states = name == "history", history(editor)
    if (position is not None or is_jump) and not is_whole(position, 0, len(states) - 1):
        raise ArgumentError(
            f"{name} must be an integer from 0 to {len(states) - 1}; got {shown(position)}"
        )
    place = None if position is None else int(position)
    if place is None or not is_jump:
        preview(editor.controller, place)
        return None
    return None if editor.is_busy else editor.do(jumping_to(place))


def _disabled(section: Section) -> Section:
    def off(item: Item) -> Item:
        if isinstance(item, tuple):
            return tuple(replace(field, enabled=False) for field in item)
        return replace(item, enabled=False)

    return replace(section, items=tuple(map(off, section.items)))
