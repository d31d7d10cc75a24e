"""Distance along a surface from points on it, up to the radius of a brush.

A front propagates over the mesh: the distances of two corners of a triangle give that of the
third, as if the triangles between the source and the front lay in one plane.  On a flat surface the
distances are exact, so a brush stroke is round for any triangulation; distances along edges alone
are up to 15 % or more too long.  Two sheets that are close in space can be far apart along the
surface.

A simplified variant of P. Trettner, D. Bommes, L. Kobbelt, "Geodesic distance computation via
virtual source propagation", Computer Graphics Forum 40(5), 247-260, 2021.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vtk_segdeform.arrays import FloatArray, IntArray

_LEAST_GAIN = 1e-6  # of the radius; smaller improvements are not propagated
_MOST_STEPS = 40  # about, from the source to the radius


class SurfaceDistance:
    """Distances over the triangles of one mesh, in any pose.

    Parameters
    ----------
    n_vertices : int
        n; each vertex must be in a triangle.
    faces : (m, 3) int
        Triangles.
    """

    def __init__(self, n_vertices: int, faces: IntArray) -> None:
        self._faces = faces
        ends, corners = np.arange(0, faces.size + 1, 3), faces.ravel()
        ones = np.ones(faces.size, dtype=np.int8)
        shape = len(faces), n_vertices
        by_vertex = sparse.csr_array((ones, corners, ends), shape).tocsc()
        self._around = by_vertex.indices  # triangles, vertex by vertex
        self._first, self._count = by_vertex.indptr[:-1], np.diff(by_vertex.indptr)

    def within(
        self, vertices: FloatArray, points: FloatArray, triangles: IntArray, radius: float
    ) -> FloatArray:
        """Return (n,) float: the distance of each vertex to the nearest of *points*.

        Parameters
        ----------
        vertices : (n, 3) float
            The pose.
        points : (k, 3) float
            On the surface.
        triangles : (k,) int
            The triangle that contains each point.
        radius : float
            Distances are computed for the vertices within this radius and their neighbours; all
            others are infinite.
        """
        distance = np.full(len(vertices), np.inf)
        if not len(points):
            return distance
        start = self._faces[triangles]
        direct = _length(vertices[start] - points[:, None])
        np.minimum.at(distance, start, direct)
        # The nearest vertices propagate first, many at once.  A vertex whose distance shrinks
        # later propagates again.
        sides = _length(vertices[start] - vertices[start[:, [1, 2, 0]]])
        step = max(2.0 * float(sides.mean()), radius / _MOST_STEPS)
        queue = np.unique(start)
        while len(queue):
            due = distance[queue] <= distance[queue].min() + step
            front, queue = queue[due], queue[~due]
            faces = self._faces[self._triangles_at(front)]
            v, a, b = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]]).T
            found = _propagated(vertices[np.stack([v, a, b])], distance[a], distance[b])
            nearer = found < distance[v] - _LEAST_GAIN * radius
            np.minimum.at(distance, v[nearer], found[nearer])
            queue = np.union1d(queue, v[nearer & (found <= radius)])
        return distance

    def _triangles_at(self, vertices: IntArray) -> IntArray:
        count = self._count[vertices]
        place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        return np.unique(self._around[np.repeat(self._first[vertices], count) + place])


def _length(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("...j,...j->...", vectors, vectors)))


def _propagated(corners: FloatArray, from_a: FloatArray, from_b: FloatArray) -> FloatArray:
    """Return the distances of v from those of a and b, for k triangles with *corners* v, a, b."""
    v, a, b = corners
    to_a, to_b = _length(v - a), _length(v - b)
    found = np.minimum(from_a + to_a, from_b + to_b)  # along the sides
    side = _length(b - a)
    flat = np.flatnonzero(np.isfinite(from_a + from_b) & (side > 0.0))
    side, along_a, along_b, to_a = side[flat], from_a[flat], from_b[flat], to_a[flat]

    # In the plane with a at 0 and b at (side, 0), v lies above and the source of the front below.
    x = np.einsum("ij,ij->i", (v - a)[flat], (b - a)[flat]) / side
    y = np.sqrt(np.maximum(to_a**2 - x**2, 0.0))
    source_x = (along_a**2 - along_b**2 + side**2) / (2.0 * side)
    depth = along_a**2 - source_x**2
    source_y = np.sqrt(np.maximum(depth, 0.0))
    whole = np.maximum(y + source_y, np.finfo(float).tiny)
    crossing = source_x + (x - source_x) * source_y / whole
    straight = (depth >= 0.0) & (crossing >= 0.0) & (crossing <= side)
    found[flat[straight]] = np.hypot(x - source_x, y + source_y)[straight]
    return np.asarray(found)
