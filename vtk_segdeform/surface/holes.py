"""Close a border loop with the triangles that together have the least area.

A triangulation of the loop v_0 ... v_{n-1} splits at its last side into two smaller ones and the
triangle between them, so the cost of the best one over v_i ... v_j is

    C(i, i+1) = 0        C(i, j) = min over i < k < j of  C(i, k) + C(k, j) + c(i, k, j)

from short spans to long ones: n^3 / 6 triangles, n^2 memory.  The cost c of a triangle is its area
plus a thousandth of its squared sides, so that of equal areas the rounder triangles win.

Source
------
G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided Geometric
Design 12(2), 207-229, 1995.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .topology import Sides, edge_keys

_ROUNDNESS = 1e-3


def close_holes(
    vertices: FloatArray, sides: Sides, largest: int
) -> tuple[list[int], FloatArray, IntArray]:
    """Return lids for the holes of up to *largest* edges, as sizes, centres and lids.

    *sides* of faces over *vertices* (n, 3) must be oriented consistently, without edges of three
    sides.  *sizes* are the numbers of edges of the holes that were closed, *lids* (k, 3) int the
    new faces.  *centres* (c, 3) are new vertices n, n + 1, ...: the middle of a hole that cannot be
    closed over its corners alone, because every way to do so needs an edge that is there already.
    """
    n = len(vertices)
    sizes: list[int] = []
    centres: list[FloatArray] = []
    lids: list[IntArray] = []
    known, added = sides.keys[sides.order], np.empty(0, dtype=np.int64)
    for loop in _loops(sides, largest):
        one, other = np.meshgrid(loop, loop)
        keys = edge_keys(one, other, n)
        place = np.searchsorted(known, keys).clip(max=len(known) - 1)
        taken = (known[place] == keys) | np.isin(keys, added)
        lid = triangulate_loop(vertices[loop], taken)
        if lid is None:
            lid = np.stack([loop, np.roll(loop, -1), np.full(len(loop), n + len(centres))], axis=1)
            centres.append(vertices[loop].mean(axis=0))
        else:
            lid = loop[lid]
            added = np.append(added, edge_keys(lid, lid[:, [1, 2, 0]], n))
        sizes.append(len(loop))
        lids.append(lid)
    return (
        sizes,
        np.array(centres).reshape(-1, 3),
        np.concatenate([np.empty((0, 3), np.int64), *lids]),
    )


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
    n = len(points)
    cost = np.zeros((n, n))
    middle = np.zeros((n, n), dtype=np.int64)
    for span in range(2, n):
        i = np.arange(n - span)
        j = i + span
        k = i[:, None] + np.arange(1, span)
        total = cost[i[:, None], k] + cost[k, j[:, None]] + _cost(points, i, k, j)
        best = total.argmin(axis=1)
        middle[i, j] = k[i, best]
        cost[i, j] = total[i, best]
        if span < n - 1:
            cost[i, j] = np.where(taken[i, j], np.inf, cost[i, j])
    if not np.isfinite(cost[0, n - 1]):
        return None
    triangles, spans = [], [(0, n - 1)]
    while spans:
        first, last = spans.pop()
        if last - first > 1:
            between = int(middle[first, last])
            triangles.append((first, between, last))
            spans += [(between, last), (first, between)]
    return np.array(triangles, dtype=np.int64)


def _cost(points: FloatArray, i: IntArray, k: IntArray, j: IntArray) -> FloatArray:
    """Return c(i, k, j), (rows, columns) float; i and j (rows,), k (rows, columns)."""
    a, b, c = points[i][:, None], points[k], points[j][:, None]
    u, v, w = b - a, c - a, c - b
    area = 0.5 * np.linalg.norm(np.cross(u, v), axis=-1)
    sides = sum(np.einsum("...x,...x->...", e, e) for e in (u, v, w))
    cost: FloatArray = area + _ROUNDNESS * sides
    return cost


def _loops(sides: Sides, largest: int) -> Iterator[IntArray]:
    """Yield the corners of each border of up to *largest* edges, against its sides' direction.

    Where borders touch, a loop is cut off as soon as a corner comes again: no loop passes a corner
    twice, and lids over all of them join what touched there into one fan.  A face all by itself has
    a border too, but the only lid for that would be the same face.
    """
    face = sides.open // 3
    border = sides.open[np.bincount(face, minlength=len(sides.faces))[face] < 3]
    onward: dict[int, list[int]] = {}
    for head, tail in zip(sides.head[border].tolist(), sides.tail[border].tolist(), strict=True):
        onward.setdefault(head, []).append(tail)
    for start in onward:
        path, place = [start], {start: 0}
        while onward[path[-1]]:
            corner = onward[path[-1]].pop()
            if corner not in place:
                place[corner] = len(path)
                path.append(corner)
                continue
            first = place[corner]
            loop, path = path[first:], path[: first + 1]
            for left in loop[1:]:
                del place[left]
            if len(loop) <= largest:
                yield np.array(loop)
