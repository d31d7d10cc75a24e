"""Results of an experiment: text, tables, figures and ratios.

A `Ratio` is a measured number with a limit; the report says whether the limit is met.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

Cell = str | float | int | None


@dataclass(frozen=True)
class Table:
    """Rows of cells under named columns.

    Numbers of one column are written in one notation; in a *mixed* table, where a column has
    different quantities, each cell has its own.
    """

    columns: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]
    title: str = ""
    mixed: bool = False

    def column(self, name: str) -> list[Cell]:
        """Return the cells of a column."""
        place = self.columns.index(name)
        return [row[place] for row in self.rows]

    def markdown(self) -> str:
        """Return the table in Markdown; text is aligned left, numbers right."""
        cells = list(zip(*self.rows, strict=True)) or [()] * len(self.columns)
        is_text = [any(isinstance(cell, str) for cell in column) for column in cells]
        powers = [not self.mixed and any(map(_is_tiny, column)) for column in cells]
        lines = [
            "| " + " | ".join(self.columns) + " |",
            "|" + "|".join("---" if text else "---:" for text in is_text) + "|",
        ]
        for row in self.rows:
            texts = [cell_text(cell, power) for cell, power in zip(row, powers, strict=True)]
            lines.append("| " + " | ".join(texts) + " |")
        return "\n".join([f"*{self.title}*", "", *lines] if self.title else lines)


@dataclass(frozen=True)
class Ratio:
    """A measured number and its limit; NaN if it was not measured."""

    what: str
    value: float
    limit: float
    at_most: bool = True

    @property
    def limit_text(self) -> str:
        """The limit as text: "at most 1"."""
        return f"at {'most' if self.at_most else 'least'} {self.limit:.3g}"

    @property
    def verdict(self) -> str:
        """Whether the limit is met; text."""
        if math.isnan(self.value):
            return "not measured"
        is_met = self.value <= self.limit if self.at_most else self.value >= self.limit
        return "met" if is_met else "**not met**"


@dataclass(frozen=True)
class Figure:
    """A figure of the report: a PNG file, its caption and a function that draws it."""

    name: str
    caption: str
    draw: Callable[[Path], None]


@dataclass
class Section:
    """The results of one experiment; *skipped* names what was not measured, with reasons."""

    title: str
    text: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    ratios: list[Ratio] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)


def cell_text(cell: Cell, power: bool = False) -> str:
    """Return a cell as text with three digits; with *power*, in scientific notation.

    >>> [cell_text(x) for x in (None, "cactus", 12345, 0.012345, 1234.5, 3.2e-15, float("nan"))]
    ['–', 'cactus', '12345', '0.0123', '1234', '3.2e-15', '–']
    >>> cell_text(0.012345, True)
    '1.2e-02'
    """
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, str | int):
        return str(cell)
    if power or _is_tiny(cell):
        return f"{cell:.1e}"
    return f"{cell:.0f}" if abs(cell) >= 100.0 else f"{cell:.3g}"


def _is_tiny(cell: Cell) -> bool:
    return isinstance(cell, float) and 0.0 < abs(cell) < 1e-3
