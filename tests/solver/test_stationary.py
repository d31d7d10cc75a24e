"""To first order: a minimum follows its targets and volumes, and its adjoint is the transpose."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform.solver.stationary import StationaryPoint, half_gradient, off_volumes, rows_of

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)


@pytest.fixture(scope="module")
def minimum():
    """Return a solver, its converged cages, their places, and what `StationaryPoint` finds."""
    deformer = SCENE.deformer(tolerance=1e-12, max_steps=2000)
    deformer.solve(SCENE.turned(40))
    path, solver = deformer._path, deformer._path.solver
    places = deformer._constraints.places(path.targets)
    return solver, path.end, places, StationaryPoint.of(solver, path.end, places)


def test_the_slope_is_minus_the_multipliers_times_the_rows(minimum):
    solver, p, places, point = minimum
    slope = half_gradient(solver, p, places)
    load = sum(k * row for k, row in zip(point.multipliers, point.rows, strict=True))
    assert np.abs(slope).max() > 1e-4 * solver.energy.scale
    assert_allclose(slope, -load, atol=1e-6 * np.abs(slope).max())
    assert np.abs(off_volumes(solver.volumes, p)).max() < 1e-14


def test_a_motion_changes_slope_and_volumes_by_what_it_was_asked_for(minimum, rng):
    solver, p, places, point = minimum
    f = solver.energy.subspace.adjoint(rng.normal(size=SCENE.mesh.vertices.shape))
    g = rng.normal(size=len(point.rows))
    dp = point.moved(f, g)
    assert_allclose([np.vdot(row, dp) for row in point.rows], g, rtol=1e-8)

    def lagrangian(q):
        rows = rows_of(solver.volumes, q)
        loads = (k * row for k, row in zip(point.multipliers, rows, strict=True))
        return half_gradient(solver, q, places) + sum(loads)

    step = 1e-4 / np.abs(dp).max()
    change = (lagrangian(p + step * dp) - lagrangian(p - step * dp)) / (2.0 * step)
    rows = np.reshape(point.rows, (len(g), -1))
    left = (f - change).ravel()  # a change of the multipliers
    left -= np.linalg.lstsq(rows.T, left, rcond=None)[0] @ rows
    assert np.abs(left).max() < 1e-4 * np.abs(f).max()


@pytest.mark.parametrize("is_other", [False, True])
def test_the_loads_are_the_transpose_of_the_motion(minimum, rng, is_other):
    """Also where the volumes that are kept are not those of the steps, as of a large mesh."""
    solver, p, places, point = minimum
    if is_other:
        rows = np.array(point.rows)
        exact = rows + 0.2 * np.abs(rows).max() * rng.normal(size=rows.shape)
        point = StationaryPoint.of(solver, p, places, exact)
    f, g, cotangent = rng.normal(size=p.shape), rng.normal(size=1), rng.normal(size=p.shape)
    v, mu = point.loads(cotangent)
    assert np.vdot(cotangent, point.moved(f, g)) == pytest.approx(np.vdot(v, f) + mu @ g, rel=1e-8)
