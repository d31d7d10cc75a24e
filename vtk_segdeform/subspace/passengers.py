"""Passengers: other points that a deformation moves, such as a lattice, a grid or a point cloud.

A mesh vertex is a blend of its positions in the cages of its regions, eqs. (2), (3).  So is any
other point q,

    x(q) = sum_r  alpha_r(q)  sum_j w_j(q; r) p_j(r)

with its mean value coordinates w in each cage.  The blend weights alpha of q are interpolated from
the nearest mesh vertices i, those nearer than the K-th,

    alpha_r(q) = sum_i s_i alpha_ri / sum_i s_i,      s_i = ((d_K - d_i) / (d_K d_i))^2

so that alpha is continuous and non-negative, sums to 1, and at a mesh vertex is the mesh's own.
Hence passengers at mesh vertices stay on the mesh, an affine map of all cages is an affine map of
all passengers, and passengers in an overlap follow all its regions.

The exact volume is reached by moving cages, so passengers follow that motion as well.

Source
------
R. Franke, G. Nielson, "Smooth interpolation of large sets of scattered data", Int. J. Numer.
Methods Eng. 15(11), 1980: the weights s, Shepard's made local.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..arrays import FloatArray, as_numbers, as_points
from ..cages import FARTHEST_POINT, Cage, mean_value_coordinates
from ..checks import all_of, require_sequence
from ..errors import ArgumentError, CageError
from ..freezing import Frozen, read_only
from ..mesh import Mesh, require_mesh
from ..progress import Progress, part
from .subspace import Subspace


@dataclass(frozen=True, eq=False, repr=False)
class Passengers(Frozen):
    """k points bound to the cages; made by `bind_passengers` or `Deformer.passengers`."""

    points: FloatArray
    """(k, 3) float: the points at rest."""
    subspace: Subspace
    """W~ of the points: x = W~ p."""

    def moved(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return the points (k, 3) moved by cages at *cage_vertices*, (m_r, 3) each.

        These are `Solution.cage_vertices` or `Session.cage_vertices`.

        Raises
        ------
        CageError
            If *cage_vertices* do not fit the cages that the points are bound to.
        """
        require_sequence(cage_vertices, "cage_vertices")
        poses = [as_points(vertices, "cage_vertices") for vertices in cage_vertices]
        expected, got = [b.shape[1] for b in self.subspace.blocks], [len(p) for p in poses]
        if got != expected:
            raise CageError(
                f"cage_vertices must contain {expected} points, cage by cage; got {got}"
            )
        p = np.concatenate(poses)
        centre = p.mean(axis=0)  # moved about it, no digits are lost far from the origin
        return np.asarray(centre + self.subspace.map(p - centre))


def bind_passengers(
    mesh: Mesh,
    weights: FloatArray,
    cages: Sequence[Cage],
    points: ArrayLike,
    *,
    progress: Progress | None = None,
) -> Passengers:
    """Bind *points* to the cages of a mesh.

    Parameters
    ----------
    mesh : Mesh
        n vertices, at rest.
    weights : (r, n) float
        The blend weights of its regions; columns sum to 1.
    cages : sequence of r Cage
        At rest.
    points : (k, 3) float
        The passengers at rest; inside the body, on it, or not far from it.
    progress : Progress, optional
        Called as the coordinates in each cage are computed; may raise `Cancelled`.
    """
    require_mesh(mesh)
    cages = all_of(cages, Cage, "cages")
    points = read_only(as_points(points, "points").copy())
    weights = as_numbers(weights, "weights")
    if weights.shape != (len(cages), mesh.n_vertices):
        expected = len(cages), mesh.n_vertices
        raise ArgumentError(
            f"weights must have shape {expected}, a row for each of the cages; got {weights.shape}"
        )
    alpha = blend_at(mesh.vertices, weights, points)
    rows, blocks = [], []
    for r, cage in enumerate(cages):
        share = part(progress, r / len(cages), (r + 1) / len(cages))
        members = np.flatnonzero(alpha[r] > 0.0)
        block = mean_value_coordinates(points[members], cage.vertices, cage.faces, progress=share)
        rows.append(members)
        blocks.append(block * alpha[r, members][:, None])
    return Passengers(points, Subspace(len(points), tuple(rows), tuple(blocks)))


def blend_at(vertices: FloatArray, weights: FloatArray, points: FloatArray) -> FloatArray:
    """Interpolate blend *weights* (r, n) of *vertices* (n, 3) at *points* (k, 3): (r, k)."""
    vertices, points = as_points(vertices, "vertices"), as_points(points, "points")
    weights = as_numbers(weights, "weights")
    if not len(vertices) or weights.ndim != 2 or weights.shape[1] != len(vertices):
        raise ArgumentError(
            f"weights must have shape (r, {len(vertices)}), a column for each vertex; "
            f"got {weights.shape}"
        )
    size = np.ptp(vertices, axis=0).max()
    if np.abs(points - vertices[0]).max(initial=0.0) > FARTHEST_POINT * size:
        raise ArgumentError(f"points are more than {FARTHEST_POINT:.0e} sizes of the mesh away")
    count = min(24, len(vertices))  # K
    distance, near = map(np.asarray, cKDTree(vertices).query(points, k=np.arange(1, count + 1)))
    farthest = distance[:, -1:]
    on_vertex = distance[:, 0] <= 1e-12 * farthest[:, 0]
    distance = np.maximum(distance, np.maximum(1e-12 * farthest, np.finfo(float).tiny))
    strength = ((farthest - distance) / (farthest * distance)) ** 2
    strength[on_vertex] = 0.0
    strength[on_vertex, 0] = 1.0
    level = strength.max(axis=1) <= 0.0  # equally far vertices
    strength[level] = 1.0
    strength /= strength.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("rks,ks->rk", weights[:, near], strength))
