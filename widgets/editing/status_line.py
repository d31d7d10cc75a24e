"""One line at the bottom of a view: what to do next, what went wrong, how far a job is.

A warning has another colour and a sign, and stays until something else is said.  What does not
fit into the window's width is broken once; what does not fit into two lines either ends in dots.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..dragging.panels import Panel, Words
from ..view import View

_CALM, _WARNING = "#2B2F36", "#8A2B06"  # white on them has a contrast above 7 to 1
_LETTERS, _TAG, _BAR = "#FFFFFF", "#FFD27F", "#4FA3D9"
_LINES = 2


class StatusLine:
    """A strip at the bottom of a view.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lies, over everything else.  Call `remove` before its window closes.
    """

    def __init__(self, view: Any) -> None:
        self.view = View.of(view)
        front = self.view.front
        self._strip = Panel(front, _CALM, opacity=0.88, layer=2)
        self._bar = Panel(front, _BAR, layer=3)
        self._tag = Words(front, _TAG, bold=True, layer=4)
        self._lines = [Words(front, _LETTERS, layer=4) for _ in range(_LINES)]
        self._said: tuple[str, str, bool, float | None] = "", "", False, None
        self._laid_out: tuple[Any, ...] = ()
        self._stop = self.view.before_render(self._lay_out)

    @property
    def text(self) -> str:
        """What it says, whether or not the window is wide enough for it."""
        return self._said[1]

    @property
    def is_warning(self) -> bool:
        """Whether what it says is that something went wrong."""
        return self._said[2]

    @property
    def fraction(self) -> float | None:
        """How far the job is that it tells of, 0..1; or None."""
        return self._said[3]

    def say(self, text: str, tag: str = "") -> None:
        """Say *text*; before it stands *tag*, a word or two."""
        self._now(tag, text, False, None)

    def warn(self, text: str, tag: str = "") -> None:
        """Say that something went wrong."""
        self._now(tag, text, True, None)

    def progress(self, fraction: float, text: str, tag: str = "") -> None:
        """Say how far a job is, 0..1, and what it does."""
        self._now(tag, text, False, min(max(fraction, 0.0), 1.0))

    def remove(self) -> None:
        """Go out of the view, for good."""
        self._stop()
        parts: list[Panel | Words] = [self._strip, self._bar, self._tag, *self._lines]
        for part in parts:
            part.remove()

    def _now(self, tag: str, text: str, warning: bool, fraction: float | None) -> None:
        said = tag, " ".join(text.split()), warning, fraction
        if said != self._said:
            self._said = said
            self.view.touch()

    def _lay_out(self) -> None:
        width, height = self.view.renderer.GetSize()
        if (width, height, self._said) == self._laid_out:
            return
        self._laid_out = width, height, self._said
        tag, text, warning, fraction = self._said
        size = letter_size(width, height)
        margin, leading = 0.7 * size, 1.45 * size
        self._tag.say(tag, size)
        left = margin + (self._tag.width() + size if tag else 0.0)
        lines = self._broken(f"! {text}" if warning else text, size, width - margin - left)
        foot = 0.35 * size if fraction is None else 0.8 * size  # room for the bar
        high = foot + leading * len(lines) + 0.35 * size
        for k, words in enumerate(self._lines):
            words.say(lines[k] if k < len(lines) else "", size)
            words.place(left, high - 0.35 * size - (k + 0.5) * leading)
        self._tag.place(margin, high - 0.35 * size - 0.5 * leading)
        self._strip.colour(_WARNING if warning else _CALM)
        self._strip.place(0.0, 0.0, width, high)
        self._bar.show(fraction is not None)
        self._bar.place(0.0, 0.0, width * (fraction or 0.0), 0.35 * size)

    def _broken(self, text: str, size: float, room: float) -> list[str]:
        """Return *text* in one line or two, each no wider than *room* pixels."""
        probe, lines, rest = self._lines[0], list[str](), text.split()
        while rest and len(lines) < _LINES:
            fitting = len(rest)
            while fitting > 1 and not _fits(probe, " ".join(rest[:fitting]), size, room):
                fitting -= 1
            lines.append(" ".join(rest[:fitting]))
            rest = rest[fitting:]
        last = lines.pop() if lines else ""
        dots = "..." if rest else ""
        while last and not _fits(probe, last + dots, size, room):
            last, dots = last[:-1].rstrip(), "..."
        return [*lines, last + dots]


def letter_size(width: int, height: int) -> float:
    """Return how large letters are in a window, pixels: what is read well, and fits."""
    return float(np.clip(min(height / 36.0, width / 48.0), 11.0, 26.0))


def _fits(probe: Words, text: str, size: float, room: float) -> bool:
    probe.say(text, size)
    return probe.width() <= room
