"""Simplification of a closed surface by edge collapses that preserve its topology.

Collapsing edge (i, j) to a point p costs

    C(i, j) = Q(p) + k (a_i + a_j) |x_i - x_j|^2        p near the minimum of Q

    Q(p)    sum of a_f (distance of p from the plane of f)^2 over the faces f accumulated in i
            and j: the quadric of [GH97]
    a       accumulated area; the second term favours edges of equal length, which matter more
            for a cage that bends than a sharp outline

A collapse is valid if it preserves the topology (the link condition of [DEGN99]: i and j have
exactly two common neighbours), inverts no face and creates no needle.  Each round collapses many of
the cheapest edges at once, chosen so that they do not affect each other; all operations are on
whole arrays, and the number of rounds grows with the logarithm of the reduction.  A round computes
the costs of the edges at collapsed vertices only; the others have theirs from the round before.

Source
------
[GH97]   M. Garland, P. Heckbert, "Surface simplification using quadric error metrics",
         SIGGRAPH 1997, 209-216.
[DEGN99] T. Dey, H. Edelsbrunner, S. Guha, D. Nekhayev, "Topology preserving edge contraction",
         Publ. Inst. Math. (Beograd) 66, 23-45, 1999.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import compiled_checks, inputs
from ..mesh import cross_rows
from ..progress import Progress, tell

_LEAST_ROUNDNESS = 0.01  # least `roundness` of a changed face
_EVENNESS = 0.05  # k; also attracts p to the midpoint of its edge, relative to the trace of Q
_PASSES = 2  # of the search for independent edges
_LEAST_COSINE = 0.3  # between the normals of a face before and after


@dataclass
class _Surface:
    points: FloatArray
    faces: IntArray
    # (n, 11), accumulated in each vertex: xx, xy, xz, yy, yz, zz of A, then b and c of
    # Q(p) = p'A p - 2 b'p + c, and the area a
    sums: FloatArray


class _Edges(NamedTuple):
    """The edges i < j of a surface of n vertices, in the order of their keys n i + j."""

    i: IntArray
    j: IntArray
    key: IntArray
    cost: FloatArray
    place: FloatArray  # the points that they collapse to

    def taken(self, at: IntArray | BoolArray) -> _Edges:
        """Return some of them."""
        return _Edges(self.i[at], self.j[at], self.key[at], self.cost[at], self.place[at])


_NONE: IntArray = np.empty(0, dtype=np.int64)
_NO_EDGES = _Edges(_NONE, _NONE, _NONE, np.empty(0), np.empty((0, 3)))


def simplify(
    vertices: FloatArray,
    faces: IntArray,
    n_vertices: int,
    *,
    progress: Progress | None = None,
    message: str = "simplifying",
) -> tuple[FloatArray, IntArray]:
    """Return a surface of *n_vertices*, or of more if the topology does not allow fewer.

    Parameters
    ----------
    vertices : (n, 3) float
        Not changed.
    faces : (m, 3) int
        Closed and oriented; each component keeps at least four vertices.
    n_vertices : int
        Target number of vertices.
    progress : Progress, optional
        Called between rounds; may cancel.
    message : str
        Text passed to *progress*.

    Returns
    -------
    vertices, faces : (n', 3) float, (m', 3) int
        Closed, oriented, of the same topology; n' >= *n_vertices*.
    """
    surface = _accumulated(vertices, faces)
    left = len(vertices)
    reduction = math.log(max(left / max(n_vertices, 1), 2.0))
    rejected = np.empty(0, dtype=np.int64)
    collapsed = 0
    known, is_moved = _NO_EDGES, np.ones(len(vertices), dtype=bool)
    while left > n_vertices:
        tell(progress, math.log(len(vertices) / left) / reduction, message)
        edges, cost = _costs(surface, known, is_moved)
        at = np.searchsorted(edges.key, rejected).clip(max=len(cost) - 1)
        cost[at[edges.key[at] == rejected]] = np.inf
        chosen = edges.taken(_independent(edges, cost, len(vertices))[: left - n_vertices])
        if len(chosen.i):
            done = _collapse(surface, chosen)
            collapsed += int(done.sum())
            left -= int(done.sum())
            rejected = np.concatenate([rejected, chosen.key[~done]])
            is_moved = np.zeros(len(vertices), dtype=bool)
            is_moved[chosen.i[done]] = is_moved[chosen.j[done]] = True
            known = edges
        elif collapsed:  # rejected edges may be valid now that their neighbourhoods changed
            rejected, collapsed = rejected[:0], 0
        else:
            break
    used, numbers = np.unique(surface.faces, return_inverse=True)
    return surface.points[used], numbers.reshape(-1, 3)


def roundness(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return 4 sqrt(3) area / (sum of squared edges) of each face: 1 equilateral, 0 a needle."""
    return _normals(vertices[faces])[1]


def _accumulated(vertices: FloatArray, faces: IntArray) -> _Surface:
    """Return the surface with a third of the quadric and area of each face at its corners."""
    corners = vertices[faces]
    normal = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(twice_area, np.finfo(float).tiny)[:, None]
    (x, y, z), d = normal.T, _dot(normal, corners[:, 0])
    terms = x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d, np.ones_like(d)
    share, at = np.repeat(twice_area / 6.0, 3), faces.ravel()
    sums = np.empty((len(vertices), 11))
    for k, term in enumerate(terms):
        sums[:, k] = np.bincount(at, share * np.repeat(term, 3), minlength=len(vertices))
    return _Surface(vertices.copy(), faces.copy(), sums)


def _costs(s: _Surface, known: _Edges, is_moved: BoolArray) -> tuple[_Edges, FloatArray]:
    """Return all edges, and their costs or infinity where a collapse is invalid.

    *known* are those of the round before, *is_moved* which vertices have moved since.
    """
    n, m = len(s.points), 3 * len(s.faces) // 2
    i, j, key = np.empty((3, m), dtype=np.int64)
    cost, place = np.empty(m), np.empty((m, 3))
    edges = _Edges(i, j, key, cost, place)
    kernels = compiled_checks(len(s.faces))
    if kernels:
        ends = np.empty((m, 2), dtype=np.int64)
        room = (np.empty(size, dtype=np.int64) for size in (n + 2, 2 * m, 2 * m))
        kernels.sorted_edges(i, j, ends, *room, *inputs(s.faces))
        read = inputs(i, j, known.i, known.j, known.cost, known.place, is_moved)
        kernels.collapse_costs(cost, place, *read, _EVENNESS, _EVENNESS, *inputs(s.points, s.sums))
    else:
        tail, head, apex = (s.faces[:, k].ravel() for k in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
        up = tail < head
        order = np.argsort(tail[up] * n + head[up], kind="stable")
        reverse = np.argsort(head[~up] * n + tail[~up], kind="stable")
        i[:], j[:] = tail[up][order], head[up][order]
        ends = np.stack([apex[up][order], apex[~up][reverse]], axis=1)
        fresh = is_moved[i] | is_moved[j]
        left = ~(is_moved[known.i] | is_moved[known.j])
        cost[~fresh], place[~fresh] = known.cost[left], known.place[left]
        cost[fresh], place[fresh] = _cost(s, i[fresh], j[fresh])
    key[:] = i * n + j
    few = np.bincount(s.faces.ravel()) <= 3
    return edges, np.where(few[ends[:, 0]] | few[ends[:, 1]], np.inf, cost)


def _cost(s: _Surface, i: IntArray, j: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the costs of edges from *i* to *j*, and the points that they collapse to."""
    xx, xy, xz, yy, yz, zz, bx, by, bz, c, area = (s.sums[i] + s.sums[j]).T
    x, y, z = (0.5 * (s.points[i] + s.points[j])).T
    more = _EVENNESS * ((xx + yy) + zz)
    # (A + k I)(p - m) = b - A m; the inverse of the symmetric matrix by cross products
    pull_x = bx - ((xx * x + xy * y) + xz * z)
    pull_y = by - ((xy * x + yy * y) + yz * z)
    pull_z = bz - ((xz * x + yz * y) + zz * z)
    p, q, r = xx + more, yy + more, zz + more
    a00, a01, a02 = q * r - yz * yz, yz * xz - xy * r, xy * yz - q * xz
    a11, a12, a22 = r * p - xz * xz, xz * xy - yz * p, p * q - xy * xy
    volume = (p * a00 + xy * a01) + xz * a02
    x = x + ((a00 * pull_x + a01 * pull_y) + a02 * pull_z) / volume
    y = y + ((a01 * pull_x + a11 * pull_y) + a12 * pull_z) / volume
    z = z + ((a02 * pull_x + a12 * pull_y) + a22 * pull_z) / volume
    quadratic = ((xx * x + xy * y) + xz * z) * x + ((xy * x + yy * y) + yz * z) * y
    quadratic += ((xz * x + yz * y) + zz * z) * z
    error = (quadratic - 2.0 * ((bx * x + by * y) + bz * z)) + c
    d = s.points[i] - s.points[j]
    return error + _EVENNESS * area * _dot(d, d), np.stack([x, y, z], axis=1)


def _independent(edges: _Edges, cost: FloatArray, n: int) -> IntArray:
    """Return cheap edges (k,) whose neighbourhoods are disjoint.

    An edge is chosen if it is the cheapest one among all edges whose ends or neighbours overlap
    with its own; a second pass considers the edges that overlap with no chosen one.
    """
    i, j = edges.i, edges.j
    cheapest, most = np.flatnonzero(np.isfinite(cost)), math.ceil(0.3 * len(cost))
    if len(cheapest) > most:
        cheapest = cheapest[cost[cheapest] <= np.partition(cost[cheapest], most - 1)[most - 1]]
    cheapest = cheapest[np.argsort(cost[cheapest], kind="stable")[:most]]
    if kernels := compiled_checks(len(cost)):
        found = np.empty(len(cheapest), dtype=np.int64)
        room = (*np.empty((2, n), dtype=np.int64), *np.empty((2, n), dtype=bool))
        count = kernels.independent_edges(found, cheapest, _PASSES, *room, *inputs(i, j))
        return np.asarray(found[:count])
    chosen = [cheapest[:0]]
    taken = np.zeros(n, dtype=bool)
    for _ in range(_PASSES):
        rank = np.arange(len(cheapest))
        least = np.full(n, len(cost))
        np.minimum.at(least, i[cheapest], rank)
        np.minimum.at(least, j[cheapest], rank)
        for _ in range(2):
            near = least.copy()
            np.minimum.at(near, i, least[j])
            np.minimum.at(near, j, least[i])
            least = near
        wins = np.minimum(least[i[cheapest]], least[j[cheapest]]) == rank
        chosen.append(cheapest[wins])
        taken[i[cheapest[wins]]] = taken[j[cheapest[wins]]] = True
        reach = taken
        for _ in range(2):
            near = reach.copy()
            near[i[reach[j]]] = near[j[reach[i]]] = True
            reach = near
        cheapest = cheapest[~(reach[i[cheapest]] | reach[j[cheapest]])]
    return np.concatenate(chosen)


def _collapse(s: _Surface, edges: _Edges) -> BoolArray:
    """Collapse the valid ones of *edges*, and return which were, (k,) bool."""
    good = _valid(s, edges)
    i, j = edges.i[good], edges.j[good]
    s.points[i] = edges.place[good]
    s.sums[i] += s.sums[j]
    number = np.arange(len(s.points))
    number[j] = i
    faces = number[s.faces]
    a, b, c = faces.T
    s.faces = faces[(a != b) & (b != c) & (c != a)]
    return good


def _valid(s: _Surface, edges: _Edges) -> BoolArray:
    """Return which of *edges* can be collapsed, (k,) bool."""
    i, j, place = edges.i, edges.j, edges.place
    owner = np.full(len(s.points), -1)
    owner[i] = owner[j] = np.arange(len(i))
    if kernels := compiled_checks(len(s.faces)):
        good, common = np.empty(len(i), dtype=bool), np.zeros(len(i), dtype=np.int64)
        count, of = np.zeros_like(owner), np.empty_like(owner)
        least = np.full(len(i), np.inf), np.full(len(i), _LEAST_ROUNDNESS)
        read = inputs(place, s.points, s.faces)
        kernels.valid_collapses(
            good, *inputs(owner), count, of, common, *least, _LEAST_COSINE, *read
        )
        return good
    moved = s.points.copy()
    moved[i] = moved[j] = place

    # The link condition: exactly two vertices are neighbours of both ends.
    of_corner = owner[s.faces]
    a, b, c = (of_corner >= 0).T
    near = np.flatnonzero(a | b | c)
    around = s.faces[near]
    tail, head = around.ravel(), around[:, [1, 2, 0]].ravel()
    adjacent = (owner[tail] < 0) & (owner[head] >= 0)
    count = np.bincount(tail[adjacent], minlength=len(owner))
    neighbour_of = np.full(len(owner), -1)
    neighbour_of[tail[adjacent]] = owner[head[adjacent]]
    common = np.bincount(neighbour_of[count >= 2], minlength=len(i))
    good = common == 2

    # The remaining faces must keep their orientation and their shape.
    is_kept = a[near].astype(np.int8) + b[near] + c[near] == 1
    kept = near[is_kept]
    before, old_roundness = _normals(s.points[around[is_kept]])
    after, new_roundness = _normals(moved[around[is_kept]])
    of_face = of_corner[kept].max(axis=1)
    worst = np.full(len(i), _LEAST_ROUNDNESS)
    np.minimum.at(worst, of_face, old_roundness)
    fine = _dot(before, after) > _LEAST_COSINE
    fine &= new_roundness >= worst[of_face]
    good[of_face[~fine]] = False
    return np.asarray(good)


def _normals(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit normals of triangles and their roundness."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = cross_rows(b - a, c - a)
    twice_area = np.sqrt(_dot(normal, normal))
    x, y, z = ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).T
    normal /= np.maximum(twice_area, np.finfo(float).tiny)[:, None]
    return normal, 2.0 * np.sqrt(3.0) * twice_area / np.maximum((x + y) + z, np.finfo(float).tiny)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the dot products of (n, 3) vectors."""
    x, y, z = (a * b).T
    return np.asarray((x + y) + z)
