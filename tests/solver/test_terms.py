"""Further terms of the solver's objective, by a wall that one vertex cannot pass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform.solver import SolverOptions
from vtk_segdeform.solver.terms import hessian_of, share_of_step, with_terms

SCENE = sausage(2, is_coarse=True)


@dataclass(frozen=True, eq=False)
class Wall:
    """The vertex with this row of W~ stays above a height, by a logarithm near it."""

    row: np.ndarray
    height: float
    reach: float
    weight: float = 1e-3

    is_always_active = False

    def renewed(self, p):
        return self

    def value_and_slope(self, p, x=None):
        gap = self.row @ p[:, 2] - self.height
        if gap >= self.reach:
            return 0.0, np.zeros_like(p)
        if gap <= 0.0:
            return np.inf, np.zeros_like(p)
        slope = np.zeros_like(p)
        log = np.log(gap / self.reach)
        slope[:, 2] = -1.5 * self.weight * log**2 / gap * self.row
        return -self.weight * log**3, slope

    def share(self, p, step):
        return 1.0

    def hessian(self, p, x=None):
        gap = self.row @ p[:, 2] - self.height
        if not 0.0 < gap < self.reach:
            return None
        log, m = np.log(gap / self.reach), len(p)
        full = np.zeros((3 * m, 3 * m))
        second = self.weight * (3.0 * log**2 - 6.0 * log) / gap**2
        full[2 * m :, 2 * m :] = 0.5 * second * np.outer(self.row, self.row)
        return full


@dataclass(frozen=True)
class Slow:
    """A constant, with which no cage vertex moves farther than a limit in a step."""

    limit: float

    def value_and_slope(self, p, x=None):
        return 1e-3, np.zeros_like(p)

    def hessian(self, p, x=None):
        return np.zeros((p.size, p.size))

    def share(self, p, step):
        return min(1.0, self.limit / np.abs(step).max())


def solver_with(deformer, *terms):
    """Give a deformer the solver with these terms."""
    own = deformer._constraints
    deformer._hold(replace(own, solver=replace(own.solver, terms=terms)))
    return deformer


def test_a_term_limits_every_step():
    deformer = SCENE.held()
    own, start, limit = deformer._constraints, deformer._path.p, 0.01
    targets = deformer._problem.frame.inward(SCENE.turned(10))
    solver, places = replace(own.solver, terms=(Slow(limit),)), own.places(targets)
    p, moves = start, []
    for _ in range(40):
        result = solver.minimise(p, places, SolverOptions(max_steps=1))
        moves.append(np.abs(result.p - p).max())
        p = result.p
    expected = replace(own.solver).minimise(start, places, SolverOptions())
    far = np.abs(expected.p - start).max()
    assert far > 4.0 * limit
    assert 0.9 * limit < max(moves) < 1.1 * limit  # and a little to restore the volume
    surface = own.problem.subspace.map  # some cage vertices hardly move it
    assert_allclose(surface(p), surface(expected.p), atol=2e-6)


def test_h_contains_a_term_from_the_first_step_on_at_which_it_is_active():
    deformer = SCENE.held()
    row, p = deformer.subspace.at(np.array([0]))[0], deformer._path.p
    wall = Wall(row, row @ p[:, 2] - 0.05, 0.1)
    solver, places = (
        solver_with(deformer, wall)._path.solver,
        deformer._constraints.places(deformer._path.targets),
    )
    here, factor = solver._at(p, places), solver._state.factor
    assert here.is_active
    step = solver.step(here)
    assert solver._state.factor is not factor
    assert_allclose(step.h, solver._step(here, solver._factor_at(here)).h, rtol=1e-9)
    factor = solver._state.factor
    solver.step(here)
    assert solver._state.factor is factor  # not again while it is active
    solver._renew(replace(here, is_active=False))
    factor = solver._state.factor
    solver.step(here)
    assert solver._state.factor is not factor


@dataclass(frozen=True)
class Spring:
    """A square about a place, times a constant; it limits steps to a share."""

    weight: float
    most: float

    def value_and_slope(self, p, x=None):
        return self.weight * float(np.vdot(p, p)), self.weight * p

    def hessian(self, p, x=None):
        return self.weight * np.eye(p.size) if self.weight else None

    def share(self, p, step):
        return self.most


def test_terms_are_added_and_the_smallest_share_counts():
    p, slope = np.arange(6.0).reshape(2, 3), np.ones((2, 3))
    springs = [Spring(2.0, 0.7), Spring(0.0, 0.5), Spring(3.0, 2.0)]
    value, steeper = with_terms(springs, p, p, value=1.0, slope=slope)
    assert value == 1.0 + 5.0 * 55.0
    assert_allclose(steeper, slope + 5.0 * p)
    assert_allclose(hessian_of(springs, p, p), 5.0 * np.eye(6))
    assert share_of_step(springs, p, p) == 0.5
    assert hessian_of(springs[1:2], p, p) is None
    assert hessian_of([], p, p) is None
    assert share_of_step([], p, p) == share_of_step(springs[2:], p, p) == 1.0
    same = with_terms(springs[1:2], p, p, value=1.0, slope=slope)
    assert same[0] == 1.0
    assert same[1] is slope
