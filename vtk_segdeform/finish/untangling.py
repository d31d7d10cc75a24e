"""Untangling: parts that cross are separated by shrinking the curve in which they cross.

Two faces that cross have a segment in common, from P to Q; at either end an edge of one pierces the
other.  The segments of all pairs make closed curves around what has passed through the surface, and
with the edge e and the face of unit normal n at P, both moving,

    dP = (I - e n^T / e.n) de + (e n^T / e.n) df,      dL = (Q - P)^T (dQ - dP) / |Q - P|

So the gradient of the length L of the curve moves the tip of a finger back out of the palm that it
has entered, and both sides of a crease away from each other, without any record of how they came
there.  The motion is smoothed over the surface, so that what lies around follows.

This works if parts are not too deep in each other.  Where the curve stays as long as it is, handles
and fixed vertices leave no room, and the surface remains as it was.

Source
------
P. Volino, N. Magnenat-Thalmann, "Resolving surface collisions through intersection contour
minimization", SIGGRAPH 2006.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Crossings, Mesh
from ..progress import Progress, tell

_RINGS = 16  # around crossing faces: what may move
_STEP = 0.2  # of the length of an edge: the farthest motion of a vertex in a step
_AVERAGES = 10, 3, 30  # of the motion with that of the neighbours, one after another
_STEPS = 100  # at most
_PATIENCE, _SHORTER = 20, 0.9  # the curve becomes shorter by this factor in so many steps, or never
_ROUNDS = 3  # since what is drawn apart may meet something else
_STEEPEST = 3.0  # length of a gradient of L by an edge, at most: almost in the plane it is infinite
_TINY = 1e-300


def untangled(
    mesh: Mesh,
    x: FloatArray,
    free: BoolArray,
    crossings: Crossings,
    *,
    progress: Progress | None = None,
) -> FloatArray:
    """Return the pose *x* (n, 3) with fewer *crossings*, if the *free* vertices (n,) allow it."""
    for turn in range(_ROUNDS):
        pairs = crossings.pairs(x)
        if not len(pairs):
            break
        there = x.copy()
        for tangle in _tangles(mesh, pairs):
            tell(progress, turn / _ROUNDS, "separating crossing parts")
            there[tangle] = _opened(mesh, x, free, tangle)
        if not np.isfinite(there).all() or len(crossings.pairs(there)) >= len(pairs):
            break
        x = there
    return x


def _tangles(mesh: Mesh, pairs: IntArray) -> Iterator[BoolArray]:
    """Yield the vertices (n,) bool of the surface around crossing *pairs* (k, 2), one by one."""
    near = around(mesh, np.unique(pairs), _RINGS)
    ids = np.flatnonzero(near)
    number = np.empty(mesh.n_vertices, dtype=np.int64)
    number[ids] = np.arange(len(ids))
    one, two = (number[mesh.faces[side, 0]] for side in pairs.T)
    across = sparse.coo_array((np.ones(len(one)), (one, two)), (len(ids), len(ids)))
    graph = mesh.adjacency[ids][:, ids] + across.tocsr()
    count, label = connected_components(graph, directed=False)
    for tangle in range(count):
        own = np.zeros(mesh.n_vertices, dtype=bool)
        own[ids[label == tangle]] = True
        yield own


def _opened(mesh: Mesh, x: FloatArray, free: BoolArray, own: BoolArray) -> FloatArray:
    """Return the vertices *own* (n,) of the pose *x*, at which nothing crosses, or as they were."""
    ids = np.flatnonzero(own)
    number = np.empty(mesh.n_vertices, dtype=np.int64)
    number[ids] = np.arange(len(ids))
    inside = own[mesh.faces]
    moving = free[ids]
    corners = mesh.faces[inside.any(axis=1) & ~inside.all(axis=1)]
    moving[number[corners[own[corners]]]] = False
    faces = number[mesh.faces[inside.all(axis=1)]]
    joined = (mesh.adjacency[ids][:, ids] > 0.0).astype(float)
    average = sparse.diags_array(1.0 / joined.sum(axis=1)) @ joined
    crossings = Crossings(mesh.vertices[ids], faces)
    for rounds in _AVERAGES:

        def smooth(slope: FloatArray, rounds: int = rounds) -> FloatArray:
            for _ in range(rounds):
                slope = np.where(moving[:, None], 0.5 * (slope + average @ slope), 0.0)
            return slope

        there = _shrunk(x[ids], faces, crossings, smooth)
        if there is not None:
            return there
    return x[ids]


def _shrunk(
    x: FloatArray,
    faces: IntArray,
    crossings: Crossings,
    smooth: Callable[[FloatArray], FloatArray],
) -> FloatArray | None:
    """Return *x* (k, 3) moved against *smooth* slopes until no *faces* cross, or None."""
    lengths = [np.inf]
    for _ in range(_STEPS):
        pairs = crossings.pairs(x)
        if not len(pairs):
            return x
        length, slope = contour(x, faces, pairs)
        lengths.append(length)
        if length > _SHORTER * lengths[max(0, len(lengths) - 1 - _PATIENCE)]:
            break
        slope = smooth(slope)
        most = float(np.linalg.norm(slope, axis=1).max())
        if not 0.0 < most < np.inf:
            break
        corners = x[faces[np.unique(pairs)]]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        edge = float(np.median(edges))
        x = x - (_STEP * edge / most) * slope
    return None


def around(mesh: Mesh, some: IntArray, rings: int) -> BoolArray:
    """Return the vertices within so many *rings* around the faces *some*, (n,) bool."""
    near = np.zeros(mesh.n_vertices, dtype=bool)
    near[mesh.faces[some]] = True
    for _ in range(rings):
        near |= mesh.adjacency @ near.astype(float) > 0.0
    return near


def contour(x: FloatArray, faces: IntArray, pairs: IntArray) -> tuple[float, FloatArray]:
    """Return the length of the curve in which *pairs* (k, 2) of faces cross, and its gradient.

    The gradient (n, 3) is bounded where an edge is almost in the plane of a face.
    """
    pair, at, edge, share, triangle, weights, normal = _piercings(x, faces, pairs)
    order = np.argsort(pair, kind="stable")
    counts = np.bincount(pair, minlength=len(pairs))
    first = np.cumsum(counts) - counts
    both = np.flatnonzero(counts >= 2)
    one, two = order[first[both]], order[first[both] + 1]
    same = faces[pairs[:, 0]][:, :, None] == faces[pairs[:, 1]][:, None, :]
    tipped = np.flatnonzero((counts == 1) & (same.sum(axis=(1, 2)) == 1))
    corner = faces[pairs[tipped, 0], same[tipped].any(axis=2).argmax(axis=1)]
    alone = order[first[tipped]]
    ends = np.concatenate([one, two, alone])
    toward = np.concatenate([at[two], at[one], x[corner]]) - at[ends]
    size = np.linalg.norm(toward, axis=1)
    length = float(size.sum() - 0.5 * size[: 2 * len(both)].sum())
    d = toward / np.maximum(size, _TINY)[:, None]
    e, n = x[edge[ends, 1]] - x[edge[ends, 0]], normal[ends]
    steep = np.einsum("ij,ij->i", e, d) / np.einsum("ij,ij->i", e, n)
    of_face = _bounded(-steep[:, None] * n)
    of_edge = _bounded(steep[:, None] * n - d)
    slope = np.zeros_like(x)
    np.add.at(slope, edge[ends, 0], (1.0 - share[ends])[:, None] * of_edge)
    np.add.at(slope, edge[ends, 1], share[ends][:, None] * of_edge)
    for k in range(3):
        np.add.at(slope, triangle[ends, k], weights[ends, k][:, None] * of_face)
    np.add.at(slope, corner, d[2 * len(both) :])
    return length, slope


def _bounded(vectors: FloatArray) -> FloatArray:
    """Return *vectors* (k, 3), none longer than `_STEEPEST`."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors * np.minimum(1.0, _STEEPEST / np.maximum(size, _TINY)))


def _piercings(x: FloatArray, faces: IntArray, pairs: IntArray) -> list[Any]:
    """Return where edges of one face of a pair pierce the other.

    The number of the pair, the point (3,), the ends of the edge (2,), the share of it, the
    triangle (3,), the barycentric coordinates in it (3,) and its unit normal (3,).
    """
    found = []
    for side in range(2):
        own, other = faces[pairs[:, side]], faces[pairs[:, 1 - side]]
        a, b, c = np.swapaxes(x[other], 0, 1)
        normal = np.cross(b - a, c - a)
        double = np.linalg.norm(normal, axis=1)
        normal = normal / np.maximum(double, _TINY)[:, None]
        height = np.einsum("kij,kj->ki", x[own] - a[:, None], normal)
        is_shared = (own[:, :, None] == other[:, None, :]).any(axis=2)
        for start, end in ((0, 1), (1, 2), (2, 0)):
            across = (height[:, start] * height[:, end] < 0.0) & (double > 0.0)
            k = np.flatnonzero(across & ~is_shared[:, start] & ~is_shared[:, end])
            share = height[k, start] / (height[k, start] - height[k, end])
            p, q = x[own[k, start]], x[own[k, end]]
            at = p + share[:, None] * (q - p)
            corners = [each[k] - at for each in (a, b, c)]
            weights = np.stack(
                [
                    np.einsum("ij,ij->i", np.cross(corners[i - 2], corners[i - 1]), normal[k])
                    / double[k]
                    for i in range(3)
                ],
                axis=1,
            )
            hit = (weights >= 0.0).all(axis=1)
            edge = np.stack([own[k, start], own[k, end]], axis=1)
            parts = (k, at, edge, share, other[k], weights, normal[k])
            found.append([each[hit] for each in parts])
    return [np.concatenate(parts) for parts in zip(*found, strict=True)]
