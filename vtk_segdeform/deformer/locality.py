"""Locality of a pull: what is far from the grabbed point, along the surface, softly stays.

    sum_s w_s |x_s - x_s^0|^2,    w_s = kappa a_s smoothstep(d_s / reach - 1)

The sum is over samples s of the surface, with their share a_s of the area, their distance d_s from
the grabbed point and their position x_s^0 at the press.  Within the reach the surface is free; from
twice the reach on, and on other parts, it has the whole weight.

The samples are the cells of the coarse volume, or the vertices of a small mesh, and distances are
along the edges between them, so a press takes some milliseconds whatever the size of the mesh; to
fix as many vertices would take a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import FloatArray, IntArray
from ..geometry import faces_between
from ..mesh import Mesh
from ..solver import CoarseVolume


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of a surface at rest, joined by edges.

    Parameters
    ----------
    cells : (n,) int
        The sample of each vertex.
    rows : (s, m) float
        W~ at the samples.
    areas : (s,) float
        Their shares of the area.
    edges : (s, s) sparse
        Lengths of the edges between them.
    """

    cells: IntArray
    rows: FloatArray
    areas: FloatArray
    edges: sparse.csr_array

    @classmethod
    def of(cls, rest: Mesh, coarse: CoarseVolume) -> SurfaceSamples:
        """Return the samples of a mesh at *rest* with its *coarse* volume."""
        n = rest.n_vertices
        at_vertices = np.bincount(rest.faces.ravel(), np.repeat(rest.face_areas, 3), n)
        cells, faces, points = np.arange(n), rest.faces, rest.vertices
        if coarse.cells is not None and coarse.shares is not None:
            cells, faces = coarse.cells, faces_between(coarse.cells, rest.faces)
            shared = [coarse.shares * axis for axis in rest.vertices.T]
            points = np.stack([np.bincount(cells, axis) for axis in shared], axis=1)
        count = len(points)
        areas = np.asarray(np.bincount(cells, at_vertices, count), dtype=np.float64)
        i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
        near = sparse.coo_array((np.ones(len(i)), (i, j)), (count, count)).tocsr().tocoo()
        lengths = np.linalg.norm(points[near.row] - points[near.col], axis=1)
        edges = sparse.coo_array((lengths, (near.row, near.col)), (count, count)).tocsr()
        rows = coarse.surface.at(np.arange(count))
        return cls(cells, rows, areas / areas.sum(), edges)

    def distances(self, vertex: int) -> FloatArray:
        """Return the distance of each sample from that of *vertex*, (s,); infinite elsewhere."""
        found = csgraph.dijkstra(self.edges, directed=False, indices=self.cells[vertex])
        return np.asarray(found, dtype=np.float64)

    def quadratic(self, vertex: int, reach: float) -> FloatArray:
        """Return sum_s w_s W~_s^T W~_s, (m, m), of total weight at most 1."""
        if np.isinf(reach):
            return np.zeros((self.rows.shape[1],) * 2)
        beyond = np.clip(self.distances(vertex) / reach - 1.0, 0.0, 1.0)
        weights = self.areas * beyond**2 * (3.0 - 2.0 * beyond)
        kept = weights > 0.0
        rows = self.rows[kept]
        return np.asarray((rows.T * weights[kept]) @ rows)
