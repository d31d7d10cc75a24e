"""The relative volume change (V - V0) / V0 of each region of a session.

A region is closed at its border as in `vtk_segdeform.solver.volume_constraints`.
"""

from __future__ import annotations

from vtk_segdeform.geometry import Lids
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session
from vtk_segdeform.solver import VolumeConstraint, region_volumes


class RegionVolumes:
    """The volume changes of the current regions in the current pose of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._volumes: tuple[Regions, Lids, list[tuple[int, VolumeConstraint]]] | None = None

    def changes(self) -> list[tuple[int, float]]:
        """Return the number and the volume change of each region that owns a face around a volume.

        The list is empty if there is only one region, whose volume is that of the mesh.
        """
        session = self._session
        owned = self._owned()
        if not owned:
            return []
        owners, volumes = zip(*owned, strict=True)
        if session.state.pose is None:
            return [(owner, 0.0) for owner in owners]
        solved = None if session.solution is None else session.solution.region_volume_change
        if solved is not None and len(solved) == len(owners):
            shares = solved.tolist()  # the solver has computed them
        else:  # also if the choice of lids has changed since
            x = session.vertices
            shares = [volume.relative(x) for volume in volumes]
        return list(zip(owners, shares, strict=True))

    def prepare(self) -> None:
        """Compute in advance everything the first call of `changes` needs."""
        self._owned()

    def _owned(self) -> list[tuple[int, VolumeConstraint]]:
        mesh, regions = self._session.mesh, self._session.regions
        if regions is None or regions.n_regions == 1:
            return []
        lids = self._session.lids
        known = self._volumes
        if known is None or known[0] is not regions or known[1] is not lids:
            known = self._volumes = regions, lids, _owned_volumes(mesh, regions, lids)
        return known[2]


def _owned_volumes(mesh: Mesh, regions: Regions, lids: Lids) -> list[tuple[int, VolumeConstraint]]:
    """Return the volume of each region that owns a face, with the region's number."""
    labels = regions.labels
    owned = []
    for volume in region_volumes(mesh, labels, lids):
        a, b, c = labels[volume.faces[0]].tolist()  # the rule of `volume_constraints` for owners
        owned.append((b if b == c else a, volume))
    return owned
