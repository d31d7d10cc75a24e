"""The iteration of both levels, on problems whose minimum is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform.solver import Anderson, Status, Step, constrained_step, minimise

N = 6


def positive():
    """Return a symmetric positive definite matrix (N, N)."""
    root = np.random.default_rng(4).normal(size=(N, N))
    return 0.3 * np.eye(N) + root @ root.T / N


class Pose(NamedTuple):
    """A pose of the bowl."""

    at: np.ndarray
    merit: float
    slope: np.ndarray


@dataclass
class Bowl:
    """Half of the quadratic <x - goal, A (x - goal)>, with steps by another matrix H."""

    A: np.ndarray
    goal: np.ndarray
    H: np.ndarray
    others: list[np.ndarray] = field(default_factory=list)  # matrices that are tried after H
    share: float = 1.0  # of every step
    constant: float = 1.0
    asked: int = 0
    farthest: float = np.inf  # of an accelerated step

    def evaluated(self, x):
        away = x - self.goal
        return Pose(x, float(np.vdot(away, self.A @ away)), self.A @ away)

    def by(self, matrix, here):
        h = -self.share * np.linalg.solve(matrix, here.slope)
        return Step(h, (), float(np.linalg.norm(h)), self.share == 1.0)

    def step(self, here):
        return self.by(self.H, here)

    def allows(self, here, at):
        return np.abs(at - here.at).max() <= self.farthest

    def another(self, here):
        self.asked += 1
        return self.by(self.others.pop(0), here) if self.others else None

    def moved(self, x, directions):
        assert not directions
        return self.evaluated(x)

    def residual(self, h):
        return h


def solved(bowl, *, tolerance=1e-9, max_steps=200, **options):
    start = bowl.evaluated(np.zeros((N, 3)))
    return minimise(bowl, start, Anderson(5), tolerance=tolerance, max_steps=max_steps, **options)


def bowl(**options):
    A, goal = positive(), np.random.default_rng(5).normal(size=(N, 3))
    return Bowl(A, goal, 2.0 * np.linalg.norm(A) * np.eye(N), **options)


def test_it_ends_at_the_minimum_and_the_merit_falls_in_every_step():
    problem = bowl()
    end = solved(problem)
    assert end.status is Status.CONVERGED
    assert_allclose(end.pose.at, problem.goal, atol=1e-7)
    assert (np.diff(end.merits) < 0.0).all()


def test_acceleration_solves_a_linear_problem_in_as_many_steps_as_it_has_eigenvalues():
    assert len(solved(bowl()).merits) - 1 <= 2 * N
    slow = bowl(share=0.999)  # limited steps are not accelerated
    assert len(solved(slow).merits) > 4 * N


def test_an_accelerated_step_that_is_not_allowed_is_not_taken():
    plain, limited = solved(bowl()), solved(bowl(farthest=0.0))
    assert len(limited.merits) > 2 * len(plain.merits)
    assert limited.merits[-1] < 1e-3 * limited.merits[0]


class Wild(Anderson):
    """An acceleration that leads astray, to *where*."""

    def __init__(self, where):
        super().__init__(1)
        self.where = where

    def extrapolate(self, q, residual):
        return self.where


@pytest.mark.parametrize(("share", "is_taken"), [(0.9, False), (0.5, False), (1e-4, True)])
def test_an_accelerated_step_must_do_about_as_well_as_the_plain_one_promises(share, is_taken):
    """Not only lower the merit, which is large where a handle has moved on."""
    problem = bowl()
    problem.H = problem.A / 0.99  # so the plain step promises a hundredth of the merit
    start = problem.evaluated(np.zeros((N, 3)))
    wild = problem.goal * (1.0 - np.sqrt(share))
    end = minimise(problem, start, Wild(wild), tolerance=1e-9, max_steps=1)
    assert (end.pose.at is wild) == is_taken
    assert end.merits[1] <= 0.02 * start.merit


def test_another_matrix_is_tried_where_no_share_of_a_step_helps():
    problem = bowl()
    problem.H, problem.others = -problem.A, [-problem.A, problem.A]
    took = []
    end = solved(problem, max_steps=1, took=took.append)
    assert_allclose(end.pose.at, problem.goal)
    assert problem.asked == 2
    assert_allclose(took[0].h, problem.goal)  # the one that was taken


def test_it_stalls_where_nothing_helps_and_returns_the_last_pose():
    problem = bowl()
    problem.H = -problem.A
    end = solved(problem)
    assert end.status is Status.STALLED
    assert_array_equal(end.pose.at, 0.0)
    assert end.step is None


def test_only_rounding_left_is_the_end_and_no_stall():
    problem = bowl(constant=1e15)  # so the merit is a difference of large terms
    problem.H = -problem.A
    end = solved(problem, tolerance=1e-300)
    assert end.status is Status.CONVERGED
    problem = bowl()
    end = solved(problem, tolerance=1e-300)
    assert end.status is Status.CONVERGED
    assert problem.asked == 0  # it ends before steps fail
    assert_allclose(end.pose.at, problem.goal, atol=1e-6)


@pytest.mark.parametrize("most", [1, 3])
def test_it_takes_at_most_so_many_steps_and_reports_each(most):
    told, took = [], []

    def progress(share, message):
        told.append((share, message))

    end = solved(bowl(), max_steps=most, progress=progress, message="bowling", took=took.append)
    assert end.status is Status.STEP_LIMIT
    assert len(end.merits) == most + 1
    assert len(took) == most
    assert told == [(k / most, "bowling") for k in range(most)]
    assert end.step is None  # from the end no step was computed
    solved(bowl(), max_steps=1, progress=progress)
    assert told[-1] == (0.0, "solving")


def test_the_constrained_step_is_that_of_the_dense_equations():
    """Of the Karush-Kuhn-Tucker matrix: H h + G^T lambda = -d, G h = -g."""
    rng = np.random.default_rng(6)
    H, slope, g = positive(), rng.normal(size=(N, 3)), np.array([0.3, -0.2])
    rows = [rng.normal(size=(N, 3)) for _ in g]
    h, multipliers, z = constrained_step(
        lambda rights: [np.linalg.solve(H, right) for right in rights], slope, rows, g
    )
    jacobian = np.array([row.ravel() for row in rows])
    full = np.kron(H, np.eye(3))
    dense = np.block([[full, jacobian.T], [jacobian, np.zeros((2, 2))]])
    expected = np.linalg.solve(dense, -np.concatenate([slope.ravel(), g]))
    assert_allclose(h.ravel(), expected[:-2], atol=1e-10)
    assert_allclose(multipliers, expected[-2:], atol=1e-10)
    assert_allclose(H @ z[1], rows[1], atol=1e-10)
