"""The relative volume change (V - V0) / V0 of regions and bodies of a session.

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
from vtk_segdeform.solver import Bodies, VolumeConstraint, volumes_by_label


class RegionVolumes:
    """The volume changes of regions and bodies in the current pose of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._volumes: tuple[Regions, Lids, dict[int, VolumeConstraint]] | None = None
        self._parts: dict[str, tuple[Bodies | VolumeConstraint, _Own]] = {}  # and what it is of
        self._changes: tuple[FloatArray | None, dict[str, float]] = None, {}

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
        """Return the change of "region 0" or "body 0" ...; 0 if there is no such volume."""
        if self._session.state.pose is None:
            return 0.0
        x = self._session.vertices
        if self._changes[0] is not x:
            self._changes = x, {}
        known = self._changes[1]
        if name not in known:
            part = self._part(name)
            known[name] = 0.0 if part is None else part.relative(x)
        return known[name]

    def prepare(self) -> None:
        """Compute in advance everything the first call of `changes` needs."""
        self._owned()

    def _part(self, name: str) -> _Own | None:
        kind, _, number = name.rpartition(" ")
        owned, bodies = self._owned(), self._session.bodies
        source = owned.get(int(number)) if kind == "region" else bodies
        if source is None:
            return None
        known = self._parts.get(name)
        if known is None or known[0] is not source:
            whole = source.body(int(number)) if isinstance(source, Bodies) else source
            known = self._parts[name] = source, _Own.of(whole)
        return known[1]

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
    """A volume over the vertices that it depends on, which is faster than over all."""

    vertices: IntArray
    volume: VolumeConstraint

    @classmethod
    def of(cls, whole: VolumeConstraint) -> _Own:
        if whole.extension is None:
            vertices, faces = np.unique(whole.faces, return_inverse=True)
            return cls(vertices, replace(whole, faces=faces.reshape(-1, 3)))
        count, n = whole.extension.shape
        is_used = np.zeros(count, dtype=bool)
        is_used[whole.faces] = True
        means = whole.extension[n:][is_used[n:]]
        is_used[means.indices] = True
        vertices = np.flatnonzero(is_used[:n])
        extension = sparse.vstack([sparse.eye_array(len(vertices)), means[:, vertices]])
        faces = (np.cumsum(is_used) - 1)[whole.faces]
        own = replace(whole, faces=faces, extension=sparse.csr_array(extension))
        return cls(vertices, own)

    def relative(self, x: FloatArray) -> float:
        return self.volume.relative(x[self.vertices])
