"""The parts of a gizmo: what each is for, and the line that it is.

In units of the gizmo's own size: arrows of nearly 1 along the axes, squares in the planes between
them, rings around them, one more ring around all, which faces the viewer, and a ball in the
middle.
"""

from __future__ import annotations

import enum
from typing import NamedTuple

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray


class Way(enum.Enum):
    """How a part lets things move."""

    FREE = "in the plane of the view"
    ALONG = "along an axis"
    WITHIN = "in the plane across an axis"
    ABOUT = "turned about an axis"


class Part(NamedTuple):
    """A way, and the axis 0, 1, 2 that it belongs to; None is the line of sight."""

    way: Way
    axis: int | None = None


FREE = Part(Way.FREE)
PARTS = (
    FREE,
    *(Part(Way.ALONG, axis) for axis in range(3)),
    *(Part(Way.WITHIN, axis) for axis in range(3)),
    *(Part(Way.ABOUT, axis) for axis in range(3)),
    Part(Way.ABOUT),
)

BALL = 0.09  # its radius
_SHAFT, _TIP = 0.17, 0.82
_SQUARE = 0.30, 0.50
_RING, _OUTER_RING = 1.0, 1.14
_SEGMENTS = 72  # of a ring


def ring_radius(part: Part) -> float:
    """Return the radius of a ring."""
    return _OUTER_RING if part.axis is None else _RING


def line_of(part: Part) -> FloatArray:
    """Return the (k, 3) line of a part; about z where its axis is the line of sight.

    A square's goes around it, and what is inside belongs to it; the ball's is its centre.
    """
    if part.way is Way.FREE:
        return np.zeros((1, 3))
    axis = 2 if part.axis is None else part.axis
    if part.way is Way.ALONG:
        return np.outer([_SHAFT, _TIP], np.eye(3)[axis])
    if part.way is Way.WITHIN:
        low, high = _SQUARE
        flat = np.array([[low, low], [high, low], [high, high], [low, high], [low, low]])
    else:
        angles = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
        flat = ring_radius(part) * np.column_stack([np.cos(angles), np.sin(angles)])
    # The plane's own two axes in the order of the compass: y z, z x, x y.
    return np.roll(np.column_stack([flat, np.zeros(len(flat))]), axis + 1, axis=1)


def towards_corner(axes: FloatArray, axis: int, positive: BoolArray) -> FloatArray:
    """Return *axes* turned about one of them so that its square comes to another corner.

    Parameters
    ----------
    axes : (3, 3) float
        x, y and z as rows.
    axis : int
        What to turn about, by quarters of a turn.
    positive : (3,) bool
        Whether the square shall be where x, y and z point to, or across from there.
    """
    b, c = axes[axis - 2], axes[axis - 1]
    quarters = ((b, c), (c, -b)), ((-c, b), (-b, -c))
    turned = axes.copy()
    turned[axis - 2], turned[axis - 1] = quarters[not positive[axis - 1]][not positive[axis - 2]]
    return turned


def distance_to_origin(line: FloatArray) -> float:
    """Return how near a (k, 2) polyline comes to the origin; without the parts that are NaN."""
    start, step = line[:-1], np.diff(line, axis=0)
    share = -(start * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-12)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * step
    return float(np.fmin.reduce(np.linalg.norm(nearest, axis=1), initial=np.inf))


def surrounds_origin(line: FloatArray) -> bool:
    """Tell whether the origin is within a convex polygon, a closed (k, 2) *line*."""
    (x, y), (along, up) = line[:-1].T, np.diff(line, axis=0).T
    sides = x * up - y * along
    return bool((sides >= 0.0).all() or (sides <= 0.0).all())
