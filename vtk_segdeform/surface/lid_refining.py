"""Refine lids: interior vertices as dense as the border, round triangles, the least area.

Many lids are refined as one surface, disjoint as they are.  Three operations take turns:

    split    interior edges much longer than the size wanted there get a vertex in the middle
    flip     an interior edge gives way to the other diagonal where that widens the least angle
    relax    interior vertices move to the mean of their neighbours, or not at all where that
             would turn a triangle over or narrow the least angle around

and at the end the interior settles on the surface of least area, on which the cotangent Laplacian
of the positions vanishes.  A plane border gives a plane lid.  The size wanted is that of the border
edges, and grows by `_GROWTH` with every unit of distance from them: the number of new vertices is
then proportional to that of border edges, not to its square.

Of neighbouring edges only one is changed at a time, the one that gains the most.

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
from .quality import corner_angles, least_angle, normals
from .topology import Sides, edge_keys

_GROWTH = 0.3  # of the size wanted, per unit of distance from the border
_LONG = 1.4  # times the size wanted: longer edges are split
_ROUND = np.deg2rad(25.0)  # least angles beyond this need not widen
_GAIN = 1e-3  # radians by which a flip must widen the least angle
_ROUNDS = 60
_FLIPS = 4
_SETTLE = 4


@dataclass(frozen=True)
class Lids:
    """Lids in refinement, with vertices of their own.

    Attributes
    ----------
    points : (k, 3) float
        The first are the corners of the loops, which do not move.
    size : (k,) float
        The edge length wanted there.
    origin : (k,) int
        The vertex of the surface that each is; -1 for a new one.
    owner : (k,) int
        Its lid.
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
    """Return *lids* refined; corners keep their numbers, new vertices come after.

    Parameters
    ----------
    lids : Lids
        Triangles over corners of loops only.
    taken : (t,) int
        Sorted `edge_keys`, over *n_vertices*, of edges of the surface around.  A lid that joins
        two corners so gets a vertex on that edge.
    """
    for _ in range(_ROUNDS):
        split = _split(lids, taken, n_vertices)
        done = split is lids
        lids = _flip(split, taken, n_vertices, _FLIPS)
        if done:
            break
        lids = _relax(lids)
    for _ in range(_SETTLE):
        lids = _relax(_flip(_settle(lids), taken, n_vertices, _FLIPS))
    return _settle(lids)


def _interior(lids: Lids) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Return of each interior edge its ends a and b, the corners c and d beyond, and its faces.

    The first face is (a, b, c), the second (b, a, d), each up to rotation.
    """
    sides = Sides(lids.faces, len(lids.points))
    one, other = sides.pairs.T
    c = lids.faces[one // 3, (one % 3 + 2) % 3]
    d = lids.faces[other // 3, (other % 3 + 2) % 3]
    return sides.tail[one], sides.head[one], c, d, one // 3, other // 3


def _best_apart(gain: FloatArray, one: IntArray, other: IntArray, n_faces: int) -> IntArray:
    """Return which edges to change, (k,) int: those that gain, and more than all on their faces."""
    some = np.flatnonzero(gain > 0.0)
    rank = np.empty(len(some), dtype=np.int64)
    rank[np.argsort(gain[some], kind="stable")] = np.arange(1, len(some) + 1)
    highest = np.zeros(n_faces, dtype=np.int64)
    np.maximum.at(highest, one[some], rank)
    np.maximum.at(highest, other[some], rank)
    return some[(highest[one[some]] == rank) & (highest[other[some]] == rank)]


def _among(keys: IntArray, known: IntArray) -> BoolArray:
    """Tell which *keys* are in the sorted *known*."""
    if not len(known):
        return np.zeros(len(keys), dtype=bool)
    return np.asarray(known[np.searchsorted(known, keys).clip(max=len(known) - 1)] == keys)


def _joins_neighbours(
    lids: Lids, a: IntArray, b: IntArray, taken: IntArray, n_vertices: int
) -> BoolArray:
    """Tell which pairs of lid vertices are joined by an edge of the surface around."""
    one, other = lids.origin[a], lids.origin[b]
    return _among(edge_keys(one, other, n_vertices), taken) & (one >= 0) & (other >= 0)


def joined_twice(lids: Lids, known: IntArray, n_vertices: int) -> BoolArray:
    """Tell which interior edges (e,) the surface around has too, or a lid over an earlier loop."""
    a, b, *_ = _interior(lids)
    one, other = lids.origin[a], lids.origin[b]
    old = np.flatnonzero((one >= 0) & (other >= 0))
    keys = edge_keys(one[old], other[old], n_vertices)
    order = np.lexsort([lids.owner[a[old]], keys])
    ordered = keys[order]
    double = np.zeros(len(a), dtype=bool)
    double[old[order[1:][ordered[1:] == ordered[:-1]]]] = True
    double[old[_among(keys, known)]] = True
    return double


def split_edges(lids: Lids, gain: FloatArray) -> Lids:
    """Return *lids* with a vertex in the middle of the interior edges (e,) that gain, best first.

    Of edges of one triangle only the first is split; *lids* itself comes back if none gains.
    """
    a, b, c, d, f, g = _interior(lids)
    some = _best_apart(gain, f, g, len(lids.faces))
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
    """Split long edges, and those that the surface around has already; *lids* if there are none."""
    a, b, *_ = _interior(lids)
    length = np.linalg.norm(lids.points[a] - lids.points[b], axis=1)
    gain = length / (_LONG * 0.5 * (lids.size[a] + lids.size[b])) - 1.0
    double = _joins_neighbours(lids, a, b, taken, n_vertices)
    gain[double] = np.maximum(gain[double], 1.0)
    return split_edges(lids, gain)


def _flip(lids: Lids, taken: IntArray, n_vertices: int, times: int) -> Lids:
    """Flip edges where that widens the least angle of both triangles and folds nothing."""
    k = len(lids.points)
    for _ in range(times):
        a, b, c, d, f, g = _interior(lids)
        before, after = (
            lids.points[np.stack([np.stack(x, axis=1), np.stack(y, axis=1)], axis=1)]
            for x, y in (((a, b, c), (b, a, d)), ((a, d, c), (d, b, c)))
        )  # (e, 2, 3, 3)
        gain = least_angle(after).min(axis=1) - least_angle(before).min(axis=1) - _GAIN
        up = normals(before).sum(axis=1)
        gain[((normals(after) * up[:, None]).sum(axis=2) <= 0.0).any(axis=1)] = 0.0
        hopeful = np.flatnonzero(gain > 0.0)
        new = edge_keys(c[hopeful], d[hopeful], k)
        there = np.sort(edge_keys(lids.faces, lids.faces[:, [1, 2, 0]], k).ravel())
        bad = (c[hopeful] == d[hopeful]) | _among(new, there)
        bad |= _joins_neighbours(lids, c[hopeful], d[hopeful], taken, n_vertices)
        gain[hopeful[bad]] = 0.0
        some = _best_apart(gain, f, g, len(lids.faces))
        _, first = np.unique(edge_keys(c[some], d[some], k), return_index=True)
        some = some[first]
        if not len(some):
            break
        a, b, c, d, f, g = (x[some] for x in (a, b, c, d, f, g))
        faces = lids.faces.copy()
        faces[f], faces[g] = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
        lids = replace(lids, faces=faces)
    return lids


def _relax(lids: Lids) -> Lids:
    """Move interior vertices to the mean of their neighbours, as far as triangles gain by it."""
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


def _settle(lids: Lids) -> Lids:
    """Move the interior onto the surface of least area, as far as no triangle suffers by it."""
    free = np.flatnonzero(lids.free)
    if not len(free):
        return lids
    cot = 1.0 / np.tan(np.clip(corner_angles(lids.points[lids.faces]), 0.05, np.pi - 0.05))
    k = len(lids.points)
    one, other = lids.faces[:, [1, 2, 0]].ravel(), lids.faces[:, [2, 0, 1]].ravel()
    half = sparse.coo_array((cot.ravel(), (one, other)), shape=(k, k))
    weights = (half + half.T).tocsr()
    weights.data = np.maximum(weights.data, 1e-3)
    laplacian = (sparse.diags_array(weights.sum(axis=1)) - weights).tocsr()
    inner = laplacian[free]
    fixed = np.flatnonzero(~lids.free)
    right = -(inner[:, fixed] @ lids.points[fixed])
    there = lids.points.copy()
    there[free] = splu(inner[:, free].tocsc()).solve(right)
    return _moved(lids, there, 0.5 * _ROUND)


def _moved(lids: Lids, there: FloatArray, enough: float) -> Lids:
    """Return the lids with interior vertices moved to *there* (k, 3), but for those that do harm.

    Harm is a triangle that turns over, or whose least angle narrows to less than *enough*.
    """
    before = lids.points[lids.faces]
    old, up = least_angle(before), normals(before)
    moving = lids.free.copy()
    while True:
        points = np.where(moving[:, None], there, lids.points)
        after = points[lids.faces]
        angle = least_angle(after)
        harm = (angle < old - 1e-12) & (angle < enough)
        harm |= ((normals(after) * up).sum(axis=1) <= 0.0) & (old > 1e-9)
        harm &= moving[lids.faces].any(axis=1)
        if not harm.any():
            return replace(lids, points=points)
        moving[lids.faces[harm]] = False
