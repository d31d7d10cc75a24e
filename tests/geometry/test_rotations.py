from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import icosphere, rotation, somewhere

from vtk_segdeform.geometry.rotations import (
    closest_rotations,
    group_by_position,
    rigid_fit,
    rotation_groups,
)


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


def test_flat_and_empty_neighbourhoods_give_rotations():
    flat = np.diag([2.0, 1.0, 0.0])
    turn = rotation([0, 1, 1], 0.8)
    found = closest_rotations(np.array([flat @ turn.T, np.zeros((3, 3))]))
    assert_allclose(found[0], turn, atol=1e-12)
    assert_allclose(np.linalg.det(found), 1.0)


def test_rigid_fit_of_a_point_or_a_line_uses_the_smallest_rotation():
    found, shift = rigid_fit(np.array([[1.0, 2, 3]]), np.array([[4.0, 4, 4]]))
    assert_allclose(found, np.eye(3))
    assert_allclose(shift, [3, 2, 1])
    line = np.outer(np.arange(4.0), [1.0, 0, 0])
    found, _ = rigid_fit(line, line @ rotation([0, 0, 1], 0.6).T)
    assert_allclose(found, rotation([0, 0, 1], 0.6), atol=1e-12)


def test_groups_are_about_as_many_as_asked_and_all_are_used():
    positions = icosphere(3)[0]
    groups = group_by_position(positions, 40)
    assert groups.min() == 0
    assert 30 <= groups.max() + 1 <= 40
    assert (np.bincount(groups) > 0).all()


def test_groups_do_not_depend_on_the_frame_even_where_distances_tie():
    positions = icosphere(3)[0]  # full of ties
    turned = positions @ rotation([1, 2, 3], 1.1).T
    assert (group_by_position(positions, 25) == group_by_position(turned, 25)).all()


def test_no_group_spans_two_parts():
    positions = icosphere(3)[0]
    parts = (positions[:, 0] > 0).astype(int) + 2 * (positions[:, 1] > 0.5)
    groups = rotation_groups(positions, parts, 30)
    for group in range(groups.max() + 1):
        assert len(np.unique(parts[groups == group])) == 1


def test_as_many_groups_as_vertices_puts_each_in_its_own():
    positions = somewhere(20)
    assert len(np.unique(group_by_position(positions, 20))) == 20
