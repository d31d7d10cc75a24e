"""What a deformation should keep, as an energy of the cage vertices p: detail, and stretch.

    E(p) = min_R  sum_i A_i |delta_i(x) - R_i delta_i|^2              detail, eq. (5)
                + s sum_T (A_T / 3) sum_{i in T} |J_T - R_i|^2        stretch,      x = W~ p

delta_i(x) is the mean-curvature normal at x, delta_i that of the rest shape, R_i the local
rotation of vertex i (or of the group it belongs to), J_T the gradient over triangle T of the map
from rest to x.  The paper has the first line only, and lets its rows count alike; weighting by
the vertex area A_i makes the energy independent of how finely the surface is meshed.  The second
line is ours: with bending alone limbs swing freely and triangles shear (area-weighted
distortion 0.16 on a 70 degree bend against 0.09).  It measures each triangle against the
rotations of its three corners ("spokes and rims"), which is never negative, however bad the
triangle; the edge form sum cot_ij |x_ij - R_i v_ij|^2 is not.

For given R the energy is quadratic.  Both lines see R through one 3 x 3 matrix per group:

    E(p) = min_R  tr(p^T Q p) - 2 sum_g tr(R_g S_g) + c,        S_g = K_g p  (linear in p)

Q (m, m) and K (3 G, m) are computed once, so a step costs nothing that grows with the mesh; of
a large mesh few vertices are asked for them (`cubature`).

Source
------
Eqs. (5), (10), (20) of the paper.  I. Chao, U. Pinkall, P. Sanan, P. Schroeder, "A simple
geometric model for elastic deformations", SIGGRAPH 2010 (spokes and rims).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray, is_number
from ..errors import ArgumentError
from ..geometry import IntrinsicTriangulation, closest_rotations
from ..mesh import Mesh
from ..progress import Progress, tell
from ..subspace import Subspace
from .cubature import Sample
from .grams import grams
from .operators import surface_operators

# A density above 300 times its 90th percentile by area is an outlier; on good meshes the maximum is
# 2 to 80 times that percentile.
_USUAL, _OUTLIER = 0.9, 300.0


@dataclass(frozen=True, eq=False)
class Energy:
    """E(p) in the subspace; made by `shape_energy`.

    `fit` and `pull` are K in two roles: what the rotations are fitted to, and what they pull on.
    With a stretch term the two are the same and E is a true minimum over R (`exact`).  Without
    one the rotations still come from the one-ring, as the paper's frames do, and only the detail
    is pulled.
    """

    quadratic: FloatArray  # Q, (m, m)
    constant: float
    scale: float  # trace of `quadratic`, without outliers
    mass: FloatArray  # W~^T diag(A) W~, (m, m), A summing to 1: mean square over the surface
    fit: sparse.csr_array | FloatArray  # (3n, n) acting on x, or (3G, m) acting on p
    pull: sparse.csr_array | FloatArray
    subspace: Subspace

    @property
    def exact(self) -> bool:
        """Whether E is a minimum over the rotations, so that its gradient is the one returned."""
        return self.fit is self.pull

    @property
    def turns_vertices(self) -> bool:
        """Whether every vertex has its own rotation, taken from x; groups take theirs from p."""
        return sparse.issparse(self.fit)

    def covariances(self, p: FloatArray) -> FloatArray:
        """Return S_g = K_g p of every group, (G, 3, 3)."""
        return self._covariances(p, self.subspace.map(p) if self.turns_vertices else p)

    def _covariances(self, p: FloatArray, x: FloatArray) -> FloatArray:
        stacked = self.fit @ x if self.turns_vertices else self._fitted.map(p)
        return np.asarray(stacked).reshape(-1, 3, 3)

    def fitted_rows(self, count: int) -> Iterator[tuple[IntArray, list[slice], FloatArray]]:
        """Yield K, what rotations are fitted to as rows on p, some *count* groups at a time.

        As (groups, columns, rows): these groups (g,), the cages whose vertices reach them, c
        vertices in all, and (g, 3, c).
        """
        if not sparse.issparse(self.fit):
            yield from self._reached
            return
        every = [slice(0, self.subspace.n_columns)]
        for start in range(0, self.fit.shape[0] // 3, count):
            rows = self.subspace.left(self.fit[3 * start : 3 * (start + count)])
            groups = np.arange(start, start + len(rows) // 3)
            yield groups, every, rows.reshape(len(groups), 3, -1)

    @cached_property
    def _reached(self) -> list[tuple[IntArray, list[slice], FloatArray]]:
        """K without its zeros: the groups that the same cages reach, together."""
        blocks = []
        for ids in self._fitted.reached_alike():
            columns, rows = self._fitted.reaching(ids)
            cages = [own for own in self.subspace.columns if own.start in columns]
            if cages:
                blocks.append((ids[::3] // 3, cages, rows.reshape(-1, 3, len(columns))))
        return blocks

    @cached_property
    def _fitted(self) -> Subspace:
        return _by_cages(np.asarray(self.fit), self.subspace.columns)

    @cached_property
    def _pulling(self) -> Subspace:
        return (
            self._fitted if self.exact else _by_cages(np.asarray(self.pull), self.subspace.columns)
        )

    def local_step(self, p: FloatArray, x: FloatArray) -> tuple[float, FloatArray]:
        """Return E(p) and half its gradient (m, 3), with the local rotations at x = W~ p."""
        pulled = self.pulled(p, x)
        return self.settled(p, self.subspace.adjoint(pulled) if self.turns_vertices else pulled)

    def pulled(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """Return K^T R for the local rotations at x = W~ p: on the cages (m, 3).

        Where every vertex turns it is on the vertices (n, 3), and W~^T is left to the caller.
        """
        rotations = closest_rotations(self._covariances(p, x))
        turned = np.swapaxes(rotations, 1, 2).reshape(-1, 3)
        return self.pull.T @ turned if self.turns_vertices else self._pulling.adjoint(turned)

    def settled(self, p: FloatArray, pulled: FloatArray) -> tuple[float, FloatArray]:
        """Return E(p) and half its gradient (m, 3), for the rotations' *pulled* on the cages."""
        product = self.quadratic @ p
        value = np.vdot(p, product) - 2.0 * np.vdot(p, pulled) + self.constant
        return float(value), product - pulled


def _by_cages(k: FloatArray, cages: Sequence[slice]) -> Subspace:
    """Return K (3G, m) in blocks as W~ is: for each cage, the groups that it reaches."""
    rows, blocks = [], []
    for own in cages:
        reached = k[:, own].reshape(-1, 3, own.stop - own.start).any(axis=(1, 2))
        rows.append(np.flatnonzero(np.repeat(reached, 3)))
        blocks.append(k[rows[-1], own])
    return Subspace(len(k), tuple(rows), tuple(blocks))


def shape_energy(
    mesh: Mesh,
    subspace: Subspace,
    stretch: float,
    groups: IntArray | None,
    *,
    progress: Progress | None = None,
) -> Energy:
    """Return the energy of *mesh*, whose size should be about 1, in *subspace*.

    Parameters
    ----------
    mesh : Mesh
        The rest shape.
    subspace : Subspace
        W~.
    stretch : float
        Trace of the stretch term in the subspace, as a multiple of that of the detail term.
    groups : (n,) int or None
        The rotation group of each vertex; None gives each vertex its own rotation.
    progress : callable, optional
        Called with the fraction done and what is going on; may raise `Cancelled`.
    """
    if not is_number(stretch, 0.0):
        raise ArgumentError(f"stretch must be a number, 0 or more; got {stretch!r}")
    tell(progress, 0.0, "asking vertices")
    surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
    rows, near, counts = subspace, groups, None
    if groups is not None and (sample := Sample.of(surface, groups)):
        surface, counts = sample.surface, sample.counts
        rows, near = sample.rows(subspace), groups[sample.ids]
    own = np.arange(mesh.n_vertices) if near is None else near
    shape = surface_operators(surface, own, counts)
    tell(progress, 0.5, "summing up their energy")
    areas = shape.counts * shape.areas
    bending, stretching, mass, traces = grams(
        rows,
        shape.laplacian,
        0.25 * shape.counts / shape.areas,
        areas / areas.sum(),
        stiffness=shape.stiffness,
        near=near,
    )
    tell(progress, 0.9, "factoring")
    scale = _without_outliers(traces, areas)
    unit = scale / np.trace(stretching)
    pull = shape.detail + (stretch * unit) * shape.fans
    fit = pull if stretch > 0.0 else shape.detail + unit * shape.fans
    if groups is not None:
        fit, pull = (
            (reduced := rows.left(pull), reduced)
            if fit is pull
            else (rows.left(fit), rows.left(pull))
        )
    curved = float(areas @ (shape.delta**2).sum(axis=1))
    flat = float(np.vdot(surface.vertices, shape.stiffness @ surface.vertices))  # twice the area
    return Energy(
        quadratic=bending + stretch * unit * stretching,
        constant=curved + stretch * unit * flat,
        scale=(1.0 + stretch) * scale,
        mass=mass,
        fit=fit,
        pull=pull,
        subspace=subspace,
    )


def _without_outliers(traces: FloatArray, areas: FloatArray) -> float:
    """Return the sum of *traces* (n,), clipped where their density over *areas* (n,) is an outlier.

    The sum scales the weights of the method.  Unclipped, it is not robust: a needle's density can
    be a million times the maximum of a good mesh.
    """
    asked = areas > 0.0
    traces, areas = traces[asked], areas[asked]
    density = traces / areas
    order = np.argsort(density)
    covered = np.cumsum(areas[order])
    usual = density[order[np.searchsorted(covered, _USUAL * covered[-1])]]
    return float(areas @ np.minimum(density, _OUTLIER * usual))
