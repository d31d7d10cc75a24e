"""Decisions between equals: the same every time, and in every frame of reference.

On a symmetric shape many lengths are equal, and rounding, which differs between frames, must not
decide between them.  So each vertex has a small random number that depends on its index only.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray

_TIE_BREAK = 1e-6  # far above rounding, and far below any difference that matters


def tie_breakers(n: int) -> FloatArray:
    """Return factors (n,) from 1 to 1 + 1e-6 for distances from n points."""
    return np.asarray(1.0 + _TIE_BREAK * np.random.default_rng(0).random(n))


def principal_axes(points: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Return right-handed principal axes as rows, longest first, that rotate with *points* (n, 3).

    The weight of each point is scaled by a random number, which separates axes of equal length and
    determines their signs.
    """
    scale, sign = np.random.default_rng(0).uniform(0.0, 2.0, (2, len(points)))
    mass = scale if weights is None else weights * scale
    centred = points - mass @ points / mass.sum()
    axes = np.linalg.eigh((centred.T * mass) @ centred)[1].T[::-1]
    axes = axes * np.where(axes @ ((sign - 1.0) @ centred) < 0.0, -1.0, 1.0)[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    return np.asarray(axes)
