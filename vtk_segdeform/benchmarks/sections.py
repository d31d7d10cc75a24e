"""What an experiment hands over: words, tables, pictures still to be drawn, and ratios to judge.

A `Ratio` is something that must hold; whether it does is printed beside it, whoever wins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

Cell = str | float | int | None


@dataclass(frozen=True)
class Table:
    """Columns with a name each, and rows of cells; numbers are rounded when they are written."""

    columns: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]
    title: str = ""

    def column(self, name: str) -> list[Cell]:
        """Return the cells under *name*."""
        place = self.columns.index(name)
        return [row[place] for row in self.rows]

    def markdown(self) -> str:
        """Return the table in Markdown; words to the left, numbers to the right."""
        left = [any(isinstance(row[k], str) for row in self.rows) for k in range(len(self.columns))]
        lines = [
            "| " + " | ".join(self.columns) + " |",
            "|" + "|".join("---" if words else "---:" for words in left) + "|",
            *("| " + " | ".join(map(written, row)) + " |" for row in self.rows),
        ]
        return "\n".join([f"*{self.title}*", "", *lines] if self.title else lines)


@dataclass(frozen=True)
class Ratio:
    """A measured number and the limit it must keep; NaN was not measured."""

    what: str
    value: float
    limit: float
    at_most: bool = True

    @property
    def bound(self) -> str:
        """The limit as text: "at most 1"."""
        return f"at {'most' if self.at_most else 'least'} {self.limit:.3g}"

    @property
    def verdict(self) -> str:
        """Whether it holds, in one word."""
        if math.isnan(self.value):
            return "not measured"
        holds = self.value <= self.limit if self.at_most else self.value >= self.limit
        return "holds" if holds else "**DOES NOT HOLD**"


@dataclass(frozen=True)
class Figure:
    """A picture: the name of a PNG file, what it shows, and how to draw it."""

    name: str
    caption: str
    draw: Callable[[Path], None]


@dataclass
class Section:
    """One experiment of the report."""

    title: str
    words: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    ratios: list[Ratio] = field(default_factory=list)
    absent: list[str] = field(default_factory=list)


def written(cell: Cell) -> str:
    """Return a cell as text: three digits, or a dash for what was not measured.

    >>> [written(x) for x in (None, "cactus", 12345, 0.012345, 1234.5, 3.2e-15, float("nan"))]
    ['–', 'cactus', '12345', '0.0123', '1234', '3.2e-15', '–']
    """
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, str | int):
        return str(cell)
    size = abs(cell)
    if size >= 100.0:
        return f"{cell:.0f}"
    return f"{cell:.1e}" if 0.0 < size < 1e-3 else f"{cell:.3g}"
