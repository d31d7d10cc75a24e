from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import rotation, somewhere

from vtk_segdeform.geometry.rotations import closest_rotations, rigid_fit


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, 3.0, np.pi])
def test_the_turn_of_a_turned_cloud_is_found(angle):
    turn, rest = rotation([1, -2, 0.5], angle), somewhere()
    found, shift = rigid_fit(rest, rest @ turn.T + [1, 2, 3])
    assert_allclose(found, turn, atol=1e-12)
    assert_allclose(shift, [1, 2, 3], atol=1e-12)


def test_a_mirrored_cloud_still_gets_a_rotation():
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


def test_flat_and_empty_neighbourhoods_give_rotations_too():
    flat = np.diag([2.0, 1.0, 0.0])
    turn = rotation([0, 1, 1], 0.8)
    found = closest_rotations(np.array([flat @ turn.T, np.zeros((3, 3))]))
    assert_allclose(found[0], turn, atol=1e-12)
    assert_allclose(np.linalg.det(found), 1.0)


def test_one_point_turns_nothing_and_a_line_only_as_far_as_it_must():
    found, shift = rigid_fit(np.array([[1.0, 2, 3]]), np.array([[4.0, 4, 4]]))
    assert_allclose(found, np.eye(3))
    assert_allclose(shift, [3, 2, 1])
    line = np.outer(np.arange(4.0), [1.0, 0, 0])
    found, _ = rigid_fit(line, line @ rotation([0, 0, 1], 0.6).T)
    assert_allclose(found, rotation([0, 0, 1], 0.6), atol=1e-12)
