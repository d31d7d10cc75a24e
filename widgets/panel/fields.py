"""What the parts of a panel are, as plain data: every skin draws the same ones.

A `Field` is one control, a `Table` a list with columns, a `Section` a box with both.  They show the
editor at one moment and are built anew for the next one; equal ones look the same, so that a skin
needs to draw only those that differ from what it has drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..editor import Action, Keys, key_cap

Value = bool | int | float | str | None
"""The value of a field; None if it is automatic, or for a button without one."""
Act = Callable[[Any], Action]
"""Returns the action for a value; refers to no editor, which would keep that alive."""
Kind = Literal[
    "button", "toggle", "hold", "number", "integer", "slider", "choice", "label", "menu", "file"
]


@dataclass(frozen=True)
class Field:
    """One control, as it is now."""

    name: str
    """Unique and stable, as in "pull.radius"; for `press`."""
    kind: Kind
    """A button that does something, or stays down with others of its `group`; a toggle; a button
    that applies while it is held; a number; a slider; a choice; a text that only shows; a menu of
    `items`; or a button for which the skin itself asks for a file."""
    label: str = ""
    """What it is called, or the text of a button."""
    tip: str = ""
    """Its tooltip, without the key: see `tooltip`."""
    action: str = ""
    """The action in the table of keys whose key the tooltip names, if any."""
    value: Value = None
    """What it shows; None for `special`.  Of a button: whether it is down, or None."""
    enabled: bool = True
    visible: bool = True
    minimum: float = 0.0
    maximum: float = 1.0
    step: float = 1.0
    page: float = 10.0
    """A large step of a slider."""
    decimals: int = 0
    prefix: str = ""
    unit: str = ""
    """After a number: "%", or a remark in parentheses."""
    special: str = ""
    """The text for None, as in "Auto"; without it, None is no value of a number."""
    on_release: bool = False
    """Whether a slider reports only where it is released: what follows takes its time."""
    choices: tuple[tuple[str, str], ...] = ()
    """The label and the value of each choice."""
    icon: str = ""
    group: str = ""
    """The group of a button: one of those with a value in a group is down."""
    items: tuple[Field | None, ...] = ()
    """The entries of a menu; None separates two groups."""
    suffixes: tuple[str, ...] = ()
    """Of the files that a "file" of a section asks for; without any, of any kind."""
    several: bool = False
    """Whether it may be more than one file."""
    saves: bool = False
    """Whether it writes this file."""
    while_busy: bool = False
    """Whether it works during a job and leaves a drag alone."""
    act: Act | None = field(default=None, compare=False, repr=False)
    """What `press` does with a value; by default it runs `action`."""


@dataclass(frozen=True)
class Column:
    """A column of a table, after the first one with the names."""

    name: str
    title: str
    tip: str = ""


@dataclass(frozen=True)
class Cell:
    """What a row has in a column: a text, a check box or both."""

    text: str = ""
    checked: bool | None = None
    """Whether the box is checked; None without a box."""


@dataclass(frozen=True)
class Row:
    """One line of a table."""

    key: str
    """What it is about, for `press`: it stays the same while other rows come and go."""
    label: str
    colour: tuple[int, int, int]
    """Red, green and blue, 0 to 255."""
    cells: tuple[Cell, ...] = ()
    """One for each column of the table."""
    selected: bool = False
    renamable: bool = False
    picture: str = ""
    """A data URL of a picture to show instead of the colour."""


@dataclass(frozen=True)
class Table:
    """Rows with a colour, a name and columns.

    ``press(editor, "NAME.select", keys)`` selects the rows with these keys, ``"NAME.rename"`` with
    (key, text) renames one, and ``"NAME.COLUMN"`` with (key, bool) checks the box in a column.
    """

    name: str
    title: str
    """Title of the first column."""
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    tip: str = ""
    n_rows: int = 6
    """The number of rows to leave room for."""
    multiple: bool = False
    """Whether several rows may be selected."""
    enabled: bool = True
    visible: bool = True
    acts: Mapping[str, Callable[..., Action]] = field(
        default_factory=dict, compare=False, repr=False
    )
    """What `press` does, by "select", "rename" or the name of a column."""


Item = Field | Table | tuple[Field, ...]
"""One line of a section: a field, a table, or fields side by side."""


@dataclass(frozen=True)
class Section:
    """One box of the panel."""

    name: str
    title: str
    items: tuple[Item, ...]
    visible: bool = True
    advice: str = ""
    """When one needs it; such a section is folded at first, and shows only this."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """All fields, in their order."""
        found: list[Field] = []
        for item in self.items:
            if not isinstance(item, Table):
                found += item if isinstance(item, tuple) else (item,)
        return tuple(found)

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables, in their order."""
        return tuple(item for item in self.items if isinstance(item, Table))


@dataclass(frozen=True)
class Word:
    """A part of a hint."""

    text: str
    action: str = ""
    """The action that a click on it runs, by `DeformEditor.run`; "" for plain text."""


@dataclass(frozen=True)
class Status:
    """The status of the editor."""

    text: str
    """The error, the last result, or the progress of a job; may be ""."""
    is_error: bool
    words: tuple[Word, ...]
    """The next step, with keys to click on."""
    is_busy: bool
    """Whether a job runs; everything but the camera, help and cancel waits for it."""
    work: str
    """Name of the job, or of the work in the background, whose progress is known; or ""."""
    progress: float | None
    """Completed fraction of the job or the work in the background, 0..1; None if there is none."""
    volume: str
    """The volume change of the mesh; "" if it is not known now."""
    state: str
    """The size of the mesh."""
    cancel: Field
    """The button that cancels the job or work; visible while there is any."""

    @property
    def hint(self) -> str:
        """The next step as plain text."""
        return "".join(word.text for word in self.words)


@dataclass(frozen=True)
class Entry:
    """A state in the history; its place is that in the list."""

    name: str
    is_current: bool = False
    is_undone: bool = False


def key_button(keys: Keys, name: str, action: str, label: str = "", **state: Any) -> Field:
    """Return a button for an *action* of the table of *keys*, with its label or *label*.

    *state* are other attributes of the `Field`.
    """
    tip = keys[action].label
    return Field(name, "button", label or tip, tip, action, **state)


def option(name: str) -> Act:
    """Return what a field does with a value of an option of the session."""
    return lambda value: lambda controller: controller.session.change_options(**{name: value})


def as_rgb(colour: NDArray[np.uint8]) -> tuple[int, int, int]:
    """Return a colour (3,), 0 to 255, as a tuple."""
    red, green, blue = colour.tolist()
    return red, green, blue


def tooltip(item: Field, keys: Keys) -> str:
    """Return the tooltip of a field, with the first key of its action in *keys*."""
    caps = [key_cap(key) for key in keys[item.action].keys[:1]] if item.action else []
    return f"{item.tip} ({caps[0]})" if caps else item.tip
