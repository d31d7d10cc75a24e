"""Inside, outside and the distance to a surface, for solids known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, OCTAHEDRON, icosphere, rotation, somewhere, together, torus, two_components

from vtk_segdeform.mesh import inside
from vtk_segdeform.mesh.inside import (
    distance_to_surface,
    inside_nodes,
    inside_points,
    winding_number,
)

BODIES = {
    "cube": CUBE,
    "octahedron": OCTAHEDRON,
    "sphere": icosphere(2),
    "torus": torus(24, 12),
    "two spheres": two_components(),
    "rod": (icosphere(3)[0] * [1.0, 0.02, 0.02], icosphere(3)[1]),
    "hollow": together(icosphere(2), (0.5 * icosphere(2)[0], icosphere(2)[1][:, ::-1])),
}
TURN = rotation([1.0, 2.0, -0.5], 1.1)


def test_the_winding_number_is_the_share_of_the_sphere_that_the_surface_covers():
    octant = [[0, 1, 2]]
    assert_allclose(winding_number([[0, 0, 0]], np.eye(3), octant), [1 / 8], atol=1e-15)
    assert_allclose(winding_number([[0, 0, 0]], np.eye(3), [[0, 2, 1]]), [-1 / 8], atol=1e-15)
    box = CUBE[0] - 0.5
    assert_allclose(winding_number([[0, 0, 0]], box, CUBE[1][:2]), [1 / 6], atol=1e-15)
    assert_allclose(winding_number([[0, 0, 0]], 2.0 * box, CUBE[1][2:]), [5 / 6], atol=1e-15)
    assert_array_equal(winding_number(np.ones((2, 3)), box, np.empty((0, 3), int)), [0.0, 0.0])


def test_near_a_flat_part_of_a_closed_surface_the_winding_number_is_a_half():
    points = np.array([[0.3, 0.4, 0.0], [0.3, 0.4, 9e-4], [0.3, 0.4, -9e-4], [0.3, 0.4, 2e-3]])
    number = winding_number(points @ TURN.T, CUBE[0] @ TURN.T, CUBE[1], near=1e-3)
    assert_allclose(number, [0.5, 0.5, 0.5, 1.0], atol=2e-3)
    assert_allclose(winding_number(points[1:], *CUBE), [1.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_points_are_inside_where_the_winding_number_is_one(name, monkeypatch):
    vertices, faces = BODIES[name]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (300, 3))
    middle = vertices.mean(axis=0)
    points = np.concatenate([points, middle + 0.6 * (vertices - middle), high + [[0, 0, 1]]])
    expected = winding_number(points, vertices, faces) > 0.5
    assert_array_equal(inside_points(points, vertices, faces), expected)
    monkeypatch.setattr(inside, "_BAND", 64)
    assert_array_equal(inside_points(points, vertices, faces), expected)
    assert len(inside_points(points[:0], vertices, faces)) == 0


@pytest.mark.parametrize("shift", [0.0, 0.37])
@pytest.mark.parametrize("name", BODIES)
def test_nodes_are_inside_where_points_are_and_also_where_the_body_reaches_beyond(name, shift):
    vertices, faces = BODIES[name]
    for scale, shape in ((2.5, (8, 7, 9)), (9.0, (7, 4, 6))):
        x = scale * vertices + np.array([4.0, 3.0, 4.0]) + shift * np.array([1.0, 0.7, 0.3])
        nodes = np.indices(shape).reshape(3, -1).T.astype(float)
        clear = distance_to_surface(nodes, x, faces) > 1e-9
        found = inside_nodes(x, faces, shape)
        assert found.shape == shape
        expected = winding_number(nodes, x, faces) > 0.5
        assert_array_equal(found.ravel()[clear], expected[clear])


def test_the_distance_to_a_cube_is_known_inside_and_outside(monkeypatch):
    x = somewhere(400, seed=1)
    x = np.vstack([x, CUBE[0], [[0.5, 0.5, 0.0], [0.5, 0.0, 0.0], [-1.0, 0.3, 0.3]]])
    outside = np.linalg.norm(np.maximum(np.maximum(-x, x - 1.0), 0.0), axis=1)
    depth = np.minimum(x, 1.0 - x).min(axis=1)
    expected = np.where(depth > 0, depth, outside)
    found = distance_to_surface(x @ TURN.T + 3.0, CUBE[0] @ TURN.T + 3.0, CUBE[1])
    assert_allclose(found, expected, atol=1e-12)
    monkeypatch.setattr(inside, "_BLOCK", 100)
    assert_allclose(distance_to_surface(x, *CUBE), expected, atol=1e-12)


def test_the_distance_to_an_obtuse_triangle_is_that_to_its_nearest_corner_edge_or_plane():
    corners, face = np.array([[0.0, 0, 0], [4, 0, 0], [-3, 1, 0]]), np.array([[0, 1, 2]])
    points = np.array([[0.5, 0.2, 2], [5, 0, 0], [-4, 1, 0], [1, -2, 0], [0, -1, 0], [-1, -1, 0]])
    to_edge = np.array([-1.0, -1, 0]) @ np.array([1.0, 3, 0]) / np.sqrt(10.0)
    expected = [2.0, 1.0, 1.0, 2.0, 1.0, abs(to_edge)]
    assert_allclose(distance_to_surface(points, corners, face), expected, rtol=1e-12)


def test_faces_without_area_change_no_distance_to_a_surface():
    vertices, faces = icosphere(1)
    points = np.random.default_rng(3).normal(size=(50, 3))
    flat = faces[:2][:, [[0, 1, 1], [0, 0, 0]]].reshape(-1, 3)
    found = distance_to_surface(points, vertices, np.concatenate([faces, flat]))
    assert_allclose(found, distance_to_surface(points, vertices, faces), rtol=1e-12)


def test_columns_through_vertices_and_edges_are_counted_once():
    vertices, faces = CUBE
    inside = inside_nodes(4.0 * vertices + [1.0, 1.0, 1.5], faces, (8, 8, 8))
    node = np.indices((8, 8, 8)).transpose(1, 2, 3, 0)
    well_in = ((node > [1, 1, 1.5]) & (node < [5, 5, 5.5])).all(axis=-1)
    well_out = ((node < [1, 1, 1.5]) | (node > [5, 5, 5.5])).any(axis=-1)
    assert inside[well_in].all()
    assert not inside[well_out].any()
