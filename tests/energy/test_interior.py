"""Rotations at points inside the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import rotation

from vtk_segdeform import models, sizes
from vtk_segdeform.cages import Cage
from vtk_segdeform.energy import Interior, with_interior
from vtk_segdeform.mesh import Mesh, winding_number

SCENE = sausage(2, is_coarse=True)
DEFORMER = SCENE.deformer()
MESH, CAGES = DEFORMER._problem.rest, DEFORMER._problem.rest_cages
BODY = np.array([True])


def interior_of(mesh: Mesh = MESH) -> Interior:
    return Interior.of(mesh, SCENE.regions.weights, BODY)


def gradients(interior: Interior, subspace=None) -> np.ndarray:
    ends = np.cumsum([cage.n_vertices for cage in SCENE.cages])[:-1]
    cages = [
        Cage(x, cage.faces) for x, cage in zip(np.split(CAGES, ends), SCENE.cages, strict=True)
    ]
    return interior.gradients(cages, DEFORMER.subspace if subspace is None else subspace)


def solid():
    """Return the energy inside alone, which is scaled by that of the surface."""
    surface = DEFORMER._problem.energy
    nothing = replace(
        surface,
        quadratic=np.eye(len(CAGES)),
        constant=0.0,
        rotation_operator=np.zeros((3, len(CAGES))),
    )
    interior = interior_of()
    whole = with_interior(nothing, gradients(interior), interior.volumes)
    return replace(whole, quadratic=whole.quadratic - np.eye(len(CAGES)))


def value_and_slope(energy, p):
    return energy.value_and_slope(p)


def test_an_affine_map_of_the_cages_has_its_own_gradient_everywhere():
    """Mean value coordinates reproduce linear functions, and blend weights sum to 1."""
    linear = np.array([[1.1, 0.2, 0.0], [0.1, 0.9, 0.3], [0.0, -0.2, 1.2]])
    found = gradients(interior_of()) @ (CAGES @ linear + [3.0, 2.0, 1.0])
    assert_allclose(found, np.broadcast_to(linear, found.shape), atol=1e-8)


def test_the_points_are_inside_and_have_the_volume_of_the_body_in_proportion():
    for mesh in (models.cactus(1500), models.torus(400), models.bar()):
        weights = np.ones((1, mesh.n_vertices))
        interior = Interior.of(mesh, weights, BODY)
        assert 100 < len(interior.points) <= 200
        inside = winding_number(interior.points, mesh.vertices, mesh.faces)
        assert np.mean(inside > 0.5) > 0.97
        assert (interior.volumes > 0.0).all()


def test_points_of_a_body_do_not_see_the_regions_of_another():
    ball = models.sphere(66)
    both = Mesh(
        np.concatenate([ball.vertices, ball.vertices + [2.2, 0.0, 0.0]]),
        np.concatenate([ball.faces, ball.faces + 66]),
    )
    weights = np.repeat(np.eye(2), 66, axis=1)
    interior = Interior.of(both, weights, np.array([True, True]))
    assert set(interior.weights.ravel()) == {0.0, 1.0}
    is_right = interior.points[:, 0] > 1.1
    assert (interior.weights[1] == is_right).all()


def test_rigid_motions_cost_nothing_and_all_others_do():
    energy = solid()
    turned = CAGES @ rotation([1.0, 2.0, 3.0], 2.0).T + [1.0, -2.0, 0.5]
    assert abs(value_and_slope(energy, CAGES)[0]) < 1e-8 * energy.constant
    assert abs(value_and_slope(energy, turned)[0]) < 1e-8 * energy.constant
    x = CAGES[:, :1] - CAGES[:, 0].mean()
    twisted = np.stack(
        [rotation([1.0, 0.0, 0.0], a) @ q for a, q in zip(2.0 * x[:, 0], CAGES, strict=True)]
    )
    for wrong in (0.8 * CAGES, CAGES * [1.0, 1.0, 0.7], twisted, -CAGES):
        assert value_and_slope(energy, wrong)[0] > 1e-3 * energy.constant


def test_the_slope_is_the_derivative():
    energy, rng = solid(), np.random.default_rng(4)
    p = CAGES + 0.05 * rng.normal(size=CAGES.shape)
    way = rng.normal(size=CAGES.shape)
    value, slope = value_and_slope(energy, p)
    errors = []
    for step in (1e-2, 1e-3, 1e-4):
        ahead, _ = value_and_slope(energy, p + step * way)
        errors.append(abs(ahead - value - 2.0 * step * np.vdot(slope, way)))
    rates = np.log10(np.array(errors[:-1]) / errors[1:])
    assert_allclose(rates, 2.0, atol=0.1)


@pytest.mark.parametrize("flip", [rotation([1.0, 2.0, 3.0], 1.0), np.diag([1.0, 1.0, -1.0])])
def test_the_points_turn_with_the_mesh_and_are_mirrored_with_it(flip):
    mesh = models.cactus(1000)
    weights = np.ones((1, mesh.n_vertices))
    mirrored = np.linalg.det(flip) < 0.0
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    other = Interior.of(Mesh(mesh.vertices @ flip.T, faces), weights, BODY)
    here = Interior.of(mesh, weights, BODY)
    assert_allclose(other.points, here.points @ flip.T, atol=1e-9)
    assert_allclose(other.volumes, here.volumes, rtol=1e-9)


def test_a_large_mesh_has_as_many_points(monkeypatch):
    monkeypatch.setattr(sizes, "DECIMATED", 500)
    monkeypatch.setattr(sizes, "DECIMATED_POINTS", 400)
    mesh = models.cactus(1500)
    interior = Interior.of(mesh, np.ones((1, mesh.n_vertices)), BODY)
    assert 100 < len(interior.points) <= 200
    inside = winding_number(interior.points, mesh.vertices, mesh.faces)
    assert np.mean(inside > 0.5) > 0.95
