"""Which keys start which actions: a table of bindings, with a user's own keys in it.

A key is VTK's name in lower case after its modifiers: "z", "ctrl+z", "f1", "ctrl+shift+z".  A key
may have different actions in different modes.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError

from .help_card import Section
from .widget_set import Mode

VIEW = "View"
"""The section of the help card about the camera."""
P, R, C, H, D = Mode
_HEADINGS = {
    frozenset(Mode): "All modes",
    frozenset({P}): "0 Pull",
    frozenset({P, D}): "0 Pull, 4 Deform",
    frozenset({R}): "1 Regions",
    frozenset({R, H}): "1 Regions, 3 Handles",
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
    ("Right click", "Menu of this part (Qt, browser)"),
    ("Wheel", "Zoom to the pointer"),
    ("Double click", "Frame this part, or all"),
]
_UNLISTED = {"equal", "backspace", "ctrl+shift+z"}  # alternatives, left out of the help card
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
    "equal": "=",
    "semicolon": ";",
    "apostrophe": "'",
    "grave": "`",
    "slash": "/",
    "page_up": "PgUp",
    "page_down": "PgDown",
    "insert": "Ins",
    **{f"kp_{digit}": f"Num {digit}" for digit in range(10)},
}
_NAMES = {cap.lower(): name for name, cap in _CAPS.items()}
# Without Num Lock the keypad has other names.  Its digits are not those of the main row.
_KEYPAD = {"kp_insert": "kp_0", "kp_end": "kp_1", "kp_next": "kp_3", "kp_page_down": "kp_3",
           "kp_begin": "kp_5", "kp_home": "kp_7", "kp_decimal": "period"}  # fmt: skip
_KEYPAD |= {f"kp_{digit}": f"kp_{digit}" for digit in range(10)}
_ALSO = {"kp_add": "plus", "kp_subtract": "minus", "iso_left_tab": "tab", "+": "plus", "-": "minus",
         "prior": "page_up", "next": "page_down", "quoteright": "apostrophe",
         "quoteleft": "grave"}  # fmt: skip
_ALSO |= _KEYPAD
_MODIFIERS = ("ctrl", "alt", "shift")
_WORD = re.compile(r"[a-z0-9_]{1,20}")


@dataclass(frozen=True)
class Binding:
    """The action of some keys in some modes."""

    name: str
    """The name of the action; "" if a widget handles these keys, which cannot be changed."""
    keys: tuple[str, ...]
    modes: frozenset[Mode]
    label: str
    action: Callable[[Any], None] | None
    """None if a widget handles these keys itself and they are listed for the help card only."""
    while_busy: bool = False
    """Whether the keys work while a job is running."""
    heading: str = ""
    """The section of the help card; by default that of the modes."""
    is_reserved: bool = False
    """Whether a widget handles these keys at any time, and not only during a drag."""

    @property
    def cap(self) -> str:
        """The first key for users; without one, the label of the action."""
        return key_cap(self.keys[0]) if self.keys else self.label


class Keys:
    """A table of bindings; immutable.

    Parameters
    ----------
    bindings : sequence of Binding
        The table.
    changes : mapping of str to sequence of str, optional
        Other keys for some of its actions, by their names.
    blenders : mapping of str to sequence of str, optional
        The changes that Blender's users make; with most of them the middle button orbits, too.

    Raises
    ------
    ArgumentError
        If there is no such action or key, or two actions have the same key in one mode.
    """

    def __init__(
        self,
        bindings: Iterable[Binding],
        changes: Mapping[str, Sequence[str]] | None = None,
        *,
        blenders: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        table = tuple(bindings)
        names = [b.name for b in table if b.name]
        own: dict[str, tuple[str, ...]] = {}
        for name, keys in (changes or {}).items():
            _require_action(name, names, "keys")
            own[name] = tuple(dict.fromkeys(key_name(key) for key in keys))
        self.bindings = tuple(replace(b, keys=own.get(b.name, b.keys)) for b in table)
        """The table with these keys, in its order."""
        self.changes = {b.name: own[b.name] for b in table if own.get(b.name, b.keys) != b.keys}
        """The keys that differ from those of the table, by action."""
        shared = [name for name, keys in blenders.items() if own.get(name) == keys]
        self.middle_orbits = 2 * len(shared) > len(blenders)
        """Whether a middle drag orbits, as in Blender, and pans with Shift; else it pans."""
        self._by_name = {b.name: b for b in self.bindings if b.name}
        self._require_distinct()

    def __getitem__(self, name: str) -> Binding:
        """Return the binding of the action *name*; ArgumentError if there is none."""
        _require_action(name, self._by_name, "name")
        return self._by_name[name]

    @property
    def mouse(self) -> list[tuple[str, str]]:
        """How the mouse moves the camera, for users."""
        if not self.middle_orbits:
            return _MOUSE
        orbit = "Middle drag  Alt+drag", _MOUSE[0][1]
        return [orbit, ("Shift+middle drag", "Pan"), *_MOUSE[2:]]

    def cap(self, name: str) -> str:
        """Return the first key of the action *name* for users, or else the label of the action."""
        return self._by_name[name].cap

    def binding_of(self, key: str, mode: Mode) -> Binding | None:
        """Return the binding of *key* in *mode*, if any."""
        found = (b for b in self._by_name.values() if key in b.keys and mode in b.modes)
        return next(found, None)

    def modes_of(self, key: str) -> list[tuple[Mode, str]]:
        """Return the modes in which *key* has an action, and its label there."""
        found = [b for b in self._by_name.values() if key in b.keys]
        return [(mode, b.label) for b in found for mode in Mode if mode in b.modes]

    def sections(self, mode: Mode | None = None) -> list[Section]:
        """Return the table for users, of *mode* or all, by modes; without actions without keys."""
        sections: dict[str, list[tuple[str, str]]] = {name: [] for name in _HEADINGS.values()}
        sections[VIEW] = list(self.mouse)
        for b in self.bindings:
            listed = [key for key in b.keys if key not in _UNLISTED] or b.keys
            caps = "  ".join(map(key_cap, listed))
            heading = b.heading or _HEADINGS.get(b.modes)
            if caps and heading is not None and (mode is None or mode in b.modes):
                sections[heading].append((caps, b.label))
        return [(heading, rows) for heading, rows in sections.items() if rows]

    def conflicts(self, name: str, key: str) -> list[Binding]:
        """Return the bindings of *key* in modes of the action *name*, other than its own."""
        modes = self._by_name[name].modes
        return [
            b for b in self.bindings
            if b.name != name and key in b.keys and b.modes & modes and (b.name or b.is_reserved)
        ]  # fmt: skip

    def _require_distinct(self) -> None:
        for binding in self._by_name.values():
            for key in binding.keys:
                for other in self.conflicts(binding.name, key):
                    raise ArgumentError(
                        f"keys: {key_cap(key)} is assigned to both {binding.label!r} and "
                        f"{other.label!r}; assign another key to one of them"
                    )


def pressed_key(interactor: Any) -> str:
    """Return the pressed key, as named in a table."""
    return event_key(
        interactor.GetKeySym(),
        control=bool(interactor.GetControlKey()),
        alt=bool(interactor.GetAltKey()),
        shift=bool(interactor.GetShiftKey()),
    )


def event_key(symbol: str | None, *, control: bool, alt: bool, shift: bool) -> str:
    """Return the key of VTK's key *symbol* and modifiers, as named in a table."""
    key = (symbol or "").lower()
    key = _ALSO.get(key, key.removeprefix("kp_"))
    return _with_modifiers(key, {"ctrl": control, "alt": alt, "shift": shift})


def key_name(text: str) -> str:
    """Return the name of a key as in a table: of "Ctrl+Z", "Esc", "[" or such a name itself.

    >>> key_name("Ctrl+Shift+Z"), key_name("Esc"), key_name("Ctrl++"), key_name("Num 1")
    ('ctrl+shift+z', 'escape', 'ctrl+plus', 'kp_1')
    """
    if not isinstance(text, str):
        raise ArgumentError(f'keys: a key must be a text such as "Ctrl+Z"; got {shown(text)}')
    head, _, key = text.strip().lower().rpartition("+")
    if not key:  # the key is + itself
        head, key = head.removesuffix("+"), "+"
    modifiers = [part.strip() for part in head.split("+")] if head else []
    key = _NAMES.get(key.strip(), key.strip())
    if not _WORD.fullmatch(key) or not set(modifiers) <= set(_MODIFIERS):
        raise ArgumentError(f'keys: no such key as {shown(text)}; write "Ctrl+Z", "Esc" or "["')
    return _with_modifiers(key, dict.fromkeys(modifiers, True))


def key_cap(key: str) -> str:
    """Return the name of a key for users: "Ctrl+Z", "Esc", "["."""
    return "+".join(_CAPS.get(part, part.capitalize()) for part in key.split("+"))


def _with_modifiers(key: str, held: Mapping[str, bool]) -> str:
    """Return *key* after the modifiers that are *held*, in a fixed order."""
    # Shift is needed to type "?" or "+", so it counts as a modifier of letters only.
    counts = {"ctrl", "alt", *(["shift"] if len(key) == 1 and key.isalpha() else [])}
    return "".join(f"{name}+" for name in _MODIFIERS if name in counts and held.get(name)) + key


def _require_action(name: object, names: Collection[str], argument: str) -> None:
    if not isinstance(name, str) or name not in names:
        near = difflib.get_close_matches(name, names, n=1) if isinstance(name, str) else []
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ArgumentError(f"{argument}: there is no action {shown(name)}{hint}")
