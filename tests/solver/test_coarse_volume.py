"""The coarse volume of a large mesh is used within a step, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import bottle
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.geometry import voronoi_cells
from vtk_segdeform.solver.coarse_volume import CoarseVolume, _matrix, _over_cells
from vtk_segdeform.solver.volume_constraints import region_volumes, total_volume
from vtk_segdeform.subspace.subspace import cage_subspace

SCENE = sausage(3)
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
P0 = np.concatenate([cage.vertices for cage in SCENE.cages])


@pytest.fixture
def coarse(monkeypatch):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 1000)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 700)


def test_a_small_mesh_has_its_own_volume():
    whole = CoarseVolume.of(sausage(2).mesh, SUBSPACE)
    assert whole.surface is SUBSPACE


@pytest.mark.usefixtures("coarse")
def test_a_point_is_the_mean_of_its_cell_over_the_surface():
    """Each vertex counts by its area: a part that is meshed more finely has no more weight."""
    mesh = SCENE.mesh
    coarse_volume = CoarseVolume.of(mesh, SUBSPACE)
    areas = np.zeros(mesh.n_vertices)
    for face, area in zip(mesh.faces, mesh.face_areas, strict=True):
        areas[face] += area / 3.0
    points = coarse_volume.surface.map(P0)
    differences = []
    for cell, point in enumerate(points):
        own = np.flatnonzero(coarse_volume.cells == cell)
        mean = np.average(mesh.vertices[own], axis=0, weights=areas[own])
        assert_allclose(point, mean, atol=1e-9)
        differences.append(np.linalg.norm(mesh.vertices[own].mean(axis=0) - mean))
    assert max(differences) > 1e-3  # the mean by number of vertices is another one


@pytest.mark.usefixtures("coarse")
def test_a_cell_without_area_is_the_mean_of_its_vertices():
    """As where a mesh far from the origin was stored in single precision."""
    flat = SCENE.mesh.vertices.copy()
    flat[flat[:, 0] > 0.0, 1:] = 0.0
    coarse_volume = CoarseVolume.of(SCENE.mesh.with_vertices(flat), SUBSPACE)
    sums = np.bincount(coarse_volume.cells, coarse_volume.shares)
    assert_allclose(sums, 1.0, rtol=1e-12)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("constraints", [total_volume, region_volumes])
def test_coarse_volumes_change_like_those_of_the_mesh(constraints):
    mesh = SCENE.mesh
    held = (total_volume(mesh),)
    if constraints is region_volumes:
        held = region_volumes(mesh, SCENE.regions.labels)
    volumes = CoarseVolume.of(mesh, SUBSPACE).volumes(held, mesh.vertices)
    assert volumes.surface.n_vertices < 0.5 * mesh.n_vertices
    at_rest = volumes.surface.map(P0)
    for fine, rough in zip(held, volumes.constraints, strict=True):
        assert abs(rough.violation(at_rest)) < 1e-12 * abs(rough.target)
        assert rough.target == pytest.approx(fine.target, rel=0.05)
        exact = SUBSPACE.adjoint(fine.gradient(mesh.vertices))
        guess = volumes.surface.adjoint(rough.gradient(at_rest))
        cosine = np.vdot(exact, guess) / np.linalg.norm(exact) / np.linalg.norm(guess)
        assert cosine > 0.995


def hessian_product(volumes, p, multipliers, dp):
    """Return G, as the solver adds it, times *dp* (m, 3)."""
    (g, rest), m = volumes.hessian(p, np.array(multipliers)), len(p)
    assert rest is None
    whole = np.zeros((3, m, 3, m))
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        whole[a, :, b], whole[b, :, a] = g[c], -g[c]
    return (whole.reshape(3 * m, 3 * m) @ dp.T.ravel()).reshape(3, m).T


@pytest.mark.parametrize(
    ("constraints", "few", "error"),
    [(total_volume, 10_000, 1e-4), (total_volume, 700, 0.05), (region_volumes, 700, 1e-4)],
)
def test_the_hessian_is_the_derivative_of_the_gradient(monkeypatch, constraints, few, error):
    monkeypatch.setattr(sizes, "VOLUME_HESSIAN_POINTS", few)
    mesh, rng = SCENE.mesh, np.random.default_rng(6)
    held = (total_volume(mesh),)
    if constraints is region_volumes:
        held = region_volumes(mesh, SCENE.regions.labels)
    volumes = CoarseVolume.of(mesh, SUBSPACE).volumes(held, mesh.vertices)
    p = P0 + 0.02 * rng.normal(size=P0.shape)
    dp, multipliers = rng.normal(size=P0.shape), rng.normal(size=len(held))
    multipliers[0] *= 1e6  # as of a small body among large ones

    def pull(p):
        gradients = [c.gradient(volumes.surface.map(p)) for c in volumes.constraints]
        return SUBSPACE.adjoint(np.tensordot(multipliers, gradients, axes=1))

    exact = 0.5 * (pull(p + dp) - pull(p - dp))  # quadratic: no approximation
    guess = hessian_product(volumes, p, multipliers, dp)
    assert np.linalg.norm(guess - exact) < error * np.linalg.norm(exact)


@pytest.mark.parametrize("per_region", [False, True])
def test_the_coarse_surface_of_an_open_mesh_is_closed_by_coarse_lids(per_region):
    mesh = bottle(40, 40)
    labels = (mesh.vertices[:, 2] > 1.5).astype(int)
    held = region_volumes(mesh, labels) if per_region else (total_volume(mesh),)
    _, cells = voronoi_cells(mesh, 500, np.random.default_rng(0))
    means = _matrix(cells, 1.0 / np.bincount(cells)[cells]) @ mesh.vertices
    for fine in held:
        rough = replace(_over_cells([fine], cells)[0], target=0.0)
        assert rough.violation(means) == pytest.approx(fine.target, rel=0.1)
        assert_allclose(rough.violation(means + [3, -2, 5]), rough.violation(means), rtol=1e-12)
