"""Simplification of a closed surface by edge collapses that preserve its topology.

Collapsing edge (i, j) to a point p costs

    C(i, j) = Q(p) + LAMBDA (a_i + a_j) |x_i - x_j|^2        p near the minimum of Q

    Q(p)    sum of a_f (distance of p from the plane of f)^2 over the faces f accumulated in i
            and j: the quadric of [GH97]
    a       accumulated area; the second term favours edges of equal length, which matter more
            for a cage that bends than a sharp outline

With a density rho of vertices per area, costs are multiplied by rho^2, its mean over the
accumulated area: edges of equal cost then have lengths proportional to rho^(-1/2).

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
from typing import Any, NamedTuple

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import cross_rows
from ..progress import Progress, tell

_ROUNDNESS = 0.01  # least `roundness` of a changed face
_LAMBDA = 0.05
_STIFFNESS = 0.05  # weight that attracts p to the midpoint of the edge, relative to Q's trace
_CHEAPEST = 0.3  # fraction of the edges considered in one round
_PASSES = 2  # of the search for independent edges
_TURN = 0.3  # cosine of the largest rotation of a face


@dataclass
class _Surface:
    points: FloatArray
    faces: IntArray
    area: FloatArray
    need: FloatArray  # integral of the relative density over the accumulated area
    # Q(p) = p'A p - 2 b'p + c, accumulated in each vertex
    A: FloatArray
    b: FloatArray
    c: FloatArray


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


def simplify(
    vertices: FloatArray,
    faces: IntArray,
    n_vertices: int,
    *,
    density: FloatArray | None = None,
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
    density : (n,) float, optional
        Positive; the result has as many more vertices per area where it is larger.
    progress : Progress, optional
        Called between rounds; may cancel.
    message : str
        Text passed to *progress*.

    Returns
    -------
    vertices, faces : (n', 3) float, (m', 3) int
        Closed, oriented, of the same topology; n' >= *n_vertices*.
    """
    surface = _accumulated(vertices, faces, density)
    left = len(vertices)
    reduction = math.log(max(left / max(n_vertices, 1), 2.0))
    rejected = np.empty(0, dtype=np.int64)
    collapsed = 0
    known = None
    while left > n_vertices:
        tell(progress, math.log(len(vertices) / left) / reduction, message)
        edges, cost = _costs(surface, known)
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
            known = edges.taken(~(is_moved[edges.i] | is_moved[edges.j])), is_moved
        elif collapsed:  # rejected edges may be valid now that their neighbourhoods changed
            rejected, collapsed = rejected[:0], 0
        else:
            break
    used, numbers = np.unique(surface.faces, return_inverse=True)
    return surface.points[used], numbers.reshape(-1, 3)


def roundness(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return 4 sqrt(3) area / (sum of squared edges) of each face: 1 equilateral, 0 a needle."""
    return _normals(vertices[faces])[1]


def _accumulated(vertices: FloatArray, faces: IntArray, density: FloatArray | None) -> _Surface:
    """Return the surface with a third of the quadric and area of each face at its corners."""
    corners = vertices[faces]
    normal = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(twice_area, np.finfo(float).tiny)[:, None]
    level = np.einsum("fi,fi->f", normal, corners[:, 0])
    share, at = np.repeat(twice_area / 6.0, 3), faces.ravel()
    n, d = np.repeat(normal, 3, axis=0), np.repeat(level, 3)
    terms = np.concatenate(
        [[np.ones_like(d), d * d], n.T * d, np.einsum("ki,kj->ijk", n, n).reshape(9, -1)]
    )
    area, c, *rest = (
        np.asarray(np.bincount(at, share * term, minlength=len(vertices)), dtype=np.float64)
        for term in terms
    )
    b, A = np.stack(rest[:3], axis=1), np.stack(rest[3:], axis=1).reshape(-1, 3, 3)
    need = area.copy() if density is None else area * density
    return _Surface(vertices.copy(), faces.copy(), area, need, A, b, c)


def _costs(s: _Surface, known: tuple[_Edges, BoolArray] | None) -> tuple[_Edges, FloatArray]:
    """Return all edges, and their costs or infinity where a collapse is invalid.

    *known* are the edges between vertices that have not moved since, and which vertices have.
    """
    tail, head, apex = (s.faces[:, k].ravel() for k in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
    up = tail < head
    n = len(s.points)
    key = tail[up] * n + head[up]
    order = np.argsort(key)
    reverse = np.argsort(head[~up] * n + tail[~up])
    key, i, j = key[order], tail[up][order], head[up][order]
    edges = _Edges(i, j, key, np.empty(len(i)), np.empty((len(i), 3)))
    fresh: Any = slice(None)
    if known is not None:
        old, is_moved = known
        fresh = is_moved[i] | is_moved[j]
        edges.cost[~fresh], edges.place[~fresh] = old.cost, old.place
    edges.cost[fresh], edges.place[fresh] = _cost(s, i[fresh], j[fresh])
    valence = np.bincount(s.faces.ravel())
    ends = np.minimum(valence[apex[up][order]], valence[apex[~up][reverse]])
    return edges, np.where(ends <= 3, np.inf, edges.cost)


def _cost(s: _Surface, i: IntArray, j: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the costs of edges from *i* to *j*, and the points that they collapse to."""
    middle = 0.5 * (s.points[i] + s.points[j])
    A, b, c = s.A[i] + s.A[j], s.b[i] + s.b[j], s.c[i] + s.c[j]
    stiffness = _STIFFNESS * (A[:, 0, 0] + A[:, 1, 1] + A[:, 2, 2])
    # (A + k I)(p - m) = b - A m; the inverse of the symmetric matrix by cross products
    pull = b - np.einsum("eij,ej->ei", A, middle)
    x, y, z = (A + stiffness[:, None, None] * np.eye(3)).transpose(1, 0, 2)
    yz = cross_rows(y, z)
    inverse = np.stack([yz, cross_rows(z, x), cross_rows(x, y)], axis=1)
    place = middle + np.einsum("eij,ej->ei", inverse, pull) / np.einsum("ei,ei->e", x, yz)[:, None]
    error = np.einsum("eij,ei,ej->e", A, place, place) - 2 * np.einsum("ei,ei->e", b, place) + c
    area = s.area[i] + s.area[j]
    cost = error + _LAMBDA * area * _squared(s.points[i] - s.points[j])
    cost *= ((s.need[i] + s.need[j]) / area) ** 2
    return cost, place


def _independent(edges: _Edges, cost: FloatArray, n: int) -> IntArray:
    """Return cheap edges (k,) whose neighbourhoods are disjoint.

    An edge is chosen if it is the cheapest one among all edges whose ends or neighbours overlap
    with its own; a second pass considers the edges that overlap with no chosen one.
    """
    i, j = edges.i, edges.j
    cheapest, most = np.flatnonzero(np.isfinite(cost)), math.ceil(_CHEAPEST * len(cost))
    if len(cheapest) > most:
        cheapest = cheapest[cost[cheapest] <= np.partition(cost[cheapest], most - 1)[most - 1]]
    cheapest = cheapest[np.argsort(cost[cheapest], kind="stable")[:most]]
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
    i, j, place = edges.i, edges.j, edges.place
    owner = np.full(len(s.points), -1)
    owner[i] = owner[j] = np.arange(len(i))
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
    worst = np.full(len(i), _ROUNDNESS)
    np.minimum.at(worst, of_face, old_roundness)
    fine = np.einsum("fi,fi->f", before, after) > _TURN
    fine &= new_roundness >= worst[of_face]
    good[of_face[~fine]] = False

    i, j = i[good], j[good]
    s.points[i] = place[good]
    for accumulated in (s.A, s.b, s.c, s.area, s.need):
        accumulated[i] += accumulated[j]
    number = np.arange(len(owner))
    number[j] = i
    faces = number[s.faces]
    a, b, c = faces.T
    s.faces = faces[(a != b) & (b != c) & (c != a)]
    return np.asarray(good)


def _normals(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit normals of triangles and their roundness."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = cross_rows(b - a, c - a)
    twice_area = np.linalg.norm(normal, axis=1)
    x, y, z = ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).T
    normal /= np.maximum(twice_area, np.finfo(float).tiny)[:, None]
    return normal, 2.0 * np.sqrt(3.0) * twice_area / np.maximum((x + y) + z, np.finfo(float).tiny)


def _squared(a: FloatArray) -> FloatArray:
    """Return the squared lengths of (n, 3) vectors."""
    x, y, z = (a**2).T
    return np.asarray((x + y) + z)
