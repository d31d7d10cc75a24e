"""The solver's own promises, on a sausage of 1026 vertices in two overlapping cages."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import rotation

from vtk_segdeform.energy.energy import shape_energy
from vtk_segdeform.solver.position_constraints import PositionTerm
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.subspace import subspace as subspace_module
from vtk_segdeform.subspace.subspace import Subspace, cage_subspace

SCENE = sausage(2)
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
P0 = np.concatenate([cage.vertices for cage in SCENE.cages])


def distance(a, b):
    """Return the farthest vertex's way, in diagonals of the mesh."""
    return np.linalg.norm(a.vertices - b.vertices, axis=1).max() / SCENE.mesh.diagonal


def wobble(seed=0, size=0.05):
    return P0 + size * np.random.default_rng(seed).normal(size=P0.shape)


def test_the_cages_at_rest_give_back_the_mesh():
    assert_allclose(SUBSPACE.map(P0), SCENE.mesh.vertices, atol=1e-11)


def test_moving_all_cages_by_an_affine_map_moves_the_mesh_by_it():
    matrix, shift = np.random.default_rng(0).normal(size=(3, 3)), [1.0, 2.0, 3.0]
    moved = SUBSPACE.map(P0 @ matrix.T + shift)
    assert_allclose(moved, SCENE.mesh.vertices @ matrix.T + shift, atol=1e-10)


def test_the_adjoint_is_the_adjoint():
    rng = np.random.default_rng(1)
    p, y = rng.normal(size=P0.shape), rng.normal(size=SCENE.mesh.vertices.shape)
    assert_allclose(np.vdot(SUBSPACE.map(p), y), np.vdot(p, SUBSPACE.adjoint(y)), rtol=1e-12)


def test_single_rows_agree_with_the_map():
    ids = np.array([5, 900, 17])
    assert_allclose(SUBSPACE.at(ids) @ wobble(), SUBSPACE.map(wobble())[ids], atol=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("directions", [0, 1])
def test_a_map_sets_every_vertex_to_where_it_starts_before_it_adds(
    monkeypatch, compiled, directions
):
    """Vertices of several blocks, of one, and of none; more of them than a piece takes."""
    monkeypatch.setattr(subspace_module, "_CACHED", 200)
    rng, n = np.random.default_rng(3), 5000
    rows = tuple(np.sort(rng.permutation(n - 10)[:k]) for k in (900, 2500))
    subspace = Subspace(n, rows, tuple(rng.normal(size=(len(own), 7)) for own in rows))
    subspace.__dict__["_is_compiled"] = compiled
    start, p = rng.normal(size=(n, 3)), rng.normal(size=(14, 3 + 3 * directions))
    expected = np.zeros((n, p.shape[1]))
    expected[:, :3] = start
    for own, block, columns in zip(rows, subspace.blocks, subspace.columns, strict=True):
        expected[own] += block @ p[columns]
    before = start.copy()
    assert_allclose(subspace.map(p, start), expected, atol=1e-13)
    assert_allclose(start, before, atol=0)


def test_arrays_of_any_form_are_multiplied_alike():
    rng = np.random.default_rng(4)
    subspace = Subspace(5000, (np.arange(5000),), (rng.normal(size=(5000, 7)),))
    subspace.__dict__["_is_compiled"] = True  # by kernels, which are compiled for one form
    p, y, start = (rng.normal(size=(k, 6))[:, :3] for k in (7, 5000, 5000))
    p.setflags(write=False)
    expected = subspace.map(p.copy(), start.copy()), subspace.adjoint(y.copy())
    start.setflags(write=False)
    assert_allclose(expected[0], subspace.blocks[0] @ p + start, atol=1e-13)
    assert_allclose(expected[1], subspace.blocks[0].T @ y, atol=1e-11)
    assert (subspace.map(p, start) == expected[0]).all()
    assert (subspace.adjoint(np.asfortranarray(y)) == expected[1]).all()


def test_cages_that_share_no_vertex_do_not_couple():
    scene = sausage(3)
    subspace = cage_subspace(scene.regions, scene.cages)
    energy = shape_energy(scene.mesh, subspace, 10.0, None)
    first, last = subspace.columns[0], subspace.columns[2]
    assert (energy.quadratic[first, last] == 0.0).all()
    assert np.abs(energy.quadratic[first, subspace.columns[1]]).max() > 0.0


BOTH = pytest.mark.parametrize("groups", [None, 40], ids=["per vertex", "grouped"])


def shape(stretch, groups):
    n = SCENE.mesh.n_vertices
    groups = None if groups is None else np.arange(n) % groups
    return shape_energy(SCENE.mesh, SUBSPACE, stretch, groups)


@BOTH
@pytest.mark.parametrize("stretch", [0.0, 1.0, 10.0])
def test_a_rigid_motion_costs_nothing_and_pulls_nowhere(stretch, groups):
    energy = shape(stretch, groups)
    for p in (P0, P0 @ rotation([1, 2, 3], 2.0).T + [3.0, 2.0, 1.0]):
        value, slope = energy.local_step(p, SUBSPACE.map(p))
        assert abs(value) < 1e-9 * energy.constant
        assert np.abs(slope).max() < 1e-9 * np.abs(energy.quadratic).max()
    value, _ = energy.local_step(wobble(), SUBSPACE.map(wobble()))
    assert value > 1e-5 * energy.constant  # and bending does cost


@BOTH
@pytest.mark.parametrize("stretch", [1.0, 10.0])
def test_the_slope_is_half_the_gradient(stretch, groups):
    energy = shape(stretch, groups)
    p, direction = wobble(), wobble(1, 1.0) - P0
    value, slope = energy.local_step(p, SUBSPACE.map(p))
    errors = []
    for t in (2e-4, 1e-4):
        ahead, _ = energy.local_step(p + t * direction, SUBSPACE.map(p + t * direction))
        errors.append(abs(ahead - value - 2.0 * t * np.vdot(slope, direction)))
    assert 3.5 < errors[0] / errors[1] < 4.5


PAPER = {"acceleration": 0, "exact_hessian": False}


@pytest.mark.parametrize("options", [{}, {**PAPER, "max_steps": 1000}, {"rotation_groups": None}])
def test_volume_is_exact_and_the_merit_never_rises(options):
    deformer = SCENE.deformer(**options)
    solution = deformer.solve(SCENE.turned(60))
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-13
    merits = np.array(solution.merits)
    assert (np.diff(merits) <= 1e-9 * merits[0]).all()
    assert merits[-1] < merits[0]


def test_volume_is_exact_after_every_single_step():
    deformer = SCENE.held()
    for _ in range(12):
        assert abs(deformer.solve(SCENE.turned(90), max_steps=1).volume_change) < 1e-13


def test_without_the_constraint_the_volume_does_change():
    solution = SCENE.held(preserve_volume=False).solve(SCENE.turned(90))
    assert abs(solution.volume_change) > 1e-3


def test_the_papers_linearised_multiplier_leaves_a_small_error():
    exact = SCENE.deformer(max_steps=3)
    linear = SCENE.deformer(exact_volume=False, max_steps=3)
    targets = SCENE.turned(25)
    assert abs(exact.solve(targets).volume_change) < 1e-13
    assert 1e-9 < abs(linear.solve(targets).volume_change) < 1e-1


def test_region_volumes_hold_each():
    scene = sausage(3)
    solution = scene.held(preserve_region_volumes=True).solve(scene.turned(60))
    assert np.abs(solution.region_volume_change).max() < 1e-12
    assert abs(solution.volume_change) < 1e-12
    free = scene.held().solve(scene.turned(60))
    assert np.abs(free.region_volume_change).max() > 1e-4


def test_acceleration_finds_the_plain_iterations_answer_in_fewer_steps():
    options = {"rotation_groups": None, "tolerance": 1e-8, "max_steps": 5000}
    targets = SCENE.turned(30)
    plain = SCENE.deformer(**PAPER, **options).solve(targets)
    fast = SCENE.deformer(**options).solve(targets)
    assert plain.status is fast.status is Status.CONVERGED
    assert distance(plain, fast) < 1e-4
    assert fast.steps < 0.5 * plain.steps


def test_groups_stay_close_to_one_rotation_per_vertex():
    targets = SCENE.turned(30)
    fine = SCENE.deformer(rotation_groups=None).solve(targets)
    assert distance(SCENE.held().solve(targets), fine) < 0.01


def test_at_the_end_the_slope_is_a_multiple_of_the_volume_gradient():
    # Karush-Kuhn-Tucker: what is left of the slope can only push against the volume.
    deformer = SCENE.deformer(tolerance=1e-10, max_steps=2000, rotation_groups=50)
    deformer.solve(SCENE.turned(40))
    solver, targets = deformer._continuation.solver, deformer._constraints.places(deformer._targets)
    x = solver.energy.subspace.map(deformer._continuation.p)
    _, slope = solver.energy.local_step(deformer._continuation.p, x)
    slope = slope + solver.positions.value_and_slope(deformer._continuation.p, targets)[1]
    gradient = solver.energy.subspace.adjoint(solver.volumes.constraints[0].gradient(x))
    factor = np.vdot(slope, gradient) / np.vdot(gradient, gradient)
    assert np.linalg.norm(slope - factor * gradient) < 1e-5 * np.linalg.norm(slope)


def test_a_strong_pull_against_the_volume_neither_diverges_nor_breaks():
    # Every vertex is a handle and is told to shrink to half: impossible at constant volume.
    everything = np.arange(SCENE.mesh.n_vertices)
    scene = type(SCENE)(SCENE.mesh, SCENE.regions, SCENE.cages, everything[:0], everything)
    solution = scene.deformer().solve(0.5 * SCENE.mesh.vertices)
    assert np.isfinite(solution.vertices).all()
    assert abs(solution.volume_change) < 1e-12


def test_many_vertices_of_a_set_pull_as_few_rows_do():
    rng = np.random.default_rng(6)
    rows = rng.normal(size=(500, 40)) * (np.arange(40) < 12)  # reaches 12 of the cage vertices
    rows = np.vstack([rows, rng.normal(size=(7, 40))])
    set_of = np.repeat([0, 1], [500, 7])
    base, strength = np.where(set_of == 0, 0.3, 2.0), np.array([5.0, 1.0])
    term = PositionTerm(rows, set_of, base, strength)
    p, u = rng.normal(size=(40, 3)), rng.normal(size=(507, 3))
    pull = term.toward(u)
    assert len(pull.rows) == 12 + 7
    away = rows @ p - u
    value, slope = pull.value_and_slope(p)
    assert value == pytest.approx((term.weights * np.square(away).sum(axis=1)).sum(), rel=1e-13)
    assert_allclose(slope, rows.T @ (term.weights[:, None] * away), rtol=1e-11, atol=1e-10)
    other = term.with_strength(np.array([50.0, 1.0]))
    value, slope = other.value_and_slope(p, u)
    assert value == pytest.approx((other.weights * np.square(away).sum(axis=1)).sum(), rel=1e-13)
    assert_allclose(slope, rows.T @ (other.weights[:, None] * away), rtol=1e-11, atol=1e-9)
