"""Few vertices in place of many: neighbours are thinned out, and those that go join the nearest.

No two vertices that remain are closer than a spacing which depends on the shape alone; every vertex
of the mesh belongs to the cell of the nearest one, along edges.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import FloatArray, IntArray
from ..mesh import Mesh
from ..progress import Progress, tell

_TIE_BREAK = 1e-6  # of an edge's length


def cells(
    mesh: Mesh, n_points: int, rng: np.random.Generator, progress: Progress | None = None
) -> tuple[IntArray, IntArray]:
    """Return the vertices that remain, (k,) int in order, and the cell of each vertex, (n,) int.

    While vertices are thinned out, those that go join a neighbour that stays; so each round is a
    smaller one than the last.  Only the remaining ones' cells are measured on the mesh itself.
    """
    kept, edges, favour = np.arange(mesh.n_vertices), mesh.edges, _favour(mesh.n_vertices)
    spacing = 0.8 * np.sqrt(mesh.face_areas.sum() / n_points)
    while mesh.n_vertices > n_points:
        tell(progress, 0.8 * (1.0 - len(kept) / mesh.n_vertices), "thinning out vertices")
        i, j = kept[edges.T]
        length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
        length *= 1.0 + favour[i] + favour[j]
        short = length < spacing
        if np.count_nonzero(short) <= 0.01 * len(kept):
            break
        stay = _independent(edges[short], len(kept), rng)
        number = _nearest_neighbour(edges[short], length[short], stay, len(kept))
        kept, edges = kept[stay], unique_edges(number[edges], len(stay))
    tell(progress, 0.8, "thinning out vertices")
    number = np.empty(mesh.n_vertices, dtype=np.int64)
    number[kept] = np.arange(len(kept))
    return kept, number[nearest_of(distinct_lengths(mesh), kept)]


def faces_between(cells: IntArray, faces: IntArray) -> IntArray:
    """Return the *faces* (m, 3) whose corners lie in three *cells*, over these, (k, 3).

    What is left of a closed surface is closed.
    """
    corners = cells[faces]
    a, b, c = corners.T
    return np.asarray(corners[(a != b) & (b != c) & (c != a)])


def distinct_lengths(mesh: Mesh) -> sparse.csr_array:
    """Return (n, n) lengths of the edges, such that no two paths are equally long.

    On a regular mesh many are, and which of several is the nearest must not hang on rounding.
    """
    graph, favour = mesh.adjacency, _favour(mesh.n_vertices)
    ends = np.repeat(favour, np.diff(graph.indptr)) + favour[graph.indices]
    return sparse.csr_array((graph.data * (1.0 + ends), graph.indices, graph.indptr), graph.shape)


def nearest_of(lengths: sparse.csr_array, start: IntArray) -> IntArray:
    """Return (n,) int: for each vertex the nearest of *start*, over the edges of a graph."""
    _, _, source = csgraph.dijkstra(lengths, indices=start, return_predecessors=True, min_only=True)
    return np.asarray(source, dtype=np.int64)


def _favour(n: int) -> FloatArray:
    """Return (n,): by what share each vertex makes the edges at it longer."""
    return np.asarray(_TIE_BREAK * np.random.default_rng(0).random(n))


def unique_edges(edges: IntArray, n: int) -> IntArray:
    """Return the (e, 2) different ones among *edges* of *n* points, sorted, without loops."""
    i, j = edges[edges[:, 0] != edges[:, 1]].T
    keys = np.sort(np.minimum(i, j) * n + np.maximum(i, j))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack(np.divmod(keys, n), axis=1)


def _independent(edges: IntArray, n: int, rng: np.random.Generator) -> IntArray:
    """Return points, in order, no two of them joined and every other joined to one.

    As if they were met in a random order, and each chosen that is not joined to one chosen before.
    All that need not wait for an earlier neighbour are chosen at once, and so on.
    """
    turn = np.empty(n, dtype=np.int64)
    turn[rng.permutation(n)] = np.arange(n)
    one, other = edges.T
    swap = turn[one] > turn[other]
    earlier, later = np.where(swap, other, one), np.where(swap, one, other)
    out = np.zeros(n, dtype=bool)
    while len(earlier):
        waiting = np.zeros(n, dtype=bool)
        waiting[later] = True
        out[later[~waiting[earlier]]] = True
        left = ~(out[earlier] | out[later])
        earlier, later = earlier[left], later[left]
    return np.flatnonzero(~out)


def _nearest_neighbour(edges: IntArray, length: FloatArray, stay: IntArray, n: int) -> IntArray:
    """Return (n,) int: which of the points *stay* each is, or else its nearest neighbour is."""
    number = np.full(n, -1)
    number[stay] = np.arange(len(stay))
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    joins = (number[i] >= 0) & (number[j] < 0)
    i, j, length = i[joins], j[joins], np.concatenate([length, length])[joins]
    least = np.full(n, np.inf)
    np.minimum.at(least, j, length)
    nearest = length == least[j]
    number[j[nearest]] = number[i[nearest]]
    return number
