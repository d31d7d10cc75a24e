"""The status line at the bottom of a view: hints, errors and the progress of a job.

A warning has another colour and a sign.  A text that is too wide for the window is wrapped into
two lines, a warning into four, within a word if it is as long as a path; the rest is replaced by
dots.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene import Panel, Text, View

_CALM, _WARNING = "#2B2F36", "#8A2B06"  # white on them has a contrast above 7 to 1
_LETTERS, _TAG, _BAR = "#FFFFFF", "#FFD27F", "#4FA3D9"
_LINES, _LINES_OF_WARNING = 2, 4


class StatusLine:
    """A strip at the bottom of a view.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it is drawn, over everything else.  Call `remove` before its window closes.
    """

    def __init__(self, view: Any) -> None:
        self.view = View.of(view)
        front = self.view.foreground
        self._strip = Panel(front, _CALM, opacity=0.88, layer=2)
        self._bar = Panel(front, _BAR, layer=3)
        self._tag = Text(front, _TAG, bold=True, layer=4)
        self._lines = [Text(front, _LETTERS, layer=4) for _ in range(_LINES_OF_WARNING)]
        self._aside = Text(front, _TAG, layer=4)
        self._content: tuple[str, str, bool, float | None, str] = "", "", False, None, ""
        self._laid_out: tuple[Any, ...] = ()
        self._height = 0.0
        self._is_shown = True
        self._stop = self.view.before_render(self._lay_out)

    @property
    def text(self) -> str:
        """The whole text, even if the window is too narrow for it."""
        return self._content[1]

    @property
    def is_warning(self) -> bool:
        """Whether the text is a warning."""
        return self._content[2]

    @property
    def fraction(self) -> float | None:
        """Completed fraction of the job that is shown, 0..1; or None."""
        return self._content[3]

    @property
    def aside(self) -> str:
        """The text at its right end, or ""."""
        return self._content[4]

    @property
    def height(self) -> float:
        """Its height in the last picture, in pixels."""
        return self._height

    def say(self, text: str, tag: str = "", aside: str = "") -> None:
        """Show *text* after *tag*, a word or two, and *aside* at the right end."""
        self._set(tag, text, False, None, aside)

    def warn(self, text: str, tag: str = "", aside: str = "") -> None:
        """Show *text* as a warning."""
        self._set(tag, text, True, None, aside)

    def progress(self, fraction: float, text: str, tag: str = "") -> None:
        """Show the progress of a job, 0..1, and its description."""
        self._set(tag, text, False, min(max(fraction, 0.0), 1.0))

    def show(self, shown: bool) -> None:
        """Show the line, or hide it because its text is shown elsewhere."""
        if shown != self._is_shown:
            self._is_shown = shown
            self._laid_out = ()
            self.view.request_render()

    def remove(self) -> None:
        """Remove it from the view, permanently."""
        self._stop()
        parts: list[Panel | Text] = [self._strip, self._bar, self._tag, self._aside, *self._lines]
        for part in parts:
            part.remove()

    def _set(
        self, tag: str, text: str, warning: bool, fraction: float | None, aside: str = ""
    ) -> None:
        content = tag, " ".join(text.split()), warning, fraction, aside
        if content != self._content:
            self._content = content
            self.view.request_render()

    def _lay_out(self) -> None:
        width, height = self.view.renderer.GetSize()
        if (width, height, self._content) == self._laid_out:
            return
        self._laid_out = width, height, self._content
        content = self._content if self._is_shown else ("", "", False, None, "")
        tag, text, warning, fraction, aside = content
        size = letter_size(width, height)
        margin, leading = 0.7 * size, 1.45 * size
        self._tag.set_text(tag, size)
        left = margin + (self._tag.width() + size if tag else 0.0)
        self._aside.set_text(aside, size)
        right = width - margin - (self._aside.width() if aside else 0.0)
        room, most = (
            right - (size if aside else 0.0) - left,
            _LINES_OF_WARNING if warning else _LINES,
        )
        lines = wrapped(
            self._lines[0], f"! {text}" if warning else text, size, room=room, most=most
        )
        foot = 0.35 * size if fraction is None else 0.8 * size  # room for the bar
        high = foot + leading * max(len(lines), 1) + 0.35 * size
        for k, words in enumerate(self._lines):
            words.set_text(lines[k] if k < len(lines) else "", size)
            words.place(left, high - 0.35 * size - (k + 0.5) * leading)
        self._tag.place(margin, high - 0.35 * size - 0.5 * leading)
        self._aside.place(right, high - 0.35 * size - 0.5 * leading)
        self._strip.set_colour(_WARNING if warning else _CALM)
        self._strip.show(bool(tag or text))
        self._strip.place(0.0, 0.0, width, high)
        self._height = high if tag or text else 0.0
        self._bar.show(fraction is not None)
        self._bar.place(0.0, 0.0, width * (fraction or 0.0), 0.35 * size)


def letter_size(width: int, height: int) -> float:
    """Return the font size for a window, in pixels; on a large one, little above that of labels."""
    return float(np.clip(min(height / 36.0, width / 48.0), 11.0, max(19.0, height / 80.0)))


def wrapped(probe: Text, text: str, size: float, *, room: float, most: int) -> list[str]:
    """Return *text* in at most *most* lines, each no wider than *room* pixels.

    Lines break between words if possible; text that does not fit is replaced by dots.  *probe* is
    used to measure, and left with another text.
    """
    lines = list[str]()
    while text and len(lines) < most:
        cut = _fitting(probe, text, size, room)
        lines.append(text[:cut].rstrip())
        text = text[cut:].lstrip()
    if text:
        cut = _fitting(probe, f"{lines[-1]}...", size, room)
        lines[-1] = lines[-1][: min(cut, len(lines[-1])) - 3].rstrip() + "..."
    return lines


def _fitting(probe: Text, text: str, size: float, room: float) -> int:
    """Return the index at which to break *text*, between two words if possible."""
    low, high = 1, len(text)  # the first `low` letters fit, or none
    while low < high:
        middle = (low + high + 1) // 2
        probe.set_text(text[:middle], size)
        low, high = (middle, high) if probe.width() <= room else (low, middle - 1)
    space = text.rfind(" ", 0, low + 1)
    # Prefer a break in a long word to a line with only the sign of a warning.
    return space if low < len(text) and space > low // 3 else low
