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


def test_a_change_of_shape_is_spread_evenly_over_the_waypoints():
    """A uniform growth has no rotation, so that every point moves along a straight line."""
    start = somewhere(size=0.1)
    end = 1.2 * start + [0.9, 0.0, 0.0]
    way = waypoints(start, end, ALL)
    assert len(way) >= 4
    for leg, targets in enumerate(way, 1):
        assert_allclose(targets, start + leg / len(way) * (end - start), atol=1e-9)


@pytest.mark.parametrize(("degrees", "legs"), [(29.0, 1), (31.0, 2), (89.0, 3), (121.0, 5)])
def test_a_leg_turns_by_30_degrees_at_most(degrees, legs):
    """Also about the axis along which the handle is long, where its points hardly move."""
    start = somewhere(size=0.01) * [10.0, 1.0, 1.0] + [0.2, 0.3, 0.1]
    middle = start.mean(axis=0)
    for axis in ([1.0, 0.0, 0.0], [0.0, 0.3, 1.0]):
        for shift in (np.zeros(3), np.array([0.05, -0.02, 0.1])):
            turn = rotation(axis, np.radians(degrees))
            end = (start - middle) @ turn.T + middle + shift
            assert len(waypoints(start, end, ALL)) == legs


def test_a_leg_is_a_fifth_of_the_mesh_at_most_or_a_share_of_that():
    start = somewhere(size=0.1)
    for length, share, legs in ((0.199, 1.0, 1), (0.201, 1.0, 2), (0.201, 0.5, 3), (0.6, 0.25, 12)):
        end = start + np.array([0.0, length, 0.0])
        way = waypoints(start, end, ALL, share)
        assert len(way) == legs
        assert way[-1] is end
    turn = rotation([0.0, 0.0, 1.0], np.radians(20.0))
    assert len(waypoints(start, start @ turn.T, ALL, 0.5)) == 2


@pytest.mark.parametrize("s", [1, 2, 3])
def test_a_screw_motion_turns_and_slides_evenly(s):
    start, axis = somewhere(size=0.1), np.array([2.0, -1.0, 2.0]) / 3.0
    centre, slide = np.array([0.3, -0.1, 0.2]), 0.3 * axis
    angle = np.radians(115.0)
    end = (start - centre) @ rotation(axis, angle).T + centre + slide
    way = waypoints(start, end, ALL)
    assert len(way) == 4
    turn = rotation(axis, s / 4 * angle)
    assert_allclose(way[s - 1], (start - centre) @ turn.T + centre + s / 4 * slide, atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("up", [0.0, 2.0])
def test_half_a_turn_is_about_the_axis_toward_the_farthest_point_of_the_handle(side, up):
    arms = np.array([[0.0, 0.1, 0.3], [0.1, -0.1, -0.1], [-0.1, 0.0, -0.1], [0.1, 0.1, -0.1]])
    start = arms * [1.0, 1.0, side] + [0.4, 0.0, up]
    end = start @ rotation([0.0, 0.0, 1.0], np.pi).T
    way = waypoints(start, end, [np.arange(4)])
    turn = rotation([0.0, 0.0, side], np.pi / len(way))
    assert_allclose(way[0], start @ turn.T, atol=1e-6)
