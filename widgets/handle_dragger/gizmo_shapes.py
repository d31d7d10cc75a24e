"""The parts of a gizmo, and the line of each part.

Lengths are in units of the gizmo's size.  The arrows lie along the axes, the squares in the planes
between them, and the rings around them.  An outer ring faces the viewer, and a ball is at the
centre.
"""

from __future__ import annotations

import enum
from typing import NamedTuple

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray


class Kind(enum.Enum):
    """The kind of motion of a part."""

    FREE = "translation in the view plane"
    AXIS = "translation along an axis"
    PLANE = "translation in the plane perpendicular to an axis"
    ROTATION = "rotation about an axis"


class Part(NamedTuple):
    """A kind of motion and its axis 0, 1 or 2; None stands for the line of sight."""

    kind: Kind
    axis: int | None = None


FREE = Part(Kind.FREE)
TURN = Part(Kind.ROTATION)
"""About the line of sight."""
LIMB = Part(Kind.ROTATION, 2)
"""About the axis of a limb, with `axes_along` it."""
PARTS = (
    FREE,
    *(Part(Kind.AXIS, axis) for axis in range(3)),
    *(Part(Kind.PLANE, axis) for axis in range(3)),
    *(Part(Kind.ROTATION, axis) for axis in range(3)),
    TURN,
)

BALL = 0.09  # radius
_SHAFT, _TIP = 0.17, 0.82
_SQUARE = 0.30, 0.50
_RING, _OUTER_RING = 1.0, 1.14
_SEGMENTS = 72  # of a ring


def ring_radius(part: Part) -> float:
    """Return the radius of a ring."""
    return _OUTER_RING if part.axis is None else _RING


def line_of(part: Part) -> FloatArray:
    """Return the (k, 3) line of a part; the outer ring lies around the z axis.

    The line of a square is its border, and its interior belongs to the part.  The line of the ball
    is its centre.
    """
    if part.kind is Kind.FREE:
        return np.zeros((1, 3))
    axis = 2 if part.axis is None else part.axis
    if part.kind is Kind.AXIS:
        return np.outer([_SHAFT, _TIP], np.eye(3)[axis])
    if part.kind is Kind.PLANE:
        low, high = _SQUARE
        flat = np.array([[low, low], [high, low], [high, high], [low, high], [low, low]])
    else:
        angles = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
        flat = ring_radius(part) * np.column_stack([np.cos(angles), np.sin(angles)])
    # The two axes of the plane in cyclic order: y z, z x, x y.
    return np.roll(np.column_stack([flat, np.zeros(len(flat))]), axis + 1, axis=1)


def facing_axes(axes: FloatArray, axis: int, positive: BoolArray) -> FloatArray:
    """Return *axes*, rotated about one of them so that its square lies in a given quadrant.

    Parameters
    ----------
    axes : (3, 3) float
        x, y and z as rows.
    axis : int
        The axis of the rotation, which is by multiples of 90 degrees.
    positive : (3,) bool
        The quadrant: whether the square lies on the positive side of x, y and z.
    """
    b, c = axes[axis - 2], axes[axis - 1]
    quadrants = ((b, c), (c, -b)), ((-c, b), (-b, -c))
    rotated = axes.copy()
    rotated[axis - 2], rotated[axis - 1] = quadrants[not positive[axis - 1]][not positive[axis - 2]]
    return rotated


def distance_to_origin(line: FloatArray) -> float:
    """Return the distance of a (k, 2) polyline from the origin, without segments that are NaN."""
    start, step = line[:-1], np.diff(line, axis=0)
    fraction = -(start * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-12)
    nearest = start + np.clip(fraction, 0.0, 1.0)[:, None] * step
    return float(np.fmin.reduce(np.linalg.norm(nearest, axis=1), initial=np.inf))


def surrounds_origin(line: FloatArray) -> bool:
    """Return whether the origin is inside a convex polygon, a closed (k, 2) *line*."""
    (x, y), (along, up) = line[:-1].T, np.diff(line, axis=0).T
    sides = x * up - y * along
    return bool((sides >= 0.0).all() or (sides <= 0.0).all())
