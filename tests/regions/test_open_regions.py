"""Regions of open, thin and non-manifold surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csgraph
from sheets import SHEETS, folded, mesh_of, plate
from solids import rotation

from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.regions.segmentation import segment


def pieces(mesh, members):
    graph = mesh.adjacency[members][:, members]
    return csgraph.connected_components(graph, directed=False)[0]


@pytest.mark.parametrize("name", every(4, SHEETS))
def test_any_surface_is_segmented_into_connected_regions(name):
    mesh = mesh_of(name)
    components = mesh.components.max() + 1
    for n_regions in (None, 1, 3, 8):
        if n_regions is not None and n_regions > mesh.n_vertices:
            continue
        regions = segment(mesh, n_regions)
        assert_allclose(regions.weights.sum(axis=0), 1.0)
        if n_regions is not None:
            assert regions.n_regions == n_regions
        for r in range(regions.n_regions):
            assert pieces(mesh, regions.members(r)) == 1 or regions.n_regions < components


def test_weights_fade_at_the_border_of_a_region_and_not_at_that_of_the_mesh():
    mesh = Mesh(*plate(20, 8, 20.0, 8.0))
    x, y, _ = mesh.vertices.T
    regions = Regions(mesh, np.array([x < 12.5, x > 7.5]))
    expected = np.clip((12.0 - x) / 4.0, 0.0, 1.0)
    assert_allclose(regions.weights[0], expected)
    assert_array_equal(regions.border_distance[0][x <= 12.0], (12.0 - x)[x <= 12.0])
    assert np.isinf(Regions.single(mesh).border_distance).all()
    assert (y[regions.weights[0] == 1.0] == 0.0).any()


@pytest.mark.parametrize("solid", [folded(), plate(30, 20)], ids=["folded", "plate"])
def test_the_regions_of_a_sheet_depend_on_neither_frame_nor_orientation(solid):
    vertices, faces = solid
    expected = segment(Mesh(vertices, faces), 4).labels
    turned = segment(Mesh(vertices @ rotation([1, 2, 3], 1.0).T, faces), 4).labels
    assert_array_equal(turned, expected)
    flipped = segment(Mesh(vertices, faces[:, ::-1]), 4).labels
    assert_array_equal(flipped, expected)
