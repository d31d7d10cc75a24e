"""What a deformer is held by: fixed vertices, handles and volumes, made once for a set of them.

Positions are in the coordinates of the solver, where the mesh has size 1; see `frame`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..freezing import read_only
from ..geometry import Carrying
from ..mesh import SurfacePoint
from ..solver import (
    Anchors,
    Contact,
    GaussNewton,
    ScaledSurface,
    Term,
    connected_sets,
    errors_at,
    position_term,
)
from .arguments import check_distance, checked_constraints, checked_targets
from .enclosed_volume import EnclosedVolume, Preserved
from .problem import Problem

_POSITION_WEIGHT = 15_000.0  # of a handle or fixed patch, times the scale of the shape energy
_NONE, _NO_POINTS = np.zeros(0, dtype=np.int64), np.empty((0, 3))


@dataclass(frozen=True)
class HoldOptions:
    """What is preserved and avoided; see `Deformer`."""

    preserve_volume: bool
    preserve_region_volumes: bool
    avoid_contact: bool
    lids: bool | None


@dataclass(frozen=True, eq=False)
class PulledPoints:
    """Points that handles of one vertex move; see `locality`."""

    places: IntArray = field(default_factory=lambda: _NONE)  # (q,), among the places of all sets
    targets: IntArray = field(default_factory=lambda: _NONE)  # (q,), their targets
    points: tuple[SurfacePoint, ...] = ()  # (q,)
    levers: FloatArray = field(default_factory=lambda: _NO_POINTS)  # (q, 3), from their vertices
    spread: float = 0.0  # within which a finish leaves the surface alone, in the mesh's unit

    def moved(self, places: FloatArray) -> FloatArray:
        """Return the *places* (s, 3) with those of the points instead of their vertices."""
        if not len(self.places):
            return places
        places = places.copy()
        places[self.places] += self.levers
        return places

    def at(self, x: FloatArray) -> FloatArray:
        """Return where the points of the mesh *x* (n, 3) are, (q, 3)."""
        return np.array([point.at(x) for point in self.points]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Fixed vertices and handles of a problem; made by `Constraints.of` and `local.local`."""

    problem: Problem
    fixed: IntArray  # (f,)
    handle: IntArray  # (k,)
    fixed_at: FloatArray  # (f, 3), in scene coordinates
    handles: list[IntArray]  # indices into the targets, one array for each connected handle
    places_of_targets: sparse.csr_array  # (s, k), from targets to the places of their sets
    places_of_fixed: FloatArray  # (s, 3)
    fixed_box: FloatArray  # (2, 3), corners of the box around the fixed vertices; or (0, 3)
    anchors: FloatArray  # (c, 3), the centres when the c bodies of a pose are scaled; else none
    preserved: Preserved
    solver: GaussNewton  # as it begins
    contact: Contact | None  # one of its terms
    pulled: PulledPoints = field(default_factory=PulledPoints)
    keeps: FloatArray | None = None  # (s,): how firmly the finish of a pull keeps samples in place

    @classmethod
    def of(
        cls,
        enclosed: EnclosedVolume,
        options: HoldOptions,
        *,
        fixed: ArrayLike,
        handle: ArrayLike,
        places: ArrayLike | None = None,
    ) -> Constraints:
        """Return those of *fixed* and *handle*, of which the former stay at *places* (f, 3).

        By default at rest.  Raises a ConstraintError if they are no sets of vertices.
        """
        problem = enclosed.problem
        mesh, energy = problem.mesh, problem.energy
        fixed, handle = map(read_only, checked_constraints(mesh, fixed, handle))
        fixed_in_scene, inside = mesh.vertices[fixed], problem.rest.vertices[fixed]
        if places is not None:
            fixed_in_scene = checked_targets(places, len(fixed), "fixed_at", "fixed")
            inside = problem.frame.inward(fixed_in_scene)
            check_distance(inside)
        handles, patches = connected_sets(mesh, handle), connected_sets(mesh, fixed)
        # The sets one after the other, each in the order of `handle` or `fixed`.
        ids = np.concatenate([handle, fixed])
        order = [*handles, *(len(handle) + patch for patch in patches)]
        in_order = sparse.eye_array(len(ids)).tocsr()[np.concatenate([_NONE, *order])]
        weight = _POSITION_WEIGHT * energy.scale
        sets = [ids[own] for own in order]
        positions = position_term(problem.subspace, problem.rest, sets, weight)
        if (loose := problem.anchors_of_loose_parts(ids)).any():
            start = problem.rest_cages
            positions = positions.local(positions.rows, Anchors(loose, start, np.zeros_like(start)))
        gathered = in_order if positions.mean is None else positions.mean @ in_order
        preserved = enclosed.preserved(
            handle, whole=options.preserve_volume, by_region=options.preserve_region_volumes
        )
        contact = _contact(problem, ids) if options.avoid_contact else None
        terms: tuple[Term, ...] = () if contact is None else (contact,)
        fixed_box = np.stack([inside.min(axis=0), inside.max(axis=0)]) if len(fixed) else _NO_POINTS
        return cls(
            problem=problem,
            fixed=fixed,
            handle=handle,
            fixed_at=fixed_in_scene,
            handles=handles,
            places_of_targets=gathered[:, : len(handle)].tocsr(),
            places_of_fixed=gathered[:, len(handle) :] @ inside,
            fixed_box=fixed_box,
            anchors=_centres(problem, preserved.scaled, fixed, inside),
            preserved=preserved,
            solver=GaussNewton(energy, positions, preserved.volumes, terms=terms),
            contact=contact,
        )

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        for each in (self.fixed, self.handle):
            each.setflags(write=False)

    def places(self, targets: FloatArray) -> FloatArray:
        """Return the places (s, 3) of all sets, for *targets* (k, 3) of the handles."""
        places = np.asarray(self.places_of_targets @ targets + self.places_of_fixed)
        return self.pulled.moved(places)

    def errors(self, targets: FloatArray, x: FloatArray) -> tuple[float, ...]:
        """Return `Solution.handle_error`, pulled points included, and `fixed_error`, of *x*."""
        frame, pulled = self.problem.frame, self.pulled
        places = frame.outward(targets)
        own = self.handle[pulled.targets]
        places[pulled.targets] += x[own] + frame.size * pulled.levers - pulled.at(x)
        at = places, self.fixed_at
        return errors_at((self.handle, self.fixed), at, self.problem.mesh.diagonal, x)

    @cached_property
    def carrying(self) -> Carrying:
        """How a finish moves components without fixed or handle vertices; see `finishing`."""
        return self.problem.carrying_from(np.concatenate([self.handle, self.fixed]))

    @property
    def unmoved(self) -> IntArray:
        """`Solution.unmoved`."""
        ids = np.concatenate([self.handle, self.fixed])
        if not len(ids):
            return _NONE
        of_component, _ = self.problem.linked_parts
        components = self.problem.mesh.components
        return np.flatnonzero(~np.isin(of_component, of_component[components[ids]]))


def _centres(
    problem: Problem, surface: ScaledSurface | None, fixed: IntArray, fixed_at: FloatArray
) -> FloatArray:
    """Return the centres (c, 3) about which bodies are scaled: means of fixed vertices, if any.

    From the centre of the frame, in scene units; *fixed_at* (f, 3) in solver coordinates.
    """
    if surface is None:
        return _NO_POINTS
    frame = problem.frame
    if len(surface.middles) == 1:
        centres = np.zeros((1, 3))
    else:
        centres = surface.middles - (frame.centre - frame.origin)
    body = surface.body[fixed]
    for k in np.unique(body):
        centres[k] = fixed_at[body == k].mean(axis=0) * frame.size
    return centres


def _contact(problem: Problem, ids: IntArray) -> Contact:
    """Return the term that keeps parts of the surface apart; the vertices *ids* are held."""
    held = np.zeros(problem.mesh.n_vertices)
    held[ids] = 1.0
    cells = problem.samples.cells
    is_held = np.bincount(cells, held) >= 0.5 * np.bincount(cells)
    return Contact.of(problem.samples.contact_surface, is_held, problem.energy.scale)
