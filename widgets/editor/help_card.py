"""A card over the view that lists the keys, as plain text in up to three columns.

The text is as large as the window allows, up to a limit.  Where the text of all keys would be too
small to read, the keys of the current mode are listed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from math import floor
from typing import Any

from ..scene import Panel, Stop, Text, View

Section = tuple[str, Sequence[tuple[str, str]]]
"""A heading, and pairs (key, action)."""

_GROUND, _LETTERS, _KEYS = "#2B2F36", "#FFFFFF", "#FFD27F"  # as in the status line
_LARGEST, _LEGIBLE, _SMALLEST = 20, 10, 6  # font size in pixels
_WIDE, _HIGH, _FOOT = 0.92, 0.82, 0.1  # of the window: largest text, free space below
_MARGIN = 1.2  # around the text, in font sizes
_GAP = 4  # letters between two columns


class HelpCard:
    """A list of keys at the centre of a view, above the status line; hidden until `show`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it is drawn, over everything else.  Call `remove` before its window closes.
    sections : sequence of (heading, rows)
        Rows are pairs (key, action).
    fewer : sequence of (heading, rows), optional
        The sections of a window in which those would be too small to read.
    """

    def __init__(
        self, view: Any, sections: Sequence[Section], fewer: Sequence[Section] = ()
    ) -> None:
        self.view = View.of(view)
        self.sections, self.fewer = tuple(sections), tuple(fewer)
        self._parts: list[Panel | Text] = []
        self._laid_out: tuple[int, int] | None = None  # the size of the window
        self._stop: Stop | None = None

    @property
    def is_shown(self) -> bool:
        """Whether it is shown."""
        return self._stop is not None

    def show(self) -> None:
        """Show it."""
        if self._stop is None:
            self._stop = self.view.before_render(self._lay_out)
            self.view.request_render()

    def hide(self) -> None:
        """Hide it."""
        if self._stop is not None:
            self._stop()
            self._stop = None
            self._clear()
            self.view.request_render()

    def list_keys(self, sections: Sequence[Section], fewer: Sequence[Section] = ()) -> None:
        """List other keys; *fewer* as for the constructor."""
        if (tuple(sections), tuple(fewer)) != (self.sections, self.fewer):
            self.sections, self.fewer = tuple(sections), tuple(fewer)
            self._laid_out = None
            if self.is_shown:
                self.view.request_render()

    def toggle(self) -> None:
        """Show it or hide it."""
        if self.is_shown:
            self.hide()
        else:
            self.show()

    def remove(self) -> None:
        """Remove it from the view, permanently."""
        self.hide()

    def _clear(self) -> None:
        for part in self._parts:
            part.remove()
        self._parts, self._laid_out = [], None

    def _lay_out(self) -> None:
        window = tuple(self.view.renderer.GetSize())
        if window == self._laid_out:
            return
        self._clear()
        self._laid_out = window
        front = self.view.foreground
        panel = Panel(front, _GROUND, layer=5)
        words, keys = (Text(front, colour, monospace=True, layer=6) for colour in (_LETTERS, _KEYS))
        self._parts = [panel, words, keys]
        for sections in filter(None, (self.sections, self.fewer)):
            fitting, (labels, caps) = max(
                (self._fitted(words, _texts(sections, count), window) for count in (1, 2, 3)),
                key=lambda fitted: fitted[0],
            )
            size = max(_SMALLEST, floor(fitting))
            if size >= _LEGIBLE:
                break
        for text, part in ((labels, words), (caps, keys)):
            part.set_text(text, size)
        width, height = words.width(), words.height()
        x, y = 0.5 * (window[0] - width), 0.5 * (1.0 + _FOOT) * window[1]
        for part in (words, keys):
            part.place(x, y)
        rim = _MARGIN * size
        panel.place(x - rim, y - 0.5 * height - rim, width + 2 * rim, height + 2 * rim)

    def _fitted(
        self, probe: Text, texts: tuple[str, str], window: Sequence[int]
    ) -> tuple[float, tuple[str, str]]:
        """Return the largest font size at which the first of *texts* fits, and the texts."""
        size = _LARGEST
        for _ in range(3):  # fonts have sizes in whole pixels, so the text is measured again
            probe.set_text(texts[0], size)
            wide = _WIDE * window[0] / (probe.width() + 2 * _MARGIN * size)
            high = _HIGH * window[1] / (probe.height() + 2 * _MARGIN * size)
            fitting = min(1.0, wide, high) * size
            size = max(_SMALLEST, floor(fitting))
        return fitting, texts


def _texts(sections: Sequence[Section], count: int) -> tuple[str, str]:
    """Return *sections* in *count* columns as a text without keys, and one with the keys only."""
    wide = 2 + max((len(key) for _, rows in sections for key, _ in rows), default=0)
    columns: list[list[tuple[str, str]]] = [[] for _ in range(count)]  # lines: label, key
    total, before = sum(2 + len(rows) for _, rows in sections), 0
    for heading, rows in sections:  # each in the column in which its middle is
        lines = [("", ""), (heading, ""), *((" " * wide + label, key) for key, label in rows)]
        columns[int(count * (before + 0.5 * len(lines)) / total)] += lines
        before += len(lines)
    columns = [column[1:] for column in columns if column]
    widths = [max(len(label) for label, _ in column) + _GAP for column in columns]
    texts = ["", ""]
    for k in range(2):
        rest = [[line[k] for line in column] for column in columns]
        for row in zip_longest(*rest, fillvalue=""):
            texts[k] += "".join(map(str.ljust, row, widths)).rstrip() + "\n"
    return texts[0][:-1], texts[1][:-1]
