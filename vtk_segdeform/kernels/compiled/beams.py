"""Faces that a beam can meet, for `line_of_sight`."""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile("i8[:], const f8[:,:], const i8[:,:], const f8[:], const f8[:,:], f8")
def faces_in_beam(met, points, faces, origin, axes, width):
    """Put into *met* (m,) the faces of which no side of a beam has all corners beyond it.

    Returns their number.
    """
    sides = np.empty(len(points), dtype=np.uint8)
    for i in range(len(points)):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        u = x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2]
        v = x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2]
        sides[i] = (
            (1 if u > width else 0)
            + (2 if u < -width else 0)
            + (4 if v > width else 0)
            + (8 if v < -width else 0)
        )
    count = 0
    for f in range(len(faces)):
        if sides[faces[f, 0]] & sides[faces[f, 1]] & sides[faces[f, 2]] == 0:
            met[count] = f
            count += 1
    return count
