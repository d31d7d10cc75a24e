"""Where the line of sight meets a surface, without a search structure.

A structure over a large mesh takes far longer to build than one pass over its vertices, and every
pose needs another one.  The pass gives each vertex a bit for every side of a narrow beam around the
line that it is beyond; the beam can meet a face only if no side has all three corners beyond it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import FloatArray, IntArray


def intersections(
    points: FloatArray, faces: IntArray, near: FloatArray, far: FloatArray, *, tolerance: float
) -> tuple[FloatArray, IntArray]:
    """Return where the segment from *near* to *far* meets a surface, in order.

    Parameters
    ----------
    points : (n, 3) float
        The vertices.
    faces : (m, 3) int
        Triangles between them.
    near, far : (3,) float
        The ends of the segment.
    tolerance : float
        Distance from the edge of a face, in the unit of *points*, that still meets it.

    Returns
    -------
    places : (k, 3) float
        From *near* to *far*.
    met : (k,) int
        Their faces.
    """
    length = float(np.linalg.norm(far - near))
    if not length > 0.0:
        return np.empty((0, 3)), np.empty(0, dtype=np.int64)
    direction = (far - near) / length
    met = _faces_in_beam(points, faces, near, direction, width=2.0 * tolerance)
    a, b, c = (points[corner] - near for corner in faces[met].T)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        depth = (a * normal).sum(axis=1) / (normal @ direction)
        place = depth[:, None] * direction
        inside = np.abs(depth - 0.5 * length) <= 0.5 * length
        for start, stop in ((a, b), (b, c), (c, a)):
            edge = stop - start
            edge /= np.linalg.norm(edge, axis=1, keepdims=True)
            within = (np.cross(edge, place - start) * normal).sum(axis=1)
            inside &= within >= -tolerance
    found = np.flatnonzero(inside)
    found = found[np.argsort(depth[found], kind="stable")]
    return near + place[found], met[found]


def _faces_in_beam(
    points: FloatArray, faces: IntArray, origin: FloatArray, direction: FloatArray, *, width: float
) -> IntArray:
    """Return faces (k,), among them all that a beam can meet.

    The beam goes through *origin* (3,) along *direction* (3,), *width* to each side.
    """
    u, v = ((points - origin) @ perpendicular(direction).T).T
    sides = (u > width) * np.uint8(1) | (u < -width) * np.uint8(2)
    sides |= (v > width) * np.uint8(4) | (v < -width) * np.uint8(8)
    first, second, third = (sides[corner] for corner in faces.T)
    return np.flatnonzero((first & second & third) == 0)


def perpendicular(direction: FloatArray) -> NDArray[np.float64]:
    """Return two unit vectors (2, 3), perpendicular to *direction* and to each other."""
    first = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])
