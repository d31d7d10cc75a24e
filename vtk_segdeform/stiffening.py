"""Solving again, with more weight, where handles or fixed vertices miss their places.

Weights are found in two passes.  The first climbs a ladder: a set that misses its places gets ten
times the weight, and so on, each combination of weights being a rung.  A set then has up to ten
times the weight that it needs, and too much of it distorts the mesh, so the second pass
interpolates between the last weight that was too low and the first that was not.  Its errors end
just below the tolerance, and the pose changes smoothly with the targets.

A pose is final when the ladder was climbed from the lowest rung, so that the weights, and with
them the pose, depend on the targets and not on how they were reached.  Every rung continues from
its last pose.  During a drag in haste the weights stay as they are until the targets rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import FloatArray
from .iteration import Iteration, SolverOptions
from .solution import Status
from .solver import GaussNewton

_STIFFER = 10.0
_STIFFEST = 1e4  # times the weight a set began with
# A higher weight must reduce the errors to this share and raise the energy by no more than this
# factor; beyond it, poses begin to fold.
_WORTH, _COST = 0.7, 1.75
_AIM = 0.95  # share of the tolerance; nearer to all of it, interpolation too often falls short
_TRIES = 3
_ALL = 0.98  # share of a rung's weights beyond which that rung will do
_SAME = 1e-6  # weights that close are the same


@dataclass(eq=False)
class _Rung:
    solver: GaussNewton
    p: FloatArray  # (m, 3), where it is

    @property
    def strength(self) -> FloatArray:
        """Times the weight that each set began with, (s,)."""
        return self.solver.positions.strength

    def move(self, places: FloatArray, options: SolverOptions) -> Iteration:
        result = self.solver.minimise(self.p, places, options)
        self.p = result.p
        return result

    def copy(self) -> _Rung:
        return _Rung(self.solver.copy(), self.p)


@dataclass(frozen=True, eq=False)
class _Errors:
    """By how much each set is off, (s,): at its places, and at vertices that share them."""

    places: FloatArray
    checks: FloatArray

    @classmethod
    def of(cls, rung: _Rung, places: FloatArray) -> _Errors:
        return cls(*rung.solver.positions.errors(rung.p, places))

    @property
    def both(self) -> FloatArray:
        return np.maximum(self.places, self.checks)

    def improve_on(self, below: _Errors) -> bool:
        """Tell whether more weight was worth it.

        Errors at places must have become smaller, and those in between must not have grown.
        """
        fewer = self.places.max() <= _WORTH * below.places.max()
        return bool(fewer and self.checks.max() <= below.checks.max())


@dataclass(frozen=True, eq=False)
class _Bracket:
    """For each set (s,) a weight that is too low, one that is not, and the errors at both.

    A set that was never raised has the same twice.
    """

    low: FloatArray
    low_errors: FloatArray
    high: FloatArray
    high_errors: FloatArray

    def raised(self, strength: FloatArray, errors: FloatArray) -> _Bracket:
        """Return the bracket after a rung above: what has more weight now had too little."""
        more = strength > self.high
        low = np.where(more, self.high, self.low)
        return _Bracket(low, np.where(more, self.high_errors, self.low_errors), strength, errors)

    def narrowed(self, strength: FloatArray, errors: FloatArray, allowed: FloatArray) -> _Bracket:
        """Return the bracket after weights within it, too low for some sets."""
        few = errors > allowed
        low = np.where(few, strength, self.low)
        return replace(self, low=low, low_errors=np.where(few, errors, self.low_errors))

    def at(self, aim: float) -> FloatArray | None:
        """Return the weights at which errors should be *aim*; None if those are the high ones.

        Errors are about a power of the weight.
        """
        inside = (self.high > self.low) & (self.high_errors < aim)
        above = np.where(inside, self.low_errors, np.e)
        below, aims = np.where(inside, self.high_errors, 1.0), np.where(inside, aim, 1.0)
        share = np.log(above / aims) / np.log(above / below)
        strength = self.low * (self.high / self.low) ** share
        return strength if (strength < _ALL * self.high).any() else None


class _Visits:
    """The rungs that a climb for *places* (k, 3) has visited, and their steps."""

    def __init__(self, places: FloatArray, options: SolverOptions) -> None:
        self.places = places
        self.rungs: list[_Rung] = []
        self.steps = 0
        self._options = options

    def move(self, rung: _Rung) -> Iteration:
        result = rung.move(self.places, self._options)
        self.rungs.append(rung)
        self.steps += result.steps
        return result


class Ladder:
    """Solvers that differ in the weight of what is held, and where each of them is.

    Parameters
    ----------
    solver : GaussNewton
        With the weights to begin with.
    p : (m, 3) float
        Cage vertices to begin at.
    tolerance : float
        Distance by which a vertex may miss its place before it gets more weight.
    """

    def __init__(self, solver: GaussNewton, p: FloatArray, tolerance: float) -> None:
        solver.forget()
        self._lowest = _Rung(solver, p)
        self._above: list[_Rung] = []  # those met in the last climb
        self._top = self._lowest  # the rung whose pose counts
        self._has_hurried = False  # and all but the top are elsewhere
        self._tolerance = tolerance

    def copy(self) -> Ladder:
        """Return one that goes on from here by itself."""
        other = Ladder(self._lowest.solver.copy(), self._lowest.p, self._tolerance)
        other._lowest, *other._above = (rung.copy() for rung in [self._lowest, *self._above])
        there = [self._lowest, *self._above].index(self._top)
        other._top = [other._lowest, *other._above][there]
        other._has_hurried = self._has_hurried
        return other

    @property
    def solver(self) -> GaussNewton:
        """The solver of the pose that counts."""
        return self._top.solver

    @property
    def p(self) -> FloatArray:
        """Cage vertices of the pose that counts, (m, 3)."""
        return self._top.p

    @property
    def is_climbed(self) -> bool:
        """Whether the pose that counts has more weight somewhere than there was to begin with."""
        return self._top is not self._lowest

    def go_on_from(self, p: FloatArray) -> None:
        """Go on from cage vertices *p* (m, 3); the volumes held are those that are there."""
        self._top.p = p
        self._has_hurried = self.is_climbed
        self._above = [self._top] if self.is_climbed else []
        volumes = self._top.solver.volumes.held_at(p)
        for rung in (self._lowest, *self._above):
            rung.solver.volumes = volumes

    def hurry(self, places: FloatArray, options: SolverOptions) -> Iteration:
        """Return a pose for *places* (k, 3) at the weights of the last; it is not final."""
        self._has_hurried = self.is_climbed
        return replace(self._top.move(places, options), status=Status.STEP_LIMIT)

    def move(self, places: FloatArray, options: SolverOptions) -> Iteration:
        """Return the pose for *places* (k, 3); its steps are those of all rungs."""
        if self._has_hurried:
            self._lowest.p, self._above, self._has_hurried = self._top.p, [self._top], False
        visits = _Visits(places, options)
        here, result = self._climb(visits)
        if result.status is Status.STEP_LIMIT and self.is_climbed:
            # What is on the screen keeps its weights.
            result = replace(visits.move(self._top), status=Status.STEP_LIMIT)
            self._above = list(dict.fromkeys([*visits.rungs[1:], *self._above]))
        else:
            self._top, self._above = here, visits.rungs[1:]
        return replace(result, steps=visits.steps)

    def _climb(self, visits: _Visits) -> tuple[_Rung, Iteration]:
        """Return the rung of the weights that are due, and its pose."""
        here = self._lowest
        result = visits.move(here)
        errors = _Errors.of(here, visits.places)
        bracket = _Bracket(here.strength, errors.both, here.strength, errors.both)
        while result.status is not Status.STEP_LIMIT:
            off = (errors.places > self._tolerance) & (here.strength < _STIFFEST)
            if not off.any():
                break
            rung = self._rung(here, np.where(off, _STIFFER * here.strength, here.strength))
            held = visits.move(rung)
            ahead = _Errors.of(rung, visits.places)
            # Where a cage cannot put a vertex in place, weight wins nothing and wrecks the rest.
            if not ahead.improve_on(errors) or held.shape > _COST * result.shape:
                status = held.status if held.status is Status.STEP_LIMIT else result.status
                result = replace(result, status=status)
                break
            here, result, errors = rung, held, ahead
            bracket = bracket.raised(here.strength, errors.both)
        return self._ease(visits, here, result, bracket)

    def _ease(
        self, visits: _Visits, here: _Rung, result: Iteration, bracket: _Bracket
    ) -> tuple[_Rung, Iteration]:
        """Return a rung of less weight that does as well as *here*, and its pose; or *here*."""
        allowed = np.maximum(self._tolerance, bracket.high_errors)
        for _ in range(_TRIES):
            strength = bracket.at(_AIM * self._tolerance)
            if strength is None or result.status is Status.STEP_LIMIT:
                break
            rung = self._rung(here, strength)
            held = visits.move(rung)
            if held.status is Status.STEP_LIMIT:
                return here, replace(result, status=held.status)
            errors = _Errors.of(rung, visits.places).both
            if (errors <= allowed).all():
                return rung, held
            bracket = bracket.narrowed(strength, errors, allowed)
        return here, result

    def _rung(self, below: _Rung, strength: FloatArray) -> _Rung:
        """Return the rung of these weights, where it was if it is known, or else at *below*."""
        for rung in self._above:
            if np.allclose(rung.strength, strength, rtol=_SAME, atol=0.0):
                return rung
        positions = below.solver.positions.with_strength(strength)
        return _Rung(replace(below.solver, positions=positions), below.p)
