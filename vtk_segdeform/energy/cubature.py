"""Cubature: the shape energy of a large mesh from a weighted sample of its vertices.

E of `energy` is a sum over vertices i, and each term depends on a vertex and its neighbours.  The
sum over a large mesh is estimated from some thousands of sampled vertices, each with the weight of
the surface around it:

    sum_i e_i  =~  sum_{i sampled} c_i e_i,      c_i = (area of its cluster / samples there) / A_i

The terms of a sampled vertex are the mesh's own: its rows of W~, its detail and its triangles.
Nothing is smoothed or remeshed, and E is still zero at rest, never negative, and invariant under
rigid motions.  Only Q, K and c of E are computed this way; every vertex keeps its row of W~, and
with it its own detail.

In each rotation cluster the samples follow each other evenly, by area, along a space-filling curve.
Half of them are distributed by area, half evenly over the clusters, so that every cluster has some.

A closed coarse surface through as many vertices would be farther from the whole energy: its chords
fall short of the area, and it has lost the detail.

Source
------
S. S. An, T. Kim, D. L. James, "Optimizing cubature for efficient integration of subspace
deformations", ACM Trans. Graph. 27(5), 2008.  W. G. Madow, L. H. Madow, "On the theory of
systematic sampling", Ann. Math. Stat. 15, 1944.  G. M. Morton, 1966 (the curve).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import IntrinsicTriangulation, principal_axes
from ..mesh import Mesh
from ..subspace import Subspace

_PHASE = 0.381966  # of the area before the first sample; no fraction that regular meshes repeat
_AXIS_BITS = 10  # of a coordinate on each axis of the curve


@dataclass(frozen=True, eq=False)
class Sample:
    """The sampled vertices, their neighbours and triangles; made by `Sample.of`.

    Parameters
    ----------
    ids : (k,) int
        The sampled vertices and their neighbours, in ascending order.
    surface : IntrinsicTriangulation
        All triangles at the sampled vertices, over the k vertices.
    weights : (k,) float
        c of each sampled vertex; 0 for their neighbours.
    """

    ids: IntArray
    surface: IntrinsicTriangulation
    weights: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, clusters: IntArray) -> Sample | None:
        """Return a sample of *mesh*, or None if it is small enough to use every vertex.

        *clusters* (n,) are the rotation clusters of its vertices, numbered from 0.
        """
        x, faces = mesh.vertices, mesh.faces
        n = len(x)
        number = sizes.CUBATURE_SAMPLE
        if n < sizes.CUBATURE_FACTOR * number:
            return None
        weights = _weights(_along_curve(x, clusters), clusters, mesh.vertex_areas, number)
        near = _touched(weights > 0.0, faces)
        ids, corners = _numbered(faces[near], n)
        surface = IntrinsicTriangulation.of(x[ids], corners)
        if surface.faces is not corners:  # bad triangles were flipped: others may be near now
            whole = IntrinsicTriangulation.of(x, faces)
            near = _touched(weights > 0.0, whole.faces)
            ids, corners = _numbered(whole.faces[near], n)
            surface = IntrinsicTriangulation(x[ids], corners, whole.lengths[near])
        return cls(ids, surface, weights[ids])

    def rows(self, subspace: Subspace) -> Subspace:
        """Return the rows of W~, *subspace*, for `ids`."""
        rows, blocks = [], []
        for members, block in zip(subspace.rows, subspace.blocks, strict=True):
            found = np.searchsorted(members, self.ids)
            mine = np.flatnonzero(np.append(members, -1)[found] == self.ids)
            rows.append(mine)
            blocks.append(block[found[mine]])
        return Subspace(len(self.ids), tuple(rows), tuple(blocks))


def _touched(vertices: BoolArray, faces: IntArray) -> BoolArray:
    """Return which *faces* (m, 3) have one of *vertices* (n,)."""
    a, b, c = (vertices[corner] for corner in faces.T)
    return np.asarray(a | b | c)


def _numbered(faces: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return the vertices of *faces* (k,), in ascending order, and the faces over these."""
    place = np.zeros(n, dtype=np.int64)
    place[faces] = 1
    ids = np.flatnonzero(place)
    place[ids] = np.arange(len(ids))
    return ids, place[faces]


def _weights(order: IntArray, clusters: IntArray, areas: FloatArray, number: int) -> FloatArray:
    """Return the weights (n,) of a sample of about *number* vertices; 0 for all others.

    *order* (n,) are all vertices along the curve, cluster by cluster.
    """
    area, size = np.bincount(clusters, areas), np.bincount(clusters)
    samples = np.ceil(0.5 * number * (area / area.sum() + 1.0 / len(area))).astype(np.int64)
    covered, ends = np.cumsum(areas[order]), np.cumsum(size)  # area along the curve; vertices
    begins = np.concatenate([[0.0], covered[ends[:-1] - 1]])

    cluster = np.repeat(np.arange(len(area)), samples)  # of each sample, and its number there
    number_of = np.arange(len(cluster)) - np.repeat(np.cumsum(samples) - samples, samples)
    share = (area / samples)[cluster]
    place = np.searchsorted(covered, begins[cluster] + (number_of + _PHASE) * share)
    sampled = order[np.clip(place, (ends - size)[cluster], ends[cluster] - 1)]
    represented = np.bincount(sampled, share, len(areas))
    weights = np.divide(represented, areas, where=areas > 0.0, out=np.zeros(len(areas)))
    weights[((size <= samples) | (area == 0.0))[clusters]] = 1.0  # small clusters: every vertex
    return weights


def _along_curve(positions: FloatArray, clusters: IntArray) -> IntArray:
    """Return all vertices cluster by cluster, each along a Morton curve; the same in any frame."""
    x = (positions - positions.mean(axis=0)) @ principal_axes(positions).T
    x -= x.min()
    # The factor keeps planes of symmetry off the steps of the curve.
    x *= (1 << _AXIS_BITS) / (x.max() * (1.0 + _PHASE / 100.0))
    place = clusters << 3 * _AXIS_BITS
    numbers, bits = np.arange(1 << _AXIS_BITS), np.arange(_AXIS_BITS)
    apart = ((numbers[:, None] >> bits & 1) << 3 * bits).sum(axis=1)  # their bits, every third
    for axis in range(3):
        place |= apart[x[:, axis].astype(np.int64)] << axis
    return np.argsort(place, kind="stable")
