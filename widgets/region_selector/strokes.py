"""The tools that select vertices by one stroke of the pointer, and what each has selected so far.

brush       within a radius along the surface of what the pointer went over
lasso       inside the line that was drawn
rectangle   between the press and the pointer
component   whatever is connected with what was pressed on

The first three select what is seen only, or right through the body as if it were glass.
"""

from __future__ import annotations

import enum
from typing import Protocol

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray

from ..picking import Hit, Picker
from ..scene import Phase, Pointer

_APART = 0.3  # of the radius: between the places that a fast brush touches
_MOST = 200  # such places between two moves of the mouse
_LEAST = 3.0  # pixels: a narrower lasso or rectangle is a slip of the hand


class Tool(enum.Enum):
    """With what vertices are selected."""

    BRUSH = enum.auto()
    LASSO = enum.auto()
    RECTANGLE = enum.auto()
    COMPONENT = enum.auto()


class Stroke(Protocol):
    """A selection in the making; it begins with the press."""

    def extend(self, pointer: Pointer) -> None:
        """Go on to where *pointer* is."""

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: the vertices selected so far."""

    @property
    def outline(self) -> FloatArray | None:
        """(k, 2) float: the closed line in the display that tells of it, if there is one."""


class Brush:
    """What is within *radius*, in the mesh's unit, of where the pointer went over the surface.

    At least the nearest vertex, however small the radius.
    """

    outline = None

    def __init__(self, picker: Picker, press: Pointer, *, radius: float, through: bool) -> None:
        self._picker = picker
        self._radius, self._through = radius, through
        self._last = press.position
        self._gap = 1.0
        self.mask = self._reached([press])

    def extend(self, pointer: Pointer) -> None:
        """Brush along a straight line, however fast the pointer went."""
        way = pointer.position - self._last
        steps = int(np.clip(np.ceil(np.linalg.norm(way) / self._gap), 1, _MOST))
        places = self._last + way * (np.arange(1, steps + 1) / steps)[:, None]
        self._last = pointer.position
        self.mask = self.mask | self._reached([Pointer(Phase.MOVE, *p) for p in places.tolist()])

    def _reached(self, pointers: list[Pointer]) -> BoolArray:
        hits = [hit for pointer in pointers for hit in under(self._picker, pointer, self._through)]
        if hits:
            self._gap = max(1.0, _APART * self._radius / self._picker.pixel_at(hits[-1]))
        reached = self._picker.distances(hits, self._radius) <= self._radius
        reached[[hit.vertex for hit in hits]] = True
        return reached if self._through else self._picker.seen(reached)


class Lasso:
    """What is inside a line that closes itself.

    A vertex is inside if a ray from it crosses the line an odd number of times.  Each piece is
    compared with the vertices once, when it is drawn; only the one that closes the line changes.
    """

    def __init__(self, picker: Picker, press: Pointer, *, through: bool) -> None:
        self._x, self._y, _ = picker.places().T
        self._picker, self._through = picker, through
        self._corners = [press.position]
        self._odd = np.zeros(len(self._x), dtype=bool)

    def extend(self, pointer: Pointer) -> None:
        """Draw on."""
        self._odd ^= self._crossed(self._corners[-1], pointer.position)
        self._corners.append(pointer.position)

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: what the line goes round."""
        inside = self._odd ^ self._crossed(self._corners[-1], self._corners[0])
        inside &= _is_meant(self.outline)
        return inside if self._through else self._picker.seen(inside)

    @property
    def outline(self) -> FloatArray:
        """(k, 2) float: the line."""
        return np.array(self._corners)

    def _crossed(self, a: FloatArray, b: FloatArray) -> BoolArray:
        """Tell whether a ray to the right of each vertex crosses the piece from *a* to *b*."""
        between = np.flatnonzero((a[1] > self._y) != (b[1] > self._y))
        share = (self._y[between] - a[1]) / (b[1] - a[1])  # none is between if this is 0
        crossed = np.zeros(len(self._x), dtype=bool)
        crossed[between] = self._x[between] < a[0] + share * (b[0] - a[0])
        return crossed


class Rectangle:
    """What is between the press and the pointer."""

    def __init__(self, picker: Picker, press: Pointer, *, through: bool) -> None:
        self._x, self._y, _ = picker.places().T
        self._picker, self._through = picker, through
        self._ends = np.array([press.position, press.position])

    def extend(self, pointer: Pointer) -> None:
        """Draw the corner opposite the press to where *pointer* is."""
        self._ends[1] = pointer.position

    @property
    def mask(self) -> BoolArray:
        """(n,) bool: what is inside; NaN, behind the camera, is not."""
        (left, low), (right, high) = self._ends.min(axis=0), self._ends.max(axis=0)
        x, y = self._x, self._y
        inside = (x >= left) & (x <= right) & (y >= low) & (y <= high) & _is_meant(self._ends)
        return np.asarray(inside if self._through else self._picker.seen(inside))

    @property
    def outline(self) -> FloatArray:
        """(4, 2) float: the corners."""
        (a, b), (c, d) = self._ends
        return np.array([[a, b], [c, b], [c, d], [a, d]])


class Component:
    """What is connected with a vertex, its far side too."""

    outline = None

    def __init__(self, picker: Picker, vertex: int) -> None:
        self.mask = picker.component(vertex)

    def extend(self, pointer: Pointer) -> None:
        """Stay with what was pressed on."""
        del pointer


def under(picker: Picker, pointer: Pointer, through: bool) -> list[Hit]:
    """Return what is under *pointer*: what is seen only, or all that a needle would go through."""
    hits = picker.hits(pointer)
    return hits if through else hits[:1]


def _is_meant(corners: FloatArray) -> bool:
    return bool(np.ptp(corners, axis=0).min() >= _LEAST)
