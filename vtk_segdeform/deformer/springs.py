"""Poses that springs pull a body to: soft targets of any points, in place of handles.

    minimise  E(p) + k mean_i |x_i - u_i|^2

Bending lets springs contract at little energy and stretching at much, so soft springs bend a body
towards its targets, and what they leave is mostly growth; see `landmarks`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray
from ..cages import Cage, fit_cages, require_cage_vertices, suggested_size
from ..finish import CellEnergy, Finisher
from ..kernels import one_blas_thread
from ..mesh import Mesh
from ..progress import Progress, part
from ..regions import Regions, segment
from ..solver import Anchors, GaussNewton, PositionTerm, SolverOptions, Volumes
from ..subspace import Passengers, blend_at
from .enclosed_volume import EnclosedVolume
from .problem import Problem

_STEPS = SolverOptions(tolerance=1e-4, max_steps=60)  # of each stiffness: errors are 1e-3 or more
_SEGMENTED, _FITTED = 0.4, 0.5  # of the progress, about


@dataclass(frozen=True, eq=False)
class SpringPose:
    """A pose of a body."""

    problem: Problem
    p: FloatArray  # (m, 3), the cages

    @one_blas_thread()
    def at(self, points: Passengers) -> tuple[FloatArray, FloatArray]:
        """Return where *points* are, (k, 3), and how the body has rotated there, (k, 3, 3)."""
        x = points.moved(self.problem.cages_in_scene(self.p))
        return x, self.problem.energy.rotations_at(points.subspace, self.p)

    @one_blas_thread()
    def surface(self) -> tuple[FloatArray, FloatArray]:
        """Return the same of all vertices, (n, 3) and (n, 3, 3)."""
        x = self.problem.frame.in_scene(self.problem.map(self.p))
        return x, self.problem.energy.vertex_rotations(self.p)


class SpringBody:
    """A body that springs pull, with automatic regions and cages.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    n_regions, n_cage_vertices : int, optional
        As of `deform`.
    progress : Progress, optional
        Called while the body is bound; may cancel.
    """

    @one_blas_thread()
    def __init__(
        self,
        mesh: Mesh,
        *,
        n_regions: int | None,
        n_cage_vertices: int | None,
        progress: Progress | None = None,
    ) -> None:
        own = regions_and_cages(mesh, n_regions, n_cage_vertices, part(progress, 0.0, _FITTED))
        rest = part(progress, _FITTED, 1.0)
        self.problem = Problem.of(mesh, *own, stretch=1.0, rotation_groups=300, progress=rest)
        self._tree = cKDTree(mesh.vertices)
        self.enclosed = EnclosedVolume.under(self.problem, None).total

    @one_blas_thread()
    def attach(self, points: FloatArray) -> Passengers:
        """Bind *points* (k, 3) to the cages."""
        return self.problem.passengers(points)

    @one_blas_thread()
    def poses(
        self,
        points: Passengers,
        which: IntArray,
        places: FloatArray,
        stiffness: Sequence[float],
    ) -> Iterator[SpringPose]:
        """Yield the poses of springs at some *points* for each *stiffness* k, which should rise.

        Each starts from the last, the first one from rest.

        Parameters
        ----------
        points : Passengers
            Of the body.
        which : (k,) int
            The points that have springs.
        places : (k, 3) float
            u.
        stiffness : sequence of float
            In units of the energy.
        """
        problem = self.problem
        rows = points.subspace.at(which)
        ids = np.unique(self._tree.query(points.points[which])[1])
        p = problem.rest_cages
        loose = Anchors(problem.anchors_of_loose_parts(ids), p, np.zeros_like(p))
        targets, own = problem.frame.inward(places), np.arange(len(which))
        for k in stiffness:
            pulls = np.full(len(which), k * problem.energy.scale / len(which))
            term = PositionTerm(rows, own, pulls, anchors=loose)
            solver = GaussNewton(problem.energy, term, Volumes(problem.subspace))
            p = solver.minimise(p, targets, _STEPS).p
            yield SpringPose(problem, p)

    @one_blas_thread()
    def separated(
        self, x: FloatArray, held: IntArray, scale: float
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """Return a pose *x* (n, 3) with those parts apart that cross only in it, and the map to it.

        The vertices *held* stay; others are as rigid as possible near *x*, which is the body at
        rest in another *scale*, grown and bent.
        """
        problem = self.problem
        mesh, stays = problem.mesh, np.isin(np.arange(len(x)), held)
        energy = CellEnergy.of(mesh.with_vertices(x), len(x) / len(problem.rest_cages))
        rest = mesh.with_vertices(scale * mesh.vertices)
        finisher = Finisher(rest, energy, stays, [], problem.cage_weights, avoid_contact=True)
        apart = finisher.run(x, x[stays]).vertices
        moves = (apart - x).T
        return apart, lambda points: points + blend_at(x, moves, points).T


def regions_and_cages(
    mesh: Mesh,
    n_regions: int | None,
    n_cage_vertices: int | None,
    progress: Progress | None = None,
) -> tuple[Regions, tuple[Cage, ...]]:
    """Return automatic regions and cages of *mesh*; the numbers are as of `deform`."""
    regions = segment(mesh, n_regions, progress=part(progress, 0.0, _SEGMENTED))
    size = suggested_size(regions) if n_cage_vertices is None else n_cage_vertices
    require_cage_vertices(size, regions.n_regions, "n_cage_vertices")
    return regions, fit_cages(mesh, regions, size, progress=part(progress, _SEGMENTED, 1.0))
