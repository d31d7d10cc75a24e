"""Angles of triangles, exact for needles and flat ones too."""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray


def least_angle(corners: FloatArray) -> FloatArray:
    """Return the smallest angle of each triangle of *corners* (..., 3, d), in radians.

    >>> least_angle(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])) / np.pi
    array([0.25])
    """
    return corner_angles(corners).min(axis=-1)


def corner_angles(corners: FloatArray) -> FloatArray:
    """Return the angle at each corner, (..., 3); 0 or pi in a flat triangle."""
    out = np.roll(corners, -1, axis=-2) - corners
    back = np.roll(corners, 1, axis=-2) - corners
    dot = (out * back).sum(axis=-1)
    squares = (out * out).sum(axis=-1) * (back * back).sum(axis=-1)
    cross = np.cross(out, back)
    sine = np.linalg.norm(cross, axis=-1) if corners.shape[-1] == 3 else np.abs(cross)
    angles = np.arctan2(sine, dot)
    return np.where(squares > 0.0, angles, 0.0)


def normals(corners: FloatArray) -> FloatArray:
    """Return the normals of triangles (..., 3, 3), as long as twice their areas."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    return np.cross(b - a, c - a)
