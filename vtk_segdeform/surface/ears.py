"""Triangles over a loop that is a simple polygon as seen along its mean normal.

Ears are clipped off the projection, the roundest first.  An ear with another corner in it or on
its rim stays, so no ear of a polygon is without area.  Triangles that do not overlap in the
projection do not cross in space, however the loop winds.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray

_STRAIGHT = 1e-9  # sine of an angle
_PAIRS = 1_000_000  # pairs of sides compared at once


def clip_ears(points: FloatArray) -> IntArray | None:
    """Return n - 2 triangles over the loop *points* (n, 3); None if it crosses itself as seen.

    Examples
    --------
    >>> clip_ears(np.array([[0.0, 0, 0], [2, 0, 1], [2, 2, 0], [1, 0.5, 1]])).tolist()
    [[1, 2, 3], [0, 1, 3]]
    """
    flat = _projected(points)
    if flat is None or _crosses_itself(flat):
        return None
    n = len(flat)
    before, after = np.roll(np.arange(n), 1), np.roll(np.arange(n), -1)
    sharp = _roundness(flat[before], flat, flat[after])
    hopeful = sharp.copy()  # 0 once an ear was tried in vain; corners that go may free it
    left = np.ones(n, dtype=bool)
    triangles = []
    for _ in range(n - 2):
        tried_again = False
        while True:
            at = int(hopeful.argmax())
            if hopeful[at] <= 0.0:
                if tried_again:
                    return None
                hopeful, tried_again = np.where(left, sharp, 0.0), True
                continue
            ear = np.array([before[at], at, after[at]])
            reflex = left & (sharp <= 0.0)
            reflex[ear] = False
            if not _any_inside(flat[ear], flat[reflex]):
                break
            hopeful[at] = 0.0
        triangles.append(ear)
        left[at], hopeful[at] = False, 0.0
        a, c = ear[[0, 2]]
        after[a], before[c] = c, a
        both = np.array([a, c])
        sharp[both] = _roundness(flat[before[both]], flat[both], flat[after[both]])
        hopeful[both] = sharp[both]
    return np.array(triangles, dtype=np.int64)


def _projected(points: FloatArray) -> FloatArray | None:
    """Return *points* (n, 2) along the normal of the loop's area, which runs counter-clockwise."""
    x = points - points.mean(axis=0)
    area = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)
    size = np.linalg.norm(area)
    if size <= 1e-12 * (x * x).sum():
        return None
    up = area / size
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.stack([x @ right, x @ np.cross(up, right)], axis=1)


def _roundness(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of triangles (k, 2) over their longest sides squared."""
    u, v, w = b - a, c - b, a - c
    turn = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    longest = np.max([(e * e).sum(axis=1) for e in (u, v, w)], axis=0)
    round_ = turn / np.maximum(longest, np.finfo(float).tiny)
    return np.where(np.abs(round_) <= _STRAIGHT, 0.0, round_)


def _any_inside(ear: FloatArray, others: FloatArray) -> bool:
    """Tell whether any of *others* (k, 2) lies in the counter-clockwise *ear* or on its rim."""
    inside = np.ones(len(others), dtype=bool)
    slack = _STRAIGHT * float(np.ptp(ear, axis=0).max()) ** 2
    for start, end in ((0, 1), (1, 2), (2, 0)):
        along, to = ear[end] - ear[start], others - ear[start]
        inside &= along[0] * to[:, 1] - along[1] * to[:, 0] >= -slack
    return bool(inside.any())


def _crosses_itself(flat: FloatArray) -> bool:
    """Tell whether sides of the polygon *flat* (n, 2) cross or touch where they are no neighbours."""
    n = len(flat)
    rows = max(1, _PAIRS // n)
    return any(
        _sides_meet(flat, np.arange(s, min(s + rows, n))).any() for s in range(0, n, rows)
    )


def _sides_meet(flat: FloatArray, some: IntArray) -> BoolArray:
    n = len(flat)
    p, q = flat, np.roll(flat, -1, axis=0)

    def side_of(start: FloatArray, end: FloatArray, point: FloatArray) -> FloatArray:
        u, v = end - start, point - start
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    a, b = p[some, None], q[some, None]
    slack = _STRAIGHT * float(np.ptp(flat, axis=0).max()) ** 2
    s1, s2 = side_of(a, b, p[None]), side_of(a, b, q[None])
    s3, s4 = side_of(p[None], q[None], a), side_of(p[None], q[None], b)
    meet = (np.minimum(s1, s2) < -slack) & (np.maximum(s1, s2) > slack)
    meet &= (np.minimum(s3, s4) < -slack) & (np.maximum(s3, s4) > slack)
    gap = np.abs(some[:, None] - np.arange(n))
    result: BoolArray = meet & (gap > 1) & (gap < n - 1)
    return result
