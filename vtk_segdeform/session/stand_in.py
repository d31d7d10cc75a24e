"""A stand-in for a session that is not bound yet: a decimated mesh in one coarse cage.

It is made in a fraction of the time of a `Session.preparation`, and pulled in the meantime.  The
solver sees the decimated mesh only; the mesh follows by the same cage and is scaled to its volume.
The poses are for display: once the session is bound, the same pull is computed with its own cages.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..cages import fit_cages
from ..deformer import checked_place
from ..geometry import decimated, lids_of
from ..mesh import Mesh, SurfacePoint, require_mesh
from ..progress import Progress, part
from ..regions import Regions
from ..solver import VolumeConstraint, scale_to_volume, total_volume
from ..subspace import Subspace, cage_subspace
from . import pulls
from .session import Session


@dataclass(frozen=True, eq=False)
class StandIn:
    """A mesh at rest that can be pulled roughly; made by `StandIn.of`.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    cluster : (n,) int
        The vertex of the decimated mesh that replaces each vertex.
    session : Session
        The decimated mesh in its cage.
    subspace : Subspace
        W~ of *mesh* in the same cage.
    volume : VolumeConstraint
        The total volume of *mesh*.
    """

    mesh: Mesh
    cluster: IntArray
    session: Session
    subspace: Subspace
    volume: VolumeConstraint

    @classmethod
    def of(
        cls, mesh: Mesh, lids: bool | None = None, progress: Progress | None = None
    ) -> StandIn | None:
        """Return the stand-in for *mesh*, whose volume is that under *lids*; in any thread.

        None if the mesh is so small that a session is prepared as soon.
        """
        require_mesh(mesh)
        if mesh.n_vertices <= sizes.STAND_IN_POINTS:
            return None
        whole = Regions.single(mesh)
        cages = fit_cages(mesh, whole, 60, progress=part(progress, 0.0, 0.5))
        mapped = part(progress, 0.5, 0.7)
        subspace = cage_subspace(whole, cages, rough=True, progress=mapped)
        coarse, cluster = _decimated(mesh)
        session = Session(coarse)
        session.set_regions(Regions.single(coarse))
        session.set_cages(cages)
        session.bind(part(progress, 0.7, 1.0))
        return cls(mesh, cluster, session, subspace, total_volume(mesh, lids_of(mesh, lids)))

    def pulled(
        self,
        vertex: int | ArrayLike | SurfacePoint,
        to: ArrayLike,
        *,
        radius: float | None = None,
        locality: float | None = None,
    ) -> FloatArray:
        """Return the mesh (n, 3) pulled from rest; the arguments are those of `Session.pull`."""
        point, motion = checked_place(self.mesh, vertex), pulls.checked_motion(self.mesh, to)
        own = int(self.cluster[point.vertex])
        if motion.shape == (3,):
            motion = self.session.mesh.vertices[own] + (motion - point.at(self.mesh.vertices))
        solution = self.session.pull(own, motion, radius=radius, locality=locality, max_steps=5)
        moves = np.concatenate(solution.cage_vertices) - self._rest_cage
        x = self.subspace.map(moves, self.mesh.vertices)
        if self.volume.has_volume:
            scale_to_volume(self.volume, x, self.mesh.vertices.mean(axis=0))
        return x

    def release(self) -> None:
        """End the pull, and return to rest."""
        self.session.revert()

    @property
    def _rest_cage(self) -> FloatArray:
        return np.concatenate([cage.vertices for cage in self.session.cages])


def _decimated(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """Return some `sizes.STAND_IN_POINTS` vertices as a mesh, and the one for each vertex (n,)."""
    coarse, cluster = mesh, np.arange(mesh.n_vertices)
    for n_points in (sizes.DECIMATED_POINTS, sizes.STAND_IN_POINTS):
        if coarse.n_vertices > 2 * n_points:
            coarse, _, next_cluster = decimated(coarse, n_points)
            cluster = next_cluster[cluster]
    return coarse, cluster
