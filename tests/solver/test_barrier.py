"""The barrier against folds: derivatives, invariance, and poses with and without it."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import rotation

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session.pose_solver import PoseSolver
from vtk_segdeform.session.state import Options, State
from vtk_segdeform.solver.barrier import Barrier
from vtk_segdeform.solver.solution import Status

SCENE = sausage(2, is_coarse=True)
HELD = {"fixed": SCENE.fixed, "handle": SCENE.handle}


@functools.cache
def deformer_of(*, avoid_folds):
    return SCENE.deformer(avoid_folds=avoid_folds)


def rest_cages():
    return deformer_of(avoid_folds=True)._rest_cages


@pytest.fixture(scope="module")
def barrier():
    return deformer_of(avoid_folds=True)._barrier


@pytest.fixture(scope="module")
def squeezed(barrier):
    """Return cages half as long along one axis, and noise: most tetrahedra are active."""
    noise = np.random.default_rng(0).normal(size=rest_cages().shape)
    return rest_cages() * [0.22, 1.0, 1.0] + 2e-3 * noise


def in_order(p):
    """Return cages as a vector, axis by axis."""
    return p.T.ravel()


def test_at_rest_all_volumes_are_as_they_were(barrier):
    assert len(barrier.corners) > 500
    assert_allclose(barrier.ratios(rest_cages()), 1.0, atol=1e-9)
    assert barrier.value_and_slope(rest_cages())[0] == 0.0
    assert barrier.hessian(rest_cages()) is None


def test_the_slope_is_half_the_derivative(barrier, squeezed):
    value, slope = barrier.value_and_slope(squeezed)
    direction = np.random.default_rng(1).normal(size=squeezed.shape)
    errors = []
    for step in (1e-3, 1e-4):  # of first order: the remainder falls with the square of the step
        ahead = barrier.value_and_slope(squeezed + step * direction)[0]
        errors.append(abs(ahead - value - 2.0 * step * np.vdot(slope, direction)))
    assert 1.8 < np.log10(errors[0] / errors[1]) < 2.2


def test_the_hessian_is_that_of_each_tetrahedron_along_its_volume(barrier, squeezed):
    lower, j = barrier.hessian(squeezed), barrier.ratios(squeezed)
    full = np.tril(lower) + np.tril(lower, -1).T
    active = j < 0.25
    value = [(0.25 - k) ** 3 / (0.0625 * k) for k in (j[active] + s for s in (1e-5, 0.0, -1e-5))]
    second = (value[0] - 2.0 * value[1] + value[2]) / 1e-10
    for seed in range(3):
        direction = np.random.default_rng(seed).normal(size=squeezed.shape)
        ahead, behind = (barrier.ratios(squeezed + s * direction) for s in (1e-6, -1e-6))
        exact = 0.5 * (barrier.weights * ((ahead - behind) / 2e-6) ** 2)[active] @ second
        assert in_order(direction) @ full @ in_order(direction) == pytest.approx(exact, rel=1e-3)


def test_a_rigid_motion_changes_nothing(barrier, squeezed):
    turn = rotation([1, 2, 3], 1.0)
    value, slope = barrier.value_and_slope(squeezed)
    moved, turned = barrier.value_and_slope(squeezed @ turn.T + [1.0, 2.0, 3.0])
    assert moved == pytest.approx(value, rel=1e-9)
    assert_allclose(turned, slope @ turn.T, atol=1e-8 * np.abs(slope).max())


@pytest.mark.parametrize("scales", [(1, 1, 0.3), (1, 1, -1), (-0.3, 1, 1), (-1, -1, -1)])
def test_there_is_a_way_back_from_a_folded_pose(barrier, scales):
    folded = rest_cages() * scales
    deformer = deformer_of(avoid_folds=True).hold(**HELD)
    rest = SCENE.mesh.vertices[SCENE.handle]
    deformer.resume([cage.vertices * scales for cage in SCENE.cages], rest)
    assert deformer.solve(rest).status is Status.CONVERGED
    assert barrier.ratios(deformer._path.p).min() > 0.99
    inverted = barrier.ratios(folded) < 0.0
    assert (barrier.value_and_slope(folded)[0] == np.inf) == inverted.any()
    begun = barrier.begun_at(folded)
    assert len(begun.corners) == np.count_nonzero(~inverted)
    assert begun.value_and_slope(folded)[0] < np.inf


def test_a_bend_folds_without_the_barrier_only(barrier):
    targets = SCENE.turned(150)
    least = []
    for deformer in (
        deformer_of(avoid_folds=True).hold(**HELD),
        deformer_of(avoid_folds=False).hold(**HELD),
    ):
        solution = deformer.solve(targets)
        assert abs(solution.volume_change) < 1e-13
        least.append(barrier.ratios(deformer._path.p).min())
    assert least[0] > 0.0
    assert least[1] < -0.05


def test_without_a_volume_to_preserve_it_maps_the_surface_itself(barrier):
    deformer = deformer_of(avoid_folds=True).hold(**HELD, preserve_volume=False)
    assert not deformer.step_volumes.constraints
    deformer.solve(SCENE.turned(150), max_steps=10)
    assert barrier.ratios(deformer._path.p).min() > 0.0


def test_a_surface_that_is_known_is_not_mapped_again(barrier, squeezed):
    x = deformer_of(avoid_folds=True).step_volumes.surface.map(squeezed)
    value, slope = barrier.value_and_slope(squeezed)
    elsewhere = np.zeros_like(squeezed)  # p is not read, x is
    known, same = barrier.value_and_slope(elsewhere, x)
    assert value > 0.0
    assert known == value
    assert_array_equal(same, slope)
    assert_array_equal(barrier.hessian(elsewhere, x), barrier.hessian(squeezed))


def test_the_solver_passes_the_surface_of_the_same_pose(monkeypatch):
    seen = []

    def recorded(self, p, x):
        seen.append((p, x))
        return 0.0, np.zeros_like(p)

    monkeypatch.setattr(Barrier, "value_and_slope", recorded)
    deformer = deformer_of(avoid_folds=True).hold(**HELD)
    deformer.solve(SCENE.turned(20))
    assert len(seen) > 3
    for p, x in seen:
        assert_allclose(x, deformer.step_volumes.surface.map(p), atol=1e-12)


def test_triangles_share_inner_points_of_the_body():
    deformer = sausage(2).deformer(avoid_folds=True)  # of small triangles
    barrier, n = deformer._barrier, deformer.step_volumes.surface.n_vertices
    inner = barrier.corners[:, 3]
    assert (inner >= n).all()
    assert len(np.unique(inner)) < 0.5 * len(inner)
    assert_allclose(barrier.points.sum(axis=1), 1.0, atol=1e-12)
    faces = {tuple(sorted(each)) for each in deformer._samples.faces.tolist()}
    assert {tuple(sorted(each)) for each in barrier.corners[:, :3].tolist()} == faces


def test_while_inactive_it_changes_no_bit():
    targets = SCENE.turned(20)
    without = deformer_of(avoid_folds=False).hold(**HELD).solve(targets)
    assert_array_equal(
        deformer_of(avoid_folds=True).hold(**HELD).solve(targets).vertices, without.vertices
    )


def test_a_session_turns_it_on_and_off():
    state = State(SCENE.regions, SCENE.cages, SCENE.fixed, {"tip": SCENE.handle})
    solver = PoseSolver(SCENE.mesh)
    for on in (True, False, True):
        options = Options(avoid_folds=on)
        terms = solver._constrain(replace(state, options=options))._constraints.solver.terms
        assert len(terms) == on


def test_an_open_sheet_has_no_inside():
    x, y = np.mgrid[0:1:6j, 0:1:6j].reshape(2, -1)
    corner = np.add.outer(6 * np.arange(5), np.arange(5)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 6, 7], corner[:, None] + [0, 7, 1]])
    sheet = Mesh(np.column_stack([x, y, 0.1 * x * y]), faces)
    points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 5.0
    cage = Cage(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    regions = Regions(sheet, np.ones((1, len(x)), dtype=bool))
    barrier = Deformer(sheet, regions, [cage], avoid_folds=True)._barrier
    assert barrier.value_and_slope(-cage.vertices)[0] == 0.0
