"""A card over the view that lists the keys.

White with a dark border, so that it is legible on any background.  The text is as large as the
window allows, up to a limit, in one, two or three columns, whichever allows the largest size.
Where the text of all keys would be too small to read, the keys of the current mode are listed, and
where even these would be, they fill several pages, through which `HelpCard.toggle` turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vtk_segdeform.pictures import INK, PAPER

from ..scene import Panel, Stop, Text, View

Section = tuple[str, Sequence[tuple[str, str]]]
"""A heading, and pairs (key, action)."""

_KEYS, _KEYS_IN_DARK = "#0B4F82", "#8CC8F2"
_DARK = 0.4  # brightness of the background, 0 to 1, below which the card is dark, too
_LARGEST, _LEGIBLE, _SMALLEST = 32.0, 12.0, 8.0  # pixels; a smaller text is on several pages
_TINY = 6.0  # pixels, in a window in which nothing can be read
_MOST_PAGES = 9
_LEADING, _MARGIN, _GAP = 1.5, 1.4, 2.0  # line height, margin, space between columns; in ems
_WIDE, _HIGH, _FOOT = 0.94, 0.86, 0.1  # of the window: largest size, free space below
_PROBE = 20.0  # font size at which widths are measured first
_DOTS_PER_INCH = 96  # of a screen on which these are pixels


class _Layout(NamedTuple):
    """How the sections are laid out."""

    size: float
    """Font size in pixels."""
    columns: list[list[Section]]
    """Those of all pages."""
    on_page: int
    """Number of columns on a page."""
    tabs: tuple[float, float]
    """Widths of keys and actions, in ems."""
    extent: tuple[float, float]
    """Width and height of the card, in ems."""

    @property
    def n_pages(self) -> int:
        """Number of pages."""
        return math.ceil(len(self.columns) / self.on_page)


class HelpCard:
    """A list of keys at the centre of a view, above the status line; hidden until `show`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it is drawn, over everything else.  Call `remove` before its window closes.
    sections : sequence of (heading, rows)
        Rows are pairs (key, action); a section stays in one column if there is one page.
    fewer : sequence of (heading, rows), optional
        The sections of a window in which those would be too small to read.
    key : str
        The key that calls `toggle`, for users.
    """

    def __init__(
        self,
        view: Any,
        sections: Sequence[Section],
        fewer: Sequence[Section] = (),
        key: str = "H",
    ) -> None:
        self.view = View.of(view)
        self.sections, self.fewer, self.key = tuple(sections), tuple(fewer), key
        self._parts: list[Panel | Text] = []
        self._laid_out: tuple[int, int, bool] | None = None  # the window's size, and if it is dark
        self._page, self._n_pages = 0, 1
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
        """Hide it; it begins with the first page again."""
        if self._stop is not None:
            self._stop()
            self._stop = None
            self._page = 0
            self._clear()
            self.view.request_render()

    def list_keys(
        self, sections: Sequence[Section], fewer: Sequence[Section] = (), key: str = "H"
    ) -> None:
        """List other keys, from the first page; *fewer* and *key* as for the constructor."""
        if (tuple(sections), tuple(fewer), key) == (self.sections, self.fewer, self.key):
            return
        self.sections, self.fewer, self.key = tuple(sections), tuple(fewer), key
        self._page, self._laid_out = 0, None
        if self.is_shown:
            self.view.request_render()

    def toggle(self) -> None:
        """Show it, turn to the next page, or hide it after the last one."""
        if not self.is_shown:
            self.show()
        elif self._page + 1 < self._n_pages:
            self._page, self._laid_out = self._page + 1, None
            self.view.request_render()
        else:
            self.hide()

    def remove(self) -> None:
        """Remove it from the view, permanently."""
        self.hide()

    def _clear(self) -> None:
        for part in self._parts:
            part.remove()
        self._parts, self._laid_out = [], None

    @property
    def _is_dark(self) -> bool:
        return self._laid_out is not None and self._laid_out[2]

    @property
    def _ink(self) -> str:
        return PAPER if self._is_dark else INK

    def _lay_out(self) -> None:
        window = self.view.renderer.GetSize()
        now = window[0], window[1], max(self.view.renderer.GetBackground()) < _DARK
        if now == self._laid_out:
            return
        self._clear()
        self._laid_out = now
        layout = self._fitting(window)
        size, (keys, labels), (wide, high) = layout.size, layout.tabs, layout.extent
        self._n_pages = layout.n_pages
        self._page = min(self._page, self._n_pages - 1)
        column = keys + _GAP / 2 + labels
        x = 0.5 * (window[0] - wide * size)
        y = 0.5 * ((1.0 + _FOOT) * window[1] - high * size)
        for rim, colour, layer in ((2.0, self._ink, 5), (0.0, INK if self._is_dark else PAPER, 6)):
            panel = Panel(self.view.foreground, colour, layer=layer)
            panel.place(x - rim, y - rim, wide * size + 2 * rim, high * size + 2 * rim)
            self._parts.append(panel)
        first = self._page * layout.on_page
        for k, sections in enumerate(layout.columns[first : first + layout.on_page]):
            left = x + (_MARGIN + k * (column + _GAP)) * size
            self._write(sections, (left, left + (keys + _GAP / 2) * size), y + high * size, size)
        if self._n_pages > 1:
            key = "close" if self._page + 1 == self._n_pages else "next page"
            text = f"Page {self._page + 1} of {self._n_pages}. {self.key}: {key}"
            self._put(text, self._ink, (x + _MARGIN * size, y + _MARGIN * size), size, bold=True)

    def _fitting(self, window: Sequence[int]) -> _Layout:
        """Return the first layout whose text is large enough, or else the one with the largest."""
        scale = max(1.0, self.view.window.GetDPI() / _DOTS_PER_INCH)
        found = []
        for sections, n_pages, least in self._choices():
            found.append(self._largest(sections, n_pages, window))
            if found[-1].size >= scale * least:
                return found[-1]
        best = max(found, key=lambda layout: layout.size)
        return best._replace(size=max(best.size, _TINY))

    def _choices(self) -> Iterator[tuple[Sequence[Section], int, float]]:
        """Yield sections, on how many pages, and the font size which that requires, in pixels.

        Zero pages are a single one on which no section is broken.
        """
        fewer = self.fewer or self.sections
        yield self.sections, 0, _LEGIBLE
        yield fewer, 0, _SMALLEST
        for n_pages in range(1, _MOST_PAGES + 1):
            yield fewer, n_pages, _SMALLEST

    def _largest(self, sections: Sequence[Section], n_pages: int, window: Sequence[int]) -> _Layout:
        """Return the layout of *sections* with the largest text; *n_pages* as in `_choices`."""
        size, foot = _PROBE, _LEADING if n_pages > 1 else 0.0
        for _ in range(2):  # font sizes are rounded, so widths are measured again at the size found
            tabs = self._widths(sections, max(size, _TINY))
            column = sum(tabs) + _GAP / 2
            choices = []
            for count in (1, 2, 3):
                columns = _shared(sections, count)
                if n_pages:
                    columns = _broken(sections, count * n_pages)
                wide = count * column + (count - 1) * _GAP + 2 * _MARGIN  # in ems
                high = max(map(_n_lines, columns)) * _LEADING + foot + 2 * _MARGIN
                size = min(_WIDE * window[0] / wide, _HIGH * window[1] / high, _LARGEST)
                choices.append(_Layout(size, columns, count, tabs, (wide, high)))
            best = max(choices, key=lambda layout: (layout.size, -layout.on_page))
            size = best.size
        return best

    def _write(
        self, sections: Sequence[Section], tabs: tuple[float, float], top: float, size: float
    ) -> None:
        """Write *sections* from *top* downwards, keys and actions at the two *tabs*, in pixels."""
        y = top - (_MARGIN + 0.5 * _LEADING) * size
        for heading, rows in sections:
            for left, right in ((heading, ""), *rows):
                is_heading = left is heading
                keys = _KEYS_IN_DARK if self._is_dark else _KEYS
                colour = self._ink if is_heading else keys
                self._put(left, colour, (tabs[0], y), size, bold=True, key=not is_heading)
                self._put(right, self._ink, (tabs[1], y), size)
                y -= _LEADING * size
            y -= 0.5 * _LEADING * size

    def _put(
        self, text: str, colour: str, at: tuple[float, float], size: float,
        *, bold: bool = False, key: bool = False,
    ) -> None:  # fmt: skip
        words = Text(self.view.foreground, colour, bold=bold or key, monospace=key, layer=7)
        words.set_text(text, size)
        words.place(*at)
        self._parts.append(words)

    def _widths(self, sections: Sequence[Section], size: float) -> tuple[float, float]:
        """Return the widths of the keys and of the actions, in ems."""
        rows = [row for _, rows in sections for row in rows]
        columns = ([key for key, _ in rows], True), ([label for _, label in rows], False)
        widths = []
        for texts, is_key in columns:
            probe = Text(self.view.foreground, INK, bold=is_key, monospace=is_key)
            widths.append([_width(probe, text, size) for text in texts])
            probe.remove()
        keys, labels = (float(np.max(w, initial=0.0)) / size for w in widths)
        return keys, labels


def _width(probe: Text, text: str, size: float) -> float:
    """Return the width of *text* in pixels."""
    probe.set_text(text, size)
    return probe.width()


def _n_lines(sections: Sequence[Section]) -> float:
    """Return the number of lines of *sections*, with half a line between two of them."""
    return sum(1 + len(rows) for _, rows in sections) + 0.5 * max(0, len(sections) - 1)


def _shared(sections: Sequence[Section], count: int) -> list[list[Section]]:
    """Return *sections* in order, in *count* columns of similar length."""
    columns: list[list[Section]] = [[] for _ in range(count)]
    total, before = _n_lines(sections), 0.0
    for section in sections:
        length = _n_lines([section])
        columns[min(count - 1, int(count * (before + 0.5 * length) / total))].append(section)
        before += length + 0.5
    return columns


def _broken(sections: Sequence[Section], count: int) -> list[list[Section]]:
    """Return *sections* in order, in *count* columns at most, of similar length.

    A section may continue in the next column, under the same heading.
    """
    most = max(3, math.ceil(_n_lines(sections) / count))
    while len(columns := _columns_of(sections, most)) > count:
        most += 1
    return columns


def _columns_of(sections: Sequence[Section], most: int) -> list[list[Section]]:
    """Return *sections* in order, in columns of at most *most* lines, at least 3."""
    columns: list[list[Section]] = [[]]
    for heading, rows in sections:
        rest = rows
        while rest:
            above = _n_lines(columns[-1]) + 0.5 if columns[-1] else 0.0
            room = int(most - above) - 1  # below the heading
            if room < min(2, len(rest)):
                columns.append([])
                continue
            columns[-1].append((heading, rest[:room]))
            rest = rest[room:]
    return columns
