"""Gauss-Newton in the subspace of the cages, with volume held by Lagrange multipliers.

    minimise  E(p) + sum_i omega_i |x_i - u_i|^2    subject to  g(x) = 0,   x = W~ p    (20)

with E the shape energy (5), u_i where the fixed vertices (6) and handles (7) belong, and g the
volume constraints (9).  The paper's step, with J_f replaced by A, is eq. (21):

    h = -H^-1 (d + G^T lambda),   lambda = (G H^-1 G^T)^-1 (g - G H^-1 d)

    H  W~^T A^T A W~ plus the position weights: constant, factored once by Cholesky
    d  half the gradient of the objective;  G = J_g W~, one row per constraint

(The paper prints a minus before its lambda; with it G h = -g would not hold.)

Four things are added, each told by a number from the cactus bent by 60 degrees:

1. *Exact volume.*  Along Z = H^-1 G^T the volume is a cubic of the step length; its root is the
   last operation of every step.  |dV| / V is then about 1e-15; (21) alone leaves 1e-4.
2. *Curvature* (`hessian`).  (21) lets rotations follow one step behind: hundreds of steps, and
   a small one says little of how far there is to go.  With their part in H, and that of the
   volumes held, it is Newton's step, and about as long as the way that is left.
3. *Anderson acceleration* (`anderson`) of (21) as a fixed-point map p -> q(p), for what has
   turned since H was factored.
4. *Safeguard.*  All iterates meet the constraints, so the objective itself is the merit: where it
   rises an accelerated step gives way to the plain one, and that is shortened (epsilon, 3.3).

Source
------
Section 3.3 of the paper.  Y. Peng, B. Deng, J. Zhang, F. Geng, W. Qin, L. Liu, "Anderson
acceleration for geometry optimization and physics simulation", SIGGRAPH 2018 (the safeguard).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import FloatArray
from ..energy import Energy, Factor, curved_factor, factored
from ..errors import CageError
from ..progress import tell
from .anderson import Anderson
from .iteration import Course, Iteration, Point, SolverOptions
from .position_constraints import PositionTerm, Pull
from .solution import Status
from .volume_constraints import Volumes, moved, restore

_RISE = 1e-13  # relative rise of the merit that counts as rounding
_DAMPING = 1e-9  # of the mean diagonal of H
_CLOSE = 1e-2  # the paper's step, to where multipliers tell how volumes curve
_SHORTEST = 1.0 / 64.0  # epsilon of section 3.3 below which a step is given up
_NOTHING = np.empty((0, 3))


@dataclass(eq=False)
class GaussNewton:
    """The factored problem; `minimise` runs it for one set of targets."""

    energy: Energy
    positions: PositionTerm
    volumes: Volumes
    _hessian: FloatArray = field(init=False, repr=False)
    _factor: Factor = field(init=False, repr=False)
    _left: Course | None = field(init=False, repr=False, default=None)
    _last: Point | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        hessian = self.energy.quadratic + self.positions.quadratic()
        # Cage vertices that move nothing (a region without fixed vertices or handles, weights
        # near zero) leave H singular.  A share of the identity damps the step there; d is
        # untouched, and with it every point where the iteration can rest.
        trace = np.trace(hessian) / len(hessian)
        damping = np.diag(np.full(len(hessian), _DAMPING * trace))
        if not len(self.positions.rows):  # nothing holds the whole: rounding would carry it off
            mean = self.energy.subspace.adjoint(np.ones((self.energy.subspace.n_vertices, 1)))
            damping += trace * (mean @ mean.T) / np.vdot(mean, mean)
        self._hessian = hessian + damping
        factor = factored(self._hessian)
        if factor is None:
            raise CageError(
                "the cages hardly move the mesh, so no pose can be solved for: "
                "make them fit more tightly"
            )
        self._factor = factor

    def copy(self) -> GaussNewton:
        """Return one that goes on from here as this one would, on its own."""
        other = copy.copy(self)
        other._left = copy.deepcopy(self._left)
        return other

    def forget(self) -> None:
        """Let the next call begin as if it were the first."""
        self._left = self._last = None

    def minimise(self, p: FloatArray, targets: FloatArray, options: SolverOptions) -> Iteration:
        """Iterate from cage vertices *p* (m, 3) for positions *targets* (k, 3).

        From where the last call ended, for the same targets, it goes on as if it had not.
        """
        course, self._left = self._left, None
        if course is None:
            course = Course(Anderson(options.window), self._factor)
        elif not course.goes_on(p, targets, options):
            course = course.for_other_targets(options)
        multipliers = np.zeros(len(self.volumes.constraints))
        directions: list[FloatArray] = []
        pull = self.positions.toward(targets)
        here = self._taken_up(p, pull)
        merits = [here.merit]
        status = Status.STEP_LIMIT
        curved = bool(options.window) and self.energy.exact
        while len(merits) <= options.max_steps:
            tell(options.progress, (len(merits) - 1) / options.max_steps, "solving")
            if curved and (course.factor_is_old):
                course.renew(self._curved(here, course) or self._factor)
            course.age += 1
            step, multipliers, directions = self._step(here, course.factor)
            course.size = self._size(step)
            if curved and course.is_astray:
                course.doubt_factor()
                continue
            if course.size <= options.tolerance:
                status = Status.CONVERGED
                break
            ahead = None
            if options.window:
                residual = self._factor.triangle.T @ step
                guess = course.memory.extrapolate(here.p, step, residual)
                ahead = self._retract(guess, directions, pull, options)
                if not self._improves(ahead, here):
                    course.memory.forget()
                    ahead = None
                    if curved and course.age > 1:  # look again before giving way to the plain step
                        course.doubt_factor()
                        continue
            ahead = ahead or self._shortened(here, step, directions, pull, options)
            if ahead is None:
                status = Status.STALLED
                break
            here = ahead
            merits.append(here.merit)
        self._left, self._last = course.ended(here.p, targets, options), here
        return Iteration(
            p=here.p,
            multipliers=multipliers,
            directions=tuple(directions),
            status=status,
            steps=len(merits) - 1,
            step_size=course.size,
            shape=here.shape,
            merits=tuple(merits),
        )

    def _curved(self, here: Point, course: Course) -> Factor | None:
        curve = self.volumes.curve if course.is_near else None
        step, multipliers, _ = self._step(here, self._factor)
        of_volumes = curve(here.p, multipliers) if curve and self._size(step) < _CLOSE else None
        return curved_factor(self._hessian, self.energy, here.p, of_volumes)

    def _step(self, here: Point, factor: Factor) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
        """Return h and lambda of (21), and the directions Z in which the volume is restored."""
        constraints, rows = self.volumes.constraints, here.rows
        h, *directions = factor.solve_all([-here.slope, *rows])
        if not constraints:
            return h, np.zeros(0), []
        matrix = np.array([[np.vdot(row, z) for z in directions] for row in rows])
        g = np.array([c.violation(here.x) for c in constraints])
        along = np.array([np.vdot(row, h) for row in rows])
        multipliers = np.linalg.lstsq(matrix, g + along, rcond=1e-12)[0]
        for multiplier, z in zip(multipliers, directions, strict=True):
            h -= multiplier * z
        return h, multipliers, directions

    def _retract(
        self,
        p: FloatArray,
        directions: Sequence[FloatArray],
        pull: Pull,
        options: SolverOptions,
    ) -> Point:
        """Return *p* moved along *directions* onto the constraints, and the objective there."""
        if not np.isfinite(p).all():
            return Point(p, p, math.inf, p, (), math.inf, p)
        if not directions or not options.exact_volume:
            return self._evaluate(p, self._surface(p), pull)
        paths = self.volumes.surface.map(np.hstack([p, *directions]))
        t = restore(self.volumes.constraints, paths)
        p = p + sum(tk * z for tk, z in zip(t, directions, strict=True))
        return self._evaluate(p, moved(paths, t), pull)

    def _surface(self, p: FloatArray) -> FloatArray:
        asked = self.volumes.constraints or self.energy.turns_vertices
        return self.volumes.surface.map(p) if asked else _NOTHING

    def _evaluate(self, p: FloatArray, x: FloatArray, pull: Pull) -> Point:
        pulled = self.energy.pulled(p, x)
        forces = [c.gradient(x) for c in self.volumes.constraints]
        if self.energy.turns_vertices:  # they, too, are on the surface: in one pass over W~
            pulled, *rows = self.volumes.surface.adjoints([pulled, *forces])
        else:
            rows = self.volumes.surface.adjoints(forces)
        value, slope = self.energy.settled(p, pulled)
        return Point(p, x, value, slope, tuple(rows), value, slope).toward(pull)

    def _taken_up(self, p: FloatArray, pull: Pull) -> Point:
        """Return the point at *p*; where the last call ended, most of it is known."""
        last = self._last
        if last is None or last.p is not p:
            return self._evaluate(p, self._surface(p), pull)
        return last.toward(pull)

    def _shortened(
        self,
        here: Point,
        step: FloatArray,
        directions: Sequence[FloatArray],
        pull: Pull,
        options: SolverOptions,
    ) -> Point | None:
        """Return the longest of the steps h, h/2, h/4 ... that lowers the objective, or None."""
        epsilon = 1.0
        while epsilon >= _SHORTEST:
            ahead = self._retract(here.p + epsilon * step, directions, pull, options)
            comparable = self.energy.exact and options.exact_volume
            if self._improves(ahead, here) or (not comparable and np.isfinite(ahead.merit)):
                return ahead
            epsilon *= 0.5
        return None

    def _improves(self, ahead: Point, here: Point) -> bool:
        return ahead.merit <= here.merit + _RISE * (self.energy.constant + abs(here.merit))

    def _size(self, step: FloatArray) -> float:
        return math.sqrt(max(0.0, float(np.vdot(step, self.energy.mass @ step))))
