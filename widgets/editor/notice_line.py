"""A line of text with buttons at the lower left of a view.

The text is wrapped into at most two lines; the rest is replaced by dots.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..scene import Panel, Text, View
from .status_line import letter_size, wrapped

_PAPER, _LETTERS = "#2B2F36", "#FFFFFF"  # contrast 13 to 1
_BUTTON, _INK = "#8CC4EA", "#14181D"  # contrast above 9 to 1
_LINES = 2
_SMALLER = 0.85  # than the status line
_WIDEST = 0.96  # of the width of the window


class NoticeLine:
    """The line; hidden until `show`.

    Parameters
    ----------
    view : View
        Where it is drawn, over everything else.
    foot : callable
        Returns the height, in pixels, of whatever is drawn below it.
    """

    def __init__(self, view: View, foot: Callable[[], float]) -> None:
        self.view, self._foot = view, foot
        self._paper = Panel(view.foreground, _PAPER, opacity=0.88, layer=2)
        self._paper.show(False)
        self._texts = [Text(view.foreground, _LETTERS, layer=4) for _ in range(_LINES)]
        self._buttons: list[_Button] = []
        self._box = 0.0, 0.0, 0.0, 0.0
        self._content: tuple[str, tuple[str, ...]] = "", ()
        self._laid_out: tuple[Any, ...] = ()
        self._stop = view.before_render(self._lay_out)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Its left, bottom, width and height in pixels; width 0 while it is hidden."""
        return self._box

    def show(self, text: str, buttons: Sequence[str]) -> None:
        """Show *text* and *buttons* after it; "" hides the line."""
        if (text, tuple(buttons)) != self._content:
            self._content = text, tuple(buttons)
            self.view.request_render()

    def button_at(self, pointer: Any) -> str | None:
        """Return the button at *pointer* (2,), pixels of the renderer; "" beside the buttons."""
        if not _is_in(self._box, pointer):
            return None
        return next((b.label for b in self._buttons if _is_in(b.box, pointer)), "")

    def centre_of(self, label: str) -> tuple[float, float]:
        """Return the centre of a button, in pixels of the renderer."""
        x, y, wide, high = next(b.box for b in self._buttons if b.label == label)
        return x + 0.5 * wide, y + 0.5 * high

    def remove(self) -> None:
        """Remove it from the view, permanently."""
        self._stop()
        parts: list[Panel | Text | _Button] = [self._paper, *self._texts, *self._buttons]
        for each in parts:
            each.remove()

    def _lay_out(self) -> None:
        width, height = self.view.renderer.GetSize()
        now = width, height, self._foot(), self._content
        if now == self._laid_out:
            return
        self._laid_out = now
        text, labels = self._content
        for button in self._buttons:
            button.remove()
        size = max(11.0, _SMALLER * letter_size(width, height))
        self._buttons = [_Button(self.view.foreground, label, size) for label in labels]
        gap, left, bottom = 0.5 * size, 0.6 * size, self._foot() + 0.6 * size
        aside = sum(button.width + gap for button in self._buttons)
        room = max(_WIDEST * width - left - 2 * gap - aside, 4 * size)
        lines = wrapped(self._texts[0], text, size, room=room, most=_LINES)
        leading = 1.45 * size
        high = leading * max(1, len(lines)) + 0.5 * size
        for k, words in enumerate(self._texts):
            words.set_text(lines[k] if k < len(lines) else "", size)
            words.place(left + gap, bottom + high - 0.25 * size - (k + 0.5) * leading)
        x = left + 2 * gap + max(words.width() for words in self._texts)
        for button in self._buttons:
            button.place(x, bottom + 0.25 * size, leading)
            x += button.width + gap
        self._box = (left, bottom, x - left, high) if text else (0.0, 0.0, 0.0, 0.0)
        self._paper.show(bool(text))
        self._paper.place(*self._box)


class _Button:
    """A label on a rectangle."""

    def __init__(self, renderer: Any, label: str, size: float) -> None:
        self.label, self.box, self._size = label, (0.0, 0.0, 0.0, 0.0), size
        self._face = Panel(renderer, _BUTTON, layer=3)
        self._words = Text(renderer, _INK, bold=True, layer=4)
        self._words.set_text(label, size)
        self.width = self._words.width() + size

    def place(self, x: float, y: float, high: float) -> None:
        self.box = x, y, self.width, high
        self._face.place(*self.box)
        self._words.place(x + 0.5 * self._size, y + 0.5 * high)

    def remove(self) -> None:
        self._face.remove()
        self._words.remove()


def _is_in(box: tuple[float, float, float, float], pointer: Any) -> bool:
    x, y, wide, high = box
    return bool(x <= pointer[0] < x + wide and y <= pointer[1] < y + high)
