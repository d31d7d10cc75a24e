"""Motions parsed from options are rigid and have the given axis, angle and pivot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import rotation as turn
from solids import somewhere

from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import motion


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, 0, -3.0], [1.0, 2.0, 3.0]])
@pytest.mark.parametrize("angle", [0.0, 0.5, math.pi, -2.0])
def test_a_turn_keeps_its_pivot_and_its_axis_and_all_distances(axis, angle):
    pivot = np.array([3.0, -1.0, 2.0])
    matrix = motion.rotation(axis, angle, pivot)
    line = pivot + np.outer([-2.0, 0.0, 1.5], axis)
    assert_allclose(motion.transform(line, matrix), line, atol=1e-12)
    x = somewhere()
    moved = motion.transform(x, matrix)
    assert_allclose(moved, pivot + (x - pivot) @ turn(axis, angle).T, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "axis", "degrees"),
    [
        ("z,60", [0, 0, 1], 60),
        ("X, -90", [1, 0, 0], -90),
        ("0,3,0,45", [0, 1, 0], 45),
        ("1,0,1,1e1", [math.sqrt(0.5), 0, math.sqrt(0.5)], 10),
    ],
)
def test_a_rotation_is_an_axis_and_degrees(text, axis, degrees):
    found, angle = motion.parse_rotation(text)
    assert_allclose(found, axis, atol=1e-15)
    assert math.degrees(angle) == pytest.approx(degrees)


@pytest.mark.parametrize(
    "text", ["", "z", "60", "z,", "w,60", "0,0,0,60", "1,0,60", "z,60,1", "z,inf"]
)
def test_a_rotation_that_is_none_is_refused(text):
    with pytest.raises(ConstraintError, match="rotate must be"):
        motion.parse_rotation(text)


def test_a_rotation_has_a_limited_number_of_turns():
    assert motion.parse_rotation("z,-3600")[1] == pytest.approx(-20 * math.pi)
    with pytest.raises(ConstraintError, match="limited to 10 turns, 3600 degrees; got 'z,1e6'"):
        motion.parse_rotation("z,1e6")


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c", "1;2;3", "nan,0,0"])
def test_a_vector_that_is_none_is_refused_by_name(text):
    with pytest.raises(ConstraintError, match="translate must be"):
        motion.parse_vector(text, "translate")


def test_a_matrix_file_is_read_back(tmp_path):
    matrix = motion.rotation([1, 2, 3], 0.8, [4, 5, 6])
    path = tmp_path / "pose.def"
    np.savetxt(path, matrix, header="the pose", fmt="%.17g")
    assert_allclose(motion.read_matrix(path), matrix, atol=0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1 2 3", "16 finite numbers; got 3"),
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 1 1", "0 0 0 1"),
        ("one two", "16 numbers"),
        ("nan " * 16, "16 finite"),
    ],
)
def test_a_matrix_file_that_holds_no_motion_is_refused(tmp_path, content, message):
    path = tmp_path / "pose.def"
    path.write_text(content)
    with pytest.raises(ConstraintError, match=message):
        motion.read_matrix(path)
