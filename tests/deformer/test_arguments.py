"""Arguments of a deformer: which ones are accepted, and what is said about the others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere

from vtk_segdeform.deformer import arguments
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.mesh import Mesh, SurfacePoint

MESH = Mesh(*icosphere(2))
X, D = MESH.vertices, MESH.diagonal


def refused(says, check, *given, error=ConstraintError):
    with pytest.raises(error, match=says):
        check(*given)


def test_options():
    arguments.check_options(0.0, 1)
    check = arguments.check_options
    refused("stretch must be a number, 0 or more; got -0.1", check, -0.1, 1, error=ArgumentError)
    refused("rotation_groups must be .* 1 or more; got 0", check, 1.0, 0, error=ArgumentError)
    assert [arguments.as_lids(each) for each in (True, np.False_, None)] == [True, False, None]
    refused("lids must be True, False or None; got 1", arguments.as_lids, 1, error=ArgumentError)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_targets_are_at_most_a_thousand_mesh_sizes_away(sign):
    arguments.check_distance(sign * np.array([[0.0, 999.0, 1.0]]))
    arguments.check_distance(np.empty((0, 3)))
    far = sign * np.array([[0.0, 1.0, 2.0], [2e3, 0.0, 0.0]])
    refused("a target is 2e.03 mesh sizes away", arguments.check_distance, far)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_places_are_at_most_20_diagonals_apart(axis):
    for apart, ok in ((19.9, True), (20.1, False)):
        far = np.full((2, 3), 7.0)
        far[1, axis] += apart * D
        for places in ([far], [far[:1], far[1:]], [far[1:], far[:0], far[:1]]):
            if ok:
                arguments.require_together(MESH, *places)
            else:
                says = "20.1 diagonals of the mesh apart; at most 20 are"
                refused(says, arguments.require_together, MESH, *places)
    arguments.require_together(MESH, np.empty((0, 3)))


def test_vertices_are_fixed_or_in_a_handle():
    fixed, handle = arguments.checked_constraints(MESH, [3, 1], np.arange(66) == 5)
    assert_array_equal(fixed, [3, 1])
    assert_array_equal(handle, [5])
    check = arguments.checked_constraints
    refused("1 vertex is both pins and handle .the first is 3", check, MESH, [3], [4, 3], "pins")
    refused("2 vertices are both fixed and handle .the first is 4", check, MESH, [9, 4], [4, 9])
    refused("handle must index 0..65", check, MESH, [], [66])


def test_a_vertex_is_one_of_the_mesh():
    assert [arguments.checked_vertex(MESH, k) for k in (0, 65)] == [0, 65]
    for wrong in (-1, 66, 1.5, "1"):
        refused(
            "vertex must be a whole number, 0 to 65; got", arguments.checked_vertex, MESH, wrong
        )


def test_a_place_is_a_vertex_or_near_the_surface():
    assert arguments.checked_place(MESH, 7) == SurfacePoint.at_vertex(7)
    assert arguments.checked_place(MESH, np.int64(7)) == SurfacePoint.at_vertex(7)
    for away, ok in ((0.049, True), (-0.049, True), (0.051, False)):
        place = X[7] * (1.0 + away * D)
        if ok:
            point = arguments.checked_place(MESH, place)
            assert np.linalg.norm(point.at(X) - place) <= 0.0491 * D
        else:
            says = "^grab is 5.1 % of model size away from the surface.* nearest one is at"
            refused(says, arguments.checked_place, MESH, place, "grab")


def test_a_point_of_the_surface_is_a_mean_of_the_corners_of_a_face():
    a, b, c = (int(k) for k in MESH.faces[40])
    for point in (
        SurfacePoint((a, b, c), (0.2, 0.3, 0.5)), SurfacePoint((a, b), (0.2, 0.8 + 1e-12)),
    ):  # fmt: skip
        assert arguments.checked_place(MESH, point) is point
    far = int(np.linalg.norm(X - X[a], axis=1).argmax())
    for wrong in (
        SurfacePoint((a, b), (0.2, 0.8 + 1e-8)), SurfacePoint((a, b), (1.2, -0.2)),
        SurfacePoint((a, b), (0.0, 1.0)), SurfacePoint((a, b, c), (0.5, 0.5)),
        SurfacePoint((a, b, far), (0.2, 0.3, 0.5)), SurfacePoint((), ()),
    ):  # fmt: skip
        refused("positive shares, with the sum 1", arguments.checked_place, MESH, wrong)
    says = "vertex must be a whole number, 0 to 65; got 66"
    refused(says, arguments.checked_place, MESH, SurfacePoint((a, 66), (0.5, 0.5)))


def test_a_pull_grabs_a_point_with_a_vertex_of_its_face_within_the_radius():
    middle = SurfacePoint.of(MESH.faces[40], np.full(3, 1.0 / 3.0))
    away = np.linalg.norm(X[MESH.faces[40]] - middle.at(X), axis=1).min()
    assert arguments.fault_of_grab(MESH, middle, away) == ""
    says = arguments.fault_of_grab(MESH, middle, 0.5 * away)
    share = 100.0 * away / D
    assert f"its face is {share:.3g} % of model size away" in says
    assert f"the pull is {0.5 * share:.3g} %; subdivide" in says
    assert arguments.place_text(MESH, SurfacePoint.at_vertex(0)) == "1,0,0"


def test_a_radius_is_15_percent_of_the_diagonal_by_default():
    assert arguments.checked_radius(MESH, None) == pytest.approx(0.15 * D)
    assert arguments.checked_radius(MESH, 2) == 2.0
    for wrong in (0.0, -1.0, np.inf, np.nan, "1"):
        refused("radius must be a positive number or None", arguments.checked_radius, MESH, wrong)


def test_the_locality_decides_the_reach_and_what_follows():
    assert [arguments.checked_locality(each) for each in (None, 0, 1)] == [None, 0.0, 1.0]
    for wrong in (-0.1, 1.1, np.nan, "1"):
        refused("locality must be a number from 0 to 1", arguments.checked_locality, wrong)
    assert [arguments.automatic_locality(n) for n in (0, 1, 2, 3, 9)] == [0.2, 0.05, 0.05, 0, 0]


def test_a_point_and_targets_are_finite_and_as_many_as_vertices():
    assert_array_equal(arguments.checked_point([1, 2, 3]), [1.0, 2.0, 3.0])
    refused(r"to must be a point \(3,\); got shape \(1, 3\)", arguments.checked_point, [[1, 2, 3]])
    refused("here must be finite", arguments.checked_point, [1, 2, np.nan], "here")
    for empty in ([], np.empty((0, 3)), ()):
        assert arguments.checked_targets(empty, 0).shape == (0, 3)
    assert_array_equal(arguments.checked_targets(X[:2], 2), X[:2])
    check = arguments.checked_targets
    says = r"through must give one point for each of the 2 handle vertices; got shape \(3, 3\)"
    refused(says, check, X[:3], 2, "through")
    refused("each of the 0 fixed vertices; got shape .1, 3", check, X[:1], 0, "at", "fixed")
    refused(r"targets must have shape \(n, 3\)", check, [], 1)
