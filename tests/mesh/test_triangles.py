"""Products of the edges of triangles."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform.mesh.triangles import (
    corner_angles,
    cross,
    cross_rows,
    least_angle,
    norm,
    normals,
)


def test_cross_products_are_those_of_numpy_bit_for_bit():
    u, v = np.random.default_rng(1).normal(size=(2, 50, 3))
    assert_array_equal(cross_rows(u, v), np.cross(u, v))
    assert_array_equal(cross_rows(u[::2], v[1::2]), np.cross(u[::2], v[1::2]))
    assert_array_equal(cross(u.T, v.T), np.cross(u, v).T)


def test_the_angles_of_a_triangle_are_those_between_its_sides_and_sum_to_pi():
    corners = np.random.default_rng(2).normal(size=(40, 3, 3))
    angles = corner_angles(corners)
    assert_allclose(angles.sum(axis=1), np.pi, rtol=1e-13)
    for k in range(3):
        u, v = corners[:, k - 1] - corners[:, k], corners[:, k - 2] - corners[:, k]
        cosine = np.sum(u * v, axis=1) / np.sqrt(np.sum(u * u, axis=1) * np.sum(v * v, axis=1))
        assert_allclose(angles[:, k], np.arccos(cosine), rtol=1e-6)
    assert_array_equal(least_angle(corners), angles.min(axis=1))
    assert_array_equal(corner_angles(corners.reshape(8, 5, 3, 3)).reshape(-1, 3), angles)


def test_the_angles_of_needles_are_accurate_and_those_of_points_are_zero():
    thin = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-12, 0]])
    assert_allclose(corner_angles(thin), [2e-12, 2e-12, np.pi], rtol=1e-11)
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0.25, 0, 0]])
    assert_array_equal(corner_angles(flat), [0.0, 0.0, np.pi])
    twice = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 2]])
    assert_array_equal(corner_angles(twice), [0.0, 0.0, 0.0])


def test_normals_and_norms_are_those_of_numpy():
    corners = np.random.default_rng(3).normal(size=(30, 3, 3))
    expected = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert_allclose(normals(corners), expected, atol=1e-14)
    assert_allclose(norm(expected.T), np.linalg.norm(expected, axis=1), rtol=1e-14)
