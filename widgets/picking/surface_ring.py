"""The ring around a point of the surface: where the surface leaves a ball about that point.

Cheap on large meshes.  The mesh is divided into connected blocks, once; only triangles of blocks
that the sphere crosses are looked at.  Blocks that are far away along the surface are left out, so
the ring does not appear on a finger beside the one under the pointer.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from vtk_segdeform.arrays import BoolArray, FloatArray
from vtk_segdeform.mesh import Mesh

_CELLS = 32  # along the diagonal; each has one block for each connected piece of surface in it
_DETOUR = 1.6  # radii along the surface, from block to block, at which a block is still near
_CORNERS = 48  # of a circle that is smaller than the triangle


class SurfaceRing:
    """Rings on the surface of one mesh, in any pose.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._triangles = mesh.faces
        x, edges, n = mesh.vertices, mesh.edges, mesh.n_vertices
        self._size = mesh.diagonal / _CELLS
        i, j, k = ((x - x.min(axis=0)) / self._size).astype(np.int64).T
        cell = ((2 * _CELLS) * i + j) * (2 * _CELLS) + k
        start, end = edges.T
        inside = cell[start] == cell[end]
        ones = np.ones(np.count_nonzero(inside), dtype=np.int8)
        graph = sparse.coo_array((ones, (start[inside], end[inside])), shape=(n, n))
        self._count, self._block = csgraph.connected_components(graph, directed=False)
        self._by_block = np.argsort(self._block, kind="stable")
        owner = self._block[mesh.faces[:, 0]]
        self._faces = np.argsort(owner, kind="stable")
        self._first = np.searchsorted(owner[self._faces], np.arange(self._count + 1))
        across = self._block[edges[~inside]]
        self._links = np.unique(np.concatenate([across, across[:, ::-1]]), axis=0)
        self._graph = sparse.csr_array((self._count, self._count))
        self._pose: int | None = None
        self._low = self._high = np.empty((0, 3))

    def around(
        self, points: FloatArray, *, pose: int, centre: FloatArray, face: int, radius: float
    ) -> FloatArray:
        """Return the segments (k, 2, 3) of the ring about *centre*.

        Parameters
        ----------
        points : (n, 3) float
            The pose.
        pose : int
            Its number; another one for every pose.
        centre : (3,) float
            On the surface.
        face : int
            The triangle that contains it.
        radius : float
            Above 0.
        """
        if pose != self._pose:
            self._pose = pose
            self._measure(points)
        corner = self._triangles[face]
        near = self._near(int(self._block[corner[0]]), radius)
        outside = np.maximum(np.maximum(self._low - centre, centre - self._high), 0.0)
        beyond = np.maximum(centre - self._low, self._high - centre)
        square = radius * radius
        crossed = (outside**2).sum(axis=1) <= square
        crossed &= (beyond**2).sum(axis=1) >= square
        a, b = self._links.T
        reached = crossed.copy()  # a triangle belongs to one block, but reaches into others
        reached[a[crossed[b]]] = True
        blocks = np.flatnonzero(reached & near)
        pieces = [self._faces[self._first[k] : self._first[k + 1]] for k in blocks]
        corners = points[self._triangles[np.concatenate([[face], *pieces]).astype(np.int64)]]
        offset = corners - centre
        ends = contour(corners, np.sqrt(np.einsum("ijk,ijk->ij", offset, offset)), radius)
        return ends if len(ends) else _circle(points[corner], centre, radius)

    def _measure(self, points: FloatArray) -> None:
        """Find the bounding boxes of the blocks."""
        x = points[self._by_block]
        starts = np.searchsorted(self._block[self._by_block], np.arange(self._count))
        self._low = np.minimum.reduceat(x, starts)
        self._high = np.maximum.reduceat(x, starts)
        middle = 0.5 * (self._low + self._high)
        a, b = self._links.T
        length = np.maximum(np.linalg.norm(middle[a] - middle[b], axis=1), 1e-9 * self._size)
        self._graph = sparse.csr_array((length, (a, b)), shape=(self._count, self._count))

    def _near(self, block: int, radius: float) -> BoolArray:
        """Return which blocks are near *block* along the surface, (b,) bool."""
        limit = _DETOUR * radius + 3.0 * self._size
        away = csgraph.dijkstra(self._graph, indices=np.array([block]), limit=limit)[0]
        return np.asarray(np.isfinite(away))


def contour(corners: FloatArray, values: FloatArray, level: float) -> FloatArray:
    """Return the segments (k, 2, 3) of the contour line at *level* over triangles.

    *corners* are (m, 3, 3) and their *values* (m, 3), which are interpolated linearly.  Each
    triangle with corners on both sides has one segment.
    """
    below = values <= level
    mixed = below.any(axis=1) & ~below.all(axis=1)
    start, first = corners[mixed], values[mixed]
    end, last = start[:, [1, 2, 0]], first[:, [1, 2, 0]]
    crossed = (first <= level) != (last <= level)  # two sides of each triangle
    start, end, first, last = start[crossed], end[crossed], first[crossed], last[crossed]
    fraction = (level - first) / (last - first)
    return np.asarray((start + fraction[:, None] * (end - start)).reshape(-1, 2, 3))


def _circle(corners: FloatArray, centre: FloatArray, radius: float) -> FloatArray:
    """Return a circle in the plane of a triangle, as segments (k, 2, 3)."""
    side = corners[1] - corners[0]
    normal = np.cross(side, corners[2] - corners[0])
    lengths = np.linalg.norm(side), np.linalg.norm(normal)
    if not min(lengths) > 0.0:
        return np.empty((0, 2, 3))
    x, normal = side / lengths[0], normal / lengths[1]
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS + 1)[:, None]
    line = centre + radius * (np.cos(angle) * x + np.sin(angle) * np.cross(normal, x))
    return np.stack([line[:-1], line[1:]], axis=1)
