"""Problem sizes of a run, and what an experiment returns: a section with text and tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

Cell = str | float | int | None


@dataclass(frozen=True)
class Scale:
    """Sizes and repetitions of the experiments."""

    name: str
    paper_size: int = 5430  # vertices of the cactus, as in the paper
    n_cage_vertices: int = 155
    drag_sizes: tuple[int, ...] = (5430, 50_000)
    repeats: int = 5  # of each measurement
    regions: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24)  # of the paper's table 2
    peer_sizes: tuple[int, ...] = (5430,)
    mechanism_bodies: int = 3
    batch: tuple[int, int, int] = (10, 20, 5430)  # meshes, poses of each, vertices


QUICK = Scale("quick", repeats=3, regions=(1, 3, 6, 12, 24), mechanism_bodies=1)
USUAL = Scale("usual", peer_sizes=(5430, 50_000))
FULL = Scale("full", drag_sizes=(5430, 50_000, 500_000), peer_sizes=(5430, 50_000, 500_000))


@dataclass(frozen=True)
class Table:
    """Rows of cells under named columns.

    Numbers of one column are written in one notation; in a *mixed* table, where a column has
    different quantities, each cell has its own.
    """

    columns: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]
    title: str
    mixed: bool = False

    def markdown(self) -> str:
        """Return the table in Markdown; text is aligned left, numbers right."""
        cells = list(zip(*self.rows, strict=True)) or [()] * len(self.columns)
        is_text = [any(isinstance(cell, str) for cell in column) for column in cells]
        powers = [not self.mixed and any(map(_is_tiny, column)) for column in cells]
        rows = [
            self.columns,
            ["---" if text else "---:" for text in is_text],
            *([cell_text(*pair) for pair in zip(row, powers, strict=True)] for row in self.rows),
        ]
        return "\n".join([f"*{self.title}*", "", *(f"| {' | '.join(row)} |" for row in rows)])


@dataclass
class Section:
    """The results of one experiment; *skipped* names what was not measured, with reasons."""

    title: str
    text: str = ""
    tables: list[Table] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def markdown(self) -> str:
        """Return the section in Markdown."""
        skipped = "\n".join(f"- Not measured: {line}" for line in self.skipped)
        parts = [f"## {self.title}", self.text, *(t.markdown() for t in self.tables), skipped]
        return "\n\n".join(filter(None, parts))


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
