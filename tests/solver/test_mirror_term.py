"""The term of symmetry: zero for mirrored motions, its gradient and its Hessian."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtk_segdeform.solver import MirrorTerm

RNG = np.random.default_rng(5)
NORMAL = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
REFLECTION = np.eye(3) - 2.0 * np.outer(NORMAL, NORMAL)
ROWS, MATES = RNG.dirichlet(np.ones(7), (2, 12))
REST = RNG.normal(size=(7, 3))
TERM = MirrorTerm.of(ROWS, MATES, normal=NORMAL, rest=REST, weight=3.0)


def test_it_is_the_sum_of_squares_of_what_is_not_mirrored(rng):
    u = rng.normal(size=REST.shape)
    off = ROWS @ u - (MATES @ u) @ REFLECTION
    assert TERM.value_and_slope(REST + u)[0] == pytest.approx(3.0 * np.vdot(off, off))


def test_mirrored_motions_cost_nothing(rng):
    """Each row and its mate have the same cage vertices but for a swap, as have the motions."""
    swap = [1, 0, 3, 2, 5, 4, 6]
    term = MirrorTerm.of(ROWS, ROWS[:, swap], normal=NORMAL, rest=REST, weight=3.0)
    u = rng.normal(size=REST.shape)
    u = u + u[swap] @ REFLECTION
    value, slope = term.value_and_slope(REST + u)
    assert value < 1e-25
    assert np.abs(slope).max() < 1e-12
    assert term.value_and_slope(REST + u[::-1])[0] > 1.0


def test_its_gradient_is_that_of_its_value_and_its_hessian_that_of_its_gradient(rng):
    u, step = rng.normal(size=(2, *REST.shape))
    value, slope = TERM.value_and_slope(REST + u)
    there, turned = TERM.value_and_slope(REST + u + step)
    curvature = np.dot(TERM.hessian(u) @ step.T.ravel(), step.T.ravel())
    assert there == pytest.approx(value + 2.0 * np.vdot(slope, step) + curvature)
    assert_allclose(TERM.hessian(u) @ step.T.ravel(), (turned - slope).T.ravel(), atol=1e-12)
    assert_allclose(TERM.hessian(u), TERM.hessian(u).T, atol=1e-12)
    assert np.linalg.eigvalsh(TERM.hessian(u))[0] > -1e-12


def test_it_limits_no_step_and_is_always_active():
    assert TERM.share(REST, REST) == 1.0
    assert TERM.is_always_active
