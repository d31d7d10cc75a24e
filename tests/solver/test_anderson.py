"""Anderson acceleration of a linear fixed-point iteration, where its answer is known."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from vtk_segdeform.solver.anderson import Anderson

N = 4  # unknowns of the iteration p -> p + A (b - p) / 2


def _problem() -> tuple[np.ndarray, np.ndarray]:
    """Return a symmetric positive definite A (N, N), not far from 1, and b (N, 1)."""
    rng = np.random.default_rng(3)
    noise = rng.normal(size=(N, N))
    return np.eye(N) + 0.1 * (noise + noise.T), rng.normal(size=(N, 1))


def _steps(anderson: Anderson, A: np.ndarray, b: np.ndarray, p: np.ndarray, count: int):
    for _ in range(count):
        h = 0.5 * A @ (b - p)
        p = anderson.extrapolate(p, h, h)
    return p


def test_the_first_step_is_the_plain_one():
    A, b = _problem()
    assert_allclose(_steps(Anderson(N), A, b, np.zeros_like(b), 1), 0.5 * A @ b)


def test_a_linear_map_of_n_unknowns_is_solved_in_n_plus_two_steps():
    """With n differences the combination spans all of space: Walker and Ni (2011), GMRES."""
    A, b = _problem()
    assert_allclose(_steps(Anderson(N), A, b, np.zeros_like(b), N + 2), b, atol=1e-9)


def test_after_forget_the_next_step_is_the_plain_one():
    A, b = _problem()
    anderson = Anderson(N)
    p = _steps(anderson, A, b, np.zeros_like(b), N)
    anderson.forget()
    assert_allclose(_steps(anderson, A, b, p, 1), p + 0.5 * A @ (b - p))
