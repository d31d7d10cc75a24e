"""Samples are evenly spread, and every vertex belongs to the nearest one along edges."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csgraph
from solids import icosphere, rotation, torus, two_components

from vtk_segdeform.geometry import unique_edges, voronoi_cells
from vtk_segdeform.geometry.sampling import distinct_lengths, faces_between, nearest_source
from vtk_segdeform.mesh import Mesh

MESHES = {"sphere": icosphere(4), "torus": torus(), "two": two_components()}


@pytest.mark.parametrize(
    ("name", "n"), [("sphere", 200), ("torus", 200), ("torus", 40), ("two", 30)]
)
def test_samples_are_apart_by_a_spacing_of_the_shape_and_cells_are_those_of_the_nearest(name, n):
    mesh = Mesh(*MESHES[name])
    kept, cell = voronoi_cells(mesh, n, np.random.default_rng(0))
    assert_array_equal(kept, np.unique(kept))
    assert 0.6 * n < len(kept) < 1.5 * n
    assert_array_equal(cell[kept], np.arange(len(kept)))
    away = csgraph.dijkstra(mesh.adjacency, indices=kept)
    own = away[cell, np.arange(mesh.n_vertices)]
    assert_allclose(own, away.min(axis=0), rtol=1e-5)
    spacing = 0.8 * np.sqrt(mesh.face_areas.sum() / n)
    apart = away[:, kept] + np.diag(np.full(len(kept), np.inf))
    assert np.mean(apart.min(axis=0) < 0.99 * spacing) < 0.05
    assert own.max() < 3.0 * spacing


def test_samples_and_cells_do_not_depend_on_the_frame():
    mesh = Mesh(*MESHES["torus"])
    moved = mesh.with_vertices(1e3 * mesh.vertices @ rotation([1, 2, 3], 0.7).T + [5, 6, 7])
    one, other = (voronoi_cells(each, 100, np.random.default_rng(3)) for each in (mesh, moved))
    assert_array_equal(one[0], other[0])
    assert_array_equal(one[1], other[1])


def test_progress_of_sampling_increases_up_to_four_fifths():
    seen = []
    rng = np.random.default_rng(0)
    voronoi_cells(Mesh(*icosphere(4)), 50, rng, lambda fraction, _: seen.append(fraction))
    assert seen[0] == 0.0
    assert len(seen) > 3
    assert seen == sorted(seen)
    assert seen[-1] == 0.8
    assert 0.5 < seen[-2] < 0.8


def test_unique_edges_are_sorted_without_loops_and_directions():
    edges = np.array([[3, 1], [1, 3], [2, 2], [0, 4], [4, 1], [0, 4], [0, 0]])
    assert_array_equal(unique_edges(edges, 5), [[0, 4], [1, 3], [1, 4]])
    assert unique_edges(edges[:0], 5).shape == (0, 2)


def test_faces_between_cells_have_corners_in_three_of_them():
    cells = np.array([0, 0, 1, 2, 3])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 3, 2], [1, 4, 0], [4, 0, 1]])
    assert_array_equal(faces_between(cells, faces), [[0, 1, 2], [3, 2, 1]])


def test_perturbed_lengths_are_symmetric_nearly_equal_and_break_ties():
    mesh = Mesh(*icosphere(3))
    lengths = distinct_lengths(mesh)
    assert_allclose(lengths.toarray(), mesh.adjacency.toarray(), rtol=3e-6)
    assert_allclose(lengths.toarray(), lengths.toarray().T, rtol=1e-15)
    data = lengths.toarray()[np.triu_indices(mesh.n_vertices)]
    data = data[data > 0]
    assert len(np.unique(data)) == len(data)
    assert (data > mesh.adjacency.data.min()).all()
    poles = np.array([mesh.vertices[:, 2].argmin(), mesh.vertices[:, 2].argmax()])
    nearest = nearest_source(lengths, poles)
    z = mesh.vertices[:, 2]
    assert_array_equal(
        nearest[np.abs(z) > 0.3], np.where(z > 0, poles[1], poles[0])[np.abs(z) > 0.3]
    )
