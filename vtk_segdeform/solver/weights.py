"""Continuation of the position weights, where handles or fixed vertices miss their places.

Weights are found in two passes.  The first raises them: a set that misses its places has its
weight multiplied by ten, and again, until it meets them.  A set then has up to ten times the
weight that it needs, and excess weight distorts the mesh, so the second pass interpolates between
the last weight that was too low and the first that was not.  The errors end just below the
tolerance, and the pose changes smoothly with the targets.

Both passes only ask whether weights suffice, which a loose solve and the step after it tell: only
the last solver is iterated to the tolerance.  They share the curvature of the energy.

A pose is final when the continuation began with the initial weights, so that the weights, and with
them the pose, depend on the targets and not on the poses before.  The solver of each combination
of weights starts from its own last pose.  During a drag the weights stay the same until the targets
rest; `WeightContinuation.follow` instead finds them in every frame, by poses near the minima.

Where a body buckles there are several minima, and the continuation may lead to another one than the
last pose shown.  A drag does not end with such a jump if its own weights suffice.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import FloatArray
from .gauss_newton import GaussNewton, SolverOptions, SolverResult
from .solution import Status

_FACTOR = 10.0  # by which a weight is raised
_HIGHEST = 1e4  # times the initial weight
# A higher weight is accepted if it multiplies the errors by at most _GAIN and the energy by at most
# _COST; at a higher cost, poses begin to fold.
_GAIN, _COST = 0.7, 1.75
_FEWEST = 0.5  # of the tolerance: errors from which on a drag keeps its weights
_SLACK = 1.1  # of errors above the tolerance that no weight reduces, up to which it keeps them
_AIM = 0.95  # of the tolerance; closer to it, interpolation too often fails
_LIVE_AIM = 0.8  # in a drag, whose targets go on
_TRIES = 3
_JUMP = 5e-3  # mesh size 1; a drag does not end with a jump so long if it can be avoided
_STEEP = 1.5  # power of the error by which the weights of a drag are raised at its end
_ALL = 0.98  # share of the higher weights beyond which these are used
_LOOSE = 1e-5  # tolerance of poses that only show whether their weights suffice
_SAME = 1e-6  # relative difference of weights that are equal but for rounding


@dataclass(eq=False)
class _Weighted:
    """A solver with certain weights, and its last pose."""

    solver: GaussNewton
    p: FloatArray  # (m, 3)
    settled: FloatArray = field(init=False)  # (m, 3), the last pose of `follow`
    ahead: FloatArray = field(init=False)  # (m, 3), `SolverResult.ahead`
    known: tuple[FloatArray, SolverOptions, SolverResult] | None = None

    def __post_init__(self) -> None:
        self.settled = self.ahead = self.p

    @property
    def strength(self) -> FloatArray:
        """The weight of each set, as a multiple of its initial weight, (s,)."""
        return self.solver.positions.strength

    def solve(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Minimise from the last pose, and keep the new one.

        In a live drag a pose near the minimum counts as converged, and is not improved.
        """
        result = self.solver.minimise(self.p, places, options)
        if options.within is not None and result.remaining <= options.within:
            result = replace(result, status=Status.CONVERGED)
        self.p, self.ahead = result.p, result.ahead
        self.known = None if result.status is Status.STEP_LIMIT else (places, options, result)
        return result

    def known_at(self, places: FloatArray, options: SolverOptions) -> SolverResult | None:
        """Return the last result, if it is that of a solve with these arguments."""
        if self.known is None or self.known[2].p is not self.p:
            return None
        is_same = np.array_equal(self.known[0], places) and (
            (options.tolerance, options.within) == (self.known[1].tolerance, self.known[1].within)
        )
        return self.known[2] if is_same else None

    def copy(self) -> _Weighted:
        other = _Weighted(self.solver.copy(), self.p)
        other.settled, other.ahead = self.settled, self.ahead
        return other


@dataclass(frozen=True, eq=False)
class _Errors:
    """The largest errors of each set, (s,): at its places, and at checked vertices between them.

    They are those of the pose after the next step, which is more accurate than the pose itself.
    """

    places: FloatArray
    checks: FloatArray

    @classmethod
    def of(cls, weighted: _Weighted, places: FloatArray) -> _Errors:
        return cls(*weighted.solver.positions.errors(weighted.ahead, places))

    @property
    def both(self) -> FloatArray:
        return np.maximum(self.places, self.checks)

    def improve_on(self, before: _Errors) -> bool:
        """Tell whether errors at places are clearly smaller, and at checked vertices not larger."""
        is_smaller = self.places.max() <= _GAIN * before.places.max()
        return bool(is_smaller and self.checks.max() <= before.checks.max())


@dataclass(frozen=True, eq=False)
class _Bracket:
    """For each set (s,) a weight that is too low, one that is not, and the errors at both.

    For a set with its initial weight the two are the same.
    """

    low: FloatArray
    low_errors: FloatArray
    high: FloatArray
    high_errors: FloatArray

    def raised(self, strength: FloatArray, errors: FloatArray) -> _Bracket:
        """Return the bracket after weights were raised to *strength*: the former were too low."""
        is_raised = strength > self.high
        low = np.where(is_raised, self.high, self.low)
        low_errors = np.where(is_raised, self.high_errors, self.low_errors)
        return _Bracket(low, low_errors, strength, errors)

    def narrowed(self, strength: FloatArray, errors: FloatArray, allowed: FloatArray) -> _Bracket:
        """Return the bracket after weights within it, too low where *errors* exceed *allowed*."""
        is_low = errors > allowed
        low = np.where(is_low, strength, self.low)
        return replace(self, low=low, low_errors=np.where(is_low, errors, self.low_errors))

    def contains(self, weighted: _Weighted) -> bool:
        """Tell whether the weights are in the bracket, and not all at its upper end."""
        strength = weighted.strength
        is_in = (self.low * (1.0 - _SAME) <= strength) & (strength <= self.high * (1.0 + _SAME))
        return bool(is_in.all() and (strength < self.high * (1.0 - _SAME)).any())

    def at(self, aim: float) -> FloatArray | None:
        """Return the weights at which errors should be *aim*; None if those are the high ones.

        Errors are approximately a power of the weight.
        """
        inside = (self.high > self.low) & (self.high_errors < aim)
        above = np.where(inside, self.low_errors, np.e)
        below, aims = np.where(inside, self.high_errors, 1.0), np.where(inside, aim, 1.0)
        share = np.log(above / aims) / np.log(above / below)
        strength = self.low * (self.high / self.low) ** share
        return strength if (strength < _ALL * self.high).any() else None


class _Run:
    """One continuation for *places* (k, 3): the solvers it has used, and their steps."""

    def __init__(self, places: FloatArray, options: SolverOptions) -> None:
        self.places = places
        self.used: list[_Weighted] = []
        self.tries: list[_Weighted] = []  # those with weights between two of the first pass
        self.steps = 0
        self.allowed = np.zeros(0)  # (s,), errors up to which weights suffice
        self.is_live = options.within is not None
        self.options = options

    def solve(self, weighted: _Weighted, options: SolverOptions | None = None) -> SolverResult:
        """Solve with *weighted* to the tolerance of *options*, or to `_LOOSE`; count its steps."""
        self.used.append(weighted)
        if options is None:
            tolerance = max(self.options.tolerance, _LOOSE)
            options = replace(self.options, tolerance=tolerance)
        known = weighted.known_at(self.places, options)
        if known is not None:
            return known
        result = weighted.solve(self.places, options)
        self.steps += result.steps
        return result

    def finish(self, weighted: _Weighted, result: SolverResult) -> SolverResult:
        """Return the *result* of *weighted*, continued to the tolerance of the options."""
        finished = self.solve(weighted, self.options)
        further = () if finished.p is result.p else finished.merits[1:]
        return replace(finished, merits=(*result.merits, *further))


class WeightContinuation:
    """Solvers that differ in the weights of positions, each with its last pose.

    Parameters
    ----------
    solver : GaussNewton
        With the initial weights.
    p : (m, 3) float
        Cage vertices to begin at.
    tolerance : float
        Distance by which a vertex may miss its place before its set gets more weight.
    """

    def __init__(self, solver: GaussNewton, p: FloatArray, tolerance: float) -> None:
        solver.forget()
        self._initial = _Weighted(solver, p)
        self._raised: list[_Weighted] = []  # with higher weights, used for the last pose
        self._current = self._initial  # the solver of the last pose
        self._tries: list[_Weighted] = []  # `_Run.tries` of the last pose with any
        self._only_current = False  # whether only that solver has followed the last targets
        # Of the last successful `follow`: its places, and the errors (s,) that were allowed.
        self._followed: FloatArray | None = None
        self._allowed = np.full(len(solver.positions.strength), tolerance)
        self._tolerance = tolerance

    def copy(self) -> WeightContinuation:
        """Return a continuation that proceeds from here independently."""
        initial = self._initial
        other = WeightContinuation(initial.solver.copy(), initial.p, self._tolerance)
        copies = {each: each.copy() for each in self._all}
        for each in copies.values():
            each.solver.share_with(copies[initial].solver)
        other._initial, other._current = copies[initial], copies[self._current]
        other._raised = [copies[each] for each in self._raised]
        other._tries = [copies[each] for each in self._tries]
        other._only_current, other._allowed = self._only_current, self._allowed
        other._followed = self._followed
        return other

    @property
    def _all(self) -> set[_Weighted]:
        return {self._initial, *self._raised, *self._tries, self._current}

    @property
    def solver(self) -> GaussNewton:
        """The solver of the last pose."""
        return self._current.solver

    @property
    def p(self) -> FloatArray:
        """Cage vertices of the last pose, (m, 3)."""
        return self._current.p

    @property
    def has_raised_weights(self) -> bool:
        """Whether the last pose has more than the initial weights."""
        return self._current is not self._initial

    def continue_from(self, p: FloatArray) -> None:
        """Continue from cage vertices *p* (m, 3), and preserve the volumes of that pose."""
        self._current.p = self._current.ahead = self._current.settled = p
        volumes = self._current.solver.volumes.preserved_at(p)
        for weighted in self._all:
            weighted.solver.volumes = volumes

    def restart(self) -> None:
        """Begin the next solve where the last successful `follow` ended."""
        for weighted in self._all:
            weighted.p = weighted.ahead = weighted.settled
            weighted.solver.forget()

    def solve_at_current_weights(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Return a pose for *places* (k, 3) at the weights of the last pose; it is not final."""
        self._only_current = self.has_raised_weights
        return replace(self._current.solve(places, options), status=Status.STEP_LIMIT)

    def follow(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Return a pose for *places* (k, 3) near the final one, found in the same way.

        All solvers stop ``options.within`` a distance of their minima, after at most
        ``options.max_steps`` each.  If one does not, `remaining` is infinite, and the next call
        continues.
        """
        run = _Run(places, options)
        found, result = self._raise(run)
        self._raised = list(dict.fromkeys([*run.used[1:], *self._raised]))
        self._only_current = False
        if result.status is Status.STEP_LIMIT:
            return replace(result, steps=run.steps, remaining=np.inf)
        self._current, self._raised = found, list(dict.fromkeys(run.used[1:]))
        self._tries = run.tries or self._tries
        self._allowed, self._followed = run.allowed, places
        for weighted in (self._initial, *self._raised):
            weighted.settled = weighted.p
        return replace(result, steps=run.steps, status=Status.STEP_LIMIT)

    def solve(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Return the final pose for *places* (k, 3); its steps are those at all weights."""
        if self._only_current:
            self._initial.p = self._initial.ahead = self._current.p
            self._raised = [self._current]
            self._only_current = False
        run = _Run(places, options)
        is_followed = self._has_followed(places)
        if is_followed and self._current.p is not self._current.settled:
            self.restart()  # a later `follow` has been given up
        found, result = self._raise(run)
        if result.status is not Status.STEP_LIMIT:
            result = run.finish(found, result)
        if result.status is Status.STEP_LIMIT and self.has_raised_weights:
            # The pose on the screen keeps its weights until a final one is known.
            result = replace(run.solve(self._current, options), status=Status.STEP_LIMIT)
            self._raised = list(dict.fromkeys([*run.used[1:], *self._raised]))
        else:
            if is_followed and self._current.solver.farthest(result.p - self._current.p) > _JUMP:
                found, result = self._kept(run) or (found, result)
            self._current, self._raised = found, list(dict.fromkeys(run.used[1:]))
            self._tries = run.tries or self._tries
        if is_followed:
            self._followed, self._current.settled = places, self._current.p
        return replace(result, steps=run.steps)

    def _has_followed(self, places: FloatArray) -> bool:
        """Return whether the last pose is one of a drag to *places*, or almost."""
        return self._followed is not None and bool(np.abs(places - self._followed).max() <= _JUMP)

    def _kept(self, run: _Run) -> tuple[_Weighted, SolverResult] | None:
        """Converge from the last pose, with higher weights if needed; None if that fails."""
        here = self._current
        for _ in range(_TRIES):
            result = run.solve(here, run.options)
            errors, is_raised = _Errors.of(here, run.places).both, here.strength > 1.0 + _SAME
            if (errors[is_raised] < _FEWEST * self._tolerance).any():
                break
            if result.status is Status.STEP_LIMIT or (errors <= self._allowed).all():
                return here, result
            factor = np.maximum((errors / (_AIM * self._allowed)) ** _STEEP, 1.0)
            if (factor > _FACTOR).any():
                break
            here = self._at(factor * here.strength, near=here, start=here.p)
        return None

    def _raise(self, run: _Run) -> tuple[_Weighted, SolverResult]:
        """Raise the weights from the initial ones as needed; return the solver and its pose."""
        here = self._initial
        result = run.solve(here)
        errors = _Errors.of(here, run.places)
        bracket = _Bracket(here.strength, errors.both, here.strength, errors.both)
        while result.status is not Status.STEP_LIMIT:
            is_off = (errors.places > self._tolerance) & (here.strength < _HIGHEST)
            if not is_off.any():
                break
            ahead = self._at(
                np.where(is_off, _FACTOR * here.strength, here.strength), near=here, start=here.p
            )
            attempt = run.solve(ahead)
            reached = _Errors.of(ahead, run.places)
            # If the cages cannot put a vertex in place, more weight only distorts the rest.
            if not reached.improve_on(errors) or attempt.shape > _COST * result.shape:
                is_limit = attempt.status is Status.STEP_LIMIT
                result = replace(result, status=attempt.status if is_limit else result.status)
                break
            here, result, errors = ahead, attempt, reached
            bracket = bracket.raised(here.strength, errors.both)
        return self._lower(run, here, result, bracket)

    def _lower(
        self, run: _Run, here: _Weighted, result: SolverResult, bracket: _Bracket
    ) -> tuple[_Weighted, SolverResult]:
        """Return a solver with less weight and no larger errors, and its pose; or *here*."""
        allowed = np.maximum(self._tolerance, bracket.high_errors)
        run.allowed = np.maximum(self._tolerance, _SLACK * bracket.high_errors)
        last = self._current
        if run.is_live and result.status is not Status.STEP_LIMIT and bracket.contains(last):
            attempt = run.solve(last)
            if attempt.status is Status.STEP_LIMIT:
                return last, attempt
            errors = _Errors.of(last, run.places).both
            inside = bracket.high > bracket.low
            is_enough = (errors <= run.allowed).all()
            if is_enough and (errors[inside] >= _FEWEST * self._tolerance).all():
                return last, attempt
        start, aim = here.p, _LIVE_AIM if run.is_live else _AIM
        for k in range(_TRIES):
            strength = bracket.at(aim * self._tolerance)
            if strength is None or result.status is Status.STEP_LIMIT:
                break
            near = self._tries[k] if k < len(self._tries) else self._current
            between = self._at(strength, near=near, start=start)
            run.tries.append(between)
            attempt = run.solve(between)
            start = between.p
            if attempt.status is Status.STEP_LIMIT:
                return here, replace(result, status=attempt.status)
            errors = _Errors.of(between, run.places).both
            if (errors <= allowed).all():
                return between, attempt
            bracket = bracket.narrowed(strength, errors, allowed)
        return here, result

    def _at(self, strength: FloatArray, *, near: _Weighted, start: FloatArray) -> _Weighted:
        """Return the solver with these weights, in its last pose or else made from *near*."""
        for weighted in self._raised:
            if np.allclose(weighted.strength, strength, rtol=_SAME, atol=0.0):
                return weighted
        return _Weighted(near.solver.with_strength(strength), start)
