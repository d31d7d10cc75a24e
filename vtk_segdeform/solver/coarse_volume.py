"""Coarse volume: the volume of a large mesh over a coarse surface, for the steps of the solver.

A step needs the gradient of the volume in the cages, and the root of its cubic.  On a million
vertices these would take longer than the rest of the step.  So the vertices of a large mesh are
divided into a few thousand *cells* of neighbours.  A cell is one point, the mean of its vertices;
a triangle whose corners lie in three cells is one triangle.  Means of x = W~ p are means of rows
of W~ times p: the coarse surface moves with the same cages, at a cost that does not depend on the
mesh.  Merging vertices leaves a closed surface closed, so its volume is a cubic as well.

Its volume differs from the mesh's by some per cent, but their changes differ far less; and the last
operation of every solve moves the mesh itself onto its exact volume (`exact_volume`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..freezing import Frozen
from ..geometry import cluster_positions, decimated, faces_between, voronoi_cells
from ..mesh import Mesh
from ..progress import Progress
from ..subspace import Subspace
from .other_measures import AreaConstraint, CentroidConstraint
from .volume_constraints import VolumeConstraint
from .volumes import Together, Volumes

_SIDES = 0.1  # of the mesh's size: distance added between surfaces that face opposite ways


@dataclass(frozen=True, eq=False)
class CoarseVolume:
    """Cells of a mesh, and W~ of their means; made by `CoarseVolume.of`.

    Parameters
    ----------
    surface : Subspace
        W~ of the cells; of a small mesh, its own.
    cells : (n,) int or None
        The cell of each vertex; None for a small mesh.
    shares : (n,) float or None
        The weight of each vertex in the mean of its cell: its share of the area.  The mean by
        number of vertices would depend on how finely each part is meshed.  Of a large mesh, only
        the vertices of a decimated one have a share.
    """

    surface: Subspace
    cells: IntArray | None = None
    shares: FloatArray | None = None

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        subspace: Subspace,
        *,
        progress: Progress | None = None,
    ) -> CoarseVolume:
        """Return the coarse volume of a *mesh* at rest with W~ *subspace*.

        Of a small mesh it is the volume of the mesh itself.
        """
        n = mesh.n_vertices
        if n <= sizes.COARSE_VOLUME:
            return cls(subspace)
        rng = np.random.default_rng(0)
        areas = mesh.vertex_areas
        if n > sizes.DECIMATED:
            coarse, kept, cluster = decimated(mesh, sizes.DECIMATED_POINTS)
            _, cells = voronoi_cells(coarse, sizes.COARSE_VOLUME_POINTS, rng, progress)
            cells = cells[cluster]
            of_clusters = np.zeros(n)
            of_clusters[kept] = np.bincount(cluster, areas)
            areas = of_clusters
        else:
            _, cells = voronoi_cells(mesh, sizes.COARSE_VOLUME_POINTS, rng, progress)
        is_flat = np.bincount(cells, areas) == 0.0
        areas = np.where(is_flat[cells], 1.0, areas)
        shares = areas / np.bincount(cells, areas)[cells]
        return cls(_surface_of(subspace, cells, shares), cells, shares)

    def volumes(
        self, constraints: Sequence[VolumeConstraint], rest: FloatArray, unit: float = 1.0
    ) -> Volumes:
        """Return *constraints* on the mesh as constraints on the cages.

        Their targets are shares of the coarse volumes of *rest* (n, 3), which may be moved, and
        smaller by *unit*.
        """
        points = rest
        if self.cells is not None and self.shares is not None:
            constraints = _over_cells(constraints, self.cells)
            points = _matrix(self.cells, self.shares) @ rest
        preserved = Together(each.at_points(points, unit) for each in constraints)
        of_few = _VolumeHessian(self.surface, preserved, points)
        return Volumes(self.surface, preserved, of_few if of_few.curved else None)


@dataclass(frozen=True, eq=False, repr=False)
class _VolumeHessian(Frozen):
    """Second derivatives of volumes by the cages, from few points; called as `Volumes.hessian`."""

    surface: Subspace
    constraints: tuple[VolumeConstraint, ...]
    points: FloatArray  # (n, 3), the surface at rest

    def __call__(
        self, p: FloatArray, multipliers: FloatArray
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return G (3, m, m) at *p* (m, 3), and the rest of the Hessian, (3m, 3m)."""
        weights, whole, constraint_of = self._over_few_points
        x = weights @ p
        of_face, rest = multipliers[self.curved][constraint_of], None
        for k, number in enumerate(self.curved):
            constraint = self.constraints[number]
            if isinstance(constraint, CentroidConstraint) and multipliers[number]:
                own = constraint_of == k
                extended = weights if whole.extension is None else whole.extension @ weights
                rows: FloatArray = np.asarray(extended, dtype=np.float64)
                body = replace(constraint, faces=whole.faces[own])
                shares, more = body.second_derivatives(whole.extended(x), rows)
                of_face[own] *= shares
                rest = multipliers[number] * more + (0.0 if rest is None else rest)
        halves = whole.hessian_halves(x, of_face)
        half = (halves.astype(np.float32) @ weights).reshape(3, len(x), -1)
        reduced = weights.T @ half
        return np.asarray(reduced - np.swapaxes(reduced, 1, 2), dtype=np.float64), rest

    @cached_property
    def curved(self) -> list[int]:
        """The numbers of the volumes and centroids; H has no second derivatives of areas."""
        return [
            k for k, each in enumerate(self.constraints) if not isinstance(each, AreaConstraint)
        ]

    @cached_property
    def _over_few_points(self) -> tuple[NDArray[np.float32], VolumeConstraint, IntArray]:
        """W~ (k, m) of few points, in single precision, and the faces of all constraints over them.

        Also the constraint of each of these faces.
        Neighbours that face the same way are merged, so that thin parts keep both their sides.  Of
        several bodies all points are used: a mean over two bodies, with multipliers that differ by
        many orders of magnitude, made H indefinite, and a frame took 3 to 8 steps instead of 1.
        """
        n = len(self.points)
        cells, shares = np.arange(n), np.ones(n)
        volumes = [self.constraints[k] for k in self.curved]
        body = VolumeConstraint(volumes[0].faces, 0.0, volumes[0].extension)
        is_one = all(np.array_equal(each.faces, body.faces) for each in volumes)
        if n > sizes.VOLUME_HESSIAN_POINTS and is_one:
            outward = body.gradient(self.points)
            areas = np.linalg.norm(outward, axis=1) + np.finfo(float).tiny
            places = np.hstack([self.points, _SIDES * outward / areas[:, None]])
            cells = cluster_positions(places, sizes.VOLUME_HESSIAN_POINTS, rounds=3, seeded=False)
            shares = areas / np.bincount(cells, areas)[cells]
        weights = self.surface.premultiplied(_matrix(cells, shares)).astype(np.float32)
        few = _over_cells(volumes, cells)
        number = np.repeat(np.arange(len(few)), [len(each.faces) for each in few])
        faces = np.concatenate([each.faces for each in few])
        return weights, VolumeConstraint(faces, 0.0, few[0].extension), number


def _surface_of(subspace: Subspace, cells: IntArray, shares: FloatArray) -> Subspace:
    """Return W~ of the means of *cells*."""
    again = partial(_surface_of, subspace, cells, shares)
    return replace(subspace.averaged(_matrix(cells, shares)), again=again)


def _over_cells(
    constraints: Sequence[VolumeConstraint], cells: IntArray
) -> tuple[VolumeConstraint, ...]:
    """Return *constraints*, which share their points, over the cells; they share them again."""
    n, count, extension = len(cells), int(cells.max()) + 1, None
    if not constraints:
        return ()
    assert all(each.extension is constraints[0].extension for each in constraints)
    if (given := constraints[0].extension) is not None:
        member = sparse.csr_array((np.ones(n), cells, np.arange(n + 1)), (n, count))
        extension = sparse.csr_array(sparse.vstack([sparse.eye_array(count), given[n:] @ member]))
    added = 0 if given is None else given.shape[0] - n
    places = np.concatenate([cells, count + np.arange(added)])
    return tuple(
        replace(each, faces=faces_between(places, each.faces), extension=extension)
        for each in constraints
    )


def _matrix(cells: IntArray, shares: FloatArray) -> sparse.csr_array:
    """Return the matrix (k, n) from vertices to the means of their cells."""
    used = np.flatnonzero(shares) if (shares == 0.0).any() else np.arange(len(cells))
    shape = int(cells.max()) + 1, len(cells)
    return sparse.coo_array((shares[used], (cells[used], used)), shape).tocsr()
