"""Few vertices speak for all: what they say is the mesh's own, and counts for the area around."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import rotation

from vtk_segdeform import models
from vtk_segdeform.deformer import binding
from vtk_segdeform.energy import cubature
from vtk_segdeform.energy.cubature import Sample
from vtk_segdeform.energy.energy import shape_energy
from vtk_segdeform.geometry.intrinsic import IntrinsicTriangulation
from vtk_segdeform.geometry.kmeans import cluster_positions
from vtk_segdeform.subspace.subspace import Subspace, bind

SCENE = sausage(3)
SUBSPACE = bind(SCENE.regions, SCENE.cages)
REST = np.concatenate([cage.vertices for cage in SCENE.cages])
GROUPS = cluster_positions(SCENE.mesh.vertices, 20)


@pytest.fixture
def asked(monkeypatch):
    """Set how many vertices are asked."""

    def ask(number):
        monkeypatch.setattr(cubature, "_ASKED", number)
        monkeypatch.setattr(cubature, "_OF_GROUP", 1)
        monkeypatch.setattr(cubature, "_WORTH", 0)

    ask(300)
    return ask


def surface_of(mesh):
    return IntrinsicTriangulation.of(mesh.vertices, mesh.faces)


def sampled(stretch=10.0):
    return shape_energy(SCENE.mesh, SUBSPACE, stretch, GROUPS)


def vertex_areas(mesh):
    return np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3.0, 3))


def value(energy, p):
    return energy.local_step(p, SUBSPACE.map(p))[0]


def test_a_small_mesh_is_asked_whole():
    assert Sample.of(surface_of(SCENE.mesh), GROUPS) is None


@pytest.mark.parametrize("stretch", [0.0, 10.0])
def test_where_all_are_asked_it_is_the_whole_energy(asked, monkeypatch, stretch):
    asked(10**6)
    everyone = Sample.of(surface_of(SCENE.mesh), GROUPS)
    assert_array_equal(everyone.counts, 1.0)
    found = sampled(stretch)
    monkeypatch.setattr(cubature, "_WORTH", 10**6)
    whole = sampled(stretch)
    for name in ("quadratic", "mass", "fit", "pull", "constant"):
        expected = getattr(whole, name)
        scale = 1e-12 * np.abs(expected).max()
        assert_allclose(getattr(found, name), expected, rtol=0.0, atol=scale)


@pytest.mark.usefixtures("asked")
def test_what_those_of_a_group_speak_for_is_its_area():
    sample = Sample.of(surface_of(SCENE.mesh), GROUPS)
    areas = vertex_areas(SCENE.mesh)
    spoken_for = np.bincount(GROUPS[sample.ids], sample.counts * areas[sample.ids])
    assert_allclose(spoken_for, np.bincount(GROUPS, areas), rtol=1e-12)
    assert 300 <= np.count_nonzero(sample.counts) <= 300 + 2 * (GROUPS.max() + 1)


@pytest.mark.usefixtures("asked")
def test_what_they_see_is_the_mesh_itself():
    mesh, sample = SCENE.mesh, Sample.of(surface_of(SCENE.mesh), GROUPS)
    assert_array_equal(sample.surface.vertices, mesh.vertices[sample.ids])
    none = np.zeros(0, dtype=np.int64), np.zeros((0, 4))  # a cage that reaches no vertex
    for subspace in (SUBSPACE, Subspace(mesh.n_vertices, *((each,) for each in none))):
        rows = sample.rows(subspace).at(np.arange(len(sample.ids)))
        assert_array_equal(rows, subspace.at(sample.ids))
    those = sample.ids[sample.counts > 0.0]
    around = mesh.faces[np.isin(mesh.faces, those).any(axis=1)]
    assert_array_equal(sample.ids[sample.surface.faces], around)


def test_no_group_is_without_and_a_small_one_is_asked_whole(asked):
    groups = GROUPS.copy()
    groups[[5, 6, 700]] = groups.max() + 1
    asked(200)
    sample = Sample.of(surface_of(SCENE.mesh), groups)
    assert_array_equal(np.unique(groups[sample.ids[sample.counts > 0.0]]), np.unique(groups))
    assert_array_equal(sample.counts[np.isin(sample.ids, [5, 6, 700])], 1.0)


def test_a_group_without_area_is_not_forgotten(asked):
    last = np.flatnonzero(GROUPS.max() == GROUPS)
    x = SCENE.mesh.vertices.copy()
    x[np.union1d(last, SCENE.mesh.adjacency[last].indices)] = x[last[0]]
    flat = SCENE.mesh.with_vertices(x)
    asked(100)
    sample = Sample.of(surface_of(flat), GROUPS)
    assert sample.counts[np.isin(sample.ids, last)].any()
    energy = shape_energy(flat, SUBSPACE, 10.0, GROUPS)
    assert energy.fit.shape == (3 * (GROUPS.max() + 1), SUBSPACE.n_columns)
    assert np.isfinite(energy.quadratic).all()


@pytest.mark.parametrize("stretch", [0.0, 10.0])
@pytest.mark.usefixtures("asked")
def test_it_is_zero_at_rest_and_wherever_the_whole_is_moved_rigidly(stretch):
    energy = sampled(stretch)
    moved = REST @ rotation([1.0, 2.0, 3.0], 2.0).T + [3.0, -1.0, 0.5]
    for p in (REST, moved):
        assert abs(value(energy, p)) < 1e-10 * energy.constant


@pytest.mark.usefixtures("asked")
def test_it_is_never_negative():
    energy, rng = sampled(), np.random.default_rng(1)
    for size in (1e-3, 0.1, 3.0):
        assert value(energy, REST + size * rng.normal(size=REST.shape)) > 0.0


@pytest.mark.usefixtures("asked")
def test_its_slope_is_what_its_differences_tend_to():
    energy, rng = sampled(), np.random.default_rng(2)
    p, dp = REST + 0.2 * rng.normal(size=REST.shape), rng.normal(size=REST.shape)
    slope = 2.0 * np.vdot(energy.local_step(p, SUBSPACE.map(p))[1], dp)
    step = 1e-4
    difference = (value(energy, p + step * dp) - value(energy, p - step * dp)) / (2.0 * step)
    assert difference == pytest.approx(slope, rel=1e-6)


def test_the_more_are_asked_the_nearer_it_is(asked, monkeypatch):
    errors, bent = [], REST * (1.0 + 0.1 * np.sin(REST))
    for number in (100, 400, 1600):
        asked(number)
        energy = sampled()
        errors.append(value(energy, bent) / energy.constant)
    monkeypatch.setattr(cubature, "_WORTH", 10**6)
    whole = sampled()
    errors = np.abs(np.array(errors) - value(whole, bent) / whole.constant)
    errors /= value(whole, bent) / whole.constant
    assert errors[0] < 0.3
    assert errors[2] < 0.01
    assert errors[2] < 0.3 * errors[0]


def test_the_same_are_asked_in_every_frame_however_regular_the_mesh(asked):
    mesh = models.bar(divisions=(8, 8, 30))
    groups = cluster_positions(mesh.vertices, 10)
    asked(200)
    here = Sample.of(surface_of(mesh), groups)
    for seed in range(3):
        turn = rotation(np.random.default_rng(seed).normal(size=3), 1.0 + seed)
        moved = mesh.with_vertices(3.7 * mesh.vertices @ turn.T + [1.0, -2.0, 5.0])
        there = Sample.of(surface_of(moved), groups)
        assert_array_equal(there.ids, here.ids)
        assert_allclose(there.counts, here.counts, rtol=1e-9)


def test_the_pose_is_that_of_the_whole_energy_and_its_volume_exact(asked, monkeypatch):
    targets = SCENE.turned(60)
    asked(800)
    monkeypatch.setattr(binding, "_BITS", 0)  # or every vertex has a rotation of its own at first
    monkeypatch.setattr(binding, "_EACH", 1)
    few = SCENE.deformer(rotation_groups=30).solve(targets)
    monkeypatch.setattr(cubature, "_WORTH", 10**6)
    whole = SCENE.deformer(rotation_groups=30).solve(targets)
    away = np.linalg.norm(few.vertices - whole.vertices, axis=1).max()
    assert 0.0 < away < 2e-3 * SCENE.mesh.diagonal
    assert abs(few.volume_change) < 1e-13
    assert few.status is whole.status
