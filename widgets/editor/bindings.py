"""The keys of the editor: one table, from which they work and from which the help card is made.

A key is VTK's name of it in lower case, after what is held down with it: "z", "ctrl+z", "f1",
"ctrl+shift+z".  The same key may mean different things in different modes, and a key that means
something in another mode only is not passed on to VTK, whose own keys would surprise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..region_selector import Paint, Tool
from . import actions, take_actions
from .actions import Action
from .help_card import Section
from .stage import Mode

R, C, H, D = Mode
ALL = frozenset(Mode)
PAINTING = frozenset({R, H})


@dataclass(frozen=True)
class Binding:
    """What some keys do in some modes."""

    keys: tuple[str, ...]
    modes: frozenset[Mode]
    label: str
    action: Action | None
    """None if a widget takes these keys by itself, so that they are only told of."""
    while_busy: bool = False
    """Whether it works while a job is running."""


BINDINGS = (
    *(
        Binding((str(mode.value),), ALL, label, actions.to_mode(mode))
        for mode, label in (
            (R, "regions: paint them"),
            (C, "cages: drag vertices"),
            (H, "handles: mark what moves"),
            (D, "deform: drag handles"),
        )
    ),
    Binding(("g",), ALL, "find regions", actions.segment),
    Binding(("f",), ALL, "fit cages", actions.fit_cages),
    Binding(("z", "ctrl+z"), ALL, "undo", actions.undo),
    Binding(("y", "ctrl+y", "ctrl+shift+z"), ALL, "redo", actions.redo),
    Binding(("0", "home"), ALL, "back to rest", actions.reset),
    Binding(("c",), ALL, "show or hide cages", actions.toggle_cages),
    Binding(("p",), ALL, "hold or free the volume", actions.toggle_volume),
    Binding(("ctrl+s",), ALL, "save", actions.save),
    Binding(("ctrl+o",), ALL, "open", actions.open_file),
    Binding(("ctrl+r",), ALL, "record what you do", take_actions.record),
    Binding(("ctrl+m",), ALL, "film the drags", take_actions.film),
    Binding(("h", "f1", "question"), ALL, "this card", actions.toggle_help, while_busy=True),
    Binding(("escape",), ALL, "cancel", actions.cancel, while_busy=True),
    Binding(("b",), PAINTING, "brush", actions.with_tool(Tool.BRUSH)),
    Binding(("l",), PAINTING, "lasso", actions.with_tool(Tool.LASSO)),
    Binding(("t",), PAINTING, "rectangle", actions.with_tool(Tool.RECTANGLE)),
    Binding(("k",), PAINTING, "whole component", actions.with_tool(Tool.COMPONENT)),
    Binding(("bracketleft", "bracketright"), PAINTING, "smaller, larger brush", None),
    Binding(("v",), PAINTING, "reach through, or not", actions.toggle_through),
    Binding(("plus", "equal"), PAINTING, "grow by one ring", actions.grow),
    Binding(("minus",), PAINTING, "shrink by one ring", actions.shrink),
    Binding(("n", "tab"), frozenset({R}), "next region", actions.next_region),
    Binding(("a",), frozenset({R}), "new region", actions.new_region),
    Binding(("m",), frozenset({R}), "merge with pointed at", actions.merge_region),
    Binding(("x",), frozenset({R}), "cut in two", actions.split_region),
    Binding(("s",), frozenset({H}), "paint what stays", actions.painting(Paint.FIXED)),
    Binding(("d",), frozenset({H}), "paint what is dragged", actions.painting(Paint.HANDLE)),
    Binding(("a",), frozenset({H}), "new handle", actions.new_handle),
    Binding(("n", "tab"), frozenset({H, D}), "next handle", actions.next_handle),
    Binding(("delete", "backspace"), frozenset({H, D}), "remove handle", actions.remove_handle),
    Binding(("o",), frozenset({C, D}), "show or hide volumes", actions.toggle_overlay),
    Binding(("x", "y", "z"), frozenset({D}), "in a drag: along an axis", None),
)

_HEADINGS = {
    ALL: "Everywhere",
    frozenset({R}): "1 Regions",
    PAINTING: "1 Regions, 3 Handles",
    frozenset({H}): "3 Handles",
    frozenset({H, D}): "3 Handles, 4 Deform",
    frozenset({C, D}): "2 Cages, 4 Deform",
    frozenset({D}): "4 Deform",
}
_CAPS = {
    "ctrl": "Ctrl",
    "shift": "Shift",
    "escape": "Esc",
    "question": "?",
    "bracketleft": "[",
    "bracketright": "]",
    "plus": "+",
    "minus": "-",
    "delete": "Del",
}
_ALSO = {"kp_add": "plus", "kp_subtract": "minus", "iso_left_tab": "tab"}
_UNTOLD = {"equal", "backspace", "ctrl+shift+z"}  # what others expect, or some keyboards need


def pressed_key(interactor: Any) -> str:
    """Return the key that is pressed now, as the table names it."""
    key = (interactor.GetKeySym() or "").lower()
    key = _ALSO.get(key, key.removeprefix("kp_"))
    # Shift is part of how "?" or "+" is typed, and says something with letters only.
    shift = interactor.GetShiftKey() and len(key) == 1 and key.isalpha()
    held = (
        (interactor.GetControlKey(), "ctrl+"),
        (interactor.GetAltKey(), "alt+"),
        (shift, "shift+"),
    )
    return "".join(name for is_down, name in held if is_down) + key


def binding_of(key: str, mode: Mode) -> Binding | None:
    """Return what *key* does in *mode*, if anything."""
    found = (b for b in BINDINGS if key in b.keys and mode in b.modes and b.action is not None)
    return next(found, None)


def modes_of(key: str) -> list[tuple[Mode, str]]:
    """Return the modes in which *key* does something, and what."""
    return [
        (mode, b.label) for b in BINDINGS if key in b.keys for mode in sorted_modes(b) if b.action
    ]


def sorted_modes(binding: Binding) -> list[Mode]:
    """Return the modes of a binding in their order."""
    return [mode for mode in Mode if mode in binding.modes]


def key_cap(key: str) -> str:
    """Return what stands on a key: "Ctrl+Z", "Esc", "["."""
    return "+".join(_CAPS.get(part, part.capitalize()) for part in key.split("+"))


def help_sections() -> list[Section]:
    """Return the table for people, by the modes in which keys work."""
    return [
        (
            heading,
            [
                ("  ".join(key_cap(key) for key in b.keys if key not in _UNTOLD), b.label)
                for b in BINDINGS
                if b.modes == modes
            ],
        )
        for modes, heading in _HEADINGS.items()
    ]
