"""Binding: all that is computed once for a mesh, its regions and its cages, in seconds.

    W~                 `subspace.cage_subspace`, figure 6 of the paper
    E(p)               `energy.shape_energy`, eqs. (5), (10), (20), with the stiffness of the cages
                       and the interior
    coarse volume      `coarse_volume.CoarseVolume`, of a large mesh

It does not depend on fixed vertices, handles or targets.  `binding_cache` keeps it on disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..cages import Cage
from ..energy import (
    Energy,
    Interior,
    shape_energy,
    with_cage_stiffness,
    with_interior,
)
from ..geometry import cluster_within_parts, decimated, lids_of
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..regions import Regions
from ..solver import CoarseVolume
from ..subspace import cage_subspace

_FORMAT = 14  # increment whenever the content of a binding changes


@dataclass(frozen=True, eq=False)
class BindingInputs:
    """The inputs of a binding.

    Parameters
    ----------
    rest : Mesh
        The mesh at rest, size about 1.
    regions : Regions
        Of the mesh in scene coordinates.
    cages : sequence of Cage
        In scene coordinates.
    rest_cages : (m, 3) float
        The stacked cage vertices, in the coordinates of *rest*.
    stretch : float
        See `energy.shape_energy`.
    n_clusters : int
        Number of rotation clusters.
    """

    rest: Mesh
    regions: Regions
    cages: Sequence[Cage]
    rest_cages: FloatArray
    stretch: float
    n_clusters: int

    @property
    def parts(self) -> IntArray:
        """Numbers (n,) of the parts that no rotation cluster spans: regions, shell by shell."""
        component = self.regions.mesh.components
        return np.asarray(self.regions.labels * (int(component.max()) + 1) + component)

    @property
    def shares(self) -> FloatArray:
        """Relative number of rotation clusters of each part: that of its cage vertices.

        A fixed part of many vertices but with a small cage hardly needs any.
        """
        numbers, labels = self.parts, self.regions.labels
        each = np.bincount(labels, minlength=len(self.cages))
        weight = np.array([cage.n_vertices for cage in self.cages]) / np.maximum(each, 1)
        return np.asarray(np.bincount(numbers, weight[labels]))

    def digest(self) -> str:
        """Return 40 hexadecimal digits that are equal exactly for equal inputs."""
        regions = self.regions
        seen = hashlib.blake2b(digest_size=20)
        seen.update(repr((_FORMAT, self.stretch, self.n_clusters, regions.smoothness)).encode())
        arrays = [regions.mesh.vertices, regions.mesh.faces, regions.membership]
        arrays += [] if regions.carrier is None else [regions.carrier]
        for array in [*arrays, *(a for cage in self.cages for a in (cage.vertices, cage.faces))]:
            seen.update(repr((array.shape, array.dtype.str)).encode())
            seen.update(np.ascontiguousarray(array).view(np.uint8).data)
        return seen.hexdigest()


@dataclass(frozen=True, eq=False)
class Binding:
    """The subspace, energy and volumes with which a `Deformer` solves."""

    energy: Energy
    coarse_volume: CoarseVolume

    @classmethod
    def compute(cls, inputs: BindingInputs, progress: Progress | None = None) -> Binding:
        """Return the binding of *inputs*."""
        tell(progress, 0.0, "checking cages")
        rest, regions, cages = inputs.rest, inputs.regions, inputs.cages
        share = part(progress, 0.0, 0.38)  # shares of the time for 5,000 to 300,000 vertices
        subspace = cage_subspace(regions, cages, progress=share)
        tell(progress, 0.38, "clustering rotations")
        clusters = _clusters(inputs)
        share = part(progress, 0.4, 0.9)
        energy = shape_energy(rest, subspace, inputs.stretch, clusters, progress=share)
        faces = [cage.faces for cage in cages]
        energy = with_cage_stiffness(energy, inputs.rest_cages, faces, clusters)
        energy = _with_interior(inputs, energy)
        coarse = CoarseVolume.of(regions.mesh, subspace, progress=part(progress, 0.93, 1.0))
        return cls(energy, coarse)


def _clusters(inputs: BindingInputs) -> IntArray:
    """Return the rotation cluster of each vertex, (n,): vertices that lie together."""
    n, x, parts = inputs.rest.n_vertices, inputs.rest.vertices, inputs.parts
    if inputs.n_clusters >= n:
        return np.arange(n)
    if n <= sizes.DECIMATED:
        return cluster_within_parts(x, parts, inputs.n_clusters, shares=inputs.shares)
    _, kept, of_vertex = decimated(inputs.regions.mesh, sizes.DECIMATED_POINTS)
    some = x[kept], parts[kept], inputs.n_clusters
    return cluster_within_parts(*some, shares=inputs.shares)[of_vertex]


def _with_interior(inputs: BindingInputs, energy: Energy) -> Energy:
    """Return *energy* with the rotations inside the bodies of the mesh."""
    mesh, regions = inputs.rest, inputs.regions
    ends = np.cumsum([cage.n_vertices for cage in inputs.cages])[:-1]
    p = np.split(inputs.rest_cages, ends)
    cages = [Cage(x, cage.faces) for x, cage in zip(p, inputs.cages, strict=True)]
    interior = Interior.of(mesh, regions.weights, lids_of(regions.mesh).encloses)
    gradients = interior.gradients(cages, energy.subspace)
    return with_interior(energy, gradients, interior.volumes)
