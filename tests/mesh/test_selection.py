"""Selections parsed from text; errors of invalid text contain the grammar."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.mesh.selection import parse_selection


@pytest.fixture(scope="module")
def ball() -> Mesh:
    """Return a rotated, translated and stretched sphere; simple coordinates could hide faults."""
    vertices, faces = icosphere(2)
    turned = vertices @ rotation([1.0, 2.0, 3.0], 0.7).T
    return Mesh(turned * [1.0, 2.0, 3.0] + [10.0, -5.0, 0.5], faces)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_half_space_is_the_vertices_beyond_the_limit(ball, axis):
    along = ball.vertices[:, axis]
    middle = float(np.median(along))
    name = "xyz"[axis]
    assert_array_equal(
        parse_selection(f"{name}>{middle!r}", ball.vertices), np.flatnonzero(along > middle)
    )
    assert_array_equal(
        parse_selection(f"{name} <= {middle!r}", ball.vertices), np.flatnonzero(along <= middle)
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_per_cent_runs_from_one_side_of_the_bounding_box_to_the_other(ball, axis):
    along = ball.vertices[:, axis]
    share = (along - along.min()) / np.ptp(along)
    found = parse_selection(f"{'xyz'[axis]}>80%", ball.vertices)
    assert_array_equal(found, np.flatnonzero(share > 0.8))
    assert len(parse_selection(f"{'xyz'[axis]}>=0%", ball.vertices)) == ball.n_vertices
    assert len(parse_selection(f"{'xyz'[axis]}<=100%", ball.vertices)) == ball.n_vertices


def test_the_extent_of_a_mesh_far_from_the_origin_has_all_its_digits(ball):
    far = ball.vertices + [1e6, 0.0, 0.0]
    with pytest.raises(ConstraintError, match=r"the mesh spans x 1000\d{3}\.\d{4,}\.\.1000"):
        parse_selection("x<0", far)


def test_a_file_of_numbers_may_use_lines_blanks_commas_and_comments(ball, tmp_path):
    path = tmp_path / "top & bottom.txt"
    path.write_text("# the top\n7 3\n3, 11 # twice is once\n\n0\n")
    assert_array_equal(parse_selection(str(path), ball.vertices), [0, 3, 7, 11])


def test_a_file_and_a_half_space_can_be_joined(ball, tmp_path):
    path = tmp_path / "some"
    path.write_text(" ".join(map(str, range(0, ball.n_vertices, 2))))
    found = parse_selection(f"{path}&y<40%", ball.vertices)
    assert_array_equal(found, [i for i in parse_selection("y<40%", ball.vertices) if i % 2 == 0])


def test_a_sel_file_gives_zeros_to_fixed_and_twos_to_the_handle(ball, tmp_path):
    status = np.ones(ball.n_vertices, dtype=int)
    status[[4, 8]] = 0
    status[[15, 16, 23]] = 2
    path = tmp_path / "ball.sel"
    path.write_text("# 0 fixed, 1 free, 2 handle\n" + "\n".join(map(str, status)))
    assert_array_equal(parse_selection(str(path), ball.vertices, role="fixed"), [4, 8])
    assert_array_equal(parse_selection(str(path), ball.vertices, role="handle"), [15, 16, 23])
    assert_array_equal(parse_selection(f"{path}=2", ball.vertices), [15, 16, 23])
    assert len(parse_selection(f"{path}=1", ball.vertices, role="fixed")) == ball.n_vertices - 5
    with pytest.raises(ConstraintError, match="select one of the numbers in"):
        parse_selection(str(path), ball.vertices)


def test_an_array_is_where_it_is_not_zero_or_where_it_equals(ball):
    part = np.arange(ball.n_vertices) % 3
    arrays = {"part": part, "is big": part == 2}
    assert_array_equal(
        parse_selection("part", ball.vertices, point_arrays=arrays), np.flatnonzero(part)
    )
    assert_array_equal(
        parse_selection("part=0", ball.vertices, point_arrays=arrays), np.flatnonzero(part == 0)
    )
    assert_array_equal(
        parse_selection("is big", ball.vertices, point_arrays=arrays), np.flatnonzero(part == 2)
    )
    unknown = np.where(part == 2, np.nan, part)  # no data is no selection
    assert_array_equal(
        parse_selection("some", ball.vertices, point_arrays={"some": unknown}),
        np.flatnonzero(part == 1),
    )


@pytest.mark.parametrize(
    "text",
    ["", "&", "z>", "w>3", "z>80%&", "z>>1", "z>1e", "80%<z", "z>1;x<2", "__import__('os')",
     "no/such/file", "z > nan", "z>80%%"],
)  # fmt: skip
def test_what_is_not_in_the_grammar_is_refused_with_the_grammar(ball, text):
    with pytest.raises(ConstraintError, match=r"use a half-space \(z>80%"):
        parse_selection(text, ball.vertices)


def test_the_error_of_an_unknown_name_lists_the_point_arrays(ball):
    with pytest.raises(ConstraintError, match="point arrays here: left, right"):
        parse_selection("middle", ball.vertices, point_arrays={"right": [0], "left": [0]})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("3 4 99999", r"must be 0\.\.65; got 3\.\.99999"),
        ("-1", r"got -1\.\.-1"),
        ("1.5", "whole"),
        ("nan", "whole"),
        ("one two", "must contain only numbers"),
        ("", "selects none"),
    ],
)
def test_a_file_that_does_not_fit_the_mesh_is_refused(ball, tmp_path, content, message):
    path = tmp_path / "ids"
    path.write_text(content)
    with pytest.raises(ConstraintError, match=message):
        parse_selection(str(path), ball.vertices)


def test_a_sel_file_of_another_mesh_is_refused(ball, tmp_path):
    path = tmp_path / "other.sel"
    path.write_text("0 1 2")
    with pytest.raises(ConstraintError, match="one number per point, 66 numbers; got 3"):
        parse_selection(str(path), ball.vertices, role="fixed")


def test_an_array_of_vectors_selects_nothing_sensible_and_is_refused(ball):
    with pytest.raises(ConstraintError, match="one number per point"):
        parse_selection("normals", ball.vertices, point_arrays={"normals": ball.vertices})
