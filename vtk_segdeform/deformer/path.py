"""The path of a deformer: its last pose, and how it gets to the next.  Nothing else changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, largest_length
from ..geometry import rigid_fit
from ..solver import (
    LONGEST_MOVE,
    GaussNewton,
    ScaledSurface,
    SolverOptions,
    SolverResult,
    Status,
    Together,
    VolumeConstraint,
    are_met,
    moved_along,
    steps_to_volume,
    waypoints,
)
from .constraints import Constraints
from .growth import VOLUME_LEG
from .problem import Problem

_WAYPOINT_TOLERANCE, _WAYPOINT_STEPS = 1e-3, 12
_LONGEST_TURN = math.radians(120.0)  # of a handle without a stop: from 180 it turns the other way
_MORE_SOLVES = 4  # at most, after a scaling or with other planes of slides
_SCALED = 3e-5  # relative scale from which another solve follows
_ROUNDING = 1e-7  # relative scale that counts as rounding
_VANISHED = 1e-12  # length of a direction of a volume, relative to the longest, that is rounding
_MISSED = 1e-9  # relative error of a volume that is not met
_CLEARANCE = 0.1  # mesh sizes: farther parts are not looked for
_CONTACT_TOLERANCE, _CONTACT_STEPS = 1e-5, 300  # of a solve with active contacts


class Pose(NamedTuple):
    """Where a solve ended."""

    x: FloatArray
    """(n, 3), in the coordinates of poses; see `frame`."""
    result: SolverResult
    """Of the last minimisation."""
    steps: int
    """Of all."""


@dataclass(eq=False)
class Path:
    """The last pose, and what the next solve continues with."""

    constraints: Constraints
    solver: GaussNewton  # with its factor, its acceleration and the way of the last solves
    p: FloatArray  # (m, 3), the cages of the pose, in solver coordinates
    end: FloatArray  # (m, 3), where the solver ended: p, before the exact volumes
    targets: FloatArray  # (k, 3), of the last solve that came to a pose
    missed: FloatArray | None = None  # (k, 3), of one after it that came to none
    active: tuple[int, ...] = ()  # `active_volumes`, of a mesh that is not scaled
    is_on_volumes: bool = True
    # The targets (k, 3) where the last solve stopped on its way, and the goals to come; else empty.
    way: tuple[FloatArray, ...] = ()

    @classmethod
    def begin(cls, constraints: Constraints, p: FloatArray, targets: FloatArray) -> Path:
        """Return a path that begins at cages *p* (m, 3), which are a pose for *targets* (k, 3)."""
        path = cls(constraints, constraints.solver.fresh(), p, p, targets)
        preserved, scaled = constraints.preserved.constraints, constraints.preserved.scaled
        is_rest = p is constraints.rest_cages
        if scaled is not None:
            if not is_rest:
                path._continue_from(p)
            return path
        path.active = tuple(k for k, each in enumerate(preserved) if not each.bound)
        if not is_rest or constraints.has_goals:
            path.is_on_volumes = not (preserved.missed(path._problem.map(p)) > _MISSED).any()
        is_ready = path.is_on_volumes and not constraints.has_goals
        if len(path.active) < len(preserved) or not is_ready:
            path._continue_from(p)
        return path

    @property
    def _problem(self) -> Problem:
        return self.constraints.problem

    @property
    def asked(self) -> FloatArray:
        """The targets (k, 3) of the last solve."""
        return self.targets if self.missed is None else self.missed

    @property
    def is_solved(self) -> bool:
        """Whether the handles are in their places, unlike those of a grown shape at rest."""
        return not (self.constraints.has_goals and self.p is self.constraints.rest_cages)

    def copy(self) -> Path:
        """Return a path that continues from here independently."""
        return replace(self, solver=self.solver.copy())

    def solve(self, goal: FloatArray, options: SolverOptions, *, is_live: bool = False) -> Pose:
        """Go on to the pose for *goal* (k, 3), with exact volumes.

        If *is_live*, the steps on the way count as well: so it may end at a waypoint, from where
        the next solve goes on.

        For a large mesh the steps preserve the volumes of a coarse surface only, so it is scaled
        to the exact ones.  If by more than `_SCALED`, they are taken again with the coarse volumes
        of the scaled mesh.
        """
        self.missed, steps = None, self.change_volumes(options)
        on_the_way, stopped = self._follow_waypoints(goal, options, is_live=is_live)
        steps += on_the_way
        self.targets = goal
        if stopped is not None:
            x, _ = self._with_exact_volume(stopped)
            return Pose(x, replace(stopped, status=Status.STEP_LIMIT), steps)
        contact = self.constraints.contact
        if contact is not None and contact.is_active(self.end):
            options = replace(
                options,
                tolerance=max(options.tolerance, _CONTACT_TOLERANCE),
                max_steps=min(options.max_steps, _CONTACT_STEPS),
            )
        released: set[int] = set()
        for _ in range(1 + _MORE_SOLVES + 2 * self.constraints.n_bounds):
            result = self._minimise(goal, options)
            steps += result.steps
            x, scaled_by = self._with_exact_volume(result)
            is_renewed = self.solver.renew_terms(self.end)
            if self._exchange_bounds(x, goal, released):
                continue
            is_exact = scaled_by <= _SCALED and not is_renewed
            is_late = result.status is Status.STEP_LIMIT or steps >= options.max_steps
            if is_exact or is_late:
                break
        return Pose(x, result, steps)

    def remaining(self) -> float:
        """Return by how much Newton's step would move the surface, in mesh sizes."""
        return self.solver.remaining(self.end, self.constraints.places(self.targets))

    def _minimise(self, targets: FloatArray, options: SolverOptions) -> SolverResult:
        result = self.solver.minimise(self.end, self.constraints.places(targets), options)
        self.p = self.end = result.p
        return result

    def _continue_from(self, p: FloatArray) -> None:
        """Continue from cages *p* (m, 3), and preserve the volumes of that pose."""
        self.p = self.end = p
        self.solver.renew_terms(p)
        volumes = self.constraints.preserved.volumes.among(self.active_volumes)
        self.solver.preserve(volumes.preserved_at(p))

    @property
    def active_volumes(self) -> tuple[int, ...]:
        """The numbers of the volumes that hold: all but bounds that the pose is within."""
        scaled = self.constraints.preserved.scaled
        preserved = self.constraints.preserved.constraints
        return self.active if scaled is None else tuple(range(len(preserved)))

    @property
    def _preserved(self) -> Together:
        """The volumes that hold."""
        every = self.constraints.preserved.constraints
        active = self.active_volumes
        return every if len(active) == len(every) else Together(every[k] for k in active)

    def change_volumes(self, options: SolverOptions) -> int:
        """Change the volumes to their targets, in legs; return the number of steps."""
        if self.is_on_volumes:
            return 0
        preserved, volumes, *_ = self.constraints.preserved
        x = self._problem.map(self.p)
        missed = np.flatnonzero(preserved.missed(x) > _MISSED).tolist()
        self.active = tuple(sorted({*self.active, *missed}))
        begin = volumes.among(self.active).preserved_at(self.p)
        off = preserved.relative(x)[list(self.active)].tolist()
        farthest = max(abs(math.log1p(each)) if each > -1.0 else 1.0 for each in off)
        legs, steps = math.ceil(farthest / VOLUME_LEG), 0
        options = replace(options, tolerance=_WAYPOINT_TOLERANCE, max_steps=_WAYPOINT_STEPS)
        for leg in range(1, legs + 1):
            has_landed = self._set_share(leg / legs, begin.constraints, off)
            if leg == legs:
                break
            if not has_landed:  # nor would it farther on
                self._set_share(1.0, begin.constraints, off)
                break
            steps += self._minimise(self.targets, options).steps
        self.is_on_volumes = True
        return steps

    def _set_share(
        self, share: float, begin: Sequence[VolumeConstraint], off: Sequence[float]
    ) -> bool:
        """Set volumes a *share* of the way from *begin*, which is *off* its goals; see below."""
        ends = zip(begin, off, strict=True)
        return self._set_volumes(
            replace(each, target=each.target + share * (each.nearer(by) - each.target))
            for each, by in ends
        )

    def _set_volumes(self, constraints: Iterable[VolumeConstraint]) -> bool:
        """Let the active volumes have the targets of *constraints*, and move the cages there.

        Return whether they have arrived there.
        """
        volumes, before = self.constraints.preserved.volumes.among(self.active), self.end
        self.solver.preserve(replace(volumes, constraints=Together(constraints)))
        self.p = self.end = self.solver.landed(before)
        return self.end is not before

    def _exchange_bounds(self, x: FloatArray, goal: FloatArray, released: set[int]) -> bool:
        """Activate bounds that the mesh *x* (n, 3) violates; release those with a wrong multiplier.

        Returns whether any did; each is *released* once at most.
        """
        if not self.constraints.n_bounds:
            return False
        preserved = self.constraints.preserved.constraints
        off = preserved.relative(x).tolist()
        missed = set(np.flatnonzero(preserved.missed(x) > _MISSED).tolist()) - set(self.active)
        multipliers = self.solver.multipliers(self.end, self.constraints.places(goal))
        slack = {
            k
            for k, multiplier in zip(self.active, multipliers, strict=True)
            if multiplier * preserved[k].bound > 0.0 and k not in released
        }
        if not missed and not slack:
            return False
        released |= slack
        last = dict(zip(self.active, self.solver.volumes.constraints, strict=True))
        self.active = tuple(sorted({*self.active, *missed} - slack))
        now = self.constraints.preserved.volumes.among(self.active).preserved_at(self.end)
        self._set_volumes(
            last.get(k, replace(each, target=each.nearer(off[k])))
            for k, each in zip(self.active, now.constraints, strict=True)
        )
        return True

    def _follow_waypoints(
        self, goal: FloatArray, options: SolverOptions, *, is_live: bool
    ) -> tuple[int, SolverResult | None]:
        """Move through the waypoints before *goal*.

        Return the number of steps, and the last result if there was no step left for the goal.
        """
        most = options.max_steps if is_live else math.inf
        longest = min(most, _WAYPOINT_STEPS)
        options = replace(options, tolerance=_WAYPOINT_TOLERANCE, max_steps=int(longest))
        steps, result = 0, None
        for count, (targets, ahead) in enumerate(self._legs(self._goals_to(goal))):
            if steps + count >= most:  # a minimisation without steps takes as long as one
                return steps, result
            result = self._minimise(targets, options)
            steps += result.steps
            self.way = (targets, *ahead)
        if steps >= most:
            return steps, result
        self.way = ()
        return steps, None

    def _goals_to(self, goal: FloatArray) -> list[FloatArray]:
        """Return *goal*, after those goals on the way without which a handle would turn back."""
        stops = list(self.way)
        while len(stops) > 1:
            turns = self._turns(stops[-2], stops[-1]) + self._turns(stops[-1], goal)
            if largest_length(turns) > _LONGEST_TURN:
                break
            stops.pop()
        return [*stops[1:], goal]

    def _turns(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return the rotation vectors (h, 3) of the handles of three vertices or more."""
        handles = [ids for ids in self.constraints.handles if len(ids) > 2]
        turns = [Rotation.from_matrix(rigid_fit(start[ids], end[ids])[0]) for ids in handles]
        return np.array([each.as_rotvec() for each in turns]).reshape(-1, 3)

    def _legs(self, goals: list[FloatArray]) -> Iterator[tuple[FloatArray, list[FloatArray]]]:
        """Yield the waypoints (k, 3) before the last of *goals*, each with the goals ahead."""
        for k, goal in enumerate(goals, 1):
            for targets in self._way_to(goal):
                yield targets, goals[k - 1 :]
            if goals[k:]:
                yield goal, goals[k:]

    def _way_to(self, goal: FloatArray) -> Iterator[FloatArray]:
        """Yield the waypoints (k, 3) before *goal*; near a contact they are close together."""
        handles, start = self.constraints.handles, self.way[0] if self.way else self.targets
        shortest = self._longest_leg(0.0)
        way = [start, *waypoints(start, goal, handles, shortest)]
        done, last, most = 0, len(way) - 1, round(1.0 / shortest)
        while done + 1 < last:
            ahead = min(most, last - done)
            if ahead > 1:
                longest = self._longest_leg(_CLEARANCE) * LONGEST_MOVE
                while ahead > 1 and largest_length(way[done + ahead] - way[done]) > longest:
                    ahead -= 1
            done += ahead
            if done < last:
                yield way[done]

    def _longest_leg(self, most: float) -> float:
        """Return how far apart waypoints may be at this pose, as a share of the usual distance.

        With contacts it is little more than the clearance between parts, which is looked for up to
        *most*: a part that has crossed another by less is pushed back.
        """
        contact = self.constraints.contact
        if contact is None or 0.0 < most <= contact.surface.spacing:
            return 1.0
        clearance = contact.clearance(self.end, most) if most else 0.0
        spacing = contact.surface.spacing
        return min(1.0, max(clearance + 0.5 * spacing, spacing) / LONGEST_MOVE)

    def _with_exact_volume(self, result: SolverResult) -> tuple[FloatArray, float]:
        """Restore the exact volumes; return the mesh and by how much it was scaled.

        The latter is 0 if the mesh was moved along the directions of the solver instead.
        """
        directions = result.directions
        if not directions:
            return self._problem.map(self.p), 0.0
        scaled, preserved = self.constraints.preserved.scaled, self._preserved
        if scaled is not None:
            return self._scaled(scaled)
        lengths = np.array([np.abs(each).max() for each in directions])
        if lengths.min() > _VANISHED * lengths.max():
            x = self._moved_to_volume(preserved, directions)
        else:
            x = self._problem.map(self.p)
        if len(preserved) > 1 and not are_met(preserved, x):
            # Of small bodies the coarse volumes, and so these directions, may vanish.
            slopes = [each.gradient(x) / self._problem.frame.size for each in preserved]
            rows = [self._problem.subspace.adjoint(slope) for slope in slopes]
            x = self._moved_to_volume(preserved, self.solver.directions(rows))
        return x, 0.0

    def _moved_to_volume(
        self, preserved: Sequence[VolumeConstraint], directions: Sequence[FloatArray]
    ) -> FloatArray:
        """Move the cages along *directions* (m, 3) to the exact volumes; return the mesh."""
        paths = self._problem.map(self.p, directions)
        steps = steps_to_volume(preserved, paths)
        self.p = self.p + sum(tk * z for tk, z in zip(steps, directions, strict=True))
        return moved_along(paths, steps)

    def _scaled(self, surface: ScaledSurface) -> tuple[FloatArray, float]:
        """Scale the mesh and its cages to the exact volume; return the mesh and by how much."""
        frame, anchors = self._problem.frame, self.constraints.anchors
        moves = (self.p - self._problem.rest_cages) * frame.size
        x, scales = surface.scaled(moves, frame.centre - frame.origin + anchors)
        inside = (anchors / frame.size)[surface.body_of_column]
        p = self.p = inside + scales[surface.body_of_column, None] * (self.p - inside)
        scaled_by = float(np.abs(scales - 1.0).max())
        if scaled_by > _ROUNDING:
            self._continue_from(p)
        return x, scaled_by
