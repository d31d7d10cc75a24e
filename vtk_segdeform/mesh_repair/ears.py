"""Ear clipping of a loop that is a simple polygon in some projection.

Ears of the projected loop are clipped, the best shaped first.  An ear that contains another corner,
even on its boundary, is not clipped, so that no triangle is degenerate.  Triangles that do not
overlap in the projection do not cross in space, however the loop winds.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray

_STRAIGHT = 1e-9  # sine of an angle
_VIEWS = 60  # projection directions that are tried
_AREA = 1e-3  # least area per corner, over the squared extent; less is seen edge-on


def clip_ears(points: FloatArray) -> tuple[IntArray, FloatArray] | None:
    """Return n - 2 triangles over the loop *points* (n, 3), and the view of the projection.

    ``points @ view.T`` with the *view* (3, 3), a rotation, are coordinates to the right, upwards
    and towards the eye.  Of the directions from which the loop is simple, its mean normal is tried
    first, and then those nearest to it.  None if the loop crosses itself in all of them.

    Examples
    --------
    >>> clip_ears(np.array([[0.0, 0, 0], [2, 0, 1], [2, 2, 0], [1, 0.5, 1]]))[0].tolist()
    [[1, 2, 3], [3, 0, 1]]
    """
    for up in _directions(points):
        view = _view(up)
        flat = (points - points[0]) @ view[:2].T
        if _is_simple(flat) and (triangles := _clipped(flat)) is not None:
            return triangles, view
    return None


def _clipped(flat: FloatArray) -> IntArray | None:
    """Return the ears of a simple polygon (n, 2); None if rounding leaves none to clip."""
    n = len(flat)
    before, after = np.roll(np.arange(n), 1), np.roll(np.arange(n), -1)
    sharp = _roundness(flat[before], flat, flat[after])
    hopeful = sharp.copy()  # 0 once an ear has failed, until a neighbour is clipped
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


def _directions(points: FloatArray) -> FloatArray:
    """Return unit vectors (v, 3): the mean normal of the loop, and others around it."""
    x = points - points.mean(axis=0)
    area = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)
    k = np.arange(_VIEWS) + 0.5  # spread evenly over the sphere
    z, turn = 1.0 - 2.0 * k / _VIEWS, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    around = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
    along = around @ area
    around = around[np.argsort(-along, kind="stable")][: np.count_nonzero(along > 0.0)]
    size = np.linalg.norm(area)
    return np.concatenate([[area / size], around]) if size > 0.0 else around


def _view(up: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose last row is *up*."""
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(up, right), up])


def _roundness(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of triangles (k, 2) over their longest sides squared."""
    u, v, w = b - a, c - b, a - c
    turn = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    longest = np.max([(e * e).sum(axis=1) for e in (u, v, w)], axis=0)
    round_ = turn / np.maximum(longest, np.finfo(float).tiny)
    return np.where(np.abs(round_) <= _STRAIGHT, 0.0, round_)


def _any_inside(ear: FloatArray, others: FloatArray) -> bool:
    """Return whether any of *others* (k, 2) is in counter-clockwise *ear* or on its boundary."""
    inside = np.ones(len(others), dtype=bool)
    slack = _STRAIGHT * float(np.ptp(ear, axis=0).max()) ** 2
    for start, end in ((0, 1), (1, 2), (2, 0)):
        along, to = ear[end] - ear[start], others - ear[start]
        inside &= along[0] * to[:, 1] - along[1] * to[:, 0] >= -slack
    return bool(inside.any())


def _is_simple(flat: FloatArray) -> bool:
    """Return whether the polygon *flat* (n, 2) is counter-clockwise and no two sides cross."""
    n, after = len(flat), np.roll(flat, -1, axis=0)
    area = (flat[:, 0] * after[:, 1] - flat[:, 1] * after[:, 0]).sum()
    if area <= _AREA * float(np.ptp(flat, axis=0).max()) ** 2 / n:
        return False
    longest = float(np.linalg.norm(after - flat, axis=1).max())
    near = cKDTree(0.5 * (flat + after)).query_pairs(longest, output_type="ndarray")
    one, other = near.T
    apart = ~np.isin(other - one, (1, n - 1))
    a, b, c, d = flat[one], after[one], flat[other], after[other]
    slack = _STRAIGHT * float(np.ptp(flat, axis=0).max()) ** 2

    def parted(start: FloatArray, end: FloatArray, p: FloatArray, q: FloatArray) -> BoolArray:
        """Return the pairs whose points p and q lie on different sides of the line."""
        u, v, w = end - start, p - start, q - start
        left, right = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
        return (np.minimum(left, right) < -slack) & (np.maximum(left, right) > slack)

    return not (apart & parted(a, b, c, d) & parted(c, d, a, b)).any()
