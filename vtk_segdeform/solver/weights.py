"""Solving again, with more weight, where handles or fixed vertices miss their places.

What is off at the weights a set begins with gets ten times as much, and so on: a rung of a ladder
each.  A pose is final when the ladder was climbed from the lowest rung, so that the weights, and
with them the pose, depend on the targets and not on how they were reached.  Every rung goes on
from where it was.  A drag in haste stays on the rung where it is until the targets rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from .gauss_newton import GaussNewton, SolverOptions, SolverResult
from .solution import Status

# A higher weight must reduce the errors to this share and raise the energy by no more than this
# factor; beyond it, poses begin to fold.
_WORTH, _COST = 0.7, 1.75


@dataclass(eq=False)
class _Rung:
    solver: GaussNewton
    p: FloatArray  # (m, 3), where it is

    def move(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        result = self.solver.minimise(self.p, places, options)
        self.p = result.p
        return result

    def copy(self) -> _Rung:
        return _Rung(self.solver.copy(), self.p)

    def errors(self, places: FloatArray) -> FloatArray:
        """Return how far each place is missed, (k,)."""
        away = self.solver.positions.rows @ self.p - places
        return np.asarray(np.linalg.norm(away, axis=1))


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
        volumes = self._top.solver.volumes.preserved_at(p)
        for rung in (self._lowest, *self._above):
            rung.solver.volumes = volumes

    def hurry(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Return a pose for *places* (k, 3) at the weights of the last; it is not final."""
        self._has_hurried = self.is_climbed
        return replace(self._top.move(places, options), status=Status.STEP_LIMIT)

    def move(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Return the pose for *places* (k, 3); its steps are those of all rungs."""
        if self._has_hurried:
            self._lowest.p, self._above, self._has_hurried = self._top.p, [self._top], False
        here, visited, steps = self._lowest, [], 0
        result = here.move(places, options)
        while result.status is not Status.STEP_LIMIT:
            rung = self._stiffer(here, places)
            if rung is None:
                break
            visited.append(rung)
            steps += result.steps
            held = rung.move(places, options)
            # Where a cage cannot put a vertex in place, weight wins nothing and wrecks the rest.
            gain = rung.errors(places).max() / here.errors(places).max()
            if gain > _WORTH or held.shape > _COST * result.shape:
                status = held.status if held.status is Status.STEP_LIMIT else result.status
                result = replace(result, status=status, steps=held.steps)
                break
            here, result = rung, held
        if result.status is Status.STEP_LIMIT and self.is_climbed:
            steps += result.steps  # what is on the screen stays as stiff as it was
            result = replace(self._top.move(places, options), status=Status.STEP_LIMIT)
            self._above = visited + [rung for rung in self._above if rung not in visited]
        else:
            self._top, self._above = here, visited
        return replace(result, steps=steps + result.steps)

    def _stiffer(self, below: _Rung, places: FloatArray) -> _Rung | None:
        """Return the rung above *below*, where it was if it is known, or None if none is due."""
        positions = below.solver.positions.stiffened(below.errors(places), self._tolerance)
        if positions is None:
            return None
        for rung in self._above:
            if np.array_equal(rung.solver.positions.strength, positions.strength):
                return rung
        return _Rung(replace(below.solver, positions=positions), below.p)
