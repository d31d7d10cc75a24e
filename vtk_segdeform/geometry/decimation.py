"""Decimation of a large mesh: one vertex for each cluster of neighbours, in a few passes.

A regular grid divides the vertices; those of a grid cell that edges within it join are a cluster.
So no cluster joins two sheets or two bodies, however close they are, and nothing is required of the
faces.  A cluster keeps its vertex nearest to their mean, and the faces between three clusters.

The decimated surface is closed if the mesh is, and its enclosed volume is defined, but it may have
edges with many faces and faces that coincide, which a `Mesh` made by a caller must not have.
"""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..freezing import read_only
from ..mesh import Mesh, connected
from .sampling import faces_between, unique_edges
from .ties import principal_axes

_MOST_CLUSTERS = 1.5  # in numbers requested; also clusters for each square of a grid on the surface

_last: WeakKeyDictionary[Mesh, tuple[int, Mesh, IntArray, IntArray]] = WeakKeyDictionary()
_lock = Lock()  # several threads ask for the same mesh at the same time


def decimated(mesh: Mesh, n_points: int) -> tuple[Mesh, IntArray, IntArray]:
    """Return a mesh of about *n_points*, its vertices in *mesh*, and the cluster of each vertex.

    The result for a mesh is kept as long as the mesh: segmentation, cages and binding all need it.

    Returns
    -------
    coarse : Mesh
        k vertices.
    kept : (k,) int
        Their indices in *mesh*.
    cluster : (n,) int
        The vertex of *coarse* that replaces each vertex of *mesh*.
    """
    with _lock:
        found = _last.get(mesh)
        if found is None or found[0] != n_points:
            cluster = _clusters(mesh, n_points)
            kept = _nearest_to_mean(mesh.vertices, cluster)
            found = _last[mesh] = n_points, _joined(mesh, kept, cluster), kept, cluster
    _, coarse, kept, cluster = found
    return coarse, kept, cluster


def _clusters(mesh: Mesh, n_points: int) -> IntArray:
    """Return the cluster of each vertex, (n,) int."""
    x = mesh.vertices @ principal_axes(mesh.vertices).T
    x = np.asarray(x - x.min(axis=0))
    spacing = np.sqrt(_MOST_CLUSTERS * mesh.face_areas.sum() / n_points)
    most = _MOST_CLUSTERS * n_points + mesh.components.max() + 1
    cluster, spacing = _in_cells(mesh, x, spacing, n_points)
    for passes in (8, 24, 72, 216):  # of a noisy mesh
        if cluster.max() < most:
            break
        x = _smoothed(mesh, x, passes)
        cluster, spacing = _in_cells(mesh, x, spacing, n_points)
    return cluster


def _in_cells(mesh: Mesh, x: FloatArray, spacing: float, n_points: int) -> tuple[IntArray, float]:
    """Return clusters (n,) for vertices at *x* (n, 3), and the spacing, searched from *spacing*."""
    i, j = mesh.edges.T
    least = np.ptp(x, axis=0).max() / (1 << 20)
    for _ in range(6):
        spacing = max(spacing, least)
        key = np.zeros(len(x), dtype=np.int64)
        for axis in range(3):
            key = (key << 21) + np.floor(x[:, axis] / spacing).astype(np.int64)
        n_cells = len(np.unique(key))
        ratio = n_cells / n_points
        if 1.0 / _MOST_CLUSTERS < ratio < _MOST_CLUSTERS or spacing == least:
            break
        spacing *= np.sqrt(ratio)
    same = key[i] == key[j]
    return connected(len(x), i[same], j[same]), spacing


def _smoothed(mesh: Mesh, x: FloatArray, passes: int) -> FloatArray:
    """Return *x* (n, 3) after *passes* that average each point with its neighbours."""
    near = mesh.adjacency
    ones = sparse.csr_array((np.ones(len(near.data)), near.indices, near.indptr), near.shape)
    size = 1.0 + np.diff(near.indptr)[:, None]
    for _ in range(passes):
        x = (x + ones @ x) / size
    return np.asarray(x - x.min(axis=0))


def _nearest_to_mean(x: FloatArray, cluster: IntArray) -> IntArray:
    """Return the vertex of each cluster that is nearest to the mean of its vertices, (k,) int."""
    size = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, axis) / size for axis in x.T], axis=1)
    away = ((x - mean[cluster]) ** 2).sum(axis=1)
    least = np.full(len(size), np.inf)
    np.minimum.at(least, cluster, away)
    nearest = np.flatnonzero(away == least[cluster])
    kept = np.empty(len(size), dtype=np.int64)
    kept[cluster[nearest[::-1]]] = nearest[::-1]
    return kept


def _joined(mesh: Mesh, kept: IntArray, cluster: IntArray) -> Mesh:
    """Return the mesh of the clusters."""
    coarse: Mesh = object.__new__(Mesh)
    faces = faces_between(cluster, mesh.faces)
    coarse.__setstate__({"vertices": mesh.vertices[kept], "faces": faces})
    # Clusters in a line, such as along a needle, have edges only.
    edges = unique_edges(cluster[mesh.edges], len(kept))
    components = mesh.components[kept]
    coarse.__dict__.update(edges=read_only(edges), components=read_only(components))
    coarse.__dict__["is_two_manifold"] = False
    return coarse
