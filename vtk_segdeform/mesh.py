"""The mesh that is deformed: triangles that close, on a two-manifold, seen from outside.

Volume, and with it the whole method, only means something on such a mesh (section 3.2 of the
paper), so a `Mesh` cannot be made from anything else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph

from .arrays import FloatArray, IntArray, as_faces, as_points


@dataclass(frozen=True, init=False, eq=False)
class Mesh:
    """A closed, outward oriented triangle mesh; frozen.

    Parameters
    ----------
    vertices : (n, 3) float
        In any length unit.
    faces : (m, 3) int
        Counter-clockwise seen from outside.

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.
    MeshError
        If the mesh is not a closed oriented two-manifold; names and counts every fault.
    """

    vertices: FloatArray
    faces: IntArray

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        points = as_points(vertices, "vertices").copy()
        triangles = as_faces(faces, len(points), "faces").copy()
        points.flags.writeable = triangles.flags.writeable = False
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "faces", triangles)

    @property
    def n_vertices(self) -> int:
        """Number of vertices, n."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles, m."""
        return len(self.faces)

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal: the size that tolerances are relative to."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @cached_property
    def edges(self) -> IntArray:
        """(e, 2) int: each edge once, smaller vertex first, in lexicographic order."""
        pairs = np.sort(self.faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
        return np.unique(pairs, axis=0)

    @cached_property
    def adjacency(self) -> sparse.csr_array:
        """(n, n) symmetric sparse: the edge length between neighbouring vertices."""
        i, j = self.edges.T
        length = np.linalg.norm(self.vertices[i] - self.vertices[j], axis=1)
        length = np.maximum(length, np.finfo(float).tiny)  # csgraph reads a zero as "no edge"
        half = sparse.coo_array((length, (i, j)), shape=(self.n_vertices,) * 2)
        return (half + half.T).tocsr()

    @cached_property
    def components(self) -> IntArray:
        """(n,) int: the connected component of each vertex, numbered from 0."""
        _, labels = csgraph.connected_components(self.adjacency, directed=False)
        return labels.astype(np.int64)

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) float: the triangles' areas."""
        a, b, c = self.vertices[self.faces.T]
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    def with_vertices(self, vertices: ArrayLike) -> Mesh:
        """Return the same triangles over other positions (n, 3)."""
        return Mesh(vertices, self.faces)
