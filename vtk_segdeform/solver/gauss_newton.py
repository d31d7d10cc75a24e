"""Gauss-Newton in the subspace of the cages, with volumes preserved by Lagrange multipliers.

    minimise  E(p) + sum_i omega_i |x_i - u_i|^2    subject to  g(x) = 0,   x = W~ p    (20)

E is the shape energy (5), u_i are the places of fixed vertices (6) and handles (7), and g are the
volume constraints (9).  E = |A x - b(x)|^2 with the linear operators A of detail and stretch, and
b(x) the detail at rest, rotated by the local rotations R(x).  The paper replaces J_f = A - db/dx by
A, so that R is constant within a step and refitted at each new pose.  Its step is eq. (21):

    h = -H^-1 (d + G^T lambda),   lambda = (G H^-1 G^T)^-1 (g - G H^-1 d)

    H  half the Hessian of the objective
    d  half its gradient;  G = J_g W~, one row per constraint

(The paper prints a minus before its lambda; then G h = -g would not hold.)

    `newton.minimise`           the iteration
    `newton.constrained_step`   h, lambda and Z = H^-1 G^T: eq. (21)
    `GaussNewton.step`          the step with an up-to-date H
    `GaussNewton.moved`         p + h, moved along Z onto g = 0
    `GaussNewton.evaluate`      the rotations R, and with them E, d and G at a pose

What is added to the iteration of the paper (`deformer.as_printed`):

1. *Exact volume.*  Along Z the volume is a cubic of the step length; its root is the last operation
   of every step (`exact_volume`).  |dV| / V is then about 1e-15; (21) alone leaves 1e-4.  For a
   large mesh this is the volume of a coarse surface (`coarse_volume`), and `Deformer` restores that
   of the mesh itself at the end.
2. *Exact Hessian* (`hessian`).  The paper's H is constant, W~^T A^T A W~ plus the position weights,
   and rotations follow one step behind: where much turns, hundreds of steps are needed, and a small
   step does not mean that the minimum is near.  With the derivatives of the rotations and of the
   volumes in H, h is Newton's step, about as long as the remaining distance.  But to compute this H
   takes as long as some 5 steps.  So it is computed where the first call begins; and again if steps
   at the present rate would not converge in that time, and if no share of a step lowers the
   objective.
   An H of the same call serves 5 steps at least, which fill the window of Anderson acceleration.
   If it is not convex, it contains a share of the rotations' derivatives only, and h is shorter.
   If it is almost singular, so that no share of h lowers the objective, the paper's H takes its
   place.
3. *Anderson acceleration* (`anderson`) of (21) as a fixed-point map p -> q(p).  Targets change q by
   a constant, so it remembers the steps of earlier frames, until H changes.  This saves a quarter
   of the steps of drags and pulls.
4. *Line search* (`newton`).
5. *Extrapolation* (`extrapolation`).  A slow drag starts each solve on along the way of the last
   ones, if the objective is lower there.  This saves half of the steps of a steady drag.
6. *Further terms* (`terms`), such as contact.  They limit every step, accelerated step and
   extrapolation, also while they are inactive.  While one is active, its Hessian is in H.

Long because the formulas of the iteration are explained here, and its objective is one class.

Source
------
Section 3.3 of the paper.  E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 2nd
ed., Springer 1996, section IV.8: when a factor serves on.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np
from scipy import linalg

from ..arrays import FloatArray, is_number, is_whole, largest_length
from ..checks import shown
from ..energy import Energy, Factor, full_factor, quadratic_factor, rotation_term
from ..errors import ArgumentError, CageError
from ..progress import Progress
from .anderson import Anderson
from .exact_volume import moved_along, steps_to_volume
from .extrapolation import End, Way
from .newton import Step, constrained_step, minimise
from .position_constraints import PositionTerm, TargetTerm
from .solution import Status
from .terms import NO_SURFACE, Term, hessian_of, share_of_step, with_terms
from .volumes import Volumes, violations

_DAMPING = 1e-9  # of the mean diagonal of H
_MOST_RAISES = 4  # of the damping, to ten times as much each
_COST = 5  # of computing H, in steps
_SETTLED = 2  # steps with one H after which their rate is known, Anderson acceleration included
_WINDOW = 5  # steps that Anderson acceleration remembers, those of earlier calls included
_MOST_TRIES = 30  # of weights of steadying anchors, each twice the one before
_EXACT = 0.99  # least share of the rotations' term with which a step tells what remains
_LANDED = 1e-3  # relative error of a volume: with more, a motion onto the volumes led nowhere
_SHORT = 20.0  # with less of it, steps are shorter than what remains by at most about this factor


@dataclass(frozen=True)
class SolverOptions:
    """How to iterate; the defaults are those of the interactive editor."""

    tolerance: float = 1e-7  # of a step's length, root mean square, mesh size 1
    max_steps: int = 500
    progress: Progress | None = field(default=None, compare=False)  # called before every step

    def __post_init__(self) -> None:
        if not (is_number(self.tolerance) and self.tolerance > 0.0):
            raise ArgumentError(f"tolerance must be a positive number; got {shown(self.tolerance)}")
        if not is_whole(self.max_steps, 1):
            raise ArgumentError(
                f"max_steps must be a whole number, 1 or more; got {shown(self.max_steps)}"
            )


@dataclass(frozen=True, eq=False)
class SolverResult:
    """The last iterate, and how it was reached."""

    p: FloatArray  # (m, 3), cage vertices
    directions: tuple[FloatArray, ...]  # Z with the H of (21), (m, 3) for each constraint
    status: Status
    steps: int
    merits: tuple[float, ...]  # the objective at the start and after each step


@dataclass(frozen=True, eq=False)
class _Iterate:
    """A pose, with the objective and the constraints there."""

    at: FloatArray  # p, the cage vertices
    x: FloatArray  # the surface of the volumes; empty without volumes
    shape: float  # E and the further terms
    shape_slope: FloatArray  # half its gradient
    rows: tuple[FloatArray, ...]  # of G, one (m, 3) for each constraint
    merit: float  # E, the further terms and the position term
    slope: FloatArray  # d
    is_active: bool = False  # whether a further term is

    def toward(self, term: TargetTerm) -> _Iterate:
        """Return the same pose for other targets."""
        value, slope = term.value_and_slope(self.at)
        return replace(self, merit=self.shape + value, slope=self.shape_slope + slope)


@dataclass(eq=False)
class _State:
    """The running state of an iteration, from which a later call continues."""

    factor: Factor  # of H; at first the paper's
    age: int = 1  # of the factor, in steps
    has_begun: bool = False  # whether H has been computed
    is_new: bool = False  # whether the factor was computed in this call
    length: float = math.inf  # of the last step in this call
    tolerance: float = 0.0  # of this call
    has_terms: bool = False  # whether the factor is with those terms that were active
    acceleration: Anderson = field(default_factory=lambda: Anderson(_WINDOW))
    end: tuple[FloatArray, FloatArray] | None = None  # p and targets of the last call

    def begin(self, p: FloatArray, targets: FloatArray, options: SolverOptions) -> None:
        """Begin a call, which continues the last steps if it begins where they ended."""
        self.tolerance, self.is_new = options.tolerance, False
        if self.end is None or self.end[0] is not p or not np.array_equal(targets, self.end[1]):
            self.acceleration.pause()
            self.length = math.inf

    def is_slow(self, step: Step) -> bool:
        """Tell whether *step* and the next ones would not converge while a new H is computed."""
        if not self.has_begun:
            return step.length > self.tolerance
        rate, least = min(step.length / self.length, 1.0), _WINDOW if self.is_new else _SETTLED
        return self.age >= least and step.length * rate**_COST > self.tolerance

    def took(self, step: Step) -> None:
        """Count a step."""
        self.age, self.length = self.age + 1, step.length

    def copy(self) -> _State:
        """Return a state from which another solver continues."""
        return replace(self, acceleration=self.acceleration.copy())


@dataclass(eq=False)
class GaussNewton:
    """The factored problem; `minimise` solves it for one set of targets."""

    energy: Energy
    positions: PositionTerm
    volumes: Volumes
    _: KW_ONLY
    terms: tuple[Term, ...] = ()
    _hessian: FloatArray = field(init=False, repr=False)
    _factor: Factor = field(init=False, repr=False)
    _term: TargetTerm = field(init=False, repr=False)  # of the present targets
    _state: _State = field(init=False, repr=False)
    _last: _Iterate | None = field(init=False, repr=False, default=None)
    _way: Way = field(init=False, repr=False, default=Way())

    def __post_init__(self) -> None:
        hessian = self.energy.quadratic + self.positions.quadratic()
        # Cage vertices that move nothing (a region without fixed vertices or handles, weights
        # near zero) leave H singular.  A share of the identity damps the step there; d, and with
        # it every stationary point, stays the same.
        trace = np.trace(self.energy.quadratic) / len(hessian)
        share = np.eye(len(hessian))
        if not len(self.positions.rows):  # without positions rounding would move the whole mesh
            mean = self.energy.subspace.adjoint(np.ones((self.energy.subspace.n_vertices, 1)))
            share += mean @ mean.T / (_DAMPING * np.vdot(mean, mean))
        # Needles may leave H slightly indefinite.
        for damping in _DAMPING * 10.0 ** np.arange(_MOST_RAISES + 1):
            self._hessian = hessian + damping * trace * share
            factor = quadratic_factor(self._hessian)
            if factor is not None:
                break
        else:
            raise CageError(
                "the cages have almost no influence on the mesh; refit them closer to the surface"
            )
        self._factor, self._state = factor, _State(factor)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_term"}

    def copy(self) -> GaussNewton:
        """Return a solver that continues from here independently."""
        other = copy.copy(self)
        other._state = self._state.copy()
        return other

    def fresh(self) -> GaussNewton:
        """Return a solver of the same problem that has not begun."""
        other = copy.copy(self)
        other._state, other._last, other._way = _State(self._factor), None, Way()
        return other

    def preserve(self, volumes: Volumes) -> None:
        """Preserve other *volumes* from now on."""
        self.volumes, self._last = volumes, None  # the rows of the last iterate are of the old ones

    def renew_terms(self, p: FloatArray) -> bool:
        """Renew the further terms at cages *p* (m, 3); return whether any has changed."""
        terms = tuple(term.renewed(p) for term in self.terms)
        has_changed = any(new is not old for new, old in zip(terms, self.terms, strict=True))
        if has_changed:
            self.terms, self._last = terms, None
        return has_changed

    def minimise(self, p: FloatArray, targets: FloatArray, options: SolverOptions) -> SolverResult:
        """Iterate from cage vertices *p* (m, 3) for positions *targets* (k, 3).

        Called again with the last p and targets, it continues.
        """
        state, self._term = self._state, self.positions.toward(targets)
        state.begin(p, targets, options)
        end = minimise(
            self,
            self._ahead(self._iterate_at(p), targets),
            state.acceleration,
            tolerance=options.tolerance,
            max_steps=options.max_steps,
            progress=options.progress,
            took=state.took,
        )
        here, left = end.pose, 0.0 if end.step is None else end.step.h
        # Not those of a factor from another pose: the result would depend on it.
        directions = tuple(self.directions(here.rows))
        state.end, self._last = (here.at, targets), here
        self._way = self._way.on_to(End(here.at + left, targets, directions))
        return SolverResult(here.at, directions, end.status, len(end.merits) - 1, end.merits)

    @property
    def constant(self) -> float:
        """The size of the terms of the energy."""
        return self.energy.constant

    def step(self, here: _Iterate) -> Step:
        """Return the step (21), with H of this pose if the last one is out of date."""
        state = self._state
        if here.is_active and not state.has_terms:
            self._renew(here)
        step = self._step(here, state.factor)
        if state.is_slow(step):
            self._renew(here)
            step = self._step(here, state.factor)
        return step

    def another(self, here: _Iterate) -> Step | None:
        """Return the step with H of this pose, then with the H of the paper, then None."""
        state = self._state
        if state.age:
            self._renew(here)
        elif state.factor.coupled:
            state.factor = self._factor
        else:
            return None
        return self._step(here, state.factor)

    def allows(self, here: _Iterate, at: FloatArray) -> bool:
        """Return whether no term limits the motion from *here* to cages *at* (m, 3)."""
        return share_of_step(self.terms, here.at, at - here.at) == 1.0

    def moved(self, p: FloatArray, directions: Sequence[FloatArray]) -> _Iterate:
        """Return *p* moved along *directions* onto the constraints, and the objective there."""
        if not np.isfinite(p).all():
            return _Iterate(p, p, math.inf, p, (), math.inf, p)
        if not directions:
            return self.evaluate(p, self._surface(p))
        return self.evaluate(*self._on_volumes(p, directions))

    def _on_volumes(
        self, p: FloatArray, directions: Sequence[FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return *p* moved along *directions* onto the volumes, and their surface there."""
        paths = self.volumes.surface.map(np.hstack([p, *directions]))
        t = steps_to_volume(self.volumes.constraints, paths)
        p = p + sum(tk * z for tk, z in zip(t, directions, strict=True))
        return p, moved_along(paths, t)

    def residual(self, h: FloatArray) -> FloatArray:
        """Return *h* in the norm of the constant H of the paper.

        Plain distances between cage vertices also count vertices that hardly move the mesh.
        """
        return np.asarray(self._factor.triangle.T @ h)

    def evaluate(self, p: FloatArray, x: FloatArray) -> _Iterate:
        """Fit the local rotations; return E, d and G at *p*, where the volumes' surface is *x*."""
        energy, slope = self.energy.value_and_slope(p)
        value, slope = with_terms(self.terms, p, x, value=energy, slope=slope)
        is_active = value != energy or any(term.is_always_active for term in self.terms)
        here = _Iterate(p, x, value, slope, self.volumes.rows(x), value, slope, is_active)
        return here.toward(self._term)

    def compliance(self, rows: FloatArray) -> FloatArray:
        """Return rows H^-1 rows^T, (k, k): how far points of *rows* (k, m) yield to unit forces.

        H with fixed rotations.  k is at most 3.
        """
        forces = np.zeros((rows.shape[1], 3))
        forces[:, : len(rows)] = rows.T
        return np.asarray(rows @ self._factor.solve(forces)[:, : len(rows)])

    def directions(self, rows: Sequence[FloatArray]) -> list[FloatArray]:
        """Return H^-1 of *rows* (m, 3) each, with the H of (21), as directions of volumes."""
        return self._factor.solve_all([np.asarray(row) for row in rows])

    def landed(self, p: FloatArray) -> FloatArray:
        """Return cages *p* (m, 3) moved onto the volumes along Z, with the H of (21).

        *p* itself if this leads nowhere, or there are no volumes.
        """
        if not self.volumes.constraints:
            return p
        at, x = self._on_volumes(p, self.directions(self.volumes.rows(self._surface(p))))
        has_landed = (np.abs(self.volumes.constraints.relative(x)) < _LANDED).all()
        return at if has_landed else p

    def multipliers(self, p: FloatArray, targets: FloatArray) -> FloatArray:
        """Return lambda (c,) at *p*: minus the change of half the minimum with each volume."""
        here = self._at(p, targets)
        still = np.zeros(len(here.rows))
        return constrained_step(self._state.factor.solve_all, here.slope, here.rows, still)[1]

    def steadying(self, p: FloatArray, least: float) -> float:
        """Return the weight of anchors over the surface that make *p* a firm minimum.

        With weight k they add k |x - x(p)|^2, the mean square over the surface.  The Hessian at
        *p*, without that of the volumes, is then at least *least* times that mean square.  k is 0
        if it is so already, else at most twice what is needed.  It is also 0 if no k is enough,
        because some cage vertices move none of the samples of the surface.
        """
        m, mass, weight = len(p), self.energy.mass, 0.0
        turning = -rotation_term(self.energy, p)
        for _ in range(_MOST_TRIES):
            full, fixed = turning.copy(), self._hessian + (weight - least) * mass
            for axis in range(3):
                block = slice(axis * m, (axis + 1) * m)
                full[block, block] += fixed
            try:
                linalg.cholesky(full, lower=True, overwrite_a=True, check_finite=False)
            except linalg.LinAlgError:
                weight = max(2.0 * weight, least)
            else:
                return weight
        return 0.0

    def unbalanced(self, p: FloatArray, targets: FloatArray) -> FloatArray:
        """Return half the gradient of the objective at *p*, (m, 3), without that of the volumes.

        It is zero at a minimum: the rest, which is orthogonal to it, changes the volumes only.
        """
        here = self._at(p, targets)
        rows = np.reshape(here.rows, (len(here.rows), p.size))
        slope = here.slope.ravel()
        share = np.linalg.lstsq(rows.T, slope, rcond=None)[0] if len(rows) else np.zeros(0)
        return np.reshape(slope - share @ rows, p.shape)

    def remaining(self, p: FloatArray, targets: FloatArray) -> float:
        """Return by how much Newton's step at *p* moves the surface of the volumes, at most.

        An estimate of the distance to the minimum for *targets*; the step is not taken.
        """
        here = self._at(p, targets)
        return self.farthest(self.response(p, here.slope, here.rows))

    def response(self, p: FloatArray, slope: FloatArray, rows: Sequence[FloatArray]) -> FloatArray:
        """Return Newton's step (m, 3) at *p* against a *slope* (m, 3), half a gradient.

        To first order it keeps the volumes whose gradients are *rows*, (m, 3) each.  The Hessian is
        that of the last step, if this was Newton's.  Where it is not convex, the step is longer.
        """
        factor = self._state.factor
        if factor.share < _EXACT:
            of_terms = hessian_of(self.terms, p, self._surface(p)) if self.terms else None
            rotations = rotation_term(self.energy, p)
            factor = full_factor(self._hessian, rotations, added=of_terms) or self._factor
        step, _, _ = constrained_step(factor.solve_all, slope, rows, np.zeros(len(rows)))
        return step if factor.share >= _EXACT else _SHORT * step

    def _step(self, here: _Iterate, factor: Factor) -> Step:
        """Return the step (21) with the *factor* of H."""
        g = violations(self.volumes.constraints, here.x)
        h, _, directions = constrained_step(factor.solve_all, here.slope, here.rows, g)
        length, share = self._length(h), share_of_step(self.terms, here.at, h)
        return Step(share * h, directions, length, share == 1.0)

    def _renew(self, here: _Iterate) -> None:
        """Let H be that of this pose; the paper's if it is not convex."""
        state = self._state
        if not state.is_new:  # another H of the same call differs little
            state.acceleration.forget()  # the differences are of steps with the last H
        state.factor, state.age = self._factor_at(here), 0
        state.has_begun = state.is_new = True
        state.has_terms = here.is_active

    def _factor_at(self, here: _Iterate) -> Factor:
        """Return the factor of the exact Hessian; of the paper's if it is not convex."""
        of_terms = hessian_of(self.terms, here.at, here.x) if here.is_active else None
        of_volumes = of_centroids = None
        if self.volumes.hessian:
            g = violations(self.volumes.constraints, here.x)
            solve = self._factor.solve_all
            _, multipliers, _ = constrained_step(solve, here.slope, here.rows, g)
            of_volumes, of_centroids = self.volumes.hessian(here.at, multipliers)
        rotations = rotation_term(self.energy, here.at)
        exact = full_factor(
            self._hessian, rotations, volumes=of_volumes, centroids=of_centroids, added=of_terms
        )
        return exact or self._factor

    def _surface(self, p: FloatArray) -> FloatArray:
        return self.volumes.surface.map(p) if self.volumes.constraints else NO_SURFACE

    def _iterate_at(self, p: FloatArray) -> _Iterate:
        """Return the iterate at *p*; where the last call ended only the targets have changed."""
        last = self._last
        if last is not None and last.at is p:
            return last.toward(self._term)
        return self.evaluate(p, self._surface(p))

    def _ahead(self, here: _Iterate, targets: FloatArray) -> _Iterate:
        """Return the start for *targets*: *here*, or on along the way if it is better there."""
        found = self._way.ahead(targets)
        if found is None or len(found[1]) != len(self.volumes.constraints):
            return here
        if not self.allows(here, found[0]):
            return here
        ahead = self.moved(*found)
        return ahead if ahead.merit < here.merit else here

    def _at(self, p: FloatArray, targets: FloatArray) -> _Iterate:
        """Return the iterate at *p* for *targets*, outside of an iteration."""
        self._term = self.positions.toward(targets)
        return self._iterate_at(p)

    def farthest(self, step: FloatArray) -> float:
        """Return the largest distance by which a *step* moves the surface of the volumes."""
        return largest_length(self.volumes.surface.map(step))

    def _length(self, step: FloatArray) -> float:
        """Return the root mean square of a *step* over the surface."""
        return math.sqrt(max(0.0, float(np.vdot(step, self.energy.mass @ step))))
