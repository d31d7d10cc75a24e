"""Faces that a beam can meet, for `line_of_sight`."""

from __future__ import annotations

from .kernels import kernel

_compile = kernel()


@_compile
def beyond_sides(sides, points, origin, axes, width, start, stop):
    """Put into *sides* (n,) a bit for each side of a beam that a vertex start..stop is beyond."""
    for i in range(start, stop):
        x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        u = x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2]
        v = x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2]
        sides[i] = (
            (1 if u > width else 0)
            + (2 if u < -width else 0)
            + (4 if v > width else 0)
            + (8 if v < -width else 0)
        )


@_compile
def beam_meets(is_met, faces, sides, start, stop):
    """Put into *is_met* (m,) whether no side has all corners of a face start..stop beyond it."""
    for f in range(start, stop):
        beyond = sides[faces[f, 0]] & sides[faces[f, 1]] & sides[faces[f, 2]]
        is_met[f] = beyond == 0
