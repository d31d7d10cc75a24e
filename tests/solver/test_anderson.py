"""Anderson acceleration of a linear fixed-point iteration, where its answer is known."""

from __future__ import annotations

import numpy as np
import pytest
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
        p = anderson.extrapolate(p + h, h)
    return p


def test_the_first_step_is_the_plain_one():
    A, b = _problem()
    assert_allclose(_steps(Anderson(N), A, b, np.zeros_like(b), 1), 0.5 * A @ b)


def test_a_linear_map_of_n_unknowns_is_solved_in_n_plus_two_steps():
    """With n differences the combination spans all of space: Walker and Ni (2011), GMRES."""
    A, b = _problem()
    assert_allclose(_steps(Anderson(N), A, b, np.zeros_like(b), N + 2), b, atol=1e-9)


@pytest.mark.parametrize("window", [1, 2])
def test_a_step_combines_the_last_ones_so_that_their_residuals_cancel_best(window):
    """In the form with weights of sum 1, the residuals measured in a norm of their own."""
    A, b = _problem()
    norm, anderson = np.diag([1.0, 2.0, 3.0, 4.0]), Anderson(window)
    p, ps, hs = np.zeros_like(b), [], []
    for _ in range(4):
        ps, hs = [*ps, p], [*hs, 0.5 * A @ (b - p)]
        p = anderson.extrapolate(p + hs[-1], norm @ hs[-1])
    own = np.hstack([norm @ h for h in hs[-window - 1 :]])
    ones = np.ones((window + 1, 1))  # min |own a| subject to sum a = 1, by its conditions
    full = np.block([[own.T @ own, ones], [ones.T, np.zeros((1, 1))]])
    shares = np.linalg.solve(full, np.append(np.zeros(window + 1), 1.0))[:-1]
    ends = np.hstack([p + h for p, h in zip(ps, hs, strict=True)][-window - 1 :])
    assert_allclose(p, ends @ shares[:, None], atol=1e-9)


def test_differences_serve_on_where_the_map_has_moved_by_a_constant():
    """As with new targets: then one step reaches the fixed point, for all of space is known."""
    A, b = _problem()
    anderson = Anderson(N)
    p = _steps(anderson, A, b, np.zeros_like(b), N + 1)
    anderson.pause()
    moved = b + np.array([[3.0], [-1.0], [0.5], [2.0]])
    assert_allclose(_steps(anderson, A, moved, p, 1), moved, atol=1e-9)
    anderson.forget()
    assert_allclose(_steps(anderson, A, b, p, 1), p + 0.5 * A @ (b - p))
