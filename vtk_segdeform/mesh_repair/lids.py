"""Triangulation of a border loop without new vertices: a lid.

*Dynamic programming.*  The triangle at the last edge of the loop v_0 ... v_{n-1} divides a
triangulation into two smaller ones, so the least cost over v_i ... v_j is

    C(i, i+1) = 0        C(i, j) = min over i < k < j of  C(i, k) + C(k, j) + c(i, k, j)

from short spans to long ones: n^3 / 6 triangles, n^2 memory.  The cost c of a triangle is its area
plus a thousandth of its squared sides, so that better-shaped triangles win among equal areas, plus
a penalty for a degenerate triangle.  Loops of equal length are processed together.

*Ear clipping* of the loop projected to a plane, the best shaped ears first, where the projection is
a simple polygon.  An ear that contains another corner, even on its boundary, is not clipped, so
that no triangle is degenerate.  Triangles that do not overlap in the projection do not cross in
space, for any shape of the loop.

Source
------
G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided Geometric
Design 12(2), 207-229, 1995.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray

_ROUNDNESS = 1e-3
_FLAT, _FLAT_CHARGE = 1e-4, 0.05  # twice the area, and the penalty, over the longest side^2
_BRANCHES = 48  # corners that approximate a longer loop
_AT_ONCE = 2_000_000  # triangles compared at once
_STRAIGHT = 1e-9  # sine of an angle
_AREA = 1e-3  # least projected area per corner, over the squared extent


def triangulate_loops(points: FloatArray, taken: BoolArray) -> tuple[IntArray, BoolArray]:
    """Return triangulations (l, n - 2, 3) of l loops, and for which loops one exists, (l,) bool.

    Parameters
    ----------
    points : (l, n, 3) float
        The corners of each loop, in their order.
    taken : (l, n, n) bool
        Symmetric: pairs of corners that must not be joined, because the surface outside the loop
        has that edge already.  Entries for edges of the loop are ignored.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> triangulate_loops(square[None], np.zeros((1, 4, 4), bool))[0].tolist()
    [[[0, 1, 3], [1, 2, 3]]]
    """
    n_loops, n, _ = points.shape
    together = max(1, _AT_ONCE // n**2)
    if n_loops > together:
        parts = [
            triangulate_loops(points[s : s + together], taken[s : s + together])
            for s in range(0, n_loops, together)
        ]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    cost = np.zeros((n_loops, n, n))
    middle = np.zeros((n_loops, n, n), dtype=np.int64)
    loop = np.arange(n_loops)[:, None]
    for span in range(2, n):
        i = np.arange(n - span)
        j = i + span
        k = i[:, None] + np.arange(1, span)
        own = _cost(points[:, i][:, :, None], points[:, k], points[:, j][:, :, None])
        total = cost[:, i[:, None], k] + cost[:, k, j[:, None]] + own
        best = total.argmin(axis=2)
        row = np.arange(len(i))
        middle[:, i, j] = k[row, best]
        cost[:, i, j] = total[loop, row, best]
        if span < n - 1:
            cost[:, i, j] = np.where(taken[:, i, j], np.inf, cost[:, i, j])
    return _cut(middle), np.isfinite(cost[:, 0, n - 1])


def triangulate_long_loop(points: FloatArray) -> IntArray:
    """Return n - 2 triangles over a loop (n, 3) of any length, in time proportional to n.

    A few corners are triangulated first, then the part between each of their chords and the
    border, recursively.
    """
    n = len(points)
    if n <= _BRANCHES:
        lid, _ = triangulate_loops(points[None], np.zeros((1, n, n), dtype=bool))
        return np.asarray(lid[0])
    chosen = np.unique(np.linspace(0, n, _BRANCHES, endpoint=False).astype(np.int64))
    parts = [chosen[triangulate_long_loop(points[chosen])]]
    for first, last in zip(chosen, [*chosen[1:], n], strict=True):
        part = np.arange(first, last + 1) % n
        if len(part) > 2:
            parts.append(part[triangulate_long_loop(points[part])])
    return np.concatenate(parts)


def _cost(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return c(i, k, j)."""
    u, v, w = b - a, c - a, c - b
    twice = np.linalg.norm(np.cross(u, v), axis=-1)
    sides = np.stack([np.einsum("...x,...x->...", e, e) for e in np.broadcast_arrays(u, v, w)])
    longest = sides.max(axis=0)
    flat = np.where(twice <= _FLAT * longest, _FLAT_CHARGE * longest, 0.0)
    return np.asarray(0.5 * twice + _ROUNDNESS * sides.sum(axis=0) + flat)


def _cut(middle: IntArray) -> IntArray:
    """Return the triangles (l, n - 2, 3) of the splits at *middle* (l, n, n)."""
    n_loops, n, _ = middle.shape
    loop, first, last = np.arange(n_loops), np.zeros(n_loops, int), np.full(n_loops, n - 1)
    owners, triangles = [], []
    while len(loop):
        between = middle[loop, first, last]
        owners.append(loop)
        triangles.append(np.stack([first, between, last], axis=1))
        loop = np.concatenate([loop, loop])
        first, last = np.concatenate([first, between]), np.concatenate([between, last])
        wide = last - first > 1
        loop, first, last = loop[wide], first[wide], last[wide]
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(triangles)[order].reshape(n_loops, n - 2, 3)


def clip_ears(points: FloatArray) -> tuple[IntArray, FloatArray] | None:
    """Return n - 2 triangles over the loop *points* (n, 3), and the view of the projection.

    The *view* (3, 3) is a rotation: ``points @ view.T`` are coordinates to the right, upwards and
    towards the viewer, along the mean normal of the loop.  None if the loop crosses itself there.

    Examples
    --------
    >>> clip_ears(np.array([[0.0, 0, 0], [2, 0, 1], [2, 2, 0], [1, 0.5, 1]]))[0].tolist()
    [[1, 2, 3], [3, 0, 1]]
    """
    x = points - points.mean(axis=0)
    up = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)
    size = np.linalg.norm(up)
    if size == 0.0:
        return None
    view = _view(up / size)
    flat = (points - points[0]) @ view[:2].T
    triangles = _clipped(flat) if _is_simple(flat) else None
    return None if triangles is None else (triangles, view)


def _clipped(flat: FloatArray) -> IntArray | None:
    """Return the ears of a simple polygon (n, 2); None if rounding leaves no valid ear."""
    n = len(flat)
    before, after = np.roll(np.arange(n), 1), np.roll(np.arange(n), -1)
    sharp = _roundness(flat[before], flat, flat[after])
    candidate = sharp.copy()  # 0 once an ear has failed, until a neighbour is clipped
    left = np.ones(n, dtype=bool)
    triangles = []
    for _ in range(n - 2):
        tried_again = False
        while True:
            at = int(candidate.argmax())
            if candidate[at] <= 0.0:
                if tried_again:
                    return None
                candidate, tried_again = np.where(left, sharp, 0.0), True
                continue
            ear = np.array([before[at], at, after[at]])
            reflex = left & (sharp <= 0.0)
            reflex[ear] = False
            if not _any_inside(flat[ear], flat[reflex]):
                break
            candidate[at] = 0.0
        triangles.append(ear)
        left[at], candidate[at] = False, 0.0
        a, c = ear[[0, 2]]
        after[a], before[c] = c, a
        both = np.array([a, c])
        sharp[both] = _roundness(flat[before[both]], flat[both], flat[after[both]])
        candidate[both] = sharp[both]
    return np.array(triangles, dtype=np.int64)


def _view(up: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose last row is *up*."""
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(up, right), up])


def _roundness(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of triangles over their longest edge squared, (k,)."""
    u, v, w = b - a, c - b, a - c
    twice_area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    longest = np.max([(e * e).sum(axis=1) for e in (u, v, w)], axis=0)
    round_ = twice_area / np.maximum(longest, np.finfo(float).tiny)
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
    """Return whether the polygon *flat* (n, 2) is counter-clockwise and no two edges cross."""
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

    def separates(start: FloatArray, end: FloatArray, p: FloatArray, q: FloatArray) -> BoolArray:
        """Return for which pairs the points p and q lie on different sides of the line."""
        u, v, w = end - start, p - start, q - start
        left, right = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
        return (np.minimum(left, right) < -slack) & (np.maximum(left, right) > slack)

    return not (apart & separates(a, b, c, d) & separates(c, d, a, b)).any()
