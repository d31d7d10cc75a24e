"""Binding: all that is computed once for a mesh, its regions and its cages, in seconds.

    W~                 `subspace.cage_subspace`, figure 6 of the paper; rigid parts move affinely
                       (`subspace.affine_parts`)
    E(p)               `energy.shape_energy`, eqs. (5), (10), (20), with the stiffness of the cages
                       and the interior
    coarse volume      `coarse_volume.CoarseVolume`, of a large mesh

It does not depend on fixed vertices, handles or targets.  `binding_cache` keeps it on disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..cages import Cage
from ..energy import (
    Contraction,
    Energy,
    Interior,
    InteriorSamples,
    grown_gradients,
    interior_weights,
    sampled_operators,
    shape_energy,
    with_cage_stiffness,
    with_interior,
    with_rotating_rows,
)
from ..geometry import cluster_within_parts, decimated, lids_of
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..regions import Regions
from ..solver import CoarseVolume
from ..subspace import AffineParts, Subspace, blend_at, cage_subspace
from .stiffness import Stiffness

_FORMAT = 16  # increment whenever the content of a binding changes
# Weight of the gradient of a rigid part, in scales of the energy.  With 100, parts bend a third as
# much in drags, some 5e-4 diagonals, and frames take a fifth longer.
_RIGID = 30.0


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
    stiffness : Stiffness, optional
        Where the surface is stiffer than elsewhere.
    """

    rest: Mesh
    regions: Regions
    cages: Sequence[Cage]
    rest_cages: FloatArray
    stretch: float
    n_clusters: int
    stiffness: Stiffness | None = None

    @property
    def factors(self) -> FloatArray | None:
        """(n,): factors of the terms of each vertex, if they are not all 1."""
        return None if self.stiffness is None else self.stiffness.factors

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

    @cached_property
    def clusters(self) -> IntArray:
        """The rotation cluster of each vertex, (n,): vertices that lie together."""
        n, x, parts = self.rest.n_vertices, self.rest.vertices, self.parts
        if self.n_clusters >= n:
            return np.arange(n)
        if n <= sizes.DECIMATED:
            return cluster_within_parts(x, parts, self.n_clusters, shares=self.shares)
        _, kept, of_vertex = decimated(self.regions.mesh, sizes.DECIMATED_POINTS)
        some = x[kept], parts[kept], self.n_clusters
        return cluster_within_parts(*some, shares=self.shares)[of_vertex]

    def digest(self) -> str:
        """Return 40 hexadecimal digits that are equal exactly for equal inputs."""
        regions = self.regions
        seen = hashlib.blake2b(digest_size=20)
        seen.update(repr((_FORMAT, self.stretch, self.n_clusters, regions.smoothness)).encode())
        arrays = [regions.mesh.vertices, regions.mesh.faces, regions.membership]
        arrays += [] if regions.carrier is None else [regions.carrier]
        if self.stiffness is not None:
            arrays += [self.stiffness.factors, *self.stiffness.rigid]
        for array in [*arrays, *(a for cage in self.cages for a in (cage.vertices, cage.faces))]:
            seen.update(repr((array.shape, array.dtype.str)).encode())
            seen.update(np.ascontiguousarray(array).view(np.uint8).data)
        return seen.hexdigest()


@dataclass(frozen=True, eq=False)
class Binding:
    """The subspace, energy and volumes with which a `Deformer` solves."""

    cages: Subspace  # W~ by the cages alone
    rigid: AffineParts | None  # the parts that are to be rigid
    energy: Energy  # in `cages`, blended with these parts
    interior: FloatArray  # (k,): the weights of the points inside the body
    coarse_volume: CoarseVolume

    @classmethod
    def compute(cls, inputs: BindingInputs, progress: Progress | None = None) -> Binding:
        """Return the binding of *inputs*."""
        tell(progress, 0.0, "checking cages")
        regions, cages = inputs.regions, inputs.cages
        share = part(progress, 0.0, 0.38)  # shares of the time for 5,000 to 300,000 vertices
        subspace = cage_subspace(regions, cages, progress=share)
        tell(progress, 0.38, "clustering rotations")
        _ = inputs.clusters
        return cls._of(inputs, subspace, None, part(progress, 0.4, 1.0))

    def stiffened(self, inputs: BindingInputs) -> Binding:
        """Return the binding of *inputs* that differ in their stiffness only."""
        return self._of(inputs, self.cages, None if self.rigid else self.coarse_volume)

    @classmethod
    def _of(
        cls,
        inputs: BindingInputs,
        cages: Subspace,
        coarse: CoarseVolume | None,
        progress: Progress | None = None,
    ) -> Binding:
        """Return the binding of *inputs* with W~ *cages*, and its *coarse* volume, if known."""
        rigid, subspace = _rigid_parts(inputs, cages), cages
        if rigid is not None:
            subspace, coarse = rigid.blended(cages, inputs.rest.vertices, rigid.shares), None
        energy, weights = _energy(inputs, subspace, rigid, part(progress, 0.0, 0.85))
        if coarse is None:
            last = part(progress, 0.88, 1.0)
            coarse = CoarseVolume.of(inputs.regions.mesh, subspace, progress=last)
        return cls(cages, rigid, energy, weights, coarse)

    def grown(self, inputs: BindingInputs, p: FloatArray) -> Binding:
        """Return this binding of *inputs* with another shape to keep: that with cages *p* (m, 3).

        The mesh depends on its cages as before, and its volumes are computed as before.
        """
        rest, subspace = inputs.rest, self.energy.subspace
        shape = rest.with_vertices(subspace.map(p - inputs.rest_cages, rest.vertices))
        energy = _surface_energy(inputs, shape, p, subspace, self.rigid)
        gradients = grown_gradients(self.energy, self.interior, p)
        return replace(self, energy=with_interior(energy, gradients, self.interior))

    def by_factors(self, inputs: BindingInputs, contraction: Contraction) -> FloatArray:
        """Return the gradient (n,) of *contraction* by the factors of *inputs*, at rest."""
        rest, factors, subspace = inputs.rest, inputs.factors, self.energy.subspace
        sampled = sampled_operators(rest, subspace, inputs.clusters, factors)
        gradients = partial(_gradients, inputs, subspace, self.rigid)
        n, inside = rest.n_vertices, _inside(inputs)
        return contraction.of_surface(sampled, inputs.stretch, n) + contraction.of_interior(
            inside, self.interior, gradients, stiffness=factors, n=n
        )


def _rigid_parts(inputs: BindingInputs, cages: Subspace) -> AffineParts | None:
    """Return the parts of *inputs* that are to be rigid; their collars are as wide as the cages.

    That is, as the mean distance between cage vertices.
    """
    if inputs.stiffness is None or not inputs.stiffness.rigid:
        return None
    spacing = np.sqrt(inputs.rest.vertex_areas.sum() / len(inputs.rest_cages))
    return AffineParts.of(
        inputs.rest,
        cages,
        inputs.stiffness.rigid,
        collar=float(spacing),
        smoothness=inputs.regions.smoothness,
    )


def _energy(
    inputs: BindingInputs,
    subspace: Subspace,
    rigid: AffineParts | None,
    progress: Progress | None = None,
) -> tuple[Energy, FloatArray]:
    """Return the energy at rest, and the weights of the points inside the body."""
    p = inputs.rest_cages
    energy = _surface_energy(inputs, inputs.rest, p, subspace, rigid, progress=progress)
    gradients, volumes = _interior(inputs, energy, rigid)
    weights = interior_weights(energy, gradients, volumes)
    return with_interior(energy, gradients, weights), weights


def _surface_energy(
    inputs: BindingInputs,
    shape: Mesh,
    p: FloatArray,
    subspace: Subspace,
    rigid: AffineParts | None,
    *,
    progress: Progress | None = None,
) -> Energy:
    """Return the energy of the surface that keeps *shape*, with cages *p* (m, 3), and of these."""
    clusters, factors = inputs.clusters, inputs.factors
    energy = shape_energy(
        shape, subspace, inputs.stretch, clusters, stiffness=factors, progress=progress
    )
    faces = [cage.faces for cage in inputs.cages]
    weight = np.full(3, _RIGID * energy.scale)
    energy = with_cage_stiffness(energy, p, faces, clusters)
    for rows in () if rigid is None else rigid.gradients:
        energy = with_rotating_rows(energy, rows, rows @ p, weight)
    if rigid is not None:  # without it, the cages around a part would hardly be held by it
        energy = replace(energy, quadratic=energy.quadratic + energy.scale * rigid.misfit)
    return energy


def _interior(
    inputs: BindingInputs, energy: Energy, rigid: AffineParts | None
) -> tuple[FloatArray, FloatArray]:
    """Return the gradients (k, 3, m) at points inside the bodies, and the volumes (k,) there."""
    interior = _inside(inputs).means(inputs.factors)
    return _gradients(inputs, energy.subspace, rigid, interior), interior.volumes


def _inside(inputs: BindingInputs) -> InteriorSamples:
    regions = inputs.regions
    return InteriorSamples.of(inputs.rest, regions.weights, lids_of(regions.mesh).encloses)


def _gradients(
    inputs: BindingInputs, subspace: Subspace, rigid: AffineParts | None, interior: Interior
) -> FloatArray:
    """Return the gradients (k, 3, m) of the map of the cages at the points of *interior*."""
    ends = np.cumsum([cage.n_vertices for cage in inputs.cages])[:-1]
    p = np.split(inputs.rest_cages, ends)
    cages = [Cage(x, cage.faces) for x, cage in zip(p, inputs.cages, strict=True)]
    gradients = interior.gradients(cages, subspace)
    if rigid is None:
        return gradients
    shares = blend_at(inputs.rest.vertices, rigid.shares, interior.points)
    return rigid.blended_gradients(gradients, shares)
