"""A coarse stand-in for a large surface, over which the solver's steps take the volume.

A step asks how the volume changes with the cages, and lands where it has not changed.  Over a
million vertices that would take longer than all the rest of it.  So a large mesh is cut into a few
thousand *cells* of neighbouring vertices; each counts as one point, the mean of its vertices, and
each triangle whose corners lie in three cells as one triangle.  Means of x = W~ p are means of
rows of W~ times p: the stand-in moves with the same cages and costs the same whatever it stands
for.  Merging vertices leaves a closed surface closed, so its volume is as good a cubic as the
mesh's own.

Its volume differs from the mesh's by some per cent, what the cages do to the two by far less;
and the last operation of every solve takes the mesh itself onto its own volume, exactly
(`Deformer`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..geometry import cells as cells_of
from ..geometry import cluster_positions, faces_between
from ..mesh import Mesh
from ..progress import Progress
from ..subspace import Subspace
from .volume_constraints import VolumeConstraint, Volumes

_POINTS = 2000  # about how many cells
_LARGE = 3_000  # vertices beyond which a mesh has a stand-in
_FEW = 700  # points that tell how the volume curves
_SIDES = 0.1  # of the mesh's size: how far apart opposite sides count


@dataclass(frozen=True, eq=False)
class StandIn:
    """Cells of a mesh, and W~ over them; made by `StandIn.of`.

    Parameters
    ----------
    surface : Subspace
        W~ over the cells; where there are none, over the mesh.
    cells : (n,) int or None
        The cell of each vertex; None where a mesh stands for itself.
    shares : (n,) float or None
        What each vertex counts in the mean of its cell.
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
        whole: bool = False,
        progress: Progress | None = None,
    ) -> StandIn:
        """Return the stand-in of a *mesh* at rest that moves by *subspace*.

        A small mesh stands for itself; with *whole*, a large one as well.
        """
        n = mesh.n_vertices
        if n <= _LARGE or whole:
            return cls(subspace)
        _, cells = cells_of(mesh, _POINTS, np.random.default_rng(0), progress)
        areas = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), n)
        shares = areas / np.bincount(cells, areas)[cells]
        return cls(subspace.averaged(_matrix(cells, shares)), cells, shares)

    def volumes(self, constraints: Sequence[VolumeConstraint], rest: FloatArray) -> Volumes:
        """Return *constraints* on the mesh as constraints on the cages, held from *rest* (n, 3) on.

        *rest* may be scaled and moved: its own volumes are what is held.
        """
        points = rest
        if self.cells is not None and self.shares is not None:
            constraints = [_coarse(each, self.cells) for each in constraints]
            points = _matrix(self.cells, self.shares) @ rest
        free = [replace(each, target=0.0) for each in constraints]
        held = tuple(replace(each, target=each.violation(points)) for each in free)
        return Volumes(self.surface, held, _Curve(self.surface, held, points) if held else None)


@dataclass(frozen=True, eq=False)
class _Curve:
    """How volumes curve with the cages, told by few points; called as `Volumes.curve`."""

    surface: Subspace
    constraints: tuple[VolumeConstraint, ...]
    points: FloatArray  # (n, 3), where the surface is at rest

    def __call__(self, p: FloatArray, multipliers: FloatArray) -> FloatArray:
        """Return G (3, m, m) at *p* (m, 3)."""
        weights, constraints = self._of_few
        x = weights @ p
        each = zip(multipliers, constraints, strict=True)
        halves = sum(multiplier * constraint.curvature(x) for multiplier, constraint in each)
        half = (halves.astype(np.float32) @ weights).reshape(3, len(x), -1)
        reduced = weights.T @ half
        return np.asarray(reduced - np.swapaxes(reduced, 1, 2), dtype=np.float64)

    @cached_property
    def _of_few(self) -> tuple[NDArray[np.float32], tuple[VolumeConstraint, ...]]:
        """W~ (k, m) of few points, in single precision, and the constraints over them.

        Neighbours that face the same way are one point, so that thin parts keep both their sides.
        """
        n = len(self.points)
        cells, shares = np.arange(n), np.ones(n)
        if n > _FEW:
            outward = np.sum([each.gradient(self.points) for each in self.constraints], axis=0)
            areas = np.linalg.norm(outward, axis=1) + np.finfo(float).tiny
            places = np.hstack([self.points, _SIDES * outward / areas[:, None]])
            cells = cluster_positions(places, _FEW, rounds=3, seeded=False)
            shares = areas / np.bincount(cells, areas)[cells]
        weights = self.surface.left(_matrix(cells, shares)).astype(np.float32)
        return weights, tuple(_coarse(each, cells) for each in self.constraints)


def _coarse(constraint: VolumeConstraint, cells: IntArray) -> VolumeConstraint:
    """Return *constraint* over the cells."""
    n, count, extension = len(cells), int(cells.max()) + 1, constraint.extension
    added = 0 if extension is None else extension.shape[0] - n
    places = np.concatenate([cells, count + np.arange(added)])
    if extension is not None:
        member = sparse.csr_array((np.ones(n), cells, np.arange(n + 1)), (n, count))
        extension = sparse.csr_array(
            sparse.vstack([sparse.eye_array(count), extension[n:] @ member])
        )
    faces = faces_between(places, constraint.faces)
    return VolumeConstraint(faces, constraint.target, extension)


def _matrix(cells: IntArray, shares: FloatArray) -> sparse.csr_array:
    """Return (k, n), from vertices to the means of their cells."""
    return sparse.coo_array((shares, (cells, np.arange(len(cells))))).tocsr()
