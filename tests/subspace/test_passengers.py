"""Passengers: at mesh vertices they follow the mesh, elsewhere continuously and without flips."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import rotation

from vtk_segdeform.errors import CageError, Cancelled
from vtk_segdeform.session.session import Session
from vtk_segdeform.subspace.passengers import blend_at

SCENE = sausage(3, is_coarse=True)
MESH = SCENE.mesh
RNG = np.random.default_rng(4)
INSIDE = MESH.vertices[RNG.integers(0, MESH.n_vertices, 400)] * RNG.uniform(0.0, 0.97, (400, 1))


@pytest.fixture(scope="module")
def bent():
    deformer = SCENE.held()
    return deformer, deformer.solve(SCENE.turned(50))


def test_an_affine_map_of_the_cages_is_an_affine_map_of_the_passengers(bent, rng):
    passengers = bent[0].passengers(INSIDE)
    matrix = rotation([1, 2, 3], 0.7) @ np.diag([1.0, 1.4, 0.6]) + 0.1 * rng.normal(size=(3, 3))
    shift = np.array([3.0, -1.0, 2.0])
    moved = passengers.moved([cage.vertices @ matrix.T + shift for cage in SCENE.cages])
    assert_allclose(moved, INSIDE @ matrix.T + shift, rtol=0, atol=1e-9)
    assert_allclose(passengers.moved([c.vertices for c in SCENE.cages]), INSIDE, atol=1e-11)


def test_blend_weights_in_space_sum_to_one_and_are_continuous(rng):
    weights = SCENE.regions.weights
    line = np.linspace([-2.5, 0.1, 0.05], [2.5, -0.1, 0.02], 4001)
    alpha = blend_at(MESH.vertices, weights, line)
    assert_allclose(alpha.sum(axis=0), 1.0, atol=1e-12)
    assert (alpha >= 0.0).all()
    coarse = np.abs(np.diff(alpha[:, ::4], axis=1)).max()
    fine = np.abs(np.diff(alpha, axis=1)).max()
    assert fine < 0.6 * coarse  # a discontinuity would not become smaller
    near = MESH.vertices + 1e-7 * rng.normal(size=MESH.vertices.shape)
    assert_allclose(blend_at(MESH.vertices, weights, near), weights, atol=1e-5)


def test_tetrahedra_inside_are_not_inverted(bent):
    deformer, solution = bent
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    tets = 0.5 * INSIDE[:, None] + 0.05 * corners  # (400, 4, 3)
    moved = deformer.carry(tets.reshape(-1, 3)).reshape(-1, 4, 3)
    ratio = np.linalg.det(moved[:, 1:] - moved[:, :1]) / np.linalg.det(tets[:, 1:] - tets[:, :1])
    assert ratio.min() > 0.25
    assert np.abs(moved - tets).max() > 0.5  # and they have moved
    low, high = solution.vertices.min(axis=0), solution.vertices.max(axis=0)
    assert ((moved > low) & (moved < high)).all()


def test_passengers_are_bound_once_for_many_poses(bent):
    deformer, solution = bent
    passengers = deformer.passengers(INSIDE)
    assert_allclose(passengers.moved(solution.cage_vertices), deformer.carry(INSIDE), atol=1e-12)
    with pytest.raises(CageError, match=r"must contain \[18, 18, 18\] points"):
        passengers.moved(solution.cage_vertices[:2])


def test_binding_can_be_cancelled_and_bad_arguments_are_named(bent):
    def stop(fraction, text):
        raise Cancelled("enough")

    with pytest.raises(Cancelled):
        bent[0].passengers(INSIDE, progress=stop)
    with pytest.raises(ValueError, match="points"):
        bent[0].carry([[0.0, np.nan, 0.0]])


def test_a_session_carries_points_as_well():
    session = Session(MESH)
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle)
    assert_allclose(session.poses.carry(session.state, INSIDE), INSIDE, atol=1e-11)
    session.drag(SCENE.turned(30))
    assert_allclose(
        session.poses.carry(session.state, MESH.vertices), session.vertices, rtol=0, atol=1e-12
    )
