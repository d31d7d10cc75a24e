"""Array arguments are converted to plain arrays, or errors name them and the value passed."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from bad_values import BAD
from numpy.testing import assert_array_equal

from vtk_segdeform.arrays import as_faces, as_ids, as_points, frozen
from vtk_segdeform.errors import ArgumentError


def test_points_and_faces_become_plain_arrays():
    points = as_points([[0, 1, 2], [3, 4, 5]], "points")
    assert points.dtype == np.float64
    assert points.flags.c_contiguous
    faces = as_faces(np.array([[0, 1, 2]], order="F", dtype=np.uint16), 3, "faces")
    assert faces.dtype == np.int64
    assert_array_equal(faces, [[0, 1, 2]])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([1.0, 2.0, 3.0], r"handle must have shape \(n, 3\); got \(3,\)"),
        ([[1.0, 2.0]], r"handle must have shape \(n, 3\); got \(1, 2\)"),
        (
            [[0, 0, np.nan], [0, np.inf, 0], [0, 0, 0]],
            "handle must be finite; 2 of 3 points have NaN",
        ),
        ([["a", "b", "c"]], "handle must contain numbers"),
        ([[1, 2, 3], [1, 2]], "handle must be an array; its rows differ in length"),
        ([[1j, 0, 0]], "handle must contain real numbers; got complex128"),
        (np.ma.array([[1.0, 2.0, 3.0]], mask=[[0, 1, 0]]), "handle has masked entries"),
    ],
)
def test_invalid_points_are_errors_that_show_the_value(points, message):
    with pytest.raises(ValueError, match=message):
        as_points(points, "handle")


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 2, 3]], r"cage must have shape \(m, 3\), triangles; got \(1, 4\)"),
        ([[0.0, 1.0, 2.0]], "cage must contain integers; got float64"),
        ([[0, 1, 6]], r"cage must index 0..5; got 0..6"),
        ([[-1, 1, 2]], r"cage must index 0..5; got -1..2"),
    ],
)
def test_invalid_faces_are_errors_that_show_the_value(faces, message):
    with pytest.raises(ValueError, match=message):
        as_faces(faces, 6, "cage")


def test_ids_keep_their_order_and_a_mask_becomes_ids():
    assert_array_equal(as_ids([4, 0, 2], 5, "fixed"), [4, 0, 2])
    assert_array_equal(as_ids([False, True, True], 3, "fixed"), [1, 2])
    assert_array_equal(as_ids(3, 5, "fixed"), [3])
    assert as_ids([], 5, "fixed").dtype == np.int64


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ([0, 5], r"fixed must index 0..4; got 0..5"),
        ([-1], r"fixed must index 0..4; got -1..-1"),
        ([1, 2, 1], "fixed contains a vertex twice"),
        (np.ma.array([1, 2], mask=[0, 1]), "fixed has masked entries"),
        ([0.5], "fixed must contain vertex numbers or be a mask; got float64"),
        ([[0, 1]], r"fixed must be a list of vertex numbers; got shape \(1, 2\)"),
        ([True, False], r"fixed, a mask, must have shape \(5,\); got \(2,\)"),
    ],
)
def test_invalid_ids_are_errors_that_show_the_value(ids, message):
    with pytest.raises(ValueError, match=message):
        as_ids(ids, 5, "fixed")


@pytest.mark.parametrize(
    "kind", ["recursive list", "recursive after rows", "endless", "huge range"]
)
def test_endless_sequences_are_errors_at_once_without_using_memory(kind):
    for values in (BAD[kind](), [BAD[kind]()]):
        tracemalloc.start()
        try:
            with pytest.raises(ArgumentError, match="fixed"):
                as_ids(values, 5, "fixed")
            assert tracemalloc.get_traced_memory()[1] < 1e6
        finally:
            tracemalloc.stop()


def test_a_frozen_array_is_read_only():
    array = frozen(np.zeros(3))
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0
