"""The keys of the editor: one table for the key handler, the help card and the documentation.

A key is VTK's name in lower case after its modifiers: "z", "ctrl+z", "f1", "ctrl+shift+z".  A key
may have different actions in different modes.  A key of another mode is not passed on to VTK,
whose own commands would surprise the user.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..region_selector import Paint, Tool
from . import actions, recording_actions, view_actions
from .actions import Action
from .help_card import Section
from .mode import Mode

P, R, C, H, D = Mode
ALL = frozenset(Mode)
PAINTING = frozenset({R, H})
BEFORE_AFTER = "backslash"  # acts while it is held
DRAGGING = frozenset({P, D})
_VIEW = "View"


@dataclass(frozen=True)
class Binding:
    """The action of some keys in some modes."""

    keys: tuple[str, ...]
    modes: frozenset[Mode]
    label: str
    action: Action | None
    """None if a widget handles these keys itself and they are listed for the help card only."""
    while_busy: bool = False
    """Whether the keys work while a job is running."""
    heading: str = ""
    """The section of the help card; by default that of the modes."""


BINDINGS = (
    *(
        Binding((str(mode.value),), ALL, label, actions.to_mode(mode))
        for mode, label in (
            (P, "Pull the surface"),
            (R, "Regions: paint"),
            (C, "Cages: drag vertices"),
            (H, "Handles: paint"),
            (D, "Deform: drag handles"),
        )
    ),
    Binding(("g",), ALL, "Auto-segment", actions.segment),
    Binding(("f",), ALL, "Fit cages", actions.fit_cages),
    Binding(("z", "ctrl+z"), ALL, "Undo", actions.undo),
    Binding(("y", "ctrl+y", "ctrl+shift+z"), ALL, "Redo", actions.redo),
    Binding(("home",), ALL, "Reset pose", actions.reset),
    Binding(("c",), ALL, "Show cages in all modes", actions.toggle_cages),
    Binding(("p",), ALL, "Preserve volume", actions.toggle_volume),
    Binding(("i",), ALL, "Show holes and changed places", actions.toggle_notices, while_busy=True),
    Binding(("ctrl+s",), ALL, "Save", actions.save),
    Binding(("ctrl+o",), ALL, "Open", actions.open_file),
    Binding(("ctrl+r",), ALL, "Record input", recording_actions.record_input),
    Binding(("ctrl+m",), ALL, "Record video", recording_actions.record_video),
    Binding(("h", "f1", "question"), ALL, "Show keys", actions.toggle_help, while_busy=True),
    Binding(("escape",), ALL, "Cancel", actions.cancel, while_busy=True),
    Binding(("b",), PAINTING, "Brush", actions.with_tool(Tool.BRUSH)),
    Binding(("l",), PAINTING, "Lasso", actions.with_tool(Tool.LASSO)),
    Binding(("t",), PAINTING, "Rectangle", actions.with_tool(Tool.RECTANGLE)),
    Binding(("k",), PAINTING, "Connected part", actions.with_tool(Tool.COMPONENT)),
    Binding(("bracketleft", "bracketright"), PAINTING, "Smaller, larger brush", None),
    Binding(("bracketleft", "bracketright"), frozenset({P}), "Smaller, larger radius", None),
    Binding(("plus", "equal"), frozenset({P}), "More local", actions.more_local),
    Binding(("minus",), frozenset({P}), "Less local", actions.less_local),
    Binding(("a",), frozenset({P}), "Automatic locality", actions.auto_locality),
    Binding(("u",), frozenset({P}), "Remove all pins", actions.unpin_all),
    Binding(("r",), frozenset({P}), "While pulling: turn", None),
    Binding(("v",), PAINTING, "Select through (X-ray)", actions.toggle_through),
    Binding(("plus", "equal"), PAINTING, "Grow by one ring", actions.grow),
    Binding(("minus",), PAINTING, "Shrink by one ring", actions.shrink),
    Binding(("n", "tab"), frozenset({R}), "Next region", actions.next_region),
    Binding(("a",), frozenset({R}), "New region", actions.new_region),
    Binding(("m",), frozenset({R}), "Merge with region under pointer", actions.merge_region),
    Binding(("x",), frozenset({R}), "Split region", actions.split_region),
    Binding(("s",), frozenset({H}), "Paint fixed vertices", actions.painting(Paint.FIXED)),
    Binding(("d",), frozenset({H}), "Paint handle", actions.painting(Paint.HANDLE)),
    Binding(("a",), frozenset({H}), "New handle", actions.new_handle),
    Binding(("n", "tab"), frozenset({H, D}), "Next handle", actions.next_handle),
    Binding(("delete", "backspace"), frozenset({H, D}), "Remove handle", actions.remove_handle),
    Binding(("m",), DRAGGING, "Make a pin a handle, or back", actions.convert_handle),
    Binding(("l",), frozenset({D}), "Local or global axes", actions.toggle_local_axes),
    Binding(("v",), frozenset({D}), "Pivot under the pointer, or reset", actions.move_pivot),
    Binding(("o",), frozenset({P, C, D}), "Show local volume change", actions.toggle_overlay),
    Binding(("x", "y", "z"), DRAGGING, "While dragging: constrain to axis", None),
    Binding(("return",), DRAGGING, "After a number: drag by exactly that", None),
    # How the mesh is shown.
    Binding(("w",), ALL, "Shaded, with edges, wireframe", actions.next_style),
    Binding(("shift+g",), ALL, "Show regions", actions.toggle_regions),
    Binding((BEFORE_AFTER,), ALL, "Hold: show the mesh at rest", actions.show_rest),
    *(
        Binding((key,), ALL, label, action, while_busy=True, heading=_VIEW)
        for key, label, action in (
            ("kp_1", "Front", view_actions.looking_from("front")),
            ("ctrl+kp_1", "Back", view_actions.looking_from("back")),
            ("kp_3", "Right", view_actions.looking_from("right")),
            ("ctrl+kp_3", "Left", view_actions.looking_from("left")),
            ("kp_7", "Top", view_actions.looking_from("top")),
            ("ctrl+kp_7", "Bottom", view_actions.looking_from("bottom")),
            ("kp_0", "Three-quarter view", view_actions.looking_from("home")),
            ("kp_5", "Orthographic or perspective", view_actions.toggle_projection),
            ("period", "Frame selection", view_actions.frame_selection),
            ("comma", "Frame all", view_actions.frame_all),
        )
    ),
)

_HEADINGS = {
    ALL: "All modes",
    frozenset({P}): "0 Pull",
    DRAGGING: "0 Pull, 4 Deform",
    frozenset({R}): "1 Regions",
    PAINTING: "1 Regions, 3 Handles",
    frozenset({H}): "3 Handles",
    frozenset({H, D}): "3 Handles, 4 Deform",
    frozenset({D}): "4 Deform",
    frozenset({P, C, D}): "0 Pull, 2 Cages, 4 Deform",
}
# How the mouse moves the camera; see `scene.navigation`.
_MOUSE = [
    ("Alt+drag", "Orbit; beside the mesh without Alt"),
    ("Middle drag", "Pan"),
    ("Right drag", "Zoom"),
    ("Wheel", "Zoom to the pointer"),
    ("Double click", "Frame the part under the pointer, or all"),
]
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
    "backslash": "\\",
    "return": "Enter",
    "period": ".",
    "comma": ",",
    **{f"kp_{digit}": f"Num {digit}" for digit in range(10)},
}
# Without Num Lock the keypad has other names.  Its digits are not those of the main row.
_KEYPAD = {"kp_insert": "kp_0", "kp_end": "kp_1", "kp_next": "kp_3", "kp_page_down": "kp_3",
           "kp_begin": "kp_5", "kp_home": "kp_7", "kp_decimal": "period"}  # fmt: skip
_KEYPAD |= {f"kp_{digit}": f"kp_{digit}" for digit in range(10)}
_ALSO = {"kp_add": "plus", "kp_subtract": "minus", "iso_left_tab": "tab", "+": "plus", "-": "minus"}
_ALSO |= _KEYPAD
_UNLISTED = {"equal", "backspace", "ctrl+shift+z"}  # alternatives, left out of the help card


def pressed_key(interactor: Any) -> str:
    """Return the pressed key, as named in the table."""
    key = (interactor.GetKeySym() or "").lower()
    key = _ALSO.get(key, key.removeprefix("kp_"))
    # Shift is needed to type "?" or "+", so it counts as a modifier of letters only.
    shift = interactor.GetShiftKey() and len(key) == 1 and key.isalpha()
    modifiers = (
        (interactor.GetControlKey(), "ctrl+"),
        (interactor.GetAltKey(), "alt+"),
        (shift, "shift+"),
    )
    return "".join(name for is_down, name in modifiers if is_down) + key


def binding_of(key: str, mode: Mode) -> Binding | None:
    """Return the binding of *key* in *mode*, if any."""
    found = (b for b in BINDINGS if key in b.keys and mode in b.modes and b.action is not None)
    return next(found, None)


def modes_of(key: str) -> list[tuple[Mode, str]]:
    """Return the modes in which *key* has an action, and its label there."""
    return [
        (mode, b.label) for b in BINDINGS if key in b.keys for mode in sorted_modes(b) if b.action
    ]


def sorted_modes(binding: Binding) -> list[Mode]:
    """Return the modes of a binding in their order."""
    return [mode for mode in Mode if mode in binding.modes]


def key_cap(key: str) -> str:
    """Return the name of a key for users: "Ctrl+Z", "Esc", "["."""
    return "+".join(_CAPS.get(part, part.capitalize()) for part in key.split("+"))


def help_sections() -> list[Section]:
    """Return the table for users, grouped by modes."""
    sections: dict[str, list[tuple[str, str]]] = {name: [] for name in _HEADINGS.values()}
    sections[_VIEW] = list(_MOUSE)
    for b in BINDINGS:
        caps = "  ".join(key_cap(key) for key in b.keys if key not in _UNLISTED)
        heading = b.heading or _HEADINGS.get(b.modes)
        if heading is not None:
            sections[heading].append((caps, b.label))
    return list(sections.items())
