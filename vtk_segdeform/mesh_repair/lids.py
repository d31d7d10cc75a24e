"""Lids over border loops from the corners of the loop alone, by dynamic programming.

A triangulation of the loop v_0 ... v_{n-1} splits at its last side into two smaller ones and the
triangle between them, so the cost of the best one over v_i ... v_j is

    C(i, i+1) = 0        C(i, j) = min over i < k < j of  C(i, k) + C(k, j) + c(i, k, j)

from short spans to long ones: n^3 / 6 triangles, n^2 memory.  The cost c of a triangle is its area
plus a thousandth of its squared sides, so that better-shaped triangles win among equal areas, plus
a penalty for a degenerate triangle.  With *outer* normals, the largest angle between neighbouring
triangles, including the faces outside the loop, decides first [Lie03], in steps of five degrees so
that rounding does not.

Loops of equal length are closed together.

Source
------
[BS95]  G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided
        Geometric Design 12(2), 207-229, 1995.
[Lie03] P. Liepa, "Filling holes in meshes", Symposium on Geometry Processing, 200-205, 2003.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray

_ROUNDNESS = 1e-3
_FLAT, _FLAT_CHARGE = 1e-4, 0.05  # twice the area, and the penalty, over the longest side^2
_STEP = np.deg2rad(5.0)
_BRANCHES = 48  # corners that represent a longer loop
_AT_ONCE = 2_000_000  # triangles compared together


def triangulate_loop(points: FloatArray, taken: BoolArray) -> IntArray | None:
    """Return n - 2 triangles over the n corners of a loop, or None if none is allowed.

    Parameters
    ----------
    points : (n, 3) float
        The corners, in the order of the loop.
    taken : (n, n) bool
        Symmetric: pairs of corners that must not be joined, because the surface outside the loop
        has that edge already.  Sides of the loop itself are never looked up.

    Returns
    -------
    triangles : (n - 2, 3) int
        Numbers of corners; each triangle runs round in the direction of the loop.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> triangulate_loop(square, np.zeros((4, 4), bool)).tolist()
    [[0, 1, 3], [1, 2, 3]]
    """
    triangles, allowed = triangulate_loops(points[None], taken[None])
    return triangles[0] if allowed[0] else None


def triangulate_loops(
    points: FloatArray, taken: BoolArray, outer: FloatArray | None = None
) -> tuple[IntArray, BoolArray]:
    """Return the triangles (l, n - 2, 3) of l loops, and for which loops there are any, (l,) bool.

    Parameters
    ----------
    points : (l, n, 3) float
        The corners of each loop.
    taken : (l, n, n) bool
        As of `triangulate_loop`.
    outer : (l, n, 3) float, optional
        Unit normals of the faces outside side i of each loop, from corner i to i + 1.
    """
    n_loops, n, _ = points.shape
    together = max(1, _AT_ONCE // n**2)
    if n_loops > together:
        parts = [
            triangulate_loops(
                points[s : s + together],
                taken[s : s + together],
                None if outer is None else outer[s : s + together],
            )
            for s in range(0, n_loops, together)
        ]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    cost = np.zeros((n_loops, n, n))
    bend = np.zeros((n_loops, n, n))
    middle = np.zeros((n_loops, n, n), dtype=np.int64)
    normal = np.zeros((n_loops, n, n, 3))
    loop = np.arange(n_loops)[:, None]
    if outer is not None:
        normal[:, np.arange(n - 1), np.arange(1, n)] = outer[:, :-1]
    for span in range(2, n):
        i = np.arange(n - span)
        j = i + span
        k = i[:, None] + np.arange(1, span)
        own, cross = _cost(points[:, i][:, :, None], points[:, k], points[:, j][:, :, None])
        total = cost[:, i[:, None], k] + cost[:, k, j[:, None]] + own
        worst = np.zeros_like(total)
        if outer is not None:
            unit = cross / np.maximum(np.linalg.norm(cross, axis=-1, keepdims=True), 1e-300)
            angles = [bend[:, i[:, None], k], bend[:, k, j[:, None]]]
            angles += [
                _angle(unit, normal[:, i[:, None], k]),
                _angle(unit, normal[:, k, j[:, None]]),
            ]
            if span == n - 1:
                angles.append(_angle(unit, outer[:, -1][:, None, None]))
            worst = np.max(angles, axis=0)
        scale = 2.0 * np.where(np.isfinite(total), total, 0.0).max(initial=0.0) + 1e-300
        best = (np.round(worst / _STEP) * scale + total).argmin(axis=2)
        row = np.arange(len(i))
        middle[:, i, j] = k[row, best]
        cost[:, i, j] = total[loop, row, best]
        bend[:, i, j] = worst[loop, row, best]
        if outer is not None:
            normal[:, i, j] = unit[loop, row, best]
        if span < n - 1:
            cost[:, i, j] = np.where(taken[:, i, j], np.inf, cost[:, i, j])
    return _cut(middle), np.isfinite(cost[:, 0, n - 1])


def triangulate_long_loop(points: FloatArray) -> IntArray:
    """Return n - 2 triangles over a loop (n, 3) of any length, in time proportional to n.

    A few of its corners are closed first, then the part between each of their chords and the
    border, and so on.
    """
    n = len(points)
    if n <= _BRANCHES:
        lid, _ = triangulate_loops(points[None], np.zeros((1, n, n), dtype=bool))
        return np.asarray(lid[0])
    stems = np.unique(np.linspace(0, n, _BRANCHES, endpoint=False).astype(np.int64))
    parts = [stems[triangulate_long_loop(points[stems])]]
    for first, last in zip(stems, [*stems[1:], n], strict=True):
        part = np.arange(first, last + 1) % n
        if len(part) > 2:
            parts.append(part[triangulate_long_loop(points[part])])
    return np.concatenate(parts)


def _cost(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return c(i, k, j) and the triangles' normals, as long as twice their areas."""
    u, v, w = b - a, c - a, c - b
    cross = np.cross(u, v)
    twice = np.linalg.norm(cross, axis=-1)
    sides = np.stack([np.einsum("...x,...x->...", e, e) for e in np.broadcast_arrays(u, v, w)])
    longest = sides.max(axis=0)
    flat = np.where(twice <= _FLAT * longest, _FLAT_CHARGE * longest, 0.0)
    return np.asarray(0.5 * twice + _ROUNDNESS * sides.sum(axis=0) + flat), cross


def _angle(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.arccos(np.clip((one * other).sum(axis=-1), -1.0, 1.0)))


def _cut(middle: IntArray) -> IntArray:
    """Return the triangles (l, n - 2, 3) where spans are cut at *middle* (l, n, n)."""
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
