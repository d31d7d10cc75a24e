"""A number typed during a drag: digits, a point, and a minus sign, which may be typed at any time.

Shared by the widgets that drag.  The number replaces the motion of the pointer: a length along the
current axis or direction, or an angle in degrees.  Enter ends the drag as a release would.
"""

from __future__ import annotations

from vtk_segdeform.arrays import FloatArray

from .gizmo_shapes import Kind
from .handle_motion import Motion

_MOST_CHARACTERS = 12  # characters
_POINT = {".", "period", "comma", "Decimal", "Separator"}
_MINUS = {"-", "minus", "Subtract"}
_ENTER = {"Return", "Enter"}


class NumberEntry:
    """The number typed so far; empty at first.

    >>> entry = NumberEntry()
    >>> [entry.type(key) for key in ("1", "KP_Decimal", "5", "minus", "w")]
    [True, True, True, True, False]
    >>> entry.text, entry.value
    ('-1.5', -1.5)
    """

    def __init__(self) -> None:
        self.text = ""

    @property
    def value(self) -> float | None:
        """The number; None if nothing that is a number has been typed."""
        try:
            return float(self.text)
        except ValueError:
            return None

    def type(self, key: str) -> bool:
        """Handle a *key* by VTK's name; return False if it is not part of a number."""
        name = key.removeprefix("KP_")
        if len(name) == 1 and name in "0123456789":
            self.text = (self.text + name)[:_MOST_CHARACTERS]
        elif name in _POINT:
            self.text += "" if "." in self.text else "."
        elif name in _MINUS:
            self.text = self.text[1:] if self.text.startswith("-") else f"-{self.text}"
        elif key == "BackSpace":
            self.text = self.text[:-1]
        else:
            return False
        return True

    @staticmethod
    def is_enter(key: str) -> bool:
        """Return whether *key* ends the entry."""
        return key.removeprefix("KP_") in _ENTER

    def matrix(self, motion: Motion) -> FloatArray | None:
        """Return *motion* by the number as a matrix (4, 4); None if there is no number yet."""
        return None if self.value is None else motion.exact(self.value)

    def caption(self, motion: Motion) -> str:
        """Return the size of *motion*, or the number with a cursor: "x 1.5_"."""
        part = motion.part
        letters = "" if part.axis is None else "xyz"[part.axis]
        if part.kind is Kind.PLANE:
            letters = "xyz".replace(letters, "")
        unit = "°" if part.kind is Kind.ROTATION else ""
        amount = f"{self.text}_{unit}" if self.text else motion.amount
        return f"{letters} {amount}".strip()
