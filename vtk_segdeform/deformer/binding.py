"""All that is computed once for a mesh, its regions and its cages: what takes seconds.

    W~              `subspace.bind`
    E(p)            `energy.shape_energy`, `cage_stiffness`
    the stand-in    `coarse_volume.StandIn`
    W~ in patches   `low_rank.Patches`, of a large mesh

With a *cache*, a folder, the binding is kept on disk (`binding_cache`), named by a hash of all
that it depends on, so that the same mesh with the same cages is bound once.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import FloatArray, IntArray
from ..cages import Cage
from ..energy import Energy, join_rotations, shape_energy, with_cage_stiffness
from ..geometry import cluster_within_parts
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..regions import Regions
from ..solver import StandIn
from ..subspace import Patches, bind
from .binding_cache import ENDING, Binding

_FORMAT = 8  # increment whenever the content of a binding changes
_BITS, _EACH = 2000, 6  # rotations at first: so many, or more, for each one asked for
_LARGE = 100_000  # vertices beyond which what every frame maps by is kept in patches


@dataclass(frozen=True, eq=False)
class Binder:
    """What is to be bound, and how; `binding_cache` does it.

    Parameters
    ----------
    rest : Mesh
        The mesh at rest, size about 1.
    regions : Regions
        Of the mesh.
    cages : sequence of Cage
        In the mesh's own unit, and ...
    rest_cages : (m, 3) float
        ... their vertices as *rest* is.
    blend : (r, n) float or None
        See `subspace.bind`.
    stretch : float
        See `energy.shape_energy`.
    n_groups : int or None
        Rotations, None for one per vertex.
    """

    rest: Mesh
    regions: Regions
    cages: Sequence[Cage]
    rest_cages: FloatArray
    blend: FloatArray | None
    stretch: float
    n_groups: int | None

    def bound(
        self, cache: str | os.PathLike[str] | None = None, progress: Progress | None = None
    ) -> Binding:
        """Return the binding, from the folder *cache* if it is there, and leave it there."""
        path = None
        if cache is not None and self.n_groups is not None and self.stretch > 0.0:
            path = Path(cache) / (self._name() + ENDING)
            if found := Binding.read(path, self.rest.n_vertices):
                return found
        binding = self._make(progress)
        if path is not None:
            binding.write(path)
        return binding

    def _make(self, progress: Progress | None) -> Binding:
        tell(progress, 0.0, "checking cages")
        blend, share = self.blend, part(progress, 0.0, 0.8)
        subspace = bind(self.regions, self.cages, blend=blend, progress=share)
        tell(progress, 0.8, "grouping rotations")
        groups = self._groups()
        share = part(progress, 0.82, 0.85)
        energy = shape_energy(self.rest, subspace, self.stretch, groups, progress=share)
        if groups is not None and energy.exact:
            faces = [cage.faces for cage in self.cages]
            energy = with_cage_stiffness(energy, self.rest_cages, faces, groups)
            energy = self._joined(energy, groups, part(progress, 0.85, 0.86))
        share, whole = part(progress, 0.86, 0.9), energy.turns_vertices
        stand_in = StandIn.of(self.regions.mesh, subspace, whole=whole, progress=share)
        patches = None
        if self.rest.n_vertices > _LARGE:
            share = part(progress, 0.9, 1.0)
            patches = Patches.of(subspace, self.rest.vertices, self.rest_cages, progress=share)
        return Binding(energy, stand_in, patches)

    def _groups(self) -> IntArray | None:
        """Return the rotation of each vertex; more than asked for, where `_joined` follows."""
        n, count = self.rest.n_vertices, self.n_groups
        if count is None:
            return None
        many = self.stretch > 0.0
        count = max(_BITS, _EACH * count) if many else count
        if count >= n:
            return np.arange(n)
        return cluster_within_parts(self.rest.vertices, self._parts, count, quick=many)

    @property
    def _parts(self) -> IntArray:
        component = self.regions.mesh.components
        return np.asarray(self.regions.labels * (int(component.max()) + 1) + component)

    def _joined(self, energy: Energy, groups: IntArray, progress: Progress | None) -> Energy:
        """Return *energy* with as many rotations as asked for."""
        assert self.n_groups is not None
        counts = np.bincount(groups)
        if len(counts) <= self.n_groups:
            return energy
        means = np.stack([np.bincount(groups, x) / counts for x in self.rest.vertices.T], axis=1)
        parts = np.zeros(len(counts), dtype=np.int64)
        parts[groups] = self._parts
        bits = means, parts, counts
        return join_rotations(energy, self.rest_cages, bits, self.n_groups, progress=progress)[0]

    def _name(self) -> str:
        """Return a name that is the same exactly when the binding is."""
        regions = self.regions
        seen = hashlib.blake2b(digest_size=20)
        seen.update(repr((_FORMAT, self.stretch, self.n_groups, regions.smoothness)).encode())
        arrays = [regions.mesh.vertices, regions.mesh.faces, regions.membership, self.blend]
        for array in [*arrays, *(a for cage in self.cages for a in (cage.vertices, cage.faces))]:
            if array is not None:
                seen.update(repr((array.shape, array.dtype.str)).encode())
                seen.update(np.ascontiguousarray(array).view(np.uint8).data)
        return seen.hexdigest()
