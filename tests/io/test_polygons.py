"""Polygons are cut into triangles without overlaps, and none is lost."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from solids import TETRAHEDRON, rotation

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.polygons import (
    cells_of,
    corner_values,
    cut_into_triangles,
    padded_corners,
    polydata_of,
    polygons_of,
    rows,
    triangles_of,
    unstripped,
)
from vtk_segdeform.mesh import Mesh

TURN = rotation([1.0, 2.0, 3.0], 0.7).T


def flat(*corners):
    return np.column_stack([np.array(corners, float), np.zeros(len(corners))])


def star(n=5):
    angle = np.arange(2 * n) * np.pi / n
    r = np.where(np.arange(2 * n) % 2, 0.35, 1.0)
    return flat(*zip(r * np.cos(angle), r * np.sin(angle), strict=True))


def comb():
    teeth = [(x + dx, y) for x in range(6) for dx, y in ((0, 3), (0.5, 3), (0.5, 1), (1, 1))]
    return flat((0, 0), (6, 0), *teeth[::-1][:-1], (0, 3))


SHAPES = {
    "L": flat((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)),
    "arrowhead": flat((0, 0), (2, 0), (0.5, 0.5), (0, 2)),
    "star": star(),
    "fine star": star(60),
    "comb": comb(),
    "corner on a side": flat((0, 0), (1, 0), (2, 0), (0, 3)),
    "frame": flat(
        (0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)
    ),
}  # fmt: skip


def cut(points, *polygons):
    counts = np.array([len(polygon) for polygon in polygons])
    return cut_into_triangles(points, counts, np.concatenate(polygons))


def area_vectors(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scale", every(3, [1.0, 1e-6, 1e6]))
def test_a_planar_polygon_is_cut_without_overlaps_from_any_first_corner(name, scale):
    points = scale * SHAPES[name] @ TURN
    n = len(points)
    x, y, _ = SHAPES[name].T
    area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() * scale**2
    for first in range(0, n, max(1, n // 7)):
        polygon = np.roll(np.arange(n), -first)
        for given in (polygon, polygon[::-1]):
            triangles, owner = cut(points, given)
            assert len(triangles) == n - 2
            assert_array_equal(owner, 0)
            up = area_vectors(points, triangles)
            assert_allclose(np.linalg.norm(up, axis=1).sum(), area, rtol=1e-9)
            sign = 1.0 if given is polygon else -1.0
            assert_allclose(up.sum(axis=0), sign * area * np.array([0, 0, 1.0]) @ TURN, rtol=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_the_triangles_have_the_boundary_of_the_polygon_also_where_it_is_not_planar(name):
    rng = np.random.default_rng(2)
    points = SHAPES[name] + rng.normal(scale=0.3, size=SHAPES[name].shape)
    polygon = np.arange(len(points))
    triangles, _ = cut(points, polygon)
    assert len(triangles) == len(points) - 2
    total = np.zeros((len(points),) * 2, dtype=int)
    for tail, head in zip(triangles.ravel(), np.roll(triangles, -1, axis=1).ravel(), strict=True):
        total[tail, head] += 1
        total[head, tail] -= 1
    expected = np.zeros_like(total)
    expected[polygon, np.roll(polygon, -1)] = 1
    assert_array_equal(total, expected - expected.T)


def test_polygons_that_cannot_be_cut_by_ears_lose_nothing():
    frame = np.array([0, 1, 2, 3, 0, 4, 5, 6, 7, 4])  # around a hole, with a bridge passed twice
    points = flat((0, 0), (4, 0), (4, 4), (0, 4), (1, 1), (1, 3), (3, 3), (3, 1))
    triangles, owner = cut(points, [0, 1, 2, 3], frame, [4, 5, 6])
    up = area_vectors(points, triangles)[:, 2]
    assert_allclose(np.bincount(owner, up), [16.0, 12.0, -2.0])
    assert_allclose(np.bincount(owner, np.abs(up)), [16.0, 12.0, 2.0])
    assert (np.diff(owner) >= 0).all()


@pytest.mark.parametrize(
    ("polygon", "n"),
    [
        ([0, 0, 1, 2, 3], 2), ([0, 1, 1, 1, 2, 3, 3], 2), ([0, 0, 0, 0], 0), ([0, 1, 0, 1], 0),
        ([0, 1, 2, 0, 1, 2], 4), ([0, 4, 5, 1], 2),
    ],
)  # fmt: skip
def test_repeated_and_collinear_corners(polygon, n):
    points = flat((0, 0), (3, 0), (3, 3), (0, 3), (1, 0), (2, 0))
    triangles, owner = cut(points, [0, 1, 2, 3], polygon)
    whole = triangles[[len(set(face)) == 3 for face in triangles.tolist()]]
    assert set(triangles.ravel()) <= {0, 1, 2, 3, *polygon}
    assert_allclose(np.linalg.norm(area_vectors(points, whole[:2]), axis=1).sum(), 9.0)
    assert len(whole) - 2 <= n
    assert (owner[:2] == 0).all()


def test_polygons_of_two_corners_are_ignored_and_bad_indices_are_not():
    polydata = pv.PolyData()
    polydata.points = flat((0, 0), (1, 0), (0, 1))
    polydata.faces = np.array([2, 0, 1, 3, 0, 1, 2, 1, 2])
    assert_array_equal(triangles_of(polydata), [[0, 1, 2]])
    polydata.faces = np.array([3, 0, 1, 3])
    with pytest.raises(MeshError, match="faces use vertices 0 to 3, but there are 3"):
        triangles_of(polydata)


@pytest.mark.parametrize("size", [4, 5, 7])
@pytest.mark.parametrize("apart", [False, True])
def test_a_polygon_given_again_is_cut_like_the_first_whatever_corner_it_begins_at(size, apart):
    angle = 2.0 * np.pi * np.arange(size) / size
    ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)  # all diagonals alike
    points = np.concatenate([ring, ring + [3.0, 0.0, 0.0], ring])
    own = np.arange(size) + (2 * size if apart else 0)
    again = [np.roll(own[::side], turn) for side in (1, -1) for turn in range(size)]
    corners = np.concatenate([np.arange(size), size + np.arange(size), *again])
    counts = np.full(2 + 2 * size, size)
    faces, polygon = cut_into_triangles(points, counts, corners)
    assert_array_equal(np.bincount(polygon), counts - 2)
    first = {frozenset(face) for face in (faces[polygon == 0]).tolist()}
    for k in range(2, len(counts)):
        found = faces[polygon == k]
        assert {frozenset(face) for face in (found % (2 * size)).tolist()} == first
        a, b, c = points[found].transpose(1, 0, 2)
        side = 1.0 if k < 2 + size else -1.0
        assert (side * np.cross(b - a, c - a)[:, 2] > 0.0).all()


def test_the_same_corners_in_another_order_are_another_polygon():
    square = flat((0, 0), (1, 0), (1, 1), (0, 1))
    triangles, owner = cut(square, [0, 1, 3, 2], [0, 1, 2, 3])  # the first one crosses itself
    assert_allclose(area_vectors(square, triangles[owner == 1])[:, 2], 0.5)


def test_polygons_and_strips_have_the_corners_and_cells_that_were_given():
    points = np.arange(24.0).reshape(8, 3) ** 2
    given = pv.PolyData()
    given.points = points
    given.verts = [1, 5]
    given.lines = [2, 0, 1]
    given.faces = [3, 0, 1, 2, 4, 4, 5, 6, 7]
    given.strips = [4, 0, 1, 2, 3, 3, 7, 6, 5]
    counts, corners = polygons_of(given)
    assert_array_equal(counts, [3, 4, 3, 3, 3])
    expected = [0, 1, 2, 4, 5, 6, 7, 0, 1, 2, 2, 1, 3, 7, 6, 5]
    assert_array_equal(corners, expected)
    assert_array_equal(cells_of(given), [2, 3, 4, 4, 5])
    assert rows(counts, corners)[:2] == [[0, 1, 2], [4, 5, 6, 7]]
    assert rows(np.array([2, 2]), np.arange(4)) == [[0, 1], [2, 3]]
    assert rows(np.array([3]), np.arange(3)) == [[0, 1, 2]]
    assert rows(np.array([3, 2]), np.arange(5)) == [[0, 1, 2], [3, 4]]
    assert rows(np.array([], int), np.array([], int)) == []
    again = polydata_of(points, counts, corners)
    assert_array_equal(again.faces, [3, 0, 1, 2, 4, 4, 5, 6, 7, 3, 0, 1, 2, 3, 2, 1, 3, 3, 7, 6, 5])
    with pytest.raises(MeshError, match="faces use vertices 0 to 8, but there are 8"):
        polydata_of(points, np.array([3]), np.array([0, 1, 8]))


def test_strips_are_cut_into_triangles_of_the_same_orientation():
    found = unstripped(np.array([5, 3, 6]), np.array([0, 1, 2, 3, 4, 7, 8, 9, 0, 1, 2, 2, 3, 4]))
    expected = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [7, 8, 9], [0, 1, 2], [3, 2, 4]]
    assert_array_equal(found, expected)


def test_values_of_corners_are_padded_and_read_back():
    counts = np.array([3, 5, 4])
    for width in (2, 3):
        values = np.random.default_rng(0).random((12, width))
        wide = padded_corners(counts, values)
        assert wide.shape == (3, 5 * width)
        assert_array_equal(wide[0, : 3 * width], values[:3].ravel())
        assert np.isnan(wide[0, 3 * width :]).all()
        assert_array_equal(corner_values(wide, counts, width), values)
        assert corner_values(wide[:, :-1], counts, width) is None
        assert corner_values(wide[:, :-width], counts, width) is None
        assert corner_values(wide[:2], counts, width) is None
        assert corner_values(np.zeros(wide.shape, dtype=int), counts, width) is None
    assert corner_values(None, counts) is None
    assert padded_corners(counts[:0], np.empty((0, 2))).shape == (0, 0)


@pytest.mark.parametrize("kind", ["obj", "off", "ply"])
def test_texture_coordinates_of_gltf_are_turned_upside_down(tmp_path, kind):
    surface = to_polydata(Mesh(*TETRAHEDRON))
    pairs = np.array([[0.0, 0.25], [0.5, 1.0], [1.0, 0.0], [0.25, 0.75]])
    for name, v in (("TEXCOORD_0", 1.0 - pairs[:, 1]), ("uv", pairs[:, 1])):
        surface.point_data.clear()
        surface.point_data[name] = pairs
        surface.point_data.active_texture_coordinates_name = name
        write_mesh(tmp_path / f"a.{kind}", surface)
        found = read_polydata(tmp_path / f"a.{kind}").active_texture_coordinates
        assert_array_equal(found, np.column_stack([pairs[:, 0], v]))
