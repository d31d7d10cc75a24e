from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import CUBE, SOLIDS, icosphere, torus

from vtk_segdeform.geometry.differential import (
    area_gradients,
    cotangent_laplacian,
    inner_vertices,
    mixed_voronoi_areas,
    with_least_areas,
)
from vtk_segdeform.geometry.intrinsic import IntrinsicTriangulation, areas, cotangents
from vtk_segdeform.mesh import Mesh


def face_areas(vertices, faces):
    a, b, c = vertices[faces.T]
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def surface(vertices, faces):
    return IntrinsicTriangulation.of(np.asarray(vertices, dtype=float), np.asarray(faces))


def laplacian_of(vertices, faces):
    of = surface(vertices, faces)
    return cotangent_laplacian(of.faces, of.cotangents, len(vertices))


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_vertex_areas_sum_to_the_surface_area(solid):
    assert_allclose(
        mixed_voronoi_areas(surface(*solid)).sum(), face_areas(*solid).sum(), rtol=1e-13
    )


def test_the_laplacian_is_symmetric_semidefinite_and_vanishes_for_constants():
    laplacian = laplacian_of(*torus(24, 12)).toarray()
    assert_allclose(laplacian, laplacian.T, atol=1e-14)
    assert_allclose(laplacian.sum(axis=1), 0.0, atol=1e-12)
    assert np.linalg.eigvalsh(laplacian).min() > -1e-12


def test_the_laplacian_of_the_coordinates_vanishes_inside_a_flat_face():
    vertices, faces = CUBE
    corners = np.array([*vertices, [0.3, 0.6, 0.0]])  # a vertex inside the bottom face
    bottom = [[0, 2, 8], [2, 3, 8], [3, 1, 8], [1, 0, 8]]
    laplacian = laplacian_of(corners, np.concatenate([faces[2:], bottom]))
    assert_allclose((laplacian @ corners)[8], 0.0, atol=1e-14)


def test_on_a_sphere_the_mean_curvature_normal_is_the_normal_over_the_radius():
    errors = []
    for level in (3, 4, 5):
        vertices, faces = icosphere(level, radius=2.0)
        areas = mixed_voronoi_areas(surface(vertices, faces))
        delta = laplacian_of(vertices, faces) @ vertices / (2.0 * areas[:, None])
        square = ((delta - vertices / 4.0) ** 2).sum(axis=1)
        errors.append(np.sqrt(areas @ square / areas.sum()))
    assert errors[2] < 0.35 * errors[0]
    assert errors[2] < 0.02 * 0.5


def test_area_gradients_reproduce_a_linear_map_in_the_plane_of_each_face():
    vertices, faces = icosphere(2)
    matrix = np.array([[1.0, 0.2, 0.0], [0.1, 0.7, -0.3], [0.0, 0.4, 1.1]])
    moved = (vertices @ matrix.T)[faces]
    transposed = np.einsum("fka,fkb->fab", area_gradients(surface(vertices, faces)), moved)
    a, b, c = vertices[faces.T]
    normal = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(normal, axis=1)[:, None, None]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    in_plane = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    assert_allclose(transposed / area, in_plane @ matrix.T, atol=1e-12)


def test_vertex_areas_are_at_least_a_twentieth_of_their_neighbours():
    vertices, faces = icosphere(2)
    areas = mixed_voronoi_areas(surface(vertices, faces))
    assert_allclose(with_least_areas(areas, faces), areas)
    speck = areas.copy()
    speck[50] = 0.0
    around = np.unique(faces[(faces == 50).any(axis=1)])
    around = around[around != 50]
    assert_allclose(with_least_areas(speck, faces)[50], 0.05 * areas[around].mean(), rtol=1e-12)


def test_inner_vertices_are_those_without_border_or_branch_except_on_strips():
    assert inner_vertices(Mesh(*icosphere(2))).all()
    vertices, faces = icosphere(2)
    hole = faces[1:]
    inner = inner_vertices(Mesh(vertices, hole))
    assert set(np.flatnonzero(~inner)) == set(faces[0])
    fin = np.vstack([faces, [[*faces[0, :2], len(vertices)]]])
    inner = inner_vertices(Mesh(np.vstack([vertices, [[2.0, 2, 2]]]), fin))
    assert set(np.flatnonzero(~inner)) == {*faces[0, :2], len(vertices)}
    strip = np.array([[k, k % 2, 0.0] for k in range(8)])
    turns = np.array([[k, k + 1, k + 2] if k % 2 else [k, k + 2, k + 1] for k in range(6)])
    assert inner_vertices(Mesh(strip, turns)).all()
    both = np.vstack([vertices, strip + 5.0]), np.vstack([hole, turns + len(vertices)])
    inner = inner_vertices(Mesh(*both))
    assert set(np.flatnonzero(~inner)) == set(faces[0])


def test_areas_and_cotangents_of_known_triangles():
    lengths = np.array([[3.0, 4.0, 5.0], [1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.0, 1.0, 1e-9]])
    assert_allclose(areas(lengths), [6.0, np.sqrt(3.0) / 4.0, 0.0, 0.5e-9], rtol=1e-14)
    for turn in range(3):
        found = cotangents(np.roll(lengths, turn, axis=1))
        expected = np.roll([[4 / 3, 3 / 4, 0.0], [3**-0.5] * 3, [0.0] * 3], turn, axis=1)
        assert_allclose(found[:3], expected, atol=1e-15)
        assert_allclose(np.roll(found[3], -turn), [0.0, 0.0, 1e9], rtol=1e-9, atol=1e-9)
