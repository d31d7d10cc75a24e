from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import rotation, somewhere

from vtk_segdeform.solver.waypoints import waypoints

ALL = [np.arange(50)]


@pytest.mark.parametrize("degrees", [5.0, 70.0, 120.0, 180.0])
def test_a_rotation_is_divided_into_equal_parts_that_keep_the_shape(degrees):
    start, axis, centre = somewhere(size=0.1), [0.3, 1.0, -0.2], np.array([0.0, 0.1, 0.7])
    end = (start - centre) @ rotation(axis, np.radians(degrees)).T + centre
    way = waypoints(start, end, ALL)
    assert_allclose(way[-1], end)
    previous = start
    for leg in way:
        moved = np.linalg.norm(leg - previous, axis=1)
        assert moved.max() <= 0.21
        shape = np.linalg.norm(leg - leg[0], axis=1)
        assert_allclose(shape, np.linalg.norm(start - start[0], axis=1), atol=1e-9)
        assert_allclose(arm(leg - centre, axis), arm(start - centre, axis), atol=1e-7)
        previous = leg


def arm(points, axis):
    """Return the distance of points from the axis through the origin."""
    return np.linalg.norm(np.cross(points, axis / np.linalg.norm(axis)), axis=1)


def test_a_short_motion_has_no_waypoint():
    start = somewhere(size=0.1)
    assert len(waypoints(start, start + 0.05, ALL)) == 1


def test_a_long_translation_is_straight():
    start = somewhere(size=0.1)
    way = waypoints(start, start + [0.9, 0.0, 0.0], ALL)
    assert len(way) == 5
    assert_allclose(way[1], start + [0.36, 0.0, 0.0], atol=1e-12)


def test_handles_have_separate_motions():
    start = somewhere(size=0.1)
    halves = [np.arange(25), np.arange(25, 50)]
    end = start.copy()
    end[:25] = start[:25] @ rotation([0, 0, 1], 2.0).T
    way = waypoints(start, end, halves)
    assert len(way) >= 3
    for leg in way:
        assert_allclose(leg[25:], start[25:], atol=1e-12)


def test_half_a_turn_has_the_same_direction_in_every_frame():
    start = somewhere(size=0.1) + [0.0, 0.0, 0.4]
    end = start @ rotation([1, 0, 0], np.pi).T
    for seed in range(5):
        turn = rotation(np.random.default_rng(seed).normal(size=3), 1.0 + seed)
        turned = waypoints(start @ turn.T, end @ turn.T, ALL)
        for leg, expected in zip(turned, waypoints(start, end, ALL), strict=True):
            assert_allclose(leg, expected @ turn.T, atol=1e-6)


def test_without_handles_there_is_no_waypoint():
    assert len(waypoints(np.empty((0, 3)), np.empty((0, 3)), [])) == 1


def test_a_change_of_shape_is_spread_evenly_over_the_waypoints():
    """A uniform growth has no rotation, so that every point moves along a straight line."""
    start = somewhere(size=0.1)
    end = 1.2 * start + [0.9, 0.0, 0.0]
    way = waypoints(start, end, ALL)
    assert len(way) >= 4
    for leg, targets in enumerate(way, 1):
        assert_allclose(targets, start + leg / len(way) * (end - start), atol=1e-9)
