"""The shape energy as a function of the cage vertices p: detail, stretch, stiffness of the cages.

    E(p) = min_R  sum_i A_i |delta_i(x) - R_i delta_i|^2              detail, eq. (5)
                + s sum_T (A_T / 3) sum_{i in T} |J_T - R_i|^2        stretch,      x = W~ p

delta_i(x) is the mean-curvature normal at x, delta_i that of the rest shape, R_i the local
rotation of vertex i (or of its rotation cluster), J_T the gradient over triangle T of the map
from rest to x.  The paper has the first term only, and weights all its rows alike; weighting by
the vertex area A_i makes the energy independent of how finely the surface is meshed.  The second
term is ours: with bending alone limbs are almost unconstrained and triangles shear.  It compares
each triangle with the rotations of its three corners ("spokes and rims"), which is never negative,
however bad the triangle; the edge form sum cot_ij |x_ij - R_i v_ij|^2 is not.

For given R the energy is quadratic.  Both terms depend on R through one 3 x 3 matrix per cluster:

    E(p) = min_R  tr(p^T Q p) - 2 sum_g tr(R_g S_g) + c,        S_g = K_g p  (linear in p)

Q (m, m) and K (3 G, m) are computed once, so the cost of a step does not depend on the size of the
mesh; those of a large mesh are computed from a weighted sample of its vertices (`cubature`).

*Borders.*  The sum of the detail goes over inner vertices only (`geometry.inner_vertices`), the
natural boundary condition; the stretch and its rotations go over all.  With one-sided rows at the
borders instead, the energy of a stretched plate would grow like 1 / edge.

*Stiffness of the cages.*  The mesh hardly depends on a cage vertex far from it, so the shape energy
leaves it almost free, and the solver takes many steps to find where it goes, which may be far away.
A third term keeps it near the mesh: the change of every cage edge but for rotation,

    e sum_a sum_{b ~ a}  1/2 sum_g omega_ag |(p_a - p_b) - R_g (q_a - q_b)|^2,    q the rest cages,

with the rotations of the mesh nearby: omega_ag is the share of cluster g in the motion of cage
vertex a, sum_{i in g} W~_ia^2 over the same sum of all i.  So it needs no rotations of its own and
only adds to Q, K and c; a step costs as much as without it.  The paper has no such term.

Source
------
Eqs. (5), (10), (20) of the paper.  I. Chao, U. Pinkall, P. Sanan, P. Schroeder, "A simple
geometric model for elastic deformations", SIGGRAPH 2010 (spokes and rims).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray, is_number
from ..errors import ArgumentError
from ..freezing import Frozen
from ..geometry import IntrinsicTriangulation, closest_rotations, inner_vertices
from ..mesh import Mesh
from ..progress import Progress, tell
from ..subspace import Subspace
from .cubature import Sample
from .operators import SurfaceOperators, reduced_operators, surface_operators

_CAGE_STIFFNESS = 3e-4  # e by traces, as a share of the shape energy: the distortion rises by 1 %


@dataclass(frozen=True, eq=False, repr=False)
class Energy(Frozen):
    """E(p) in the subspace; made by `shape_energy`."""

    quadratic: FloatArray  # Q, (m, m)
    constant: float
    scale: float  # trace of `quadratic`
    mass: FloatArray  # W~^T diag(A) W~, (m, m), A summing to 1: mean square over the surface
    rotation_operator: FloatArray  # K, (3G, m)
    subspace: Subspace

    def covariances(self, p: FloatArray) -> FloatArray:
        """Return S_g = K_g p of every cluster, (G, 3, 3)."""
        return self._blocks.map(p).reshape(-1, 3, 3)

    @cached_property
    def nonzero_rows(self) -> list[tuple[IntArray, IntArray, FloatArray]]:
        """K without its zeros: clusters that the same cages move, together.

        As (clusters, columns, rows): the clusters (g,), the cage vertices (c,) that move them, and
        the rows (g, 3, c).
        """
        blocks = []
        for ids in self._blocks.sets_by_cages():
            columns, rows = self._blocks.nonzeros(ids)
            if len(columns):
                blocks.append((ids[::3] // 3, columns, rows.reshape(-1, 3, len(columns))))
        return blocks

    def vertex_rotations(self, p: FloatArray) -> FloatArray:
        """Return how the surface has rotated near each vertex since rest, (n, 3, 3).

        The rotations of clusters are blended: first those that move a cage vertex, by their squared
        rows of K, then those of the cage vertices by W~.  So they vary as smoothly as x.
        """
        return self.rotations_at(self.subspace, p)

    def rotations_at(self, points: Subspace, p: FloatArray) -> FloatArray:
        """Return the same at other *points*, by their W~."""
        rotations = closest_rotations(self.covariances(p))
        of_cages = self._shares.T @ rotations.reshape(-1, 9)
        blended = points.map(of_cages).reshape(-1, 3, 3)
        return closest_rotations(np.swapaxes(blended, 1, 2))

    @cached_property
    def _shares(self) -> FloatArray:
        """The share of each cluster in the rotation of a cage vertex, (G, m)."""
        k = self.rotation_operator
        shares = (k * k).reshape(len(k) // 3, 3, -1).sum(axis=1)
        shares /= np.maximum(shares.sum(axis=0), np.finfo(float).tiny)
        return np.asarray(shares)

    @cached_property
    def _blocks(self) -> Subspace:
        return _blocks_by_cage(self.rotation_operator, self.subspace.columns)

    def value_and_slope(self, p: FloatArray) -> tuple[float, FloatArray]:
        """Return E(p) and half its gradient (m, 3), with the local rotations at *p*."""
        rotations = closest_rotations(self.covariances(p))
        load = self._blocks.adjoint(np.swapaxes(rotations, 1, 2).reshape(-1, 3))  # K^T R
        product = self.quadratic @ p
        value = np.vdot(p, product) - 2.0 * np.vdot(p, load) + self.constant
        return float(value), product - load


def _blocks_by_cage(k: FloatArray, cages: Sequence[slice]) -> Subspace:
    """Return K (3G, m) in blocks like those of W~: for each cage, the clusters that it moves."""
    rows, blocks = [], []
    for own in cages:
        reached = k[:, own].reshape(-1, 3, own.stop - own.start).any(axis=(1, 2))
        rows.append(np.flatnonzero(np.repeat(reached, 3)))
        blocks.append(k[rows[-1], own])
    return Subspace(len(k), tuple(rows), tuple(blocks))


class SampledOperators(NamedTuple):
    """The operators of a mesh, or of a sample of its vertices, k in all."""

    operators: SurfaceOperators
    surface: IntrinsicTriangulation
    rows: Subspace  # W~, (k, m)
    clusters: IntArray  # (k,)
    sample: Sample | None


def sampled_operators(
    mesh: Mesh, subspace: Subspace, clusters: IntArray, stiffness: FloatArray | None
) -> SampledOperators:
    """Return the operators of `shape_energy`."""
    inner = inner_vertices(mesh)
    if not (sample := Sample.of(mesh, clusters)):
        surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
        operators = surface_operators(surface, clusters, stiffness, inner=inner)
        return SampledOperators(operators, surface, subspace, clusters, None)
    ids, own, factors = sample.ids, clusters[sample.ids], sample.weights
    if stiffness is not None:
        factors = stiffness[ids] * factors
    operators = surface_operators(sample.surface, own, factors, inner=inner[ids])
    return SampledOperators(operators, sample.surface, sample.rows(subspace), own, sample)


def shape_energy(
    mesh: Mesh,
    subspace: Subspace,
    stretch: float,
    clusters: IntArray,
    *,
    stiffness: FloatArray | None = None,
    progress: Progress | None = None,
) -> Energy:
    """Return the detail and stretch of *mesh*, whose size should be about 1, in *subspace*.

    Parameters
    ----------
    mesh : Mesh
        The rest shape.
    subspace : Subspace
        W~.
    stretch : float
        Trace of the stretch term in the subspace, as a multiple of that of the detail term.
    clusters : (n,) int
        The rotation cluster of each vertex.
    stiffness : (n,) float, optional
        Factors of the terms of each vertex; by default 1.
    progress : Progress, optional
        Called between the steps; may cancel.
    """
    if not is_number(stretch, 0.0):
        raise ArgumentError(f"stretch must be a number, 0 or more; got {stretch!r}")
    tell(progress, 0.0, "sampling vertices")
    shape, surface, rows, own, sample = sampled_operators(mesh, subspace, clusters, stiffness)
    tell(progress, 0.5, "computing the energy")
    areas = shape.areas if sample is None else sample.weights * shape.areas
    bending, stretching, mass = reduced_operators(
        rows,
        shape.laplacian,
        0.25 * shape.bends / shape.areas,
        areas / areas.sum(),
        stiffness=shape.stiffness,
        clusters=own,
    )
    tell(progress, 0.9, "factoring")
    scale = float(np.trace(bending))
    unit = scale / np.trace(stretching)
    bent = float((shape.bends * shape.areas) @ (shape.delta**2).sum(axis=1))
    flat = float(np.vdot(surface.vertices, shape.stiffness @ surface.vertices))  # twice the area
    return Energy(
        quadratic=bending + stretch * unit * stretching,
        constant=bent + stretch * unit * flat,
        scale=(1.0 + stretch) * scale,
        mass=mass,
        rotation_operator=rows.premultiplied(shape.detail + (stretch * unit) * shape.fans),
        subspace=subspace,
    )


def with_cage_stiffness(
    energy: Energy,
    rest: FloatArray,
    faces: Sequence[IntArray],
    clusters: IntArray,
) -> Energy:
    """Return *energy* plus the stiffness of the cages.

    Parameters
    ----------
    energy : Energy
        Of the surface.
    rest : (m, 3) float
        The cage vertices at rest, stacked.
    faces : sequence of (f_r, 3) int
        The faces of each cage.
    clusters : (n,) int
        The rotation cluster of each vertex.
    """
    tail, head = _cage_edges(energy, faces)
    offset = rest[tail] - rest[head]
    m = len(rest)
    laplacian = np.zeros((m, m))
    np.add.at(laplacian, (tail, tail), 1.0)
    np.add.at(laplacian, (tail, head), -1.0)
    strength = _CAGE_STIFFNESS * energy.scale / np.trace(laplacian)

    omega = energy.subspace.sums_of_squares(clusters)  # (G, m)
    omega /= np.maximum(omega.sum(axis=0), np.finfo(float).tiny)
    rows = np.empty((len(omega), 3, m))
    ends = np.concatenate([tail, tail]), np.concatenate([tail, head])
    for axis in range(3):
        half = 0.5 * offset[:, axis]  # row a: half of sum_b (q_a - q_b) (p_a - p_b), along the axis
        by_tail = sparse.coo_array((np.concatenate([half, -half]), ends), (m, m)).tocsr()
        rows[:, axis] = (by_tail.T @ omega.T).T
    return replace(
        energy,
        quadratic=energy.quadratic + strength * laplacian,
        constant=energy.constant + 0.5 * strength * float(np.vdot(offset, offset)),
        rotation_operator=energy.rotation_operator + strength * rows.reshape(-1, m),
    )


def with_rotating_rows(
    energy: Energy, rows: FloatArray, offsets: FloatArray, weights: FloatArray
) -> Energy:
    """Return *energy* plus min_R sum_k w_k |rows_k p - R offsets_k|^2, one rotation R for the sum.

    Parameters
    ----------
    energy : Energy
        Of the surface.
    rows : (k, m) float
        Differences of points of the surface, in p.
    offsets : (k, 3) float
        The same at rest; of at least rank 2, so that they determine R.
    weights : (k,) float
        w.
    """
    return replace(
        energy,
        quadratic=energy.quadratic + (rows.T * weights) @ rows,
        constant=energy.constant + float(weights @ (offsets**2).sum(axis=1)),
        rotation_operator=np.concatenate([energy.rotation_operator, (offsets.T * weights) @ rows]),
    )


def _cage_edges(energy: Energy, faces: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Return both ends of every cage edge among all m cage vertices, in both directions."""
    # A closed cage has each edge once in each direction.
    directed = [
        columns.start + triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        for columns, triangles in zip(energy.subspace.columns, faces, strict=True)
    ]
    tail, head = np.concatenate(directed).T
    return tail, head
