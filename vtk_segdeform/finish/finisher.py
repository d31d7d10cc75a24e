"""The finish of a pose: as rigid as possible within a length l, and where the cages are beyond it.

    minimise  E(x) + sum_i w_i |x_i - y_i|^2,      w_i = A_i / l_i^2
    subject to  x = u at fixed vertices and handles,   g(x) = 0                              (9)

E is the energy of `cell_energy` and y the pose of the cages, with fixed vertices and handles put in
their places; A_i is the area around vertex i, and l_i twice the spacing of the cages there, whose
square is the area around one of their vertices.  The Hessian of E is at most its Laplacian C, which
is A_i k^2 for a wave with the wave number k.  So waves that are long beside l stay as the cages
found them, and shorter ones, which cages hardly represent, relax.  How limbs bend is left to the
cages: their energy has the detail term (5), and the minimum of E alone is farther from where real
bodies are.

The iteration is that of the cages (`solver.newton`).  H is the rows of the free vertices of
C + diag(w), factored once; fixed vertices and handles are eliminated, so they are exact.  E is a
minimum over rotations of quadratics with the Laplacian C, so the plain step minimises an upper
bound of the objective.  Mostly 10 to 70 steps are taken until one moves no vertex by more than 3e-6
of the diagonal: 15 of 16 poses were then within 1.1e-4 of the converged one.

A finish that avoids contact untangles y (`untangling`), and where faces come to cross that do not
in y, it continues with ten times the weights w: they stay about as far apart as they are there.

Components without a fixed or handle vertex stay where they are, since nothing determines their
place; so do vertices in no triangle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray
from ..kernels import one_blas_thread
from ..mesh import Crossings, Mesh
from ..progress import Progress, tell
from ..solver import (
    CONVERGED,
    Anderson,
    Status,
    Step,
    VolumeConstraint,
    are_met,
    constrained_step,
    minimise,
    moved_along,
    steps_to_volume,
)
from .cell_energy import CellEnergy
from .factor import factored
from .untangling import around, untangled

_STEPS = 200  # at most
_TOLERANCE = 0.03 * CONVERGED  # diagonals; a step that moves less is the last
# Where something comes to cross: rounds, factor of w, and rings around the faces, of a hold.
_HOLDS, _FIRMER, _RINGS = 8, 10.0, 2
_LANDINGS = 3  # on several volumes, of which the first is inexact where the surface is crumpled
_WINDOW, _ROWS = 6, 10_000  # steps that the acceleration remembers, and rows of their residuals


@dataclass(frozen=True, eq=False)
class Finish:
    """The result of a finish."""

    vertices: FloatArray  # (n, 3); the start itself if no step was taken
    merits: tuple[float, ...]  # the objective before and after each step
    steps: int
    remaining: float  # the largest motion of a vertex in the next step
    status: Status


class _Evaluated(NamedTuple):
    """A pose, with its objective and half the gradient of it, which is 0 at held vertices."""

    at: FloatArray  # x, (n, 3)
    merit: float
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
    weights : (n,) float
        w.  0: as rigid as possible, wherever the cages are.
    progress : Progress, optional
        Called while the matrix is factored; may cancel.
    avoid_contact : bool
        Separate parts that cross in the pose of the cages, and keep others from crossing.

    Raises
    ------
    MeshError
        If the matrix is singular.
    """

    def __init__(
        self,
        mesh: Mesh,
        energy: CellEnergy,
        held: BoolArray,
        constraints: Sequence[VolumeConstraint],
        weights: FloatArray,
        progress: Progress | None = None,
        *,
        avoid_contact: bool = False,
    ) -> None:
        anchored = np.bincount(mesh.components, held) > 0.0
        free = anchored[mesh.components] & ~held
        self._mesh, self._energy = mesh, energy.near(free)
        self._held, self._free = held, np.flatnonzero(free)
        rows = energy.laplacian[self._free]
        self._to_held, self._own = rows[:, np.flatnonzero(held)], rows[:, self._free]
        self._crossings = Crossings(mesh.vertices, mesh.faces) if avoid_contact else None
        self._factor(weights, progress)
        corners = (each.faces[each.faces < len(free)] for each in constraints)
        self._constraints = [
            each for each, own in zip(constraints, corners, strict=True) if free[own].any()
        ]
        self._diagonal = mesh.diagonal

    def _factor(self, weights: FloatArray, progress: Progress | None) -> None:
        """Let *weights* (n,) be w."""
        self._weights = weights[:, None]
        pulls = sparse.diags_array(weights[self._free])
        self._solve = factored(sparse.csr_array(self._own + pulls), progress)

    @one_blas_thread()
    def run(
        self,
        pose: FloatArray,
        places: FloatArray,
        progress: Progress | None = None,
        *,
        start: FloatArray | None = None,
    ) -> Finish:
        """Return the finish of the *pose* (n, 3) of the cages, with its held vertices at *places*.

        *places* (k, 3) are in the order of the vertices.  The steps begin at *start* (n, 3), such
        as an earlier finish; by default at y.
        """
        self._y = y = self._untangled(self._at_places(pose, places), progress)
        begin = y if start is None or start is pose else self._at_places(start, places)
        if not len(self._free):
            return Finish(begin, (), 0, 0.0, Status.CONVERGED)
        found = self._apart(self._descend(begin, progress), progress)
        tell(progress, 1.0, "finished")
        return found

    def made(self, found: Finish, change: Callable[[FloatArray], FloatArray]) -> Finish:
        """Return *found* with its free vertices after an affine *change*, on the volumes.

        The directions of the volumes are changed alike.
        """
        x = found.vertices.copy()
        x[self._free] = change(x)[self._free]
        for _ in range(_LANDINGS):
            directions = [self._at_free(change(x + d) - change(x)) for d in self._directions(x)]
            x = self._landed_near(x, directions)
            if are_met(self._constraints, x):
                break
        return replace(found, vertices=x)

    def _apart(self, found: Finish, progress: Progress | None) -> Finish:
        """Return *found* with w raised around faces that do not cross in y, until they do not."""
        if self._crossings is None:
            return found
        before, weights = self._crossings.at(self._y), self._weights.ravel()
        for _ in range(_HOLDS):
            crossing = np.setdiff1d(self._crossings.at(found.vertices), before)
            if not len(crossing):
                return found
            weights = np.where(around(self._mesh, crossing, _RINGS), _FIRMER, 1.0) * weights
            self._factor(weights, progress)
            again = self._descend(found.vertices, progress)
            found = replace(again, steps=found.steps + again.steps)
        return Finish(self._y, (), found.steps, 0.0, Status.STALLED)

    def _untangled(self, x: FloatArray, progress: Progress | None) -> FloatArray:
        """Return the start *x* (n, 3) with fewer crossings, on the volumes; or as it is."""
        if self._crossings is None:
            return x
        free = np.zeros(len(x), dtype=bool)
        free[self._free] = True
        apart = untangled(self._mesh, x, free, self._crossings, progress=progress)
        if apart is x:
            return x
        landed = self._landed(apart, self._directions(apart))
        return landed if np.isfinite(landed).all() else x

    def _at_places(self, pose: FloatArray, places: FloatArray) -> FloatArray:
        """Return *pose* with the held vertices at *places*, and those within l moved along."""
        offsets = places - pose[self._held]
        if not offsets.any():
            return pose
        x = pose.copy()
        x[self._held] = places
        if not len(self._free):
            return x
        x[self._free] -= self._solve(self._to_held @ offsets)
        return self._landed_near(x, self._directions(x))

    def _descend(self, begin: FloatArray, progress: Progress | None) -> Finish:
        """Return *begin* after as many steps as it takes, at most `_STEPS`."""
        end = minimise(
            self,
            self._evaluated(begin),
            Anderson(_WINDOW),
            tolerance=_TOLERANCE * self._diagonal,
            max_steps=_STEPS,
            progress=progress,
            message="finishing on the mesh",
        )
        last = self.step(end.pose) if end.step is None else end.step
        return Finish(end.pose.at, end.merits, len(end.merits) - 1, last.length, end.status)

    @property
    def constant(self) -> float:
        """The size of the terms of the energy."""
        return self._energy.constant

    def step(self, here: _Evaluated) -> Step:
        """Return the step (21)."""
        rows = [self._at_free(each.gradient(here.at)) for each in self._constraints]
        g = np.array([each.violation(here.at) for each in self._constraints])
        h, _, directions = constrained_step(self._solved, here.slope, rows, g)
        return Step(h, directions, math.sqrt(float(np.einsum("ij,ij->i", h, h).max())))

    def another(self, _: _Evaluated) -> None:
        """Return no other step: there is one Hessian."""

    def allows(self, _: _Evaluated, __: FloatArray) -> bool:
        """Return True: no motion is limited."""
        return True

    def moved(self, x: FloatArray, directions: Sequence[FloatArray]) -> _Evaluated:
        """Return *x* moved along *directions* onto the volumes, and the objective there."""
        if np.isfinite(x).all():  # otherwise there is no volume to restore
            x = self._landed(x, directions)
        return self._evaluated(x) if np.isfinite(x).all() else _Evaluated(x, math.inf, x)

    def residual(self, h: FloatArray) -> FloatArray:
        """Return some rows of *h*."""
        return h[self._free[:: 1 + len(self._free) // _ROWS]]

    def _directions(self, x: FloatArray) -> list[FloatArray]:
        """Return Z at *x*, (n, 3) for each constraint."""
        return self._solved([self._at_free(each.gradient(x)) for each in self._constraints])

    def _solved(self, rights: Sequence[FloatArray]) -> list[FloatArray]:
        """Return H^-1 of *rights*, (n, 3) each: 0 at held vertices."""
        found = []
        for right in rights:
            solved = np.zeros_like(right)
            solved[self._free] = self._solve(right[self._free])
            found.append(solved)
        return found

    def _at_free(self, values: FloatArray) -> FloatArray:
        """Return *values* (n, 3) with 0 at held vertices."""
        found = np.zeros_like(values)
        found[self._free] = values[self._free]
        return found

    def _evaluated(self, x: FloatArray) -> _Evaluated:
        value, slope = self._energy.value_and_slope(x)
        away = x - self._y
        pull = self._weights * away
        return _Evaluated(x, value + float(np.vdot(pull, away)), self._at_free(slope + pull))

    def _landed_near(self, x: FloatArray, directions: Sequence[FloatArray]) -> FloatArray:
        """Return *x* moved along *directions* onto the volumes; as it is if they are far away."""
        landed = self._landed(x, directions)
        is_near = np.isfinite(landed).all() and np.ptp(landed - x, axis=0).max() < self._diagonal
        return landed if is_near else x

    def _landed(self, x: FloatArray, directions: Sequence[FloatArray]) -> FloatArray:
        """Return *x* moved along *directions* onto the volumes.

        They are scaled to about 1, so that cubics along them overflow no sooner than volumes; a
        power of two changes no digit of a step.
        """
        if not directions:
            return x
        scales = [-math.frexp(np.abs(each).max())[1] for each in directions]
        paths = np.hstack([x, *map(np.ldexp, directions, scales)])
        return moved_along(paths, steps_to_volume(self._constraints, paths))
