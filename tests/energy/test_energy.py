"""The shape energy: zero under rigid motion, exact gradient, and the stiffness of the cages."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import sausage
from solids import rotation

from vtk_segdeform.energy.energy import shape_energy, with_cage_stiffness, with_rotating_rows
from vtk_segdeform.geometry.kmeans import cluster_positions
from vtk_segdeform.subspace.subspace import cage_subspace

SCENE = sausage(2)  # in cages 1.75 times as large as their regions
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
REST = np.concatenate([cage.vertices for cage in SCENE.cages])
FACES = [cage.faces for cage in SCENE.cages]
CLUSTERS = cluster_positions(SCENE.mesh.vertices, 40)
WITHOUT = shape_energy(SCENE.mesh, SUBSPACE, 10.0, CLUSTERS)
ENERGY = with_cage_stiffness(WITHOUT, REST, FACES, CLUSTERS)


def wobble(seed=0, size=0.05):
    return REST + size * np.random.default_rng(seed).normal(size=REST.shape)


def test_cage_stiffness_resists_motion_that_hardly_moves_the_mesh():
    step = np.random.default_rng(3).normal(size=REST.shape)
    weak = np.linalg.eigh(WITHOUT.quadratic)[1][:, 3:6]  # the softest except translations
    p = REST + 0.3 * weak @ (weak.T @ step)
    assert ENERGY.value_and_slope(p)[0] > 5.0 * WITHOUT.value_and_slope(p)[0]


@pytest.mark.parametrize("n_regions", [1, 2])
def test_loose_cages_stay_near_the_mesh(n_regions):
    scene = sausage(n_regions, is_coarse=True)
    solution = scene.deformer().solve(scene.turned(60))
    middle = solution.vertices.mean(axis=0)
    for vertices, cage in zip(solution.cage_vertices, scene.cages, strict=True):
        reach = np.linalg.norm(cage.vertices - scene.mesh.vertices.mean(axis=0), axis=1).max()
        assert np.linalg.norm(vertices - middle, axis=1).max() < 3.0 * reach


def shape(stretch, n_clusters):
    n = SCENE.mesh.n_vertices
    clusters = np.arange(n) % (n_clusters or n)
    return shape_energy(SCENE.mesh, SUBSPACE, stretch, clusters)


def with_arms(weight=50.0):
    """Return an energy, the same with the arms from a vertex to others, and these at rest."""
    energy, ids = shape(10.0, 40), np.arange(30, 36)
    rows, rest = SUBSPACE.at(ids), SCENE.mesh.vertices[ids]
    rows, arms = rows[1:] - rows[0], rest[1:] - rest[0]
    return energy, with_rotating_rows(energy, rows, arms, np.full(len(arms), weight)), arms


def value_at(energy, p):
    return energy.value_and_slope(p)[0]


def test_rotating_rows_resist_growth_but_no_rigid_motion():
    plain, energy, arms = with_arms(weight=50.0)
    turned = REST @ rotation([3, 1, 2], 0.8).T + [3.0, 2.0, 1.0]
    assert abs(value_at(energy, turned)) < 1e-9 * energy.constant
    for growth in (0.7, 1.4):
        more = value_at(energy, growth * turned) - value_at(plain, growth * turned)
        assert more == pytest.approx(50.0 * (growth - 1.0) ** 2 * (arms**2).sum(), rel=1e-6)


ENERGIES = {
    "per vertex": lambda: shape(10.0, None),
    "no stretch": lambda: shape(0.0, None),
    "clusters": lambda: shape(1.0, 40),
    "cage stiffness": lambda: ENERGY,
    "rotating rows": lambda: with_arms()[1],
}


@pytest.mark.parametrize("name", ENERGIES)
def test_it_is_zero_with_no_gradient_under_rigid_motion(name):
    energy = ENERGIES[name]()
    for p in (REST, REST @ rotation([1, 2, 3], 2.0).T + [3.0, 2.0, 1.0]):
        value, slope = energy.value_and_slope(p)
        assert abs(value) < 1e-9 * energy.constant
        assert np.abs(slope).max() < 1e-9 * np.abs(energy.quadratic).max()
    assert value_at(energy, wobble()) > 1e-5 * energy.constant  # bending is not free


@pytest.mark.parametrize("name", ENERGIES)
def test_the_slope_is_half_the_gradient(name):
    energy = ENERGIES[name]()
    p, direction = wobble(), wobble(1, 1.0) - REST
    value, slope = energy.value_and_slope(p)
    errors = []
    for t in (2e-4, 1e-4):
        expected = value + 2.0 * t * np.vdot(slope, direction)
        errors.append(abs(value_at(energy, p + t * direction) - expected))
    assert 3.5 < errors[0] / errors[1] < 4.5
