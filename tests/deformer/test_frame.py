"""The frame of a mesh: solver coordinates of size 1, and pose coordinates that keep digits."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere

from vtk_segdeform.deformer.frame import Frame

POINTS = icosphere(2)[0] * [3.0, 2.0, 1.0]


@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_in_solver_coordinates_the_mesh_fits_into_a_ball_of_diameter_one(shift):
    frame = Frame.of(POINTS + shift)
    inside = frame.inward(POINTS + shift)
    assert_allclose(inside.mean(axis=0), 0.0, atol=1e-10)
    assert np.linalg.norm(inside, axis=1).max() == pytest.approx(0.5, rel=1e-9)
    assert_allclose(frame.outward(inside), POINTS + shift, rtol=1e-14, atol=1e-14)


def test_near_the_origin_poses_are_computed_in_the_coordinates_of_the_scene():
    frame = Frame.of(POINTS + 0.5)
    assert frame.is_far is False
    assert_array_equal(frame.origin, np.zeros(3))
    assert frame.about_origin(POINTS) is frame.in_scene(POINTS) is POINTS


def test_far_from_the_origin_poses_are_computed_about_the_centre():
    points = POINTS + 2.0**20
    frame = Frame.of(points)
    assert frame.is_far
    assert np.abs(frame.about_origin(points)).max() < 4.0
    assert_array_equal(frame.in_scene(frame.about_origin(points)), points)
