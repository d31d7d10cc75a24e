"""The stretch energy over all vertices, with a rotation for the cell of triangles around each.

    E(x) = min_R  sum_i sum_T c_iT A_T |J_T - R_i|^2,      sum_i c_iT = 1 for each triangle T

J_T is the gradient over triangle T of the map from rest to x.  With c_iT = 1/3 at the corners of T
this is the stretch of `energy`, as rigid as possible with spokes and rims.  Here a share t of the
triangles at a vertex also counts for its neighbours: c = P c_0 with

    P_ij = (1 - t_j) delta_ij + t_j / degree(j)  if j is a neighbour of i

whose columns sum to 1.  The larger its cells, the more the energy resists bending: the only
resistance to bending of a triangle mesh is that rotations are shared.  So detail is preserved by
t, at the cost of one sparse product: the energy stays a minimum over the rotations, and its
quadratic part is the Laplacian, whatever t,

    E(x) = min_R  tr(x^T C x) - 2 sum_i tr(R_i S_i) + tr(X^T C X),     S = P K x,     X at rest

The bi-Laplacian of the detail (5), whose factor takes ten times as long, is not needed.  To E the
band of local volumes is added (`volume_band`).

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
from .volume_band import VolumeBand


@dataclass(frozen=True, eq=False)
class CellEnergy:
    """E(x) of a mesh, with its band; made by `CellEnergy.of`."""

    laplacian: sparse.csr_array  # C, (n, n)
    fans: sparse.csr_array  # K, (3n, n): S_i of c_0, the first rows of all i, then the second ...
    neighbours: sparse.csr_array  # (n, n): P for t = 1
    constant: float
    band: VolumeBand

    @classmethod
    def of(cls, mesh: Mesh) -> CellEnergy:
        """Return the energy of *mesh*, on its intrinsic triangulation."""
        n = mesh.n_vertices
        surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
        faces, starts = surface.faces, np.arange(0, surface.faces.size + 1, 3)
        thirds = np.full(faces.size, 1.0 / 3.0), faces.ravel(), starts
        corners = sparse.csc_array(thirds, (n, len(faces))).tocsr()
        gradients = area_gradients(surface)
        fans = [
            corners @ sparse.csr_array((along.ravel(), faces.ravel(), starts), (len(faces), n))
            for along in np.moveaxis(gradients, 2, 0)
        ]
        laplacian = cotangent_laplacian(faces, surface.cotangents, n)
        relative = mesh.vertices - mesh.vertices.mean(axis=0)
        constant = float(np.vdot(relative, laplacian @ relative))
        stacked = sparse.vstack(fans).tocsr()
        return cls(laplacian, stacked, _neighbours(mesh), constant, VolumeBand.of(mesh))

    def value_and_slope(
        self, x: FloatArray, shares: Sequence[FloatArray]
    ) -> tuple[float, FloatArray]:
        """Return E + V at *x* (n, 3), and half its gradient (n, 3).

        *shares* has t (n, 1) of each round in which the cells grow by their neighbours.
        """
        n = len(x)
        covariances = np.swapaxes((self.fans @ x).reshape(3, n, 3), 0, 1).reshape(n, 9)
        for share in shares:
            covariances += self.neighbours @ (share * covariances) - share * covariances
        rotations = closest_rotations(covariances.reshape(n, 3, 3))
        turned = np.swapaxes(rotations, 1, 2).reshape(n, 9)
        product = self.laplacian @ x
        value = np.vdot(x, product) - 2.0 * np.vdot(turned, covariances) + self.constant
        for share in reversed(shares):
            turned = turned + share * (self.neighbours.T @ turned - turned)
        load = self.fans.T @ np.swapaxes(turned.reshape(n, 3, 3), 0, 1).reshape(3 * n, 3)
        beyond, slope = self.band.value_and_slope(x)
        return float(value) + beyond, product - load + slope


def _neighbours(mesh: Mesh) -> sparse.csr_array:
    """Return 1 / degree(j) for each neighbour i of j, (n, n)."""
    graph = mesh.adjacency
    degree = np.diff(graph.indptr)
    return sparse.csr_array((1.0 / degree[graph.indices], graph.indices, graph.indptr), graph.shape)
