"""Lines of numbers are read as they are written, with and without compiled kernels."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vtk_segdeform import sizes
from vtk_segdeform.io.number_lines import Lines, numbers_of, words_per_line
from vtk_segdeform.kernels import dispatch


@pytest.fixture(params=["numba", "numpy"], autouse=True)
def either(request, monkeypatch):
    """Run with and without compiled kernels, whatever the size."""
    monkeypatch.setattr(sizes, "COMPILED_CHECKS", 0)
    if request.param == "numba":
        pytest.importorskip("numba")
    else:
        monkeypatch.setattr(dispatch, "_kernels", lambda: None)
    return request.param


TEXT = b"# head\nv 1 2 3\nvt 0.5 0.25\nv\t4 -5e1 .5\n\nf 1 2 3\nvn 0 0 1\nv 7 8 9\nf 3 2 1\nvtx 1"


def test_lines_are_grouped_by_their_first_word():
    lines = Lines(TEXT, ("v", "vt", "f"))
    assert lines.of("v") == b"v 1 2 3\nv\t4 -5e1 .5\nv 7 8 9\n"
    assert lines.of("vt") == b"vt 0.5 0.25\n"
    assert lines.of("f") == b"f 1 2 3\nf 3 2 1\n"
    assert_array_equal(lines.at("f"), [5, 8])
    assert_array_equal(lines.above("v"), [0, 0, 1, 1, 2, 2, 2, 2, 3, 3])
    assert list(lines.others()) == [(0, "# head"), (4, ""), (6, "vn 0 0 1"), (9, "vtx 1")]


def test_tables_have_one_row_a_line_and_only_if_all_are_as_wide():
    lines = Lines(TEXT, ("v", "vt", "f"))
    assert_array_equal(lines.table("v"), [[1, 2, 3], [4, -50, 0.5], [7, 8, 9]])
    assert_array_equal(lines.table("vt"), [[0.5, 0.25]])
    for other in (b"v 1 2 3\nv 1 2\n", b"v 1 2 3\nv 1 2 3 4\n", b"v 1 2 3\nv 1 2 x\n"):
        assert Lines(other, ("v",)).table("v") is None
    assert Lines(b"f 1 2 3", ("v", "f")).table("v") is None


@pytest.mark.parametrize(
    ("text", "corners"),
    [
        ("f 1 2 3\nf 4 -5 6 7", [[1, 0, 0], [2, 0, 0], [3, 0, 0], [4, 0, 0], [-5, 0, 0], [6, 0, 0],
                                 [7, 0, 0]]),
        ("f 1/4 2/5 3/6\nf 3/1 2/2 1/3 9/9", [[1, 4, 0], [2, 5, 0], [3, 6, 0], [3, 1, 0], [2, 2, 0],
                                              [1, 3, 0], [9, 9, 0]]),
        ("f 1//4 2//5 3//6\nf 3//1 2//2 1//3 9//9", [[1, 0, 4], [2, 0, 5], [3, 0, 6], [3, 0, 1],
                                                     [2, 0, 2], [1, 0, 3], [9, 0, 9]]),
        ("f 1/7/4 2/8/5 3/9/6\nf 3/1/1 2/2/2 1/3/3 -9/9/9", [[1, 7, 4], [2, 8, 5], [3, 9, 6],
                                                            [3, 1, 1], [2, 2, 2], [1, 3, 3],
                                                            [-9, 9, 9]]),
    ],
)  # fmt: skip
def test_corners_of_faces_may_be_given_in_four_ways(text, corners):
    counts, found = Lines(text.encode(), ("f",)).corners("f")
    assert_array_equal(counts, [3, 4])
    assert_array_equal(found, corners)


@pytest.mark.parametrize(
    "text",
    ["f 1 2 0", "f 1 2 x", "f 1/2 2/0 3/1", "f 1/2/3/4 2/2/2/2 3/3/3/3", "f 1 2 3.5",
     f"f 1 2 {10**17}", "f 1 2 3/"],
)  # fmt: skip
def test_other_corners_are_not_read(text):
    assert Lines(f"f 1 2 3\n{text}\n".encode(), ("f",)).corners("f") is None
    assert Lines(f"{text}\n".encode(), ("f",)).corners("f") is None


def test_corners_given_in_two_ways_are_read_by_compiled_kernels_only(either):
    found = Lines(b"f 1 2/5 3//6\n", ("f",)).corners("f")
    if either == "numpy":
        assert found is None
    else:
        assert_array_equal(found[1], [[1, 0, 0], [2, 5, 0], [3, 0, 6]])


def test_words_are_counted_on_each_line():
    begins, counts = words_per_line(b"one two\n\n  three\tfour  five\nsix\n")
    assert_array_equal(counts, [2, 0, 3, 1])
    assert_array_equal(begins, [0, 4, 11, 17, 23, 28])


def test_numbers_of_a_text_are_as_many_as_wanted_and_nothing_else():
    assert_array_equal(numbers_of(b"1 2\n-3", np.int64), [1, 2, -3])
    assert_array_equal(numbers_of(b"1 2\n-3", np.int64, 3), [1, 2, -3])
    assert_array_equal(numbers_of(b"1.5 2e-3\n-.25 ", np.float64), [1.5, 2e-3, -0.25])
    assert numbers_of(b"1.5 2e-3 7", np.float32).dtype == np.float32
    for wrong in (2, 4):
        assert numbers_of(b"1 2 3", np.int64, wrong) is None
    assert numbers_of(b"1 2 x", np.float64) is None
    assert len(numbers_of(b"", np.float64)) == 0
