"""The solver on a sausage in two overlapping cages: exact volumes, falling merits, minima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform.solver.extrapolation import Way
from vtk_segdeform.solver.gauss_newton import GaussNewton
from vtk_segdeform.solver.solution import Status

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)  # 258 vertices in two overlapping cages


def distance(a, b):
    """Return the largest distance of a vertex in two poses, in diagonals of the mesh."""
    return np.linalg.norm(a.vertices - b.vertices, axis=1).max() / SCENE.mesh.diagonal


@pytest.mark.parametrize("options", [{}, {"rotation_groups": SCENE.mesh.n_vertices}])
def test_volume_is_exact_and_the_merit_never_rises(options):
    deformer = SCENE.deformer(**options)
    solution = deformer.solve(SCENE.turned(60))
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-13
    merits = np.array(solution.merits)
    assert (np.diff(merits) <= 1e-9 * merits[0]).all()
    assert merits[-1] < merits[0]


def test_volume_is_exact_after_every_step():
    deformer = SCENE.held()
    for _ in range(12):
        assert abs(deformer.solve(SCENE.turned(90), max_steps=1).volume_change) < 1e-13


def test_without_the_constraint_the_volume_does_change():
    solution = SCENE.held(preserve_volume=False).solve(SCENE.turned(90))
    assert abs(solution.volume_change) > 1e-3


def test_every_region_volume_is_preserved():
    scene = sausage(3, is_coarse=True)
    solution = scene.held(preserve_region_volumes=True).solve(scene.turned(60))
    assert np.abs(solution.region_volume_change).max() < 1e-12
    assert abs(solution.volume_change) < 1e-12
    free = scene.held().solve(scene.turned(60))
    assert np.abs(free.region_volume_change).max() > 1e-4


def test_a_steady_drag_starts_ahead_and_ends_in_the_same_poses():
    ahead, behind = SCENE.held(), SCENE.held()
    for angle in (1.0, 2.0, 3.0, 4.0):
        behind._path.solver._way = Way()
        fast, slow = (each.solve(SCENE.turned(angle), max_steps=50) for each in (ahead, behind))
        assert abs(fast.volume_change) < 1e-13
        assert distance(fast, slow) < 1e-4
        if angle > 2.0:
            assert np.ptp(fast.merits) < 0.3 * np.ptp(slow.merits)
    assert distance(*(each.solve(SCENE.turned(4.0)) for each in (ahead, behind))) < 1e-5


def test_the_directions_of_the_volume_do_not_depend_on_the_way_to_a_pose():
    """A large mesh is moved along them, so its pose would depend on the way, too."""
    straight, roundabout = SCENE.held(), SCENE.held()
    for angle in (10.0, 20.0, 30.0, 38.0, 39.5):
        roundabout.solve(SCENE.turned(angle))
    ends = []
    for deformer in (straight, roundabout):
        deformer.solve(SCENE.turned(40.0))
        ends.append(deformer._path.solver._way.ends[-1])
    (first,), (second,) = (end.directions for end in ends)
    assert np.linalg.norm(first - second) < 1e-4 * np.linalg.norm(first)


def test_rotation_clusters_stay_close_to_a_rotation_for_each_vertex():
    targets = SCENE.turned(30)
    fine = SCENE.deformer(rotation_groups=SCENE.mesh.n_vertices).solve(targets)
    assert distance(SCENE.held().solve(targets), fine) < 0.01


def test_at_the_end_the_slope_is_a_multiple_of_the_volume_gradient():
    # Karush-Kuhn-Tucker: the slope is a multiple of the gradient of the constraint.
    deformer = SCENE.deformer(tolerance=1e-10, max_steps=2000, rotation_groups=50)
    deformer.solve(SCENE.turned(40))
    solver, targets = deformer._path.solver, deformer._constraints.places(deformer._path.targets)
    x = solver.energy.subspace.map(deformer._path.p)
    _, slope = solver.energy.value_and_slope(deformer._path.p)
    slope = slope + solver.positions.value_and_slope(deformer._path.p, targets)[1]
    gradient = solver.energy.subspace.adjoint(solver.volumes.constraints[0].gradient(x))
    factor = np.vdot(slope, gradient) / np.vdot(gradient, gradient)
    assert np.linalg.norm(slope - factor * gradient) < 1e-5 * np.linalg.norm(slope)


def test_a_strong_pull_against_the_volume_neither_diverges_nor_breaks():
    # Every vertex is a handle, and the targets are half as large: impossible at constant volume.
    everything = np.arange(SCENE.mesh.n_vertices)
    scene = type(SCENE)(SCENE.mesh, SCENE.regions, SCENE.cages, everything[:0], everything)
    solution = scene.deformer().solve(0.5 * SCENE.mesh.vertices)
    assert np.isfinite(solution.vertices).all()
    assert abs(solution.volume_change) < 1e-12


def test_an_almost_singular_hessian_does_not_stop_the_solver(monkeypatch):
    """Its steps are too long at any of their shares, so those of the paper replace them."""
    of_h, asked = GaussNewton._factor_at, []

    def almost_singular(self, *args):
        factor = of_h(self, *args)
        asked.append(factor)
        return replace(factor, triangle=np.asfortranarray(1e-3 * factor.triangle))

    deformer = SCENE.held()
    expected = deformer.solve(SCENE.turned(10))
    with monkeypatch.context() as wrong:
        wrong.setattr(GaussNewton, "_factor_at", almost_singular)
        found = SCENE.held().solve(SCENE.turned(10), max_steps=20)
    assert asked
    assert found.status is Status.STEP_LIMIT
    assert distance(found, expected) < 5e-3


def test_the_iteration_ends_where_only_rounding_is_left():
    solution = SCENE.deformer(tolerance=1e-300).solve(SCENE.turned(30))
    assert solution.status is Status.CONVERGED
    assert solution.steps < 100
    assert distance(solution, SCENE.held().solve(SCENE.turned(30))) < 1e-6


def test_the_compliance_is_how_far_points_move_under_unit_forces():
    solver = SCENE.held()._constraints.solver
    rows = solver.energy.subspace.at(np.array([100, 400]))
    h, compliance = solver._hessian, solver.compliance(rows)
    assert_allclose(compliance, rows @ np.linalg.solve(h, rows.T), rtol=1e-6)
