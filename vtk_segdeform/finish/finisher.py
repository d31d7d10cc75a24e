"""The finish of a pose: a few steps of `cell_energy` over all vertices, from the pose of the cages.

    minimise  E(x)   subject to   x = u at fixed vertices and handles,   g(x) = 0            (9)

The equations are those of `solver.gauss_newton`, with the Laplacian of the free vertices in place
of H, which is factored once; fixed vertices and handles are eliminated, so they are exact:

    h = -H^-1 (d + G^T lambda),   lambda = (G H^-1 G^T)^-1 (g - G H^-1 d)                    (21)

Every step ends on the volumes, moved along Z = H^-1 G^T (`solver.exact_volume`), so the energy is
the merit: Anderson acceleration proposes a step, and where the energy rises the plain step replaces
it, and is halved.

Triangles that are folded at the end are opened where they are (`unfolding`).

Parts that cross only after the finish are put half of the way back to where they were before it,
or all of it, with more and more of the surface about them, and the last steps are repeated with
these vertices held: the rest of the surface relaxes around them.  In a cactus bent by 120 degrees
this leaves distortion 0.079 without crossings; the start has 0.120, and the finish with crossings
0.067.  Where many of the faces of a patch crossed before the finish, they are not held, which would
not part them.  Creases in which a few triangles still cross others are smoothed (`creases`).  Of a
deformer that avoids contact, parts that still cross are separated (`untangling`).

Components without a fixed or handle vertex stay where they are, since nothing determines their
place; so do vertices in no triangle.

Long because the iteration and its repairs share the factored problem.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import one_blas_thread
from ..mesh import Crossings, Mesh
from ..progress import Progress, part, tell
from ..solver import Anderson, VolumeConstraint, moved_along, steps_to_volume
from .cell_energy import CellEnergy
from .creases import smoothed
from .factor import factored
from .gradients import around
from .unfolding import unfolded
from .untangling import untangled

_STEPS = 30  # at most
# They end once the energy has fallen by less than 3 % in eight of them.  With a tenth instead,
# distortion of most poses is 1.01 times as much, but of long thin limbs 1.16 times.
_SEVERAL, _GAIN = 8, 0.03
_TOLERANCE = 1e-5  # or once the root mean square of a step, in mesh sizes, is less
_ROUNDED = 1e-9  # the same of a pose that is finished further: such a step may be due to rounding
_WINDOW, _ROWS = 6, 10_000  # steps that the acceleration remembers, and rows of their residuals
_Z_STEPS = 4  # for which the directions of the volumes are used
_ROUNDING = 1e-15  # mesh sizes by which places may differ from those of the start
_RISE = 1e-13  # relative rise of the energy that counts as rounding
_SHORTEST = 1.0 / 16.0  # least share of a step
_UNTANGLED = 3  # rounds of drawing crossing parts apart, and restoring the volume, at most
_RELAXED = 0, 1, 2, 4  # rings about what was drawn apart that stay while the rest relaxes
_UNFOLDED = 3  # rounds of removing folds, and restoring the volume, at most
_MANY = 0.5  # share of the crossing faces of a patch that crossed before
# Shares of the finish at which crossing parts are held, and rings about them, one after another.
_PARTLY = (0.5, 1), (0.0, 1), (0.0, 1), (0.0, 2), (0.0, 4), (0.0, 8)


@dataclass(frozen=True, eq=False)
class Finish:
    """The result of a finish."""

    vertices: FloatArray  # (n, 3); the start itself if no step was taken
    merits: tuple[float, ...]  # the energy before and after each step
    steps: int


class Unbalanced(NamedTuple):
    """What a minimum would not have, at a pose of n vertices; zero where these stay."""

    slope: FloatArray
    """(n, 3): half the gradient of the energy."""
    rows: list[FloatArray]
    """(n, 3) each: the gradients of the volumes, of which the slope of a minimum is a sum."""
    step: FloatArray
    """(n, 3): the next step, which keeps the rotations; smooth motions may have far more to go."""
    stays: BoolArray
    """(n,): the vertices that do not move."""


@dataclass(frozen=True, eq=False)
class _Evaluated:
    """A pose, with its energy and half the gradient of it."""

    x: FloatArray
    value: float
    slope: FloatArray


class Finisher:
    """The problem of one set of fixed and handle vertices, factored.

    Parameters
    ----------
    mesh : Mesh
        n vertices, at rest, in the coordinates of *constraints*.
    energy : CellEnergy
        Of *mesh*.
    held : (n,) bool
        Fixed and handle vertices.
    constraints : sequence of VolumeConstraint
        The volumes to preserve.
    progress : Progress, optional
        Called while the matrix is factored; may cancel.
    avoid_contact : bool
        Also separate parts that crossed before the finish; see `untangling`.

    Raises
    ------
    MeshError
        If the Laplacian of the free vertices is singular.
    """

    def __init__(
        self,
        mesh: Mesh,
        energy: CellEnergy,
        held: BoolArray,
        constraints: Sequence[VolumeConstraint],
        progress: Progress | None = None,
        *,
        avoid_contact: bool = False,
    ) -> None:
        anchored = np.bincount(mesh.components, held) > 0.0
        free = anchored[mesh.components] & ~held
        self._mesh, self._energy = mesh, energy.near(free)
        self._crossings, self._avoid_contact = Crossings(mesh.vertices, mesh.faces), avoid_contact
        self._held, self._stays, self._free = held, ~free, np.flatnonzero(free)
        rows = energy.laplacian[self._free]
        self._to_held = rows[:, np.flatnonzero(held)]
        self._solve = factored(rows[:, self._free], progress)
        corners = (each.faces[each.faces < len(free)] for each in constraints)
        self._constraints = [
            each for each, own in zip(constraints, corners, strict=True) if free[own].any()
        ]
        self._size = 2.0 * float(
            np.linalg.norm(mesh.vertices - mesh.vertices.mean(axis=0), axis=1).max()
        )

    @one_blas_thread()
    def run(
        self,
        start: FloatArray,
        places: FloatArray,
        progress: Progress | None = None,
        *,
        further: bool = False,
    ) -> Finish:
        """Return the finish of the pose *start* (n, 3), with its held vertices at *places* (k, 3).

        *places* are in the order of the vertices.  If *start* has no crossings, nor has the result:
        it is *start* itself if all else fails.  A pose that was finished before is finished
        *further*, with all steps.
        """
        begin = self._at_places(start, places)
        found = self._run(begin, part(progress, 0.0, 0.5), further=further)
        if not found.steps and not self._avoid_contact:
            return found
        return self._apart(begin, found, part(progress, 0.5, 1.0))

    def _apart(self, begin: FloatArray, found: Finish, progress: Progress | None) -> Finish:
        """Return *found*, the finish of *begin*, without crossings that *begin* does not have."""
        tell(progress, 0.0, "looking for crossings")
        if not len(self._crossings.at(found.vertices)):
            return found
        before = self._crossings.at(begin)
        crossing = least = self._grown(found.vertices, before)
        best, end, steps = found, found.vertices, found.steps
        stays = self._stays
        for turn, (share, rings) in enumerate(_PARTLY):
            if not len(least):
                break
            stays = stays | around(self._mesh, crossing, rings)
            own = part(progress, *(0.5 * (turn + np.arange(2)) / len(_PARTLY)))
            places = begin[stays] + share * (end[stays] - begin[stays])
            places[self._held[stays]] = end[self._held]
            problem = Finisher(self._mesh, self._energy, stays, self._constraints, own)
            found = problem._run(problem._at_places(end, places), own)
            steps += found.steps
            crossing = self._grown(found.vertices, before)
            if len(crossing) < len(least):
                best, least = found, crossing
        if len(least) and not len(before):
            return Finish(begin, (), steps)
        x = self._without_creases(best.vertices, part(progress, 0.5, 0.7))
        x = self._opened(x, part(progress, 0.7, 0.8))
        if self._avoid_contact:
            x = self._drawn_apart(x, part(progress, 0.8, 1.0))
        return replace(best, vertices=x, steps=steps)

    def _drawn_apart(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x* untangled and relaxed around; *x* itself if something still crosses."""
        crossing = self._crossings.at(x)
        apart = self._untangled(x, progress) if len(crossing) else x
        if apart is x or len(self._crossings.at(apart)):
            return apart
        for rings in _RELAXED:
            held = self._stays | around(self._mesh, crossing, rings)
            problem = Finisher(self._mesh, self._energy, held, self._constraints, progress)
            relaxed = problem._run(apart, progress).vertices
            if not len(self._crossings.at(relaxed)):
                return self._open_and_apart(relaxed, progress)
        return self._open_and_apart(apart, progress)

    def _open_and_apart(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x*, which does not cross itself, with as few folds as that allows."""
        best, least = x, np.count_nonzero(self._energy.folds.at(x))
        for _ in range(_UNTANGLED):
            if not least:
                break
            x = self._untangled(self._without_folds(x, progress), progress)
            folded = np.count_nonzero(self._energy.folds.at(x))
            if len(self._crossings.at(x)):
                break
            if folded < least:
                best, least = x, folded
        return best

    def _opened(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x* without folds, as far as nothing more crosses after it."""
        opened = self._without_folds(x, progress)
        return opened if len(self._crossings.at(opened)) <= len(self._crossings.at(x)) else x

    def _grown(self, x: FloatArray, before: IntArray) -> IntArray:
        """Return the crossing faces in the pose *x*, of patches of which few crossed *before*."""
        faces, crossing = self._mesh.faces, self._crossings.at(x)
        own = np.flatnonzero(around(self._mesh, np.union1d(crossing, before), 1))
        among = self._mesh.adjacency[own][:, own]
        count, label = connected_components(among, directed=False)
        patch = np.zeros(len(x), dtype=np.int64)
        patch[own] = label
        now, then = (
            np.bincount(patch[faces[each, 0]], minlength=count) for each in (crossing, before)
        )
        grown: IntArray = crossing[(then <= _MANY * now)[patch[faces[crossing, 0]]]]
        return grown

    def between(self, begin: FloatArray, end: FloatArray, shares: float | FloatArray) -> FloatArray:
        """Return *begin* moved by *shares*, (n, 1) or one, of its finish *end*, on the volumes."""
        x = begin + shares * (end - begin)
        x[self._held] = end[self._held]
        x = self._landed(x, self._directions(x))
        return x if np.isfinite(x).all() else end

    def is_better(self, begin: FloatArray, end: FloatArray) -> bool:
        """Return whether *end* has lower energy than *begin* without additional folds."""
        folds = self._energy.folds
        before, after = (self._evaluated(x).value for x in (begin, end))
        return after < before and bool(folds.at(end).sum() <= folds.at(begin).sum())

    def unbalanced(self, x: FloatArray) -> Unbalanced:
        """Return how far the pose *x* (n, 3), on the volumes, is from a minimum."""
        here, step, slope = self._evaluated(x), np.zeros_like(x), np.zeros_like(x)
        if len(self._free):
            step[self._free] = self._step(here, self._directions(x))
        rows = [each.gradient(x) for each in self._constraints]
        slope[self._free] = here.slope[self._free]
        for each in rows:
            each[self._stays] = 0.0
        return Unbalanced(slope, rows, step, self._stays)

    def _run(
        self, begin: FloatArray, progress: Progress | None, *, further: bool = False
    ) -> Finish:
        """Return the finish of a pose whose held vertices are in their places."""
        if not len(self._free):
            return Finish(begin, (), 0)
        found = self._descend(begin, part(progress, 0.0, 0.7), further=further)
        if found.steps:
            x = self._without_folds(found.vertices, part(progress, 0.7, 1.0))
            found = replace(found, vertices=x)
        tell(progress, 1.0, "finished")
        return found

    def _at_places(self, start: FloatArray, places: FloatArray) -> FloatArray:
        """Return *start* with the held vertices at *places*, and the others moved smoothly."""
        offsets = places - start[self._held]
        if np.abs(offsets).max(initial=0.0) <= _ROUNDING * self._size:
            return start
        x = start.copy()
        x[self._held] = places
        if not len(self._free):
            return x
        x[self._free] -= self._solve(self._to_held @ offsets)
        landed = self._landed(x, self._directions(x))
        is_near = np.isfinite(landed).all() and np.ptp(landed - x, axis=0).max() < self._size
        return landed if is_near else x

    def _descend(self, begin: FloatArray, progress: Progress | None, *, further: bool) -> Finish:
        """Return *begin* after as many steps as it takes, or `_STEPS`; *further*, after these."""
        here, free = self._evaluated(begin), self._free
        merits, anderson, age = [here.value], Anderson(_WINDOW), _Z_STEPS
        directions: list[FloatArray] = []
        stride = slice(None, None, 1 + len(free) // _ROWS)
        for count in range(_STEPS):
            tell(progress, count / _STEPS, "finishing on the mesh")
            if age >= _Z_STEPS:
                directions, age = self._directions(here.x), 0
            age += 1
            h = self._step(here, directions)
            tolerance = _ROUNDED if further else _TOLERANCE
            if math.sqrt(float(np.vdot(h, h)) / len(h)) <= tolerance * self._size:
                break
            is_slow = len(merits) > _SEVERAL and here.value > (1.0 - _GAIN) * merits[-1 - _SEVERAL]
            if is_slow and not further:
                break
            guess = anderson.extrapolate(here.x[free], h, h[stride])
            ahead = self._improved(here, guess, directions)
            if ahead is None:
                anderson.forget()
                share = 1.0
                while ahead is None and share >= _SHORTEST:
                    ahead = self._improved(here, here.x[free] + share * h, directions)
                    share *= 0.5
            if ahead is None and age == 1:
                break
            age = _Z_STEPS if ahead is None else age
            if ahead is not None:
                here = ahead
                merits.append(here.value)
        return Finish(here.x, tuple(merits), len(merits) - 1)

    def _directions(self, x: FloatArray) -> list[FloatArray]:
        """Return Z = H^-1 G^T at *x*, (n, 3) for each constraint, up to a power of two.

        They are about as long as the mesh, so that cubics along them overflow no sooner than
        volumes; a power of two changes no digit of a step.
        """
        directions = []
        for constraint in self._constraints:
            direction = np.zeros_like(x)
            direction[self._free] = self._solve(constraint.gradient(x)[self._free])
            exponent = math.frexp(np.abs(direction).max() / self._size)[1]
            direction = np.ldexp(direction, -exponent)
            directions.append(direction)
        return directions

    def _step(self, here: _Evaluated, directions: Sequence[FloatArray]) -> FloatArray:
        """Return h of (21) for the free vertices, (f, 3)."""
        free = self._free
        h: FloatArray = -self._solve(here.slope[free])
        if not directions:
            return h
        z = [each[free] for each in directions]
        rows = [each.gradient(here.x)[free] for each in self._constraints]
        g = np.array([each.violation(here.x) for each in self._constraints])
        gh = np.array([np.vdot(row, h) for row in rows])
        gz = np.array([[np.vdot(row, each) for each in z] for row in rows])
        multipliers = np.linalg.lstsq(gz, g + gh, rcond=1e-12)[0]
        for multiplier, each in zip(multipliers, z, strict=True):
            h -= multiplier * each
        return h

    def _improved(
        self,
        here: _Evaluated,
        free: FloatArray,
        directions: Sequence[FloatArray],
    ) -> _Evaluated | None:
        """Return the pose with the *free* vertices (f, 3) on the volumes, if its energy is less."""
        x = here.x.copy()
        x[self._free] = free
        x = self._landed(x, directions)
        if not np.isfinite(x).all():
            return None
        ahead = self._evaluated(x)
        rise = _RISE * (self._energy.constant + abs(here.value))
        return ahead if ahead.value <= here.value + rise else None

    def _evaluated(self, x: FloatArray) -> _Evaluated:
        return _Evaluated(x, *self._energy.value_and_slope(x))

    def _landed(self, x: FloatArray, directions: Sequence[FloatArray]) -> FloatArray:
        """Return *x* moved along *directions* onto the volumes."""
        if not directions:
            return x
        paths = np.hstack([x, *directions])
        return moved_along(paths, steps_to_volume(self._constraints, paths))

    def _untangled(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x* with fewer crossings, at its volume; *x* itself if there are no fewer."""
        free = np.zeros(len(x), dtype=bool)
        free[self._free] = True
        for _ in range(_UNTANGLED):
            apart = untangled(self._mesh, x, free, self._crossings, progress=progress)
            if apart is x:
                break
            apart = self._landed(apart, self._directions(apart))  # may make it touch again
            fewer = len(self._crossings.at(apart)) < len(self._crossings.at(x))
            if not fewer or not np.isfinite(apart).all():
                break
            x = apart
        return x

    def _without_creases(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x* without those of its crossings that smoothing removes."""
        free = np.zeros(len(x), dtype=bool)
        free[self._free] = True
        smooth = smoothed(self._mesh, x, free, self._crossings.at, progress=progress)
        if smooth is x:
            return x
        smooth = self._landed(smooth, self._directions(smooth))
        is_better = len(self._crossings.at(smooth)) < len(self._crossings.at(x))
        return smooth if is_better and np.isfinite(smooth).all() else x

    def _without_folds(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return *x* with as few folds as its places and volumes allow."""
        folds = self._energy.folds
        free = np.zeros(len(x), dtype=bool)
        free[self._free] = True
        best, least = x, np.count_nonzero(folds.at(x))
        for turn in range(_UNFOLDED):
            if not least:
                break
            tell(progress, turn / _UNFOLDED, "removing folds")
            x = unfolded(self._mesh, folds, x, free)
            x = self._landed(x, self._directions(x))
            folded = np.count_nonzero(folds.at(x))
            if not np.isfinite(x).all() or folded >= least:
                break
            best, least = x, folded
        return best
