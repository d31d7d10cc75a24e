"""Solving again, with more weight, where handles or fixed vertices miss their places.

What is off at the weights a set begins with gets ten times as much, and so on: a rung of a ladder
each.  At the top, each set's weight is interpolated between the last rung that was too low and the
first that was high enough, so that it is off by about as much as it may be: weight that no set
needs distorts the mesh.  A pose is final when the ladder was climbed from the lowest rung, so that
the weights, and with them the pose, depend on the targets and not on how they were reached.  Every
rung goes on from where it was.  A drag in haste stays on the rung where it is until the targets
rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import FloatArray
from .iteration import Iteration, SolverOptions
from .solution import Status
from .solver import GaussNewton

_STIFFER = 10.0
_STIFFEST = 1e4  # times the weight it started with
# A higher weight must reduce the errors to this share and raise the energy by no more than this
# factor; beyond it, poses begin to fold.
_WORTH, _COST = 0.7, 1.75
_AIM = 0.97  # share of the tolerance at which interpolation aims
_TRIES = 3
_CLOSE = 0.98  # share of the weights of the rung above at which it is as good


@dataclass(eq=False)
class _Rung:
    solver: GaussNewton
    p: FloatArray  # (m, 3), where it is

    def move(self, places: FloatArray, options: SolverOptions) -> Iteration:
        result = self.solver.minimise(self.p, places, options)
        self.p = result.p
        return result

    def copy(self) -> _Rung:
        return _Rung(self.solver.copy(), self.p)

    def errors(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far the places of each set are missed, (s,), and its border (s,)."""
        return self.solver.positions.errors(self.p, places)

    @property
    def strength(self) -> FloatArray:
        return self.solver.positions.strength


@dataclass(frozen=True, eq=False)
class _Bracket:
    """For each set (s,) a weight that is too low, one that is not, and the errors at both."""

    low: FloatArray
    low_errors: FloatArray
    high: FloatArray
    high_errors: FloatArray

    @classmethod
    def at(cls, strength: FloatArray, errors: FloatArray) -> _Bracket:
        return cls(strength, errors, strength, errors)

    def raised(self, strength: FloatArray, errors: FloatArray) -> _Bracket:
        """Return the bracket after a rung higher up: sets with more weight had too little."""
        more = strength > self.high
        low = np.where(more, self.high, self.low)
        low_errors = np.where(more, self.high_errors, self.low_errors)
        return _Bracket(low, low_errors, strength, errors)

    def narrowed(
        self, strength: FloatArray, errors: FloatArray, allowed: FloatArray
    ) -> _Bracket:
        """Return the bracket after weights in between."""
        missed = errors > allowed
        return _Bracket(
            np.where(missed, strength, self.low),
            np.where(missed, errors, self.low_errors),
            np.where(missed, self.high, strength),
            np.where(missed, self.high_errors, errors),
        )

    def between(self, aim: float) -> FloatArray | None:
        """Return weights at which the errors should be *aim*; None if they are those on top.

        Errors fall as a power of the weight, or nearly.
        """
        inside = (self.high > self.low) & (self.high_errors < aim)
        if not inside.any():
            return None
        low, high = np.where(inside, self.low_errors, 2.0), np.where(inside, self.high_errors, 1.0)
        share = np.where(inside, np.log(low / aim) / np.log(low / high), 1.0)
        strength = self.low * (self.high / self.low) ** share
        return None if (strength > _CLOSE * self.high).all() else strength


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
        here, result, visited = self._climb(places, options)
        steps = result.steps
        if result.status is Status.STEP_LIMIT and self.is_climbed:
            # What is on the screen stays as stiff as it was.
            result = replace(self._top.move(places, options), status=Status.STEP_LIMIT)
            steps += result.steps
            self._above = visited + [rung for rung in self._above if rung not in visited]
        else:
            self._top, self._above = here, visited
        return replace(result, steps=steps)

    def _climb(
        self, places: FloatArray, options: SolverOptions
    ) -> tuple[_Rung, Iteration, list[_Rung]]:
        """Return the rung to be on, its pose with the steps of all rungs, and those visited."""
        here, visited = self._lowest, []
        result = here.move(places, options)
        errors = here.errors(places)
        bracket = _Bracket.at(here.strength, np.maximum(*errors))
        while result.status is not Status.STEP_LIMIT:
            missed = (errors[0] > self._tolerance) & (here.strength < _STIFFEST)
            if not missed.any():
                break
            rung = self._rung(here, np.where(missed, _STIFFER * here.strength, here.strength))
            visited.append(rung)
            held = rung.move(places, options)
            steps = result.steps + held.steps
            ahead = rung.errors(places)
            # Where a cage cannot put a vertex in place, weight wins nothing and wrecks the rest.
            gains = ahead[0].max() <= _WORTH * errors[0].max() and ahead[1].max() <= errors[1].max()
            if not gains or held.shape > _COST * result.shape:
                status = held.status if held.status is Status.STEP_LIMIT else result.status
                result = replace(result, status=status, steps=steps)
                break
            here, result, errors = rung, replace(held, steps=steps), ahead
            bracket = bracket.raised(rung.strength, np.maximum(*errors))
        allowed = np.maximum(self._tolerance, bracket.high_errors)
        for _ in range(_TRIES):
            strength = bracket.between(_AIM * self._tolerance)
            if strength is None or result.status is Status.STEP_LIMIT:
                break
            rung = self._rung(here, strength)
            visited.append(rung)
            held = rung.move(places, options)
            held = replace(held, steps=result.steps + held.steps)
            ahead_errors = np.maximum(*rung.errors(places))
            if held.status is Status.STEP_LIMIT:
                result = replace(result, status=held.status, steps=held.steps)
            elif (ahead_errors <= allowed).all():
                return rung, held, visited
            else:
                result = replace(result, steps=held.steps)
                bracket = bracket.narrowed(strength, ahead_errors, allowed)
        return here, result, visited

    def _rung(self, below: _Rung, strength: FloatArray) -> _Rung:
        """Return the rung of these weights, where it was if it is known, or else at *below*."""
        for rung in self._above:
            if np.array_equal(rung.strength, strength):
                return rung
        positions = below.solver.positions.with_strength(strength)
        return _Rung(replace(below.solver, positions=positions), below.p)
