"""The tools that select vertices with one stroke of the pointer.

brush       within a radius, along the surface, of the path of the pointer
lasso       inside a drawn line
rectangle   inside the rectangle from the press to the pointer
component   the connected part under the press
region      the region under the press

The first three select visible vertices only, or also hidden ones (X-ray).
"""

from __future__ import annotations

import enum
from typing import Protocol

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray

from ..picking import Hit, Picker
from ..scene import Phase, Pointer

_SPACING = 0.3  # of the radius, between the dabs of a fast brush
_MOST_DABS = 200  # between two mouse moves
_LEAST_SIZE = 3.0  # pixels; a smaller lasso or rectangle is taken for a click
_LEAST_SHARE = 1e-6  # of a vertex at the radius of the brush


class Tool(enum.Enum):
    """The tool that selects vertices."""

    BRUSH = enum.auto()
    LASSO = enum.auto()
    RECTANGLE = enum.auto()
    COMPONENT = enum.auto()
    REGION = enum.auto()


class Stroke(Protocol):
    """A selection in progress; it begins with the press."""

    def extend(self, pointer: Pointer) -> None:
        """Continue the stroke to *pointer*."""

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: the vertices selected so far."""

    @property
    def outline(self) -> FloatArray | None:
        """(k, 2) float: the closed line to draw in the display, or None."""


class Brush:
    """Selects the vertices within *radius*, in the mesh's unit, of the path of the pointer.

    At least the vertex nearest to each hit is selected, however small the radius.
    """

    outline = None

    def __init__(self, picker: Picker, press: Pointer, *, radius: float, through: bool) -> None:
        self._picker = picker
        self._radius, self._through = radius, through
        self._last = press.position
        self._spacing = 1.0  # pixels between dabs
        self._shares = self._covered([press])

    def extend(self, pointer: Pointer) -> None:
        """Brush along a straight line to *pointer*, without gaps after a fast move."""
        path = pointer.position - self._last
        dabs = int(np.clip(np.ceil(np.linalg.norm(path) / self._spacing), 1, _MOST_DABS))
        positions = self._last + path * (np.arange(1, dabs + 1) / dabs)[:, None]
        self._last = pointer.position
        pointers = [Pointer(Phase.MOVE, *position) for position in positions.tolist()]
        self._shares = np.maximum(self._shares, self._covered(pointers))

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: the vertices selected so far."""
        return np.asarray(self._shares > 0.0)

    @property
    def shares(self) -> FloatArray:
        """(n,) float: 1 on the path, and less towards the radius; see `shares_of`."""
        return self._shares

    def _covered(self, pointers: list[Pointer]) -> FloatArray:
        hits = [hit for each in pointers for hit in hits_at(self._picker, each, self._through)]
        if hits:
            self._spacing = max(1.0, _SPACING * self._radius / self._picker.pixel_at(hits[-1]))
        away = self._picker.distances(hits, self._radius) / self._radius
        shares = np.where(away <= 1.0, np.maximum((1.0 - away**2) ** 2, _LEAST_SHARE), 0.0)
        own = [hit.vertex for hit in hits]
        shares[own] = np.where(away[own] <= 1.0, shares[own], 1.0)
        if not self._through:
            shares[~self._picker.visible(shares > 0.0)] = 0.0
        return shares


class Lasso:
    """Selects the vertices inside a line whose ends are connected automatically.

    A vertex is inside if a ray from it crosses the line an odd number of times.  Each segment is
    tested against the vertices once, when it is drawn; only the closing segment changes.
    """

    def __init__(self, picker: Picker, press: Pointer, *, through: bool) -> None:
        self._x, self._y, _ = picker.display_points().T
        self._picker, self._through = picker, through
        self._corners = [press.position]
        self._odd = np.zeros(len(self._x), dtype=bool)

    def extend(self, pointer: Pointer) -> None:
        """Continue the line to *pointer*."""
        self._odd ^= self._crossed(self._corners[-1], pointer.position)
        self._corners.append(pointer.position)

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: the vertices inside."""
        inside = self._odd ^ self._crossed(self._corners[-1], self._corners[0])
        inside &= _is_large_enough(self.outline)
        return inside if self._through else self._picker.visible(inside)

    @property
    def outline(self) -> FloatArray:
        """(k, 2) float: the line."""
        return np.array(self._corners)

    def _crossed(self, a: FloatArray, b: FloatArray) -> BoolArray:
        """Return (n,) bool: whether a ray to the right of a vertex crosses the segment a b."""
        between = np.flatnonzero((a[1] > self._y) != (b[1] > self._y))
        fraction = (self._y[between] - a[1]) / (b[1] - a[1])  # *between* is empty if b[1] == a[1]
        crossed = np.zeros(len(self._x), dtype=bool)
        crossed[between] = self._x[between] < a[0] + fraction * (b[0] - a[0])
        return crossed


class Rectangle:
    """Selects the vertices in the rectangle from the press to the pointer."""

    def __init__(self, picker: Picker, press: Pointer, *, through: bool) -> None:
        self._x, self._y, _ = picker.display_points().T
        self._picker, self._through = picker, through
        self._ends = np.array([press.position, press.position])

    def extend(self, pointer: Pointer) -> None:
        """Move the corner opposite the press to *pointer*."""
        self._ends[1] = pointer.position

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: the vertices inside; vertices behind the camera, NaN, are not."""
        (left, low), (right, high) = self._ends.min(axis=0), self._ends.max(axis=0)
        x, y = self._x, self._y
        inside = (x >= left) & (x <= right) & (y >= low) & (y <= high)
        inside &= _is_large_enough(self._ends)
        return np.asarray(inside if self._through else self._picker.visible(inside))

    @property
    def outline(self) -> FloatArray:
        """(4, 2) float: the corners."""
        (a, b), (c, d) = self._ends
        return np.array([[a, b], [c, b], [c, d], [a, d]])


class Whole:
    """Selects a whole connected part or region, (n,) bool, including its far side."""

    outline = None

    def __init__(self, mask: BoolArray) -> None:
        self.mask = mask

    def extend(self, pointer: Pointer) -> None:
        """Keep the part under the press."""
        del pointer


def shares_of(stroke: Stroke) -> FloatArray:
    """Return how far each vertex is selected, (n,), 0 to 1: with a brush, less towards its rim."""
    return stroke.shares if isinstance(stroke, Brush) else stroke.mask.astype(np.float64)


def hits_at(picker: Picker, pointer: Pointer, through: bool) -> list[Hit]:
    """Return the first hit of the line of sight at *pointer*, or with *through* all hits."""
    hits = picker.hits(pointer)
    return hits if through else hits[:1]


def _is_large_enough(corners: FloatArray) -> bool:
    return bool(np.ptp(corners, axis=0).min() >= _LEAST_SIZE)
