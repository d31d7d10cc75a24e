"""The stretch energy over all vertices, with a rotation for the cell of triangles around each.

    E(x) = min_R  sum_i sum_T c_iT A_T |J_T - R_i|^2,      sum_i c_iT = 1 for each triangle T

J_T is the gradient over triangle T of the map from rest to x.  With c_iT = 1/3 at the corners of T
this is the stretch of `energy`, as rigid as possible with spokes and rims.  Here a share t of the
triangles at a vertex also counts for its neighbours: c = P c_0 with

    P_ij = (1 - t_j) delta_ij + t_j / degree(j)  if j is a neighbour of i

whose columns sum to 1.  The larger its cells, the more the energy resists bending: the only
resistance to bending of a triangle mesh is that rotations are shared.  So detail is preserved by
t, and the cost is that of one sparse product: the energy stays a minimum over the rotations, and its
quadratic part is the Laplacian, whatever t,

    E(x) = min_R  tr(x^T C x) - 2 sum_i tr(R_i S_i) + tr(X^T C X),     S = P K x,     X at rest

The bi-Laplacian of the detail (5), whose factor takes ten times as long, is not needed.

Source
------
O. Sorkine, M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007.  I. Chao, U. Pinkall,
P. Sanan, P. Schroeder, "A simple geometric model for elastic deformations", SIGGRAPH 2010.
Z. Levi, C. Gotsman, "Smooth rotation enhanced as-rigid-as-possible mesh animation", IEEE TVCG
21(2), 2015: rotations of neighbours compared with each other, which takes many more iterations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..arrays import FloatArray
from ..geometry import (
    IntrinsicTriangulation,
    area_gradients,
    closest_rotations,
    cotangent_laplacian,
)
from ..mesh import Mesh


@dataclass(frozen=True, eq=False)
class CellEnergy:
    """E(x) of a mesh; made by `CellEnergy.of`."""

    rest: FloatArray  # X, (n, 3)
    laplacian: sparse.csr_array  # C, (n, n)
    gradients: sparse.csr_array  # (3m, n): A_T J_T^T of every triangle, by rows
    corners: sparse.csr_array  # (n, m): c_0
    neighbours: sparse.csr_array  # (n, n): P - I for t = 1, but for its diagonal
    constant: float

    @classmethod
    def of(cls, mesh: Mesh) -> CellEnergy:
        """Return the energy of *mesh*; bad triangles count as those around them."""
        n = mesh.n_vertices
        surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
        faces, m = surface.faces, len(surface.faces)
        gradients = np.swapaxes(area_gradients(surface), 1, 2).ravel()  # by triangle, axis, corner
        columns = np.repeat(faces, 3, axis=0).ravel()
        each = sparse.csr_array((gradients, columns, np.arange(0, 9 * m + 1, 3)), (3 * m, n))
        thirds = np.full(3 * m, 1.0 / 3.0), faces.ravel(), np.arange(0, 3 * m + 1, 3)
        laplacian = cotangent_laplacian(faces, surface.cotangents, n)
        relative = mesh.vertices - mesh.vertices.mean(axis=0)
        return cls(
            rest=mesh.vertices,
            laplacian=laplacian,
            gradients=each,
            corners=sparse.csc_array(thirds, (n, m)).tocsr(),
            neighbours=_neighbours(mesh),
            constant=float(np.vdot(relative, laplacian @ relative)),
        )

    def value_and_slope(
        self, x: FloatArray, shares: Sequence[FloatArray]
    ) -> tuple[float, FloatArray]:
        """Return E at *x* (n, 3), and half its gradient (n, 3).

        *shares* has t (n, 1) of each round in which the cells grow by their neighbours.
        """
        covariances = self.corners @ np.asarray(self.gradients @ x).reshape(-1, 9)
        for share in shares:
            covariances += self.neighbours @ (share * covariances) - share * covariances
        rotations = closest_rotations(covariances.reshape(-1, 3, 3))
        turned = np.swapaxes(rotations, 1, 2).reshape(-1, 9)
        product = self.laplacian @ x
        value = np.vdot(x, product) - 2.0 * np.vdot(turned, covariances) + self.constant
        for share in reversed(shares):
            turned = turned + share * (self.neighbours.T @ turned - turned)
        spread = self.corners.T @ turned
        return float(value), product - self.gradients.T @ spread.reshape(-1, 3)


def _neighbours(mesh: Mesh) -> sparse.csr_array:
    """Return 1 / degree(j) for each neighbour i of j, (n, n)."""
    graph = mesh.adjacency
    degree = np.diff(graph.indptr)
    return sparse.csr_array((1.0 / degree[graph.indices], graph.indices, graph.indptr), graph.shape)
