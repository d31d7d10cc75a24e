"""Even samples of the vertices of a mesh, and their Voronoi cells along edges.

No two samples are closer than a spacing that depends on the shape alone.  Every vertex of the mesh
belongs to the cell of the nearest sample, measured along edges.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..mesh import Mesh
from ..progress import Progress, tell
from .ties import tie_breakers


def voronoi_cells(
    mesh: Mesh, n_points: int, rng: np.random.Generator, progress: Progress | None = None
) -> tuple[IntArray, IntArray]:
    """Return about *n_points* samples, (k,) int and sorted, and the cell of each vertex, (n,) int.

    Each round keeps an independent set of the vertices that are too close and contracts every
    other vertex to its nearest kept neighbour, so that rounds become smaller.  The final cells are
    computed on the mesh itself.
    """
    kept, edges, factors = np.arange(mesh.n_vertices), mesh.edges, tie_breakers(mesh.n_vertices)
    spacing = 0.8 * np.sqrt(mesh.face_areas.sum() / n_points)
    while mesh.n_vertices > n_points:
        tell(progress, 0.8 * (1.0 - len(kept) / mesh.n_vertices), "sampling vertices")
        i, j = kept[edges.T]
        length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
        length *= factors[i] * factors[j]
        short = length < spacing
        if np.count_nonzero(short) <= 0.01 * len(kept):
            break
        chosen = _independent(edges[short], len(kept), rng)
        number = _nearest_neighbour(edges[short], length[short], chosen, len(kept))
        kept, edges = kept[chosen], unique_edges(number[edges], len(chosen))
    tell(progress, 0.8, "sampling vertices")
    number = np.empty(mesh.n_vertices, dtype=np.int64)
    number[kept] = np.arange(len(kept))
    return kept, number[nearest_source(distinct_lengths(mesh), kept)]


def faces_between(cells: IntArray, faces: IntArray) -> IntArray:
    """Return the *faces* (m, 3) whose corners lie in three different *cells*, as cells, (k, 3).

    The result is closed if the surface is.
    """
    corners = cells[faces]
    a, b, c = corners.T
    return np.asarray(corners[(a != b) & (b != c) & (c != a)])


def distinct_lengths(mesh: Mesh) -> sparse.csr_array:
    """Return edge lengths (n, n), perturbed so that no two paths are equally long.

    Regular meshes have many equally long paths, and rounding must not decide which is the shortest.
    """
    graph, factors = mesh.adjacency, tie_breakers(mesh.n_vertices)
    lengths = graph.data * np.repeat(factors, np.diff(graph.indptr)) * factors[graph.indices]
    return sparse.csr_array((lengths, graph.indices, graph.indptr), graph.shape)


def nearest_source(lengths: sparse.csr_array, sources: IntArray) -> IntArray:
    """Return the nearest of *sources* to each vertex along the edges of a graph, (n,) int.

    As Dijkstra's algorithm does, for many sources and in a few operations of numpy: each round
    continues from all vertices that the last one has come nearer to.
    """
    from_, to = np.repeat(np.arange(lengths.shape[0]), np.diff(lengths.indptr)), lengths.indices
    away, source = np.full(lengths.shape[0], np.inf), np.full(lengths.shape[0], -1)
    away[sources], source[sources] = 0.0, sources
    nearer = source >= 0
    while nearer.any():
        edge = np.flatnonzero(nearer[from_])
        length = away[from_[edge]] + lengths.data[edge]
        is_shorter = length < away[to[edge]]
        edge, length = edge[is_shorter], length[is_shorter]
        np.minimum.at(away, to[edge], length)
        best = edge[length == away[to[edge]]]
        source[to[best]] = source[from_[best]]
        nearer = np.zeros(len(nearer), dtype=bool)
        nearer[to[best]] = True
    return source


def unique_edges(edges: IntArray, n: int) -> IntArray:
    """Return the distinct *edges* between *n* points, (e, 2), sorted and without loops."""
    i, j = edges[edges[:, 0] != edges[:, 1]].T
    keys = np.sort(np.minimum(i, j) * n + np.maximum(i, j))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack(np.divmod(keys, n), axis=1)


def _independent(edges: IntArray, n: int, rng: np.random.Generator) -> IntArray:
    """Return a maximal independent set of the points, sorted.

    It is the set that a greedy pass in random order chooses.  Each round chooses at once all
    points whose earlier neighbours are decided.
    """
    position = np.empty(n, dtype=np.int64)
    position[rng.permutation(n)] = np.arange(n)
    one, other = edges.T
    swap = position[one] > position[other]
    earlier, later = np.where(swap, other, one), np.where(swap, one, other)
    excluded = np.zeros(n, dtype=bool)
    while len(earlier):
        undecided = np.zeros(n, dtype=bool)
        undecided[later] = True
        excluded[later[~undecided[earlier]]] = True
        left = ~(excluded[earlier] | excluded[later])
        earlier, later = earlier[left], later[left]
    return np.flatnonzero(~excluded)


def _nearest_neighbour(edges: IntArray, length: FloatArray, chosen: IntArray, n: int) -> IntArray:
    """Return the index in *chosen* of each point, or of its nearest chosen neighbour, (n,) int."""
    number = np.full(n, -1)
    number[chosen] = np.arange(len(chosen))
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    joins = (number[i] >= 0) & (number[j] < 0)
    i, j, length = i[joins], j[joins], np.concatenate([length, length])[joins]
    least = np.full(n, np.inf)
    np.minimum.at(least, j, length)
    nearest = length == least[j]
    number[j[nearest]] = number[i[nearest]]
    return number
