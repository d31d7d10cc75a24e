"""Gradients of the triangles of a patch, and the pose that has given ones.

The vertices of a patch follow wanted gradients J* as well as they can,

    minimise  sum_T w_T A_T |J_T - J*_T|^2     over the vertices that move, with the others in place

where J_T (3, 2) maps the plane of a triangle at rest to its plane in the pose.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Mesh
from .folds import Folds

_STAY = 1e-12  # share of the equations by which vertices stay where they are
_TINY = 1e-300


class Patch:
    """The triangles at the vertices *moving* (n,) bool of a mesh.

    Attributes
    ----------
    triangles : (m,) int
        Those with an area at rest.
    faces : (m, 3) int
        Their vertices.
    """

    def __init__(self, mesh: Mesh, folds: Folds, moving: BoolArray) -> None:
        triangles = np.flatnonzero(moving[mesh.faces].any(axis=1) & folds.good)
        self.triangles, self.faces = triangles, mesh.faces[triangles]
        self._moving = np.flatnonzero(moving)
        a, b, d = folds.inverses[:, triangles]
        zero = np.zeros_like(a)
        self._areas = 0.5 / (a * d)
        rows = np.arange(2 * len(triangles))
        # J^T of all triangles, two rows each, is B x.
        inverse = np.stack([np.stack([a, zero], 1), np.stack([b, d], 1)], 1)
        values = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2)
        columns = np.repeat(self.faces, 2, axis=0)
        places = np.repeat(rows, 3), columns.ravel()
        self._gradient = sparse.csr_array((values.ravel(), places), (len(rows), mesh.n_vertices))
        self._own = self._gradient[:, self._moving]

    def edges(self, folds: Folds) -> tuple[BoolArray, IntArray]:
        """Return which edges are between two of the triangles, and their numbers there (e, 2)."""
        number = np.full(len(folds.faces), -1)
        number[self.triangles] = np.arange(len(self.triangles))
        sides = number[folds.sides]
        inside = np.asarray((sides >= 0).all(axis=1))
        return inside, sides[inside]

    def at(self, x: FloatArray) -> FloatArray:
        """Return J of each triangle in the pose *x* (n, 3), (m, 3, 2)."""
        return np.asarray(np.swapaxes((self._gradient @ x).reshape(-1, 2, 3), 1, 2))

    def fitted(self, x: FloatArray, wanted: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the pose *x* (n, 3) with gradients close to *wanted* (m, 3, 2); *weights* (m,)."""
        weighted = self._own.T * np.repeat(self._areas * weights, 2)
        off = np.swapaxes(wanted - self.at(x), 1, 2).reshape(-1, 3)
        x = x.copy()
        normal = weighted @ self._own
        # A vertex of flat triangles only is in no equation, and stays.
        stay = _STAY * float(normal.diagonal().mean()) + _TINY
        normal = normal + stay * sparse.eye_array(len(self._moving))
        x[self._moving] += splu(normal.tocsc()).solve(np.asarray(weighted @ off))
        return x


def around(mesh: Mesh, some: IntArray | BoolArray, rings: int) -> BoolArray:
    """Return the vertices within so many *rings* around the faces *some*, (n,) bool."""
    near = np.zeros(mesh.n_vertices, dtype=bool)
    near[mesh.faces[some]] = True
    for _ in range(rings):
        near |= mesh.adjacency @ near.astype(float) > 0.0
    return near
