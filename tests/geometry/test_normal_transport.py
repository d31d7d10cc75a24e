"""Given normals and tangents follow rotations and affine maps exactly; seams and edges remain."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.geometry import NormalTransport

AFFINE = np.array([[1.2, 0.4, -0.3], [0.1, 0.7, 0.5], [-0.2, 0.3, 1.5]])
TURN = rotation(np.array([1.0, 2.0, -1.0]), 1.1)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def transport_of(points, faces, normals):
    counts = np.full(len(faces), len(faces[0]))
    corners = np.asarray(faces).ravel()
    return NormalTransport(
        points, counts, corners, normals, of_corner=corners, place=np.arange(len(points))
    )


def face_normals(points, faces):
    a, b, c = points[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def smooth(points, faces):
    total = np.zeros_like(points)
    np.add.at(total, faces, face_normals(points, faces)[:, None])
    return unit(total)


def bumpy(level=2):
    points, faces = icosphere(level)
    rng = np.random.default_rng(5)  # with which no two faces are nearly in a plane
    return points * (1 + 0.2 * rng.random((len(points), 1))), faces


def test_at_rest_nothing_changes_whatever_the_normals_are(rng):
    points, faces = bumpy()
    normals = rng.normal(size=points.shape) * rng.choice([0.0, 0.5, 3.0], (len(points), 1))
    carried = transport_of(points, faces, normals)
    assert_allclose(carried.normals(points), normals, atol=1e-13)
    tangents = rng.normal(size=points.shape)
    assert_allclose(carried.tangents(tangents, points), tangents, atol=1e-13)


def test_any_normals_and_tangents_follow_a_rotation_and_a_scale(rng):
    points, faces = bumpy()
    normals, tangents = rng.normal(size=(2, *points.shape))
    carried, moved = transport_of(points, faces, normals), 2.5 * points @ TURN.T + [5, 0, 1]
    assert_allclose(carried.normals(moved), normals @ TURN.T, atol=1e-12)
    assert_allclose(carried.tangents(tangents, moved), tangents @ TURN.T, atol=1e-12)


def test_any_normals_of_cells_follow_a_rotation(rng):
    points, faces = bumpy()
    normals = rng.normal(size=faces.shape)
    carried = NormalTransport(
        points, np.full(len(faces), 3), faces.ravel(), normals,
        of_corner=np.repeat(np.arange(len(faces)), 3), place=None,
    )  # fmt: skip
    assert_allclose(carried.normals(points), normals, atol=1e-13)
    assert_allclose(carried.normals(points @ TURN.T), normals @ TURN.T, atol=1e-12)


def test_smooth_normals_follow_an_affine_map_as_its_cofactor_matrix_says():
    points, faces = bumpy()
    normals = smooth(points, faces)
    moved = transport_of(points, faces, normals).normals(points @ AFFINE.T)
    assert_allclose(moved, unit(normals @ np.linalg.inv(AFFINE)), atol=1e-9)


def test_normals_of_faces_become_those_of_the_deformed_faces():
    points, faces = bumpy()
    corners = np.arange(3 * len(faces))
    bent = points + 0.1 * np.sin(3 * points[:, [1, 2, 0]])
    carried = NormalTransport(
        points, np.full(len(faces), 3), faces.ravel(), unit(face_normals(points, faces)),
        of_corner=np.repeat(np.arange(len(faces)), 3), place=None,
    )  # fmt: skip
    assert_allclose(carried.normals(bent), unit(face_normals(bent, faces)), atol=1e-12)
    soup = transport_of(points[faces].reshape(-1, 3), corners.reshape(-1, 3),
                        np.repeat(unit(face_normals(points, faces)), 3, axis=0))  # fmt: skip
    hard = soup.normals(bent[faces].reshape(-1, 3))  # every edge of the soup is hard
    assert_allclose(hard, np.repeat(unit(face_normals(bent, faces)), 3, axis=0), atol=1e-12)


def test_both_sides_of_a_seam_remain_alike_and_equal_to_the_surface_without_it():
    points, faces = bumpy()
    normals, bent = smooth(points, faces), points + 0.1 * np.sin(3 * points[:, [1, 2, 0]])
    whole = transport_of(points, faces, normals).normals(bent)
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    cut = transport_of(points[faces].reshape(-1, 3), corners, normals[faces].reshape(-1, 3))
    split = cut.normals(bent[faces].reshape(-1, 3))
    assert_allclose(split, whole[faces].reshape(-1, 3), atol=1e-12)
    for vertex in range(0, len(points), 17):
        twins = split[faces.ravel() == vertex]
        assert_array_equal(twins, np.broadcast_to(twins[0], twins.shape))


def test_faces_without_area_do_not_count_and_points_without_faces_keep_their_normals():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 0, 1]])
    normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    moved = transport_of(points, faces, normals).normals(points @ TURN.T)
    assert_allclose(moved[:3], np.tile(TURN[:, 2], (3, 1)), atol=1e-12)
    assert_array_equal(moved[3:], normals[3:])
    flat = transport_of(points, faces, normals).normals(points * [1, 0, 0])  # all collapsed
    assert_array_equal(flat, normals)


@pytest.mark.parametrize("kind", ["nan", "zero", "infinite"])
def test_normals_that_are_none_stay_as_they_are(kind):
    points, faces = bumpy()
    normals = smooth(points, faces)
    normals[4] = {"nan": np.nan, "zero": 0.0, "infinite": np.inf}[kind]
    moved = transport_of(points, faces, normals).normals(points @ AFFINE.T)
    assert_array_equal(moved[4], normals[4])
    assert np.isfinite(np.delete(moved, 4, axis=0)).all()


def test_tangents_follow_the_surface_and_stay_normal_to_the_normals():
    points, faces = icosphere(3)
    tangents = unit(np.cross([1e-3, 0, 1], points))
    carried = transport_of(points, faces, points)
    moved = carried.tangents(tangents, points * [1, 1, 3.0])  # along circles of latitude
    assert np.abs((moved * carried.normals(points * [1, 1, 3.0])).sum(axis=1)).max() < 1e-7
    away = np.abs(points[:, 2]) < 0.9
    assert (moved * tangents).sum(axis=1)[away].min() > 0.99


def test_a_normal_whose_faces_are_flat_to_rounding_follows_the_faces_beside_them():
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -1e-18, 3e-18]], dtype=float
    )
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]])
    normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    carried = transport_of(points, faces, normals)
    assert_allclose(carried.normals(points @ TURN.T), normals @ TURN.T, atol=1e-12)
