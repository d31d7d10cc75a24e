"""What a deformer is held by: fixed vertices, handles and volumes, made once for a set of them.

Positions are in the coordinates of the solver, where the mesh has size 1; see `frame`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray, largest_length
from ..freezing import read_only
from ..geometry import Carrying, rigid_fit
from ..mesh import SurfacePoint
from ..solver import (
    Anchors,
    Contact,
    GaussNewton,
    HeldVolumes,
    ScaledSurface,
    Sliding,
    Term,
    connected_sets,
    errors_at,
    position_term,
)
from .arguments import check_distance, checked_constraints, checked_targets
from .enclosed_volume import EnclosedVolume, Preserved
from .problem import Problem
from .slides import Guide, Slide, guides, with_mirrored
from .symmetry import Mirror
from .volume_goals import VolumeGoal

_POSITION_WEIGHT = 15_000.0  # of a handle or fixed patch, times the scale of the shape energy
_MIRROR_SHARE = 0.1  # weight of the symmetry of the cages, as a share of that of a handle
_NONE, _NO_POINTS = np.zeros(0, dtype=np.int64), np.empty((0, 3))


@dataclass(frozen=True)
class HoldOptions:
    """What is preserved and avoided; see `Deformer`."""

    preserve_volume: bool
    preserve_region_volumes: bool
    avoid_contact: bool
    lids: bool | None
    slides: tuple[Slide, ...] = ()
    mirror: Mirror | None = None
    goals: Mapping[str, VolumeGoal | None] = field(default_factory=dict)
    parts: Mapping[str, BoolArray] = field(default_factory=dict)


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
    guides: tuple[Guide, ...] = ()  # of sliding vertices, in the coordinates of poses
    mirror: Mirror | None = None
    mates: IntArray = field(default_factory=lambda: _NONE)
    """(e,): the handle vertices whose mates are the last e ones of `handle`."""
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
        mesh = enclosed.problem.mesh
        fixed, handle = checked_constraints(mesh, fixed, handle)
        mirror, slides = options.mirror, options.slides
        mates = fixed_mates = _NONE
        if mirror is not None:
            fixed, fixed_mates = mirror.with_mates(fixed, handle)
            handle, mates = mirror.with_mates(handle, fixed)
            slides = with_mirrored(slides, mesh, mirror)
        fixed, handle = read_only(fixed), read_only(handle)
        preserved = enclosed.preserved(
            handle,
            whole=options.preserve_volume,
            by_region=options.preserve_region_volumes,
            goals=options.goals,
            parts=options.parts,
            mirror=options.mirror,
        )
        problem, energy = preserved.problem, preserved.problem.energy
        fixed_in_scene, inside = mesh.vertices[fixed], problem.rest.vertices[fixed]
        if places is not None:
            count = len(fixed) - len(fixed_mates)
            fixed_in_scene = checked_targets(places, count, "fixed_at", "fixed")
            if mirror is not None:
                fixed_in_scene = mirror.moved(mesh, fixed, fixed_mates, fixed_in_scene)
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
            start = preserved.rest_cages
            positions = positions.local(positions.rows, Anchors(loose, start, np.zeros_like(start)))
        gathered = in_order if positions.mean is None else positions.mean @ in_order
        contact = _contact(problem, ids) if options.avoid_contact else None
        sliding = [
            Sliding.at(
                problem.rest_cages,
                problem.subspace.nonzeros(each.vertices),
                each.track,
                weight / len(each.vertices),
            )
            for each in guides(slides, problem.rest, few=True)
        ]
        terms: list[Term] = [*sliding, *(() if contact is None else (contact,))]
        if mirror is not None:
            terms.append(mirror.term(problem.subspace, problem.rest_cages, _MIRROR_SHARE * weight))
        fixed_box = np.stack([inside.min(axis=0), inside.max(axis=0)]) if len(fixed) else _NO_POINTS
        return cls(
            problem=problem,
            fixed=fixed,
            handle=handle,
            fixed_at=fixed_in_scene,
            handles=handles,
            places_of_targets=gathered[:, : len(handle)].tocsr(),
            places_of_fixed=np.asarray(gathered[:, len(handle) :] @ inside),
            fixed_box=fixed_box,
            anchors=_centres(problem, preserved.scaled, fixed, inside),
            preserved=preserved,
            solver=GaussNewton(energy, positions, preserved.volumes, terms=tuple(terms)),
            contact=contact,
            guides=guides(slides, problem.rest_pose),
            mirror=mirror,
            mates=mates,
        )

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        for each in (self.fixed, self.handle):
            each.setflags(write=False)

    @property
    def rest_cages(self) -> FloatArray:
        """(m, 3): the cages of the shape without handles and fixed vertices."""
        return self.preserved.rest_cages

    @property
    def has_goals(self) -> bool:
        """Whether volumes are set or bounded."""
        return any(each.name for each in self.preserved.constraints)

    @property
    def n_bounds(self) -> int:
        """Number of volumes that are bounded only."""
        return sum(each.bound != 0 for each in self.preserved.constraints)

    @property
    def n_given(self) -> int:
        """Number of handle vertices that targets are given for; the others are their mates."""
        return len(self.handle) - len(self.mates)

    def goal(self, targets: FloatArray) -> FloatArray:
        """Return the targets (k, 3) of all handle vertices, in solver coordinates.

        *targets* (n_given, 3) are in scene coordinates.
        """
        if self.mirror is not None:
            targets = self.mirror.moved(self.problem.mesh, self.handle, self.mates, targets)
        return self.problem.frame.inward(targets)

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

    def shape_errors(self, x: FloatArray) -> tuple[float, float]:
        """Return `Solution.rigid_error` and `slide_error` of *x* (n, 3)."""
        problem, rigid, slide = self.problem, 0.0, 0.0
        x, stiff = problem.frame.about_origin(x), problem.inputs.stiffness
        for ids in () if stiff is None else stiff.rigid:
            turn, shift = rigid_fit(problem.rest_pose.vertices[ids], x[ids])
            off = problem.rest_pose.vertices[ids] @ turn.T + shift - x[ids]
            rigid = max(rigid, largest_length(off))
        is_held = np.zeros(len(x), dtype=bool)
        is_held[self.handle] = is_held[self.fixed] = True
        for guide in self.guides:
            off = x[guide.vertices] - guide.track(x[guide.vertices])[0]
            slide = max(slide, largest_length(off[~is_held[guide.vertices]]))
        return rigid / problem.mesh.diagonal, slide / problem.mesh.diagonal

    @cached_property
    def carrying(self) -> Carrying:
        """How a finish moves components without anything that is held; see `finishing`."""
        stiff = self.problem.inputs.stiffness
        rigid = () if stiff is None else stiff.rigid
        guided = (each.vertices for each in self.guides)
        return self.problem.carrying_from(
            np.concatenate([self.handle, self.fixed, *guided, *rigid])
        )

    def held_volumes(self, x: FloatArray) -> HeldVolumes:
        """Return the volumes of *x* (n, 3) that have goals."""
        x = self.problem.frame.about_origin(x)
        volumes = self.preserved.constraints
        off = list(zip(volumes, volumes.relative(x).tolist(), strict=True))
        now = {each.name: each.target + by * each.size for each, by in off if each.name}
        changes = {each.name: each.change(by) for each, by in off if each.name}
        return HeldVolumes(now, changes, max((each.missed(by) for each, by in off), default=0.0))

    @cached_property
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
