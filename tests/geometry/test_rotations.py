from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import rotation, somewhere

from vtk_segdeform.geometry.rotations import closest_rotations, rigid_fit


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, 3.0, np.pi])
def test_the_rotation_of_a_rotated_point_cloud_is_found(angle):
    turn, rest = rotation([1, -2, 0.5], angle), somewhere()
    found, shift = rigid_fit(rest, rest @ turn.T + [1, 2, 3])
    assert_allclose(found, turn, atol=1e-12)
    assert_allclose(shift, [1, 2, 3], atol=1e-12)


def test_a_reflected_point_cloud_gets_a_rotation():
    rest = somewhere()
    found, _ = rigid_fit(rest, rest * [1, 1, -1])
    assert_allclose(np.linalg.det(found), 1.0)
    assert_allclose(found @ found.T, np.eye(3), atol=1e-12)


def test_closest_rotations_maximise_the_trace():
    rng = np.random.default_rng(1)
    covariances = rng.normal(size=(20, 3, 3))
    best = np.einsum("kab,kba->k", closest_rotations(covariances), covariances)
    for angle in (1e-3, 0.1, 1.0):
        for axis in rng.normal(size=(10, 3)):
            other = closest_rotations(covariances) @ rotation(axis, angle)
            assert (np.einsum("kab,kba->k", other, covariances) <= best + 1e-12).all()


def test_rigid_fit_of_a_point_or_a_line_uses_the_smallest_rotation():
    found, shift = rigid_fit(np.array([[1.0, 2, 3]]), np.array([[4.0, 4, 4]]))
    assert_allclose(found, np.eye(3))
    assert_allclose(shift, [3, 2, 1])
    line = np.outer(np.arange(4.0), [1.0, 0, 0])
    found, _ = rigid_fit(line, line @ rotation([0, 0, 1], 0.6).T)
    assert_allclose(found, rotation([0, 0, 1], 0.6), atol=1e-12)
    axes = np.vstack([np.eye(3), [[1.0, 2.0, -2.0]]]) * [2.0, 2.0, 2.0]
    for direction in axes:
        line = np.outer(np.arange(4.0), direction) + 5.0
        found, shift = rigid_fit(line, -line)  # any half turn about a perpendicular axis
        assert_allclose(found @ direction, -direction, atol=1e-12)
        assert_allclose(np.linalg.det(found), 1.0)
        assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
        assert_allclose(line @ found.T + shift, -line, atol=1e-12)


def test_weights_count_points_that_often():
    rest, moved = somewhere(6, seed=1), somewhere(6, seed=2)
    weights = np.array([1, 2, 3, 1, 2, 4])
    found, shift = rigid_fit(rest, moved, weights.astype(float))
    often, by = rigid_fit(np.repeat(rest, weights, axis=0), np.repeat(moved, weights, axis=0))
    assert_allclose(found, often, atol=1e-12)
    assert_allclose(shift, by, atol=1e-12)
    assert_allclose(weights @ (rest @ found.T + shift - moved), 0.0, atol=1e-12)


@pytest.mark.usefixtures("either")
def test_many_closest_rotations_are_those_of_each():
    turns = np.array([rotation(axis, 0.3 * k) for k, axis in enumerate(somewhere(11, seed=3))])
    stretch = np.array([1.0, 3.0, 0.2])
    assert_allclose(
        closest_rotations(stretch[:, None] * turns.transpose(0, 2, 1)), turns, atol=1e-12
    )
