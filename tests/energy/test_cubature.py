"""Cubature: sampled vertices have the terms of the mesh, with the weight of the area around."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import rotation

from vtk_segdeform import models, sizes
from vtk_segdeform.energy.cubature import Sample
from vtk_segdeform.energy.energy import shape_energy
from vtk_segdeform.geometry.kmeans import cluster_positions
from vtk_segdeform.subspace.subspace import Subspace, cage_subspace

SCENE = sausage(3)
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
CLUSTERS = cluster_positions(SCENE.mesh.vertices, 20)


@pytest.fixture
def sample_size(monkeypatch):
    """Return a function that sets the number of sampled vertices."""

    def resize(number):
        monkeypatch.setattr(sizes, "CUBATURE_SAMPLE", number)
        monkeypatch.setattr(sizes, "CUBATURE_FACTOR", 0)

    resize(300)
    return resize


def sampled(stretch=10.0):
    return shape_energy(SCENE.mesh, SUBSPACE, stretch, CLUSTERS)


def vertex_areas(mesh):
    return np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3.0, 3))


@pytest.mark.parametrize("stretch", [0.0, 10.0])
def test_a_sample_of_all_vertices_has_the_whole_energy(sample_size, monkeypatch, stretch):
    sample_size(10**6)
    everything = Sample.of(SCENE.mesh, CLUSTERS)
    assert_array_equal(everything.weights, 1.0)
    found = sampled(stretch)
    monkeypatch.setattr(sizes, "CUBATURE_FACTOR", 10**6)
    whole = sampled(stretch)
    for name in ("quadratic", "mass", "rotation_operator", "constant"):
        expected = getattr(whole, name)
        scale = 1e-12 * np.abs(expected).max()
        assert_allclose(getattr(found, name), expected, rtol=0.0, atol=scale)


@pytest.mark.usefixtures("sample_size")
def test_the_weights_in_a_cluster_add_up_to_its_area():
    sample = Sample.of(SCENE.mesh, CLUSTERS)
    areas = vertex_areas(SCENE.mesh)
    represented = np.bincount(CLUSTERS[sample.ids], sample.weights * areas[sample.ids])
    assert_allclose(represented, np.bincount(CLUSTERS, areas), rtol=1e-12)
    assert 300 <= np.count_nonzero(sample.weights) <= 300 + 2 * (CLUSTERS.max() + 1)


@pytest.mark.usefixtures("sample_size")
def test_a_sample_has_the_rows_and_triangles_of_the_mesh():
    mesh, sample = SCENE.mesh, Sample.of(SCENE.mesh, CLUSTERS)
    assert_array_equal(sample.surface.vertices, mesh.vertices[sample.ids])
    none = np.zeros(0, dtype=np.int64), np.zeros((0, 4))  # a cage that moves no vertex
    for subspace in (SUBSPACE, Subspace(mesh.n_vertices, *((each,) for each in none))):
        rows = sample.rows(subspace).at(np.arange(len(sample.ids)))
        assert_array_equal(rows, subspace.at(sample.ids))
    samples = sample.ids[sample.weights > 0.0]
    around = mesh.faces[np.isin(mesh.faces, samples).any(axis=1)]
    assert_array_equal(sample.ids[sample.surface.faces], around)


def test_every_cluster_has_samples_and_a_small_one_is_sampled_completely(sample_size):
    clusters = CLUSTERS.copy()
    clusters[[5, 6, 700]] = clusters.max() + 1
    sample_size(200)
    sample = Sample.of(SCENE.mesh, clusters)
    assert_array_equal(np.unique(clusters[sample.ids[sample.weights > 0.0]]), np.unique(clusters))
    assert_array_equal(sample.weights[np.isin(sample.ids, [5, 6, 700])], 1.0)


def test_a_cluster_without_area_has_samples(sample_size):
    last = np.flatnonzero(CLUSTERS.max() == CLUSTERS)
    x = SCENE.mesh.vertices.copy()
    x[np.union1d(last, SCENE.mesh.adjacency[last].indices)] = x[last[0]]
    flat = SCENE.mesh.with_vertices(x)
    sample_size(100)
    sample = Sample.of(flat, CLUSTERS)
    assert sample.weights[np.isin(sample.ids, last)].any()
    energy = shape_energy(flat, SUBSPACE, 10.0, CLUSTERS)
    assert energy.rotation_operator.shape == (3 * (CLUSTERS.max() + 1), SUBSPACE.n_columns)
    assert np.isfinite(energy.quadratic).all()


def test_the_sample_is_the_same_in_every_frame_even_of_a_regular_mesh(sample_size):
    mesh = models.bar(divisions=(8, 8, 30))
    clusters = cluster_positions(mesh.vertices, 10)
    sample_size(200)
    here = Sample.of(mesh, clusters)
    for seed in range(3):
        turn = rotation(np.random.default_rng(seed).normal(size=3), 1.0 + seed)
        moved = mesh.with_vertices(3.7 * mesh.vertices @ turn.T + [1.0, -2.0, 5.0])
        there = Sample.of(moved, clusters)
        assert_array_equal(there.ids, here.ids)
        assert_allclose(there.weights, here.weights, rtol=1e-9)
