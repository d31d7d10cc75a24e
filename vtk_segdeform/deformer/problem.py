"""What is deformed, and how: a mesh with its regions, cages and energy, made once.

Positions are in the coordinates of the solver, where the mesh has size 1; see `frame`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray
from ..cages import Cage
from ..energy import Energy
from ..finish import CellEnergy
from ..freezing import Frozen
from ..geometry import Carrying, carriers, towards
from ..mesh import Mesh, SurfacePoint, connected
from ..progress import Progress
from ..regions import Regions
from ..subspace import Passengers, Subspace, bind_passengers, blend_at
from .binding import Binding, BindingInputs
from .binding_cache import cached_binding
from .frame import Frame
from .locality import SurfaceSamples
from .stiffness import Stiffness

_NO_POINTS = np.empty((0, 3))
# l of the finish, in spacings of the cages.  With 1, the worst 1 % of distortion in 24 poses of
# four bodies is 1.5 times that of as-rigid-as-possible, with 2, 1.3 times; poses of a dog are 2 %
# farther from the true ones.
_SPACINGS = 2.0
# Weight of the gap between a component and its leader, times the scale of the shape energy; with
# ten times more or less, hollow bodies bend alike.
_LED, _GAPS = 1.0, 400  # and points at which it is kept, about
_LOOSE = 1e-4  # weight of the anchors of a loose component, in traces of the energy of its region


@dataclass(frozen=True, eq=False, repr=False)
class Problem(Frozen):
    """A mesh and its energy in the subspace of its cages; made by `Problem.of`."""

    mesh: Mesh  # n vertices, in the coordinates of the caller
    regions: Regions
    cages: Sequence[Cage]  # of the caller
    frame: Frame
    rest: Mesh  # in the coordinates of the solver
    rest_pose: Mesh  # in those of poses
    rest_cages: FloatArray  # (m, 3), stacked
    shape: Mesh  # whose detail and lengths are kept, in the coordinates of poses: at rest or grown
    inputs: BindingInputs
    binding: Binding

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        regions: Regions,
        cages: Sequence[Cage],
        *,
        stretch: float,
        rotation_groups: int,
        stiffness: Stiffness | None = None,
        cache: FilePath | None = None,
        progress: Progress | None = None,
    ) -> Problem:
        """Bind *mesh* to *cages*; see `Deformer`."""
        frame = Frame.of(mesh.vertices)
        rest = mesh.with_vertices(frame.inward(mesh.vertices))
        inside = [frame.inward(cage.vertices) for cage in cages]
        rest_cages = np.concatenate([_NO_POINTS, *inside])
        given = rest, regions, cages, rest_cages, stretch, rotation_groups
        inputs = BindingInputs(*given, stiffness=stiffness)
        binding = cached_binding(inputs, cache, progress)
        at_origin = frame.about_origin(mesh.vertices)
        rest_pose = mesh.with_vertices(at_origin) if frame.is_far else mesh
        parts = mesh, regions, cages, frame, rest, rest_pose, rest_cages
        return cls(*parts, shape=rest_pose, inputs=inputs, binding=binding)

    def stiffened(self, stiffness: Stiffness | None) -> Problem:
        """Return the problem with another stiffness."""
        inputs = replace(self.inputs, stiffness=stiffness)
        return self._with(inputs=inputs, binding=self.binding.stiffened(inputs))

    def grown(self, p: FloatArray) -> Problem:
        """Return the problem whose shape to keep is that of cages *p* (m, 3); see `growth`."""
        shape = self.rest_pose.with_vertices(self.map(p))
        return self._with(shape=shape, binding=self.binding.grown(self.inputs, p))

    def _with(self, **changes: Any) -> Problem:
        """Return the problem with *changes*, and what is known and does not depend on them."""
        other = replace(self, **changes)
        is_same = other.binding.cages is other.subspace is self.subspace
        names = ("linked_parts", *(("samples", "_gaps") if is_same else ()))
        vars(other).update({name: vars(self)[name] for name in names if name in vars(self)})
        return other

    @property
    def energy(self) -> Energy:
        """E(p)."""
        return self.binding.energy

    @property
    def subspace(self) -> Subspace:
        """W~."""
        return self.binding.energy.subspace

    @cached_property
    def samples(self) -> SurfaceSamples:
        """Samples of the surface, of which some are held in pulls."""
        of_component, _ = self.linked_parts
        return SurfaceSamples.of(self.rest, self.binding.coarse_volume, of_component)

    def map(self, p: FloatArray, directions: Sequence[FloatArray] = ()) -> FloatArray:
        """Return the pose of cages *p* (m, 3), (n, 3); and W~ z of *directions* (m, 3) beside.

        It is rest + W~ (p - rest), which is W~ p, but at rest exact however W~ is rounded.
        """
        size = self.frame.size
        moves = [(p - self.rest_cages) * size, *(z * size for z in directions)]
        return self.subspace.map(np.hstack(moves), self.rest_pose.vertices)

    def cages_in_scene(self, p: FloatArray) -> tuple[FloatArray, ...]:
        """Return the vertices of each cage, in the coordinates of the caller."""
        p = self.frame.outward(p)
        return tuple(p[own] for own in self.subspace.columns)

    def passengers(self, points: ArrayLike, *, progress: Progress | None = None) -> Passengers:
        """Bind other points (k, 3), in the coordinates of the caller; see `subspace.passengers`."""
        weights = self.regions.weights
        found = bind_passengers(self.mesh, weights, self.cages, points, progress=progress)
        inside, every = self.frame.inward(found.points), slice(None)
        subspace = self._with_rigid_parts(found.subspace, inside, self.rest, every)
        return Passengers(found.points, subspace)

    def _with_rigid_parts(
        self, subspace: Subspace, points: FloatArray, mesh: Mesh, kept: IntArray | slice
    ) -> Subspace:
        """Return W~ *subspace* of *points* (k, 3), blended with the rigid parts as *mesh* is.

        Its vertices are those *kept* of all.
        """
        rigid = self.binding.rigid
        if rigid is None:
            return subspace
        shares = blend_at(mesh.vertices, rigid.shares[:, kept], points)
        return rigid.blended(subspace, points, shares)

    def row_of(self, point: SurfacePoint) -> FloatArray:
        """Return the row of W~ of *point*, (m,)."""
        return np.asarray(np.array(point.shares) @ self.subspace.at(np.array(point.corners)))

    @cached_property
    def linked_parts(self) -> tuple[IntArray, IntArray]:
        """The part of each component of the mesh (c,) and each region (r,), linked by sharing.

        Components are also linked with their leaders.
        """
        region, component = np.nonzero(self.regions.components)
        n_regions, count = self.regions.components.shape
        own, leader = np.arange(count), self.regions.leader
        one = np.concatenate([component, own])
        other = np.concatenate([count + region, own if leader is None else leader])
        part = connected(count + n_regions, one, other)
        return part[:count], part[count:]

    @cached_property
    def _gaps(self) -> dict[int, FloatArray]:
        """For components with a leader, W~ at points on them, less W~ of their leader there.

        Each is (k, m), and its product with the cages (m, 3) at rest is 0.
        """
        if (leader := self.regions.leader) is None:
            return {}
        rest, component, found = self.rest, self.rest.components, {}
        inside = np.split(self.rest_cages, np.cumsum([len(c.vertices) for c in self.cages])[:-1])
        cages = [Cage(x, cage.faces) for x, cage in zip(inside, self.cages, strict=True)]
        own = np.arange(len(leader))
        for k in np.flatnonzero(leader != own):
            ids = np.flatnonzero(component == k)
            ids = ids[:: 1 + len(ids) // _GAPS]
            other, kept = rest.of_components(own == leader[k])
            points = rest.vertices[ids]
            led = bind_passengers(other, self.regions.weights[:, kept], cages, points).subspace
            led = self._with_rigid_parts(led, points, other, kept)
            found[int(k)] = self.subspace.at(ids) - led.at(np.arange(len(ids)))
        return found

    def carrying_from(self, ids: IntArray) -> Carrying:
        """Return how motions are carried from the components of vertices *ids* to the others.

        Regions without carriers may have several components as well: then each of these follows one
        with which it shares regions.
        """
        roots, carrier = self.mesh.components[ids], self.regions.carrier
        if carrier is None:
            part, _ = self.linked_parts
            found = carriers(self.mesh, roots=roots)
            carrier = np.where(part[found] == part, found, np.arange(len(part)))
        return Carrying(self.mesh, towards(carrier, roots))

    def kept_gaps(self, ids: IntArray) -> FloatArray:
        """Return the quadratic (m, m) that keeps the gaps between components and their leaders.

        Those that have any of the vertices *ids* (k,) do not follow.
        """
        total, component = np.zeros_like(self.energy.quadratic), self.mesh.components
        for k, rows in self._gaps.items():
            if not (component[ids] == k).any():
                total += _LED * self.energy.scale / len(rows) * (rows.T @ rows)
        return total

    def anchors_of_loose_parts(self, ids: IntArray) -> FloatArray:
        """Return the quadratic (m, m) of anchors for components without any of the vertices *ids*.

        Nothing determines where they are.  Those that share no region with other components stay,
        or follow their leaders: their gaps are kept.  The others follow those that they share
        regions with; their anchors are so weak, compared with the energy of the least region that
        they are in, that they only prevent drifting.
        """
        energy, inside, led = self.energy, self.regions.components, self.kept_gaps(ids)
        if not len(ids) or inside.shape[1] == 1:
            return led
        of_component, of_region = self.linked_parts
        stays = ~np.isin(of_region, of_component[self._has(ids)])
        own = [len(cage.vertices) for cage in self.cages]
        quadratic = np.diag(np.where(np.repeat(stays, own), energy.scale, 0.0))
        rows, weight, _ = self.loose_samples(ids)
        return np.asarray(led + quadratic + (rows.T * weight) @ rows)

    def loose_samples(self, ids: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return the rows of W~ (k, m) of samples of components without any vertices *ids*.

        And the weights (k,) of their anchors, in proportion to the trace of the energy of a region,
        and this region (k,).
        """
        samples, inside = self.samples, self.regions.components
        own = [len(cage.vertices) for cage in self.cages]
        traces = np.add.reduceat(np.diag(self.energy.quadratic), np.cumsum([0, *own[:-1]]))
        each = np.where(inside, traces[:, None], np.inf)
        of_sample = np.empty(len(samples.points), dtype=np.int64)
        of_sample[samples.cells] = self.mesh.components
        share = each.min(axis=0) / np.bincount(of_sample, minlength=inside.shape[1])
        loose = ~self._has(ids)[of_sample]
        own_component = of_sample[loose]
        region = each.argmin(axis=0)[own_component]
        return samples.rows[loose], _LOOSE * share[own_component], region

    def _has(self, ids: IntArray) -> BoolArray:
        """Return whether each component (c,) has any of the vertices *ids*."""
        found = np.zeros(self.regions.components.shape[1], dtype=bool)
        found[self.mesh.components[ids]] = True
        return found

    @cached_property
    def cell_energy(self) -> CellEnergy:
        """The energy of the finish."""
        per_cage = self.mesh.n_vertices / len(self.rest_cages)
        stiff = self.inputs.stiffness
        return CellEnergy.of(self.shape, per_cage, None if stiff is None else stiff.factors)

    @cached_property
    def cage_weights(self) -> FloatArray:
        """Weights w (n,) of `finish.finisher`: 1 / 4 of a cage vertex, over its region by area."""
        own = self.regions.weights * self.mesh.vertex_areas
        counts = np.array([len(cage.vertices) for cage in self.cages])
        areas = np.where(self.regions.is_carried, 0.0, own).sum(axis=1)  # cages are no coarser
        density = np.divide(counts, areas, where=areas > 0.0, out=np.zeros(len(areas)))
        weights = np.asarray(density @ own) / _SPACINGS**2
        stiff = self.inputs.stiffness
        return weights if stiff is None else weights * stiff.factors
