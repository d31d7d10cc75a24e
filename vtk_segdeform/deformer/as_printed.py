"""The paper as printed, line by line, for comparison with what `Deformer` makes of it.

    min |A W~ p - b|^2   subject to   g(W~ p) = 0                                       (20)

    A x = b    three kinds of rows, all of the same weight, with x = W~ p:
               1 / (4 A_i) sum_j (cot alpha_ij + cot beta_ij) (x_i - x_j) = R_i delta_i  (5)
               x_i = u_i at fixed vertices                                               (6)
               x_i = u_i at handles                                                      (7)
    g(x)       V(x) - V_0                                                                (9)
    W~         mean value coordinates in each cage, blended                         (2)-(4)

Every step replaces f(x) = A x - b(x) and g(x) by their tangents (10)-(12), with J_f = A - J_b
approximated by A (14), so that the matrix is constant and factored once:

    h      = -(W~^T A^T A W~)^-1 (W~^T A^T f + W~^T J_g^T lambda)                       (21)
    lambda = (J_g W~ (W~^T A^T A W~)^-1 W~^T J_g^T)^-1
             (g - J_g W~ (W~^T A^T A W~)^-1 W~^T A^T f)
    p      = p + epsilon h, epsilon constant                                   (section 3.3)

The paper prints a minus sign before its lambda; then J_g W~ h = -g, which (12) requires, would not
hold.  Where the paper is silent, this file is simple:

- *R_i*, by which the detail turns (J_b is its derivative): the rotation that is closest to the
  motion of the edges at vertex i, with their cotangents as weights.
- *Units.*  Rows (5) are curvatures and rows (6), (7) lengths, so their balance depends on the unit
  of the mesh.
- *The end.*  A step that moves no vertex by more than a tolerance.

Source
------
K. Doba, H. Masuda, "Rapid Mesh Deformation with Non-linear Constraints Using Segmentation".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, sparse

from ..arrays import FloatArray, IntArray, is_number, is_whole
from ..cages import Cage, mean_value_coordinates
from ..checks import require, require_sequence, shown
from ..errors import ArgumentError, CageError, ConstraintError, MeshError
from ..geometry import (
    IntrinsicTriangulation,
    closest_rotations,
    cotangent_laplacian,
    mixed_voronoi_areas,
    signed_volume,
    volume_gradient,
)
from ..mesh import Mesh, require_mesh
from ..regions import CageSurface, Regions, cage_distance_weights, require_regions
from .arguments import checked_constraints, checked_targets


@dataclass(frozen=True, eq=False)
class PaperSolution:
    """Where the iteration of the paper ended.

    Attributes
    ----------
    vertices : (n, 3) float
        x.
    cage_vertices : tuple of (m_r, 3) float
        p, cage by cage.
    steps : int
        Number of steps (21).
    volume_change : float
        g(x) / V_0.
    step_lengths : (steps,) float
        The largest motion of a vertex in each step, in diagonals of the mesh.
    """

    vertices: FloatArray
    cage_vertices: tuple[FloatArray, ...]
    steps: int
    volume_change: float
    step_lengths: FloatArray


class PaperDeformer:
    """The paper's method bound to a mesh, made by `Deformer.as_printed`.

    A solve continues from the last one; `reset` returns to rest.

    Parameters
    ----------
    mesh : Mesh
        n vertices; a closed two-manifold.
    regions : Regions
        r overlapping regions of *mesh*.
    cages : sequence of r Cage or Mesh
        Closed surfaces, such as those of `cages.scaled_cages`.
    fixed, handle : (k,) int or (n,) bool
        Vertices that stay in place, and vertices that follow the targets.

    Raises
    ------
    MeshError
        If the mesh is no closed two-manifold.
    ConstraintError
        If *fixed* or *handle* is no set of vertices of the mesh, they share a vertex, or both are
        empty.
    RegionError
        If *regions* belong to another mesh, or there is not one cage for each.
    CageError
        If the cages move the mesh too little: (21) cannot be factored.
    """

    def __init__(
        self,
        mesh: Mesh,
        regions: Regions,
        cages: Sequence[Cage | Mesh],
        *,
        fixed: ArrayLike,
        handle: ArrayLike,
    ) -> None:
        require_mesh(mesh)
        require_regions(regions, mesh)
        if not mesh.is_two_manifold:
            raise MeshError("the volume (8) of the paper requires a closed two-manifold")
        require_sequence(cages, "cages")
        self.mesh, self.regions = mesh, regions
        self.cages: tuple[CageSurface, ...] = tuple(
            cage if isinstance(cage, Mesh) else require(cage, Cage, f"cages[{k}]")
            for k, cage in enumerate(cages)
        )
        self.fixed, self.handle = checked_constraints(mesh, fixed, handle)
        if not len(self.fixed) + len(self.handle):
            raise ConstraintError("the rows (5) require at least one fixed or handle vertex")
        v, n = mesh.vertices, mesh.n_vertices

        surface = IntrinsicTriangulation.of(v, mesh.faces)
        self.cotangents = cotangent_laplacian(surface.faces, surface.cotangents, n)
        detail = sparse.diags_array(0.5 / mixed_voronoi_areas(surface)) @ self.cotangents  # (5)
        places = sparse.eye_array(n).tocsr()[np.concatenate([self.fixed, self.handle])]  # (6), (7)
        self.A = sparse.vstack([detail, places]).tocsr()
        self.delta = detail @ v
        self.volume = signed_volume(v, mesh.faces)  # (8)
        self.W = blended_coordinates(regions, self.cages)

        reduced = self.A @ self.W
        try:
            self.factor = linalg.cho_factor((reduced.T @ reduced).toarray())
        except linalg.LinAlgError:
            raise CageError(
                "cage vertices have too little influence on the mesh: the matrix of (21) is not "
                "positive definite"
            ) from None
        self.reset()

    def reset(self) -> None:
        """Return to rest."""
        self.p = np.concatenate([cage.vertices for cage in self.cages])

    def solve(
        self,
        targets: ArrayLike,
        *,
        max_steps: int = 500,
        tolerance: float = 1e-4,
        epsilon: float = 1.0,
    ) -> PaperSolution:
        """Take steps (21) toward *targets*, from where the last solve ended.

        Parameters
        ----------
        targets : (k, 3) float
            Places of the handle vertices, in the order of `handle`.
        max_steps : int
            Most steps.
        tolerance : float
            The last step is the first that moves no vertex by more than this share of the mesh
            diagonal.
        epsilon : float
            Share of each step that is taken, section 3.3.

        Raises
        ------
        ConstraintError
            If *targets* do not fit the handle.
        ArgumentError
            If an option is out of its range.
        """
        if not is_whole(max_steps, 1):
            raise ArgumentError(
                f"max_steps must be a whole number, 1 or more; got {shown(max_steps)}"
            )
        for name, value in {"tolerance": tolerance, "epsilon": epsilon}.items():
            if not (is_number(value) and value > 0.0):
                raise ArgumentError(f"{name} must be a positive number; got {shown(value)}")
        u = np.concatenate(
            [self.mesh.vertices[self.fixed], checked_targets(targets, len(self.handle))]
        )
        x, lengths = self.W @ self.p, list[float]()
        while len(lengths) < max_steps:
            self.p = self.p + epsilon * self.step(x, u)
            x, before = self.W @ self.p, x
            lengths.append(_largest(x - before) / self.mesh.diagonal)
            if lengths[-1] <= tolerance:
                break
        ends = np.cumsum([len(cage.vertices) for cage in self.cages])[:-1]
        return PaperSolution(
            vertices=x,
            cage_vertices=tuple(np.split(self.p, ends)),
            steps=len(lengths),
            volume_change=self.g(x) / self.volume,
            step_lengths=np.array(lengths),
        )

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Return h (m, 3) of (21) at *x* = W~ p, for places *u* of fixed vertices and handles."""
        f = self.A @ x - self.b(x, u)
        slope = self.W.T @ (self.A.T @ f)  # W~^T A^T f
        rows = self.W.T @ volume_gradient(x, self.mesh.faces)  # W~^T J_g^T
        h, z = -self._solved(slope), self._solved(rows)
        multiplier = (self.g(x) + np.vdot(rows, h)) / np.vdot(rows, z)  # lambda
        return np.asarray(h - multiplier * z)

    def b(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Return the right side of A x = b at *x*: the turned detail (5), and *u* of (6), (7)."""
        turned = np.einsum("nij,nj->ni", self.rotations(x), self.delta)
        return np.concatenate([turned, u])

    def g(self, x: FloatArray) -> float:
        """Return V(x) - V_0, eq. (9)."""
        return signed_volume(x, self.mesh.faces) - self.volume

    def rotations(self, x: FloatArray) -> FloatArray:
        """Return how the surface at *x* has turned at each vertex since rest, (n, 3, 3)."""
        C, v = self.cotangents, self.mesh.vertices
        # S_i = sum_j w_ij (v_i - v_j) (x_i - x_j)^T by the product rule: C has w_ij beside its
        # diagonal, with a minus sign.
        products = (v[:, :, None] * x[:, None, :]).reshape(len(x), 9)
        S = v[:, :, None] * (C @ x)[:, None] + (C @ v)[:, :, None] * x[:, None]
        return closest_rotations(S - (C @ products).reshape(-1, 3, 3))

    def _solved(self, right: FloatArray) -> FloatArray:
        """Return (W~^T A^T A W~)^-1 *right*, (m, 3)."""
        return np.asarray(linalg.cho_solve(self.factor, right))


def blended_coordinates(regions: Regions, cages: Sequence[CageSurface]) -> sparse.csr_array:
    """Return W~ (n, m), figure 6: a block for each cage, blended where regions overlap."""
    alpha = cage_distance_weights(regions, cages)  # (4)
    blocks = []
    for r, cage in enumerate(cages):
        inside: IntArray = regions.members(r)
        w = mean_value_coordinates(regions.mesh.vertices[inside], cage.vertices, cage.faces)  # (2)
        block = sparse.csr_array(alpha[r, inside, None] * w)  # (3)
        rows = sparse.eye_array(regions.mesh.n_vertices).tocsc()[:, inside]
        blocks.append(rows @ block)
    return sparse.hstack(blocks).tocsr()


def _largest(vectors: FloatArray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())
