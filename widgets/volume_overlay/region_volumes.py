"""The relative volume change (V - V0) / V0 of each region of a session.

A region is closed at its border as in `vtk_segdeform.solver.volume_constraints`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.geometry import Lids
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session
from vtk_segdeform.solver import VolumeConstraint, volumes_by_label


class RegionVolumes:
    """The volume changes of the current regions in the current pose of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._volumes: tuple[Regions, Lids, dict[int, VolumeConstraint]] | None = None
        self._own: _Own | None = None  # of the last `change`
        self._last: tuple[FloatArray, _Own, float] | None = None

    def changes(self) -> list[tuple[int, float]]:
        """Return the number and the volume change of each region that owns a face around a volume.

        The list is empty if there is only one region, whose volume is that of the mesh.
        """
        session = self._session
        owned = self._owned()
        if not owned:
            return []
        if session.state.pose is None:
            return [(owner, 0.0) for owner in owned]
        solved = None if session.solution is None else session.solution.region_volume_change
        if solved is not None and len(solved) == len(owned):
            shares = solved.tolist()  # the solver has computed them
        else:  # also if the choice of lids has changed since
            x = session.vertices
            shares = [volume.relative(x) for volume in owned.values()]
        return list(zip(owned, shares, strict=True))

    def change(self, name: str) -> float:
        """Return the change of one volume, "region 0" ...; 0 if the region has none of its own."""
        owned = self._owned().items() if self._session.state.pose is not None else ()
        volume = next((each for region, each in owned if name == f"region {region}"), None)
        if volume is None:
            return 0.0
        x, own, last = self._session.vertices, self._own, self._last
        if own is None or own.whole is not volume:
            own = self._own = _Own.of(volume)
        if last is None or last[0] is not x or last[1] is not own:
            last = self._last = x, own, own.relative(x)
        return last[2]

    def prepare(self) -> None:
        """Compute in advance everything the first call of `changes` needs."""
        self._owned()

    def _owned(self) -> dict[int, VolumeConstraint]:
        mesh, regions = self._session.mesh, self._session.regions
        if regions is None or regions.n_regions == 1:
            return {}
        lids = self._session.lids
        known = self._volumes
        if known is None or known[0] is not regions or known[1] is not lids:
            known = self._volumes = regions, lids, volumes_by_label(mesh, regions.labels, lids)
        return known[2]


class _Own(NamedTuple):
    """The volume of a region over the vertices that it depends on, which is faster."""

    whole: VolumeConstraint
    """Over all vertices."""
    vertices: IntArray
    volume: VolumeConstraint

    @classmethod
    def of(cls, whole: VolumeConstraint) -> _Own:
        assert whole.extension is not None
        count, n = whole.extension.shape
        is_used = np.zeros(count, dtype=bool)
        is_used[whole.faces] = True
        means = whole.extension[n:][is_used[n:]]
        is_used[means.indices] = True
        vertices = np.flatnonzero(is_used[:n])
        extension = sparse.vstack([sparse.eye_array(len(vertices)), means[:, vertices]])
        faces = (np.cumsum(is_used) - 1)[whole.faces]
        own = replace(whole, faces=faces, extension=sparse.csr_array(extension))
        return cls(whole, vertices, own)

    def relative(self, x: FloatArray) -> float:
        return self.volume.relative(x[self.vertices])
