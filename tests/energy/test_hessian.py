"""The Hessian of the shape energy: the limit of differences of the gradient."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import rotation

from vtk_segdeform.energy.energy import shape_energy
from vtk_segdeform.energy.hessian import _roots, full_factor, quadratic_factor, rotation_term
from vtk_segdeform.geometry.kmeans import cluster_positions
from vtk_segdeform.subspace.subspace import cage_subspace

SCENE = sausage()
REST = np.concatenate([cage.vertices for cage in SCENE.cages])


def energy_of(n_clusters):
    subspace = cage_subspace(SCENE.regions, SCENE.cages)
    clusters = cluster_positions(SCENE.mesh.vertices, n_clusters)
    return shape_energy(SCENE.mesh, subspace, 10.0, clusters)


def bent(p):
    """Return *p* bent smoothly, by half a radian at the ends."""
    angle = 0.15 * p[:, :1]
    x, z = p[:, :1] * np.cos(angle), p[:, 2:] + p[:, :1] * np.sin(angle)
    return np.hstack([x, p[:, 1:2], z])


def hessian_times(energy, p, dp):
    """Return half the Hessian of E at *p* times *dp*, from the two terms that the solver adds."""
    lower = np.tril(rotation_term(energy, p))
    part = lower + np.tril(lower, -1).T
    return energy.quadratic @ dp - (part @ dp.T.ravel()).reshape(3, -1).T


def slope(energy, p):
    return energy.value_and_slope(p)[1]


@pytest.mark.parametrize("n_clusters", [40, SCENE.mesh.n_vertices])
def test_it_is_the_derivative_of_the_gradient_to_second_order(n_clusters, rng):
    energy, p = energy_of(n_clusters), bent(REST)
    dp = rng.normal(size=p.shape)
    exact = hessian_times(energy, p, dp)
    errors = []
    for step in (1e-2, 1e-3):
        difference = slope(energy, p + step * dp) - slope(energy, p - step * dp)
        errors.append(np.linalg.norm(difference / (2 * step) - exact) / np.linalg.norm(exact))
    assert errors[1] < 1e-4
    assert errors[1] < 0.02 * errors[0]  # slope 2: ten times closer, a hundred times better


@pytest.mark.parametrize("stretch", [10.0, 0.0])
def test_energy_and_gradient_are_those_of_the_dense_operators(stretch):
    subspace, p = cage_subspace(SCENE.regions, SCENE.cages), bent(REST)
    clusters = cluster_positions(SCENE.mesh.vertices, 250)
    energy = shape_energy(SCENE.mesh, subspace, stretch, clusters)
    assert energy.rotation_operator.size > 60_000  # enough to be multiplied without its zeros
    u, _, vt = np.linalg.svd((energy.rotation_operator @ p).reshape(-1, 3, 3))
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]  # no reflections
    load = energy.rotation_operator.T @ (u @ vt).reshape(-1, 3)
    product = energy.quadratic @ p
    value, half = energy.value_and_slope(p)
    exact = np.vdot(p, product) - 2.0 * np.vdot(p, load) + energy.constant
    assert abs(value - exact) < 1e-12 * energy.constant
    assert_allclose(half, product - load, atol=1e-12 * np.abs(product).max())


def test_a_rotation_of_the_whole_mesh_costs_nothing():
    energy = energy_of(40)
    for axis in np.eye(3):
        turn = np.cross(axis, REST)
        assert np.vdot(turn, energy.quadratic @ turn) > 1.0  # the paper's Hessian resists
        cost = np.vdot(turn, hessian_times(energy, REST, turn))
        assert abs(cost) < 1e-9 * np.vdot(turn, energy.quadratic @ turn)


def test_the_hessian_rotates_with_the_pose(rng):
    energy, p = energy_of(40), bent(REST)
    turn = rotation([1.0, 2.0, 0.5], 1.1)
    dp = rng.normal(size=p.shape)
    turned = hessian_times(energy, p @ turn.T, dp @ turn.T)
    expected = hessian_times(energy, p, dp) @ turn.T
    assert_allclose(turned, expected, atol=1e-9 * np.abs(expected).max())


def test_both_forms_of_the_factor_solve(rng):
    energy, p = energy_of(40), bent(REST)
    held = energy.quadratic + np.eye(len(p)) * np.trace(energy.quadratic)
    y = rng.normal(size=p.shape)
    plain = quadratic_factor(held)
    assert_allclose(held @ plain.solve(y), y, atol=1e-9)
    curved = full_factor(held, rotation_term(energy, p))
    h = curved.solve(y)
    back = hessian_times(energy, p, h) + (held - energy.quadratic) @ h
    assert_allclose(back, y, atol=2e-3 * np.abs(y).max())  # a thousandth of the term is left out


def test_the_hessian_of_the_volumes_is_added(rng):
    energy, p, m = energy_of(40), bent(REST), len(REST)
    held = energy.quadratic + np.eye(m) * np.trace(energy.quadratic)
    g = 1e-3 * np.trace(energy.quadratic) / m * rng.normal(size=(3, m, m))
    g -= np.swapaxes(g, 1, 2)
    with_it, without = (full_factor(held, rotation_term(energy, p), volumes=of) for of in (g, None))
    added = with_it.triangle @ with_it.triangle.T - without.triangle @ without.triangle.T
    blocks = added.reshape(3, m, 3, m)
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        assert_allclose(blocks[a, :, b], g[c], atol=1e-9 * np.abs(g).max())
        assert_allclose(blocks[b, :, a], -g[c], atol=1e-9 * np.abs(g).max())
        assert np.abs(blocks[a, :, a]).max() < 1e-9 * np.abs(g).max()


def test_a_hessian_that_is_not_convex_has_no_factor():
    assert quadratic_factor(-np.eye(4)) is None
    energy = energy_of(40)
    assert full_factor(-energy.quadratic, rotation_term(energy, REST)) is None


def test_a_mirrored_pose_still_has_a_factor():
    energy = energy_of(40)
    mirrored = REST * [1.0, 1.0, -1.0]
    held = energy.quadratic + 1e-3 * np.eye(len(REST)) * np.trace(energy.quadratic)
    factor = full_factor(held, rotation_term(energy, mirrored))
    assert factor is None or np.isfinite(factor.solve(mirrored)).all()


def test_the_stiffness_of_weak_clusters_is_raised(rng):
    """Also if they are flat, needles, mirrored or nothing; firm ones have the inverse itself."""
    spread = rng.normal(size=(60, 3, 3))
    stiffness = spread @ np.swapaxes(spread, 1, 2)
    stiffness[:20] -= 2.0 * np.linalg.eigvalsh(stiffness[:20])[:, 1, None, None] * np.eye(3)
    stiffness[20:24] = np.diag([1.0, 1.0, 1e-9])
    stiffness[24:28] = np.diag([1.0, 1e-7, 0.0])
    values, axes = np.linalg.eigh(stiffness)
    raised = np.maximum(values, 1e-3 * np.abs(values).max(axis=1, keepdims=True))
    expected = (axes / raised[:, None]) @ np.swapaxes(axes, 1, 2)
    roots = _roots(stiffness)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    found = np.swapaxes(roots, 1, 2) @ roots
    assert_allclose(found / size, expected / size, atol=1e-11)
    assert (values[28:, 0] > 2e-3 * values[28:, 2]).sum() > 20
    assert np.isfinite(_roots(np.zeros((1, 3, 3)))).all()
