"""Intrinsic triangulation of the mesh, without bad triangles: the domain of the energy.

The cotangents of caps and needles are unbounded.  Clamping them corner by corner gives values that
belong to no triangle, and an indefinite matrix.  The energy uses an *intrinsic triangulation*
instead: triangles over the vertices of the mesh, defined by edge lengths alone.  Lengths that
satisfy the triangle inequality define a planar triangle, whose Dirichlet energy is never negative,
so the matrix is positive semi-definite.  Two operations lead from the mesh to the triangulation;
neither changes a mesh of well-shaped triangles:

    mollify     lengthen every edge by  eps = max(0, d - min (a + b - c)),  the minimum over all
                corners, so that every triangle has a slack a + b - c of at least d     [SC20, 4.5]
    flip        every edge of a bad triangle that is not Delaunay, cot + cot < 0 at the two
                opposite corners, until none is left                                    [FSSB07]

Mollification alone makes the matrix positive semi-definite, but leaves a cap with a cotangent of
about sqrt(mean / 2 d), whose square enters the detail of eq. (5).  Flipping all edges, as in
[SC20], would change good meshes too.

Source
------
[SC20]    N. Sharp, K. Crane, "A Laplacian for nonmanifold triangle meshes", Computer Graphics
          Forum 39(5), 69-80, 2020.
[FSSB07]  M. Fisher, B. Springborn, P. Schroeder, A. I. Bobenko, "An algorithm for the construction
          of intrinsic Delaunay triangulations with applications to digital geometry processing",
          Computing 81, 199-213, 2007.
[Kah14]   W. Kahan, "Miscalculating area and angles of a needle-like triangle", 2014.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import FloatArray, IntArray
from ..kernels import ROWS_AT_ONCE, in_parallel
from ..mesh import HalfEdges, next_half_edge

_SLACK = 1e-6  # d, relative to the mean edge length
_BAD_COTANGENT = 100.0  # cotangent of the smallest angle of a bad triangle: 0.6 degrees


@dataclass(frozen=True, eq=False)
class IntrinsicTriangulation:
    """Triangles over the vertices of a mesh, defined by their edge lengths.

    Parameters
    ----------
    vertices : (n, 3) float
        Vertices of the mesh.
    faces : (m, 3) int
        Oriented like the mesh.
    lengths : (m, 3) float
        Length of the edge opposite each corner; they satisfy the triangle inequality.
    """

    vertices: FloatArray
    faces: IntArray
    lengths: FloatArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray) -> IntrinsicTriangulation:
        """Return the triangulation of a mesh; boundary edges are not flipped."""
        lengths = _mollified(_edge_lengths(vertices, faces))
        if (np.abs(cotangents(lengths)).max(axis=1, initial=0.0) > _BAD_COTANGENT).any():
            faces, lengths = _flipped(faces, lengths, len(vertices))
        return cls(vertices, faces, lengths)

    @cached_property
    def cotangents(self) -> FloatArray:
        """(m, 3) float: cotangents of the angles of the triangles."""
        return cotangents(self.lengths)

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) float: areas of the triangles."""
        return areas(self.lengths)


def areas(lengths: FloatArray) -> FloatArray:
    """Return the areas of triangles of edge *lengths* (m, 3), accurate for needles, (m,)."""
    found = np.empty(len(lengths))

    def work(start: int, stop: int) -> None:
        c, b, a = np.sort(lengths[start:stop], axis=1).T
        product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))  # [Kah14]
        found[start:stop] = 0.25 * np.sqrt(np.maximum(product, 0.0))

    in_parallel(work, len(lengths), ROWS_AT_ONCE)
    return found


def cotangents(lengths: FloatArray) -> FloatArray:
    """Return the cotangents of the angles opposite edges of *lengths* (m, 3), (m, 3)."""
    squares = lengths * lengths
    fourfold = 4.0 * areas(lengths)[:, None]
    cosines = squares.sum(axis=1, keepdims=True) - 2.0 * squares
    found: FloatArray = np.zeros_like(cosines)
    np.divide(cosines, fourfold, where=fourfold > 0.0, out=found)
    return found


def _edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    lengths = np.empty(faces.shape)

    def work(start: int, stop: int) -> None:
        a, b, c = vertices[faces[start:stop].T]
        for corner, side in enumerate((c - b, a - c, b - a)):
            lengths[start:stop, corner] = np.sqrt(np.einsum("ij,ij->i", side, side))

    in_parallel(work, len(faces), ROWS_AT_ONCE)
    return lengths


def _mollified(lengths: FloatArray) -> FloatArray:
    slack = (lengths.sum(axis=1) - 2.0 * lengths.max(axis=1)).min(initial=np.inf)
    return lengths + max(0.0, _SLACK * float(lengths.mean()) - float(slack))


def _flipped(faces: IntArray, lengths: FloatArray, n_vertices: int) -> tuple[IntArray, FloatArray]:
    """Return faces and lengths after flips, in rounds of edges that share no face.

    A flip never increases the Dirichlet energy of any function [FSSB07], so the rounds terminate.
    """
    twin = _twins(faces, n_vertices)
    corners, opposite = faces.copy().ravel(), lengths.copy().ravel()
    cot = cotangents(lengths)
    for _ in range(1000):  # more than ten are rare
        bad = np.flatnonzero(np.abs(cot).max(axis=1) > _BAD_COTANGENT)
        h = _independent(_not_delaunay(bad, twin, cot.ravel()), twin, cot.ravel())
        if not len(h):
            break
        _flip(h, twin, corners, opposite)
        changed = np.concatenate([h, twin[next_half_edge(h)]]) // 3
        cot[changed] = cotangents(opposite.reshape(-1, 3)[changed])
    return corners.reshape(-1, 3), opposite.reshape(-1, 3)


def _twins(faces: IntArray, n_vertices: int) -> IntArray:
    """Return the corner opposite the same edge in the other face, itself at a boundary, (3m,).

    Here corner h = 3 f + c stands for the edge opposite it.
    """
    # A half-edge runs from its corner to the next one, opposite the last corner.
    half_edges = HalfEdges(faces, n_vertices)
    pairs = half_edges.pairs[~half_edges.inconsistent]  # those of a one-sided surface stay
    one, other = next_half_edge(next_half_edge(pairs)).T
    twin = np.arange(faces.size)
    twin[one], twin[other] = other, one
    return twin


def _not_delaunay(bad: IntArray, twin: IntArray, cot: FloatArray) -> IntArray:
    """Return the edges of the faces *bad* that are not Delaunay, each as one of its corners."""
    h = (3 * bad[:, None] + np.arange(3)).ravel()
    h = np.unique(np.minimum(h, twin[h]))
    inner = h // 3 != twin[h] // 3
    return np.asarray(h[inner & (cot[h] + cot[twin[h]] < -1e-9)])


def _independent(h: IntArray, twin: IntArray, cot: FloatArray) -> IntArray:
    """Return the edges among *h* that are the worst ones of both their faces."""
    worst_first = np.argsort(cot[h] + cot[twin[h]], kind="stable")
    h = h[worst_first]
    rank, pair = np.arange(len(h)), np.stack([h // 3, twin[h] // 3])
    first = np.full(len(cot) // 3, len(h))
    np.minimum.at(first, pair.ravel(), np.tile(rank, 2))
    return np.asarray(h[(first[pair] == rank).all(axis=0)])


def _flip(h: IntArray, twin: IntArray, corners: IntArray, opposite: FloatArray) -> None:
    """Flip the edges i j of faces (k, i, j) and (l, j, i) to k l: (k, i, l) and (l, j, k)."""
    t = twin[h]
    h1, t1 = next_half_edge(h), next_half_edge(t)
    h2, t2 = next_half_edge(h1), next_half_edge(t1)
    k, new = corners[h], corners[t]  # new is l
    ij, jk, ki, il, lj = (opposite[each] for each in (h, h1, h2, t1, t2))
    # Both faces unfolded, with i j on the axis.
    above = 2.0 * areas(np.stack([ij, jk, ki], axis=1)) / ij
    below = 2.0 * areas(np.stack([ij, il, lj], axis=1)) / ij
    along = ((ki - jk) * (ki + jk) - (il - lj) * (il + lj)) / (2.0 * ij)
    kl = np.hypot(along, above + below)
    # Two slots change their corner: l replaces j, and k replaces i.
    moved = np.arange(len(twin))
    moved[t1], moved[h1] = h, t  # the new slots of the edges i l and j k
    outside = [moved[twin[each]] for each in (t1, h2, h1, t2)]
    corners[h2], corners[t2] = new, k
    for slot, length in zip((h, h1, h2, t, t1, t2), (il, kl, ki, jk, kl, lj), strict=True):
        opposite[slot] = length
    own = [moved[each] for each in (t1, h2, h1, t2)]
    for slot, beyond in zip(own, outside, strict=True):
        twin[slot], twin[beyond] = beyond, slot
    twin[h1], twin[t1] = t1, h1
