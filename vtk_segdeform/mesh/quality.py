"""Angles of triangles, exact for needles and flat ones too."""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray


def least_angle(corners: FloatArray) -> FloatArray:
    """Return the smallest angle of each triangle of *corners* (..., 3, d), in radians.

    >>> least_angle(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])) / np.pi
    array([0.25])
    """
    angles = corner_angles(corners)
    return np.minimum(np.minimum(angles[..., 0], angles[..., 1]), angles[..., 2])


def corner_angles(corners: FloatArray) -> FloatArray:
    """Return the angle at each corner, (..., 3); 0 or pi in a flat triangle."""
    sides = corners[..., [1, 2, 0], :] - corners  # from each corner to the next
    squares = np.einsum("...ix,...ix->...i", sides, sides)
    dots = -np.einsum("...ix,...ix->...i", sides, sides[..., [2, 0, 1], :])
    up = normals(corners)
    twice_area = np.sqrt(np.einsum("...x,...x->...", up, up))[..., None]
    there = (squares > 0.0) & (squares[..., [2, 0, 1]] > 0.0)
    return np.where(there, np.arctan2(twice_area, dots), 0.0)


def normals(corners: FloatArray) -> FloatArray:
    """Return the normals of triangles (..., 3, 3), as long as twice their areas."""
    x, y, z = np.moveaxis(corners, -1, 0)
    u = [e[..., 1] - e[..., 0] for e in (x, y, z)]
    v = [e[..., 2] - e[..., 0] for e in (x, y, z)]
    cross = [u[i] * v[j] - u[j] * v[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(cross, axis=-1)
