"""How far it is along a surface from points on it, as far as a brush reaches.

A wave: distance is handed from two corners of a triangle to its third, as if all that the wave
has crossed so far lay flat.  On a flat surface the distances are exact, so what a brush paints
is round whatever the triangles; along edges alone it would have corners, 15 % or more off.  What
is near in space but far along the surface is far.

A simple relative of P. Trettner, D. Bommes, L. Kobbelt, "Geodesic distance computation via
virtual source propagation", Computer Graphics Forum 40(5), 247-260, 2021.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vtk_segdeform.arrays import FloatArray, IntArray

_BETTER = 1e-6  # of the radius; less is not worth another step
_STRIDES = 40  # to the radius, about, at most


class SurfaceDistance:
    """Distances over the triangles of one mesh, whatever its pose.

    Parameters
    ----------
    n_vertices : int
        n, each in some triangle.
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
        """Return (n,) float: how far each vertex is from the nearest of some points.

        Parameters
        ----------
        vertices : (n, 3) float
            The pose.
        points : (k, 3) float
            On the surface.
        triangles : (k,) int
            The triangle in which each of them lies.
        radius : float
            How far the wave goes.  It reaches the neighbours of whatever is within; others are
            infinitely far.
        """
        distance = np.full(len(vertices), np.inf)
        if not len(points):
            return distance
        start = self._faces[triangles]
        direct = _length(vertices[start] - points[:, None])
        np.minimum.at(distance, start, direct)
        # Nearest first, a few at once: what goes on too early goes on again.
        sides = _length(vertices[start] - vertices[start[:, [1, 2, 0]]])
        stride = max(2.0 * float(sides.mean()), radius / _STRIDES)
        waiting = np.unique(start)
        while len(waiting):
            due = distance[waiting] <= distance[waiting].min() + stride
            front, waiting = waiting[due], waiting[~due]
            faces = self._faces[self._triangles_at(front)]
            v, a, b = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]]).T
            found = _handed_on(vertices[np.stack([v, a, b])], distance[a], distance[b])
            nearer = found < distance[v] - _BETTER * radius
            np.minimum.at(distance, v[nearer], found[nearer])
            waiting = np.union1d(waiting, v[nearer & (found <= radius)])
        return distance

    def _triangles_at(self, vertices: IntArray) -> IntArray:
        count = self._count[vertices]
        place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        return np.unique(self._around[np.repeat(self._first[vertices], count) + place])


def _length(ways: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("...j,...j->...", ways, ways)))


def _handed_on(corners: FloatArray, from_a: FloatArray, from_b: FloatArray) -> FloatArray:
    """Return how far v is, given how far a and b are, for k triangles with *corners* v, a, b."""
    v, a, b = corners
    to_a, to_b = _length(v - a), _length(v - b)
    found = np.minimum(from_a + to_a, from_b + to_b)  # round a corner
    side = _length(b - a)
    flat = np.flatnonzero(np.isfinite(from_a + from_b) & (side > 0.0))
    side, along_a, along_b, to_a = side[flat], from_a[flat], from_b[flat], to_a[flat]

    # With a at 0 and b at (side, 0), v is above and the point that the wave comes from below.
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
