"""Refinement of lids: interior vertices as dense as the border, good triangles, least area.

Any number of disjoint lids are refined as one surface.  Three operations alternate:

    split    interior edges much longer than the target size get a vertex in the middle
    flip     an interior edge is replaced by the other diagonal where that increases the least
             angle
    relax    interior vertices move to the mean of their neighbours, unless that inverts a
             triangle or reduces the least angle around them

Finally the interior moves to the surface of least area, where the cotangent Laplacian of the
positions vanishes.  A planar border gives a planar lid.  The target size is that of the border
edges and grows by `_GROWTH` per unit of distance from them, so that the number of new vertices is
proportional to the number of border edges, not to its square.

Splits and flips change at most one edge of a triangle at a time.

Source
------
P. Liepa, "Filling holes in meshes", Symposium on Geometry Processing, 200-205, 2003; with the size
graded and the operations of M. Botsch, L. Kobbelt, "A remeshing approach to multiresolution
modeling", Symposium on Geometry Processing, 185-192, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, corner_angles, edge_keys, least_angle, normals

_GROWTH = 0.3  # of the target size, per unit of distance from the border
_LONG = 1.4  # times the target size: longer edges are split
_ROUND = np.deg2rad(25.0)  # larger least angles need not increase
_GAIN = 1.01  # factor by which a flip must increase the least angle
_FLAT = 1e-9  # radians
_LEAST_WEIGHT = 1e-3  # replaces negative cotangents, since the weights of a mean must be positive
_ROUNDS = 50


@dataclass(frozen=True)
class Lids:
    """Lids in refinement, with vertices of their own.

    Attributes
    ----------
    points : (k, 3) float
        The corners of the loops come first; they do not move.
    size : (k,) float
        The target edge length.
    origin : (k,) int
        The corresponding vertex of the surface; -1 for a new vertex.
    owner : (k,) int
        The lid of each vertex.
    faces : (m, 3) int
    """

    points: FloatArray
    size: FloatArray
    origin: IntArray
    owner: IntArray
    faces: IntArray

    @property
    def free(self) -> BoolArray:
        """(k,) bool: whether a vertex is new and may move."""
        return np.asarray(self.origin < 0)


def refine(lids: Lids, taken: IntArray, n_vertices: int) -> Lids:
    """Return *lids* refined; new vertices come after the corners.

    Parameters
    ----------
    lids : Lids
        Triangles over the corners of loops only.
    taken : (t,) int
        Sorted `edge_keys` of the surrounding surface.  A lid edge with one of these keys is split.
    n_vertices : int
        Number of vertices of the surrounding surface, as used for the keys.
    """
    for _ in range(_ROUNDS):
        split = _split(lids, taken, n_vertices)
        done = split is lids
        lids = _flip(split, taken, n_vertices)
        if done:
            break
        lids = _relax(lids)
    return _settle(lids)


def _interior(lids: Lids) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Return the ends a, b of each interior edge, the opposite corners c, d, and the two faces.

    The first face is (a, b, c), the second (b, a, d), each up to rotation.
    """
    half_edges = HalfEdges(lids.faces, len(lids.points))
    one, other = half_edges.pairs.T
    c = lids.faces[one // 3, (one % 3 + 2) % 3]
    d = lids.faces[other // 3, (other % 3 + 2) % 3]
    return half_edges.tail[one], half_edges.head[one], c, d, one // 3, other // 3


def _independent(urgency: FloatArray, one: IntArray, other: IntArray, n_faces: int) -> IntArray:
    """Return edges of positive *urgency* to change at once, (k,) int: at most one of each face.

    On each face the most urgent edge is chosen; ties are broken at random.
    """
    some = np.flatnonzero(urgency > 0)
    ties = np.random.default_rng(len(some)).permutation(len(some))
    rank = np.empty(len(some), dtype=np.int64)
    rank[np.lexsort([ties, urgency[some]])] = np.arange(1, len(some) + 1)
    highest = np.zeros(n_faces, dtype=np.int64)
    np.maximum.at(highest, one[some], rank)
    np.maximum.at(highest, other[some], rank)
    return np.asarray(some[(highest[one[some]] == rank) & (highest[other[some]] == rank)])


def among(keys: IntArray, known: IntArray) -> BoolArray:
    """Return which *keys* are in the sorted *known*."""
    if not len(known):
        return np.zeros(len(keys), dtype=bool)
    return np.asarray(known[np.searchsorted(known, keys).clip(max=len(known) - 1)] == keys)


def _joins_neighbours(
    lids: Lids, a: IntArray, b: IntArray, taken: IntArray, n_vertices: int
) -> BoolArray:
    """Return which pairs of lid vertices are joined by an edge of the surrounding surface."""
    one, other = lids.origin[a], lids.origin[b]
    return among(edge_keys(one, other, n_vertices), taken) & (one >= 0) & (other >= 0)


def joined_twice(lids: Lids, known: IntArray, n_vertices: int) -> BoolArray:
    """Return which interior edges (e,) exist in the surface or in a lid of an earlier loop."""
    a, b, *_ = _interior(lids)
    one, other = lids.origin[a], lids.origin[b]
    old = np.flatnonzero((one >= 0) & (other >= 0))
    keys = edge_keys(one[old], other[old], n_vertices)
    order = np.lexsort([lids.owner[a[old]], keys])
    ordered = keys[order]
    double = np.zeros(len(a), dtype=bool)
    double[old[order[1:][ordered[1:] == ordered[:-1]]]] = True
    double[old[among(keys, known)]] = True
    return double


def split_edges(lids: Lids, urgency: FloatArray) -> Lids:
    """Return *lids* with interior edges (e,) of positive *urgency* split in the middle.

    At most one edge of a triangle is split; *lids* itself is returned if none is.
    """
    a, b, c, d, f, g = _interior(lids)
    some = _independent(urgency, f, g, len(lids.faces))
    if not len(some):
        return lids
    a, b, c, d, f, g = (x[some] for x in (a, b, c, d, f, g))
    new = len(lids.points) + np.arange(len(some))
    faces = lids.faces.copy()
    faces[f], faces[g] = np.stack([a, new, c], axis=1), np.stack([b, new, d], axis=1)
    more = np.concatenate([np.stack([new, b, c], axis=1), np.stack([new, a, d], axis=1)])
    half = 0.5 * np.linalg.norm(lids.points[a] - lids.points[b], axis=1)
    return Lids(
        np.concatenate([lids.points, 0.5 * (lids.points[a] + lids.points[b])]),
        np.append(lids.size, np.minimum(lids.size[a], lids.size[b]) + _GROWTH * half),
        np.append(lids.origin, np.full(len(some), -1)),
        np.append(lids.owner, lids.owner[a]),
        np.concatenate([faces, more]),
    )


def _split(lids: Lids, taken: IntArray, n_vertices: int) -> Lids:
    """Split long edges and edges that duplicate one of the surface; *lids* itself if none are."""
    a, b, *_ = _interior(lids)
    length = np.linalg.norm(lids.points[a] - lids.points[b], axis=1)
    ratio = length / (_LONG * 0.5 * (lids.size[a] + lids.size[b]))
    double = _joins_neighbours(lids, a, b, taken, n_vertices)
    return split_edges(lids, np.where(ratio > 1.0, ratio, double.astype(float)))


def _flip(lids: Lids, taken: IntArray, n_vertices: int) -> Lids:
    """Flip edges where that increases the least angle of both triangles and inverts none."""
    k = len(lids.points)
    edges = np.stack(_interior(lids))
    wide = np.pi - corner_angles(lids.points[lids.faces])
    beyond = [
        (wide[face] * (lids.faces[face] == corner[:, None])).sum(axis=1)
        for corner, face in ((edges[2], edges[4]), (edges[3], edges[5]))
    ]
    edges = edges[:, beyond[0] + beyond[1] < np.pi - _FLAT]  # not Delaunay
    a, b, c, d, f, g = edges
    before, after = (
        lids.points[np.stack([np.stack(x, axis=1), np.stack(y, axis=1)], axis=1)]
        for x, y in (((a, b, c), (b, a, d)), ((a, d, c), (d, b, c)))
    )  # (e, 2, 3, 3)
    gain = least_angle(after).min(axis=1) - _GAIN * least_angle(before).min(axis=1) - _FLAT
    up = normals(before).sum(axis=1)
    gain[((normals(after) * up[:, None]).sum(axis=2) <= 0.0).any(axis=1)] = 0.0
    keys = edge_keys(c, d, k)
    existing = np.sort(edge_keys(lids.faces, lids.faces[:, [1, 2, 0]], k).ravel())
    bad = (c == d) | among(keys, existing) | _joins_neighbours(lids, c, d, taken, n_vertices)
    gain[bad] = 0.0
    some = _independent((gain > 0.0).astype(float), f, g, len(lids.faces))
    some = some[np.unique(keys[some], return_index=True)[1]]
    if not len(some):
        return lids
    a, b, c, d, f, g = edges[:, some]
    faces = lids.faces.copy()
    faces[f], faces[g] = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    return replace(lids, faces=faces)


def _relax(lids: Lids) -> Lids:
    """Move interior vertices to the mean of their neighbours where that improves triangles."""
    one, other = lids.faces.ravel(), lids.faces[:, [1, 2, 0]].ravel()
    k = len(lids.points)
    count = np.bincount(one, minlength=k) + np.bincount(other, minlength=k)
    total = np.stack(
        [
            np.bincount(one, x[other], minlength=k) + np.bincount(other, x[one], minlength=k)
            for x in lids.points.T
        ],
        axis=1,
    )
    return _moved(lids, total / np.maximum(count, 1)[:, None], _ROUND)


def harmonic(lids: Lids, values: FloatArray) -> FloatArray:
    """Return *values* (k, d) with harmonic values at interior vertices.

    These are cotangent-weighted means of their neighbours, and within the range of the border.
    """
    free, fixed = np.flatnonzero(lids.free), np.flatnonzero(~lids.free)
    if not len(free):
        return values
    cot = 1.0 / np.tan(np.clip(corner_angles(lids.points[lids.faces]), 0.05, np.pi - 0.05))
    k = len(lids.points)
    one, other = lids.faces[:, [1, 2, 0]].ravel(), lids.faces[:, [2, 0, 1]].ravel()
    half = sparse.coo_array((cot.ravel(), (one, other)), shape=(k, k))
    weights = (half + half.T).tocsr()
    weights.data = np.maximum(weights.data, _LEAST_WEIGHT)
    inner: sparse.csr_array = (sparse.diags_array(weights.sum(axis=1)) - weights).tocsr()[free]
    smooth = values.copy()
    smooth[free] = splu(inner[:, free].tocsc()).solve(-(inner[:, fixed] @ values[fixed]))
    return smooth


def _settle(lids: Lids) -> Lids:
    """Move the interior to the surface of least area, except where triangles would get worse."""
    return _moved(lids, harmonic(lids, lids.points), 0.5 * _ROUND)


def _moved(lids: Lids, targets: FloatArray, sufficient: float) -> Lids:
    """Return the lids with interior vertices moved to *targets* (k, 3), except for harmful moves.

    A move is harmful if it inverts a triangle, or reduces an angle below *sufficient* and below
    the previous least angle around the vertex.
    """
    before = lids.points[lids.faces]
    old, up = least_angle(before), normals(before)
    limit = np.full(len(lids.points), sufficient)
    np.minimum.at(limit, lids.faces.ravel(), np.repeat(old - 1e-12, 3))
    moving = lids.free.copy()
    while True:
        points = np.where(moving[:, None], targets, lids.points)
        after = points[lids.faces]
        angle = least_angle(after)
        inverted = ((normals(after) * up).sum(axis=1) <= 0.0) & (old > _FLAT)
        narrow = (angle < old)[:, None] & (angle[:, None] < limit[lids.faces])
        harmful = (inverted[:, None] | narrow) & moving[lids.faces]
        if not harmful.any():
            return replace(lids, points=points)
        moving[lids.faces[harmful]] = False
