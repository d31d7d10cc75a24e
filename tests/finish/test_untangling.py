"""Parts that cross are drawn apart: what crosses no more, and what stays as it was."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.finish import CellEnergy, Finisher, untangling
from vtk_segdeform.finish.untangling import contour, untangled
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.mesh import Crossings, Mesh
from vtk_segdeform.solver import Bodies, total_volume

TURN = rotation([1.0, 2.0, -0.5], 1.1)


def two_spheres(gap: float) -> Mesh:
    """Return two spheres of radius 1, the second turned, with a *gap* between them along x."""
    points, faces = icosphere(3)
    other = points @ TURN.T + [2.0 + gap, 0.05, 0.02]
    return Mesh(np.concatenate([points, other]), np.concatenate([faces, faces + len(points)]))


REST = two_spheres(0.5)
TOUCHING = two_spheres(-0.2).vertices  # their diameters are 2
AWAY = np.abs(REST.vertices[:, 0] - 1.25) > 1.5  # the two far caps
FREE = ~AWAY


def crossings() -> Crossings:
    return Crossings(REST.vertices, REST.faces)


def test_the_length_is_that_of_the_circle_in_which_two_spheres_cross():
    length, _ = contour(TOUCHING, REST.faces, crossings().pairs(TOUCHING))
    assert length == pytest.approx(2.0 * np.pi * np.sqrt(1.0 - 0.9**2), rel=0.05)


def test_the_gradient_is_that_of_the_length(monkeypatch):
    monkeypatch.setattr(untangling, "_STEEPEST", np.inf)
    pairs = crossings().pairs(TOUCHING)
    _, slope = contour(TOUCHING, REST.faces, pairs)
    rng = np.random.default_rng(1)
    for _ in range(3):
        way = rng.normal(size=slope.shape)
        off = [
            (contour(TOUCHING + t * way, REST.faces, pairs)[0]
             - contour(TOUCHING - t * way, REST.faces, pairs)[0]) / (2.0 * t)
            - np.vdot(slope, way)
            for t in (2e-5, 1e-5)
        ]  # fmt: skip
        assert abs(off[1]) < 1e-4 * abs(np.vdot(slope, way))
        assert off[0] == pytest.approx(4.0 * off[1], rel=0.2)


def test_parts_are_drawn_apart_and_what_is_held_stays():
    assert len(crossings().pairs(TOUCHING)) > 40
    apart = untangled(REST, TOUCHING, FREE, crossings())
    assert not len(crossings().pairs(apart))
    assert_array_equal(apart[AWAY], TOUCHING[AWAY])
    # Half of the depth on either side would be enough.
    assert np.linalg.norm(apart - TOUCHING, axis=1).max() < 0.4


def test_parts_are_drawn_apart_alike_in_any_place_and_unit():
    def moved(x):
        return 1e3 * x @ TURN.T + [5.0, -3e3, 1.0]

    mesh = REST.with_vertices(moved(REST.vertices))
    there = untangled(mesh, moved(TOUCHING), FREE, Crossings(mesh.vertices, mesh.faces))
    assert_allclose(there, moved(untangled(REST, TOUCHING, FREE, crossings())), atol=1e-4)


def test_a_pose_that_cannot_be_drawn_apart_stays_as_it_is():
    nothing = np.zeros(len(TOUCHING), dtype=bool)
    assert untangled(REST, TOUCHING, nothing, crossings()) is TOUCHING
    assert untangled(REST, REST.vertices, FREE, crossings()) is REST.vertices


def test_crossings_of_the_rest_shape_are_left_alone():
    own = Crossings(TOUCHING, REST.faces)
    assert untangled(REST.with_vertices(TOUCHING), TOUCHING, FREE, own) is TOUCHING


def test_only_what_crosses_moves():
    far = 20.0 + icosphere(3)[0]
    n, faces = len(TOUCHING), icosphere(3)[1]
    mesh = Mesh(np.concatenate([REST.vertices, far]), np.concatenate([REST.faces, faces + n]))
    pose = np.concatenate([TOUCHING, far + 1.0])
    free = np.concatenate([FREE, np.ones(len(far), dtype=bool)])
    apart = untangled(mesh, pose, free, Crossings(mesh.vertices, mesh.faces))
    assert not len(Crossings(mesh.vertices, mesh.faces).pairs(apart))
    assert_array_equal(apart[n:], pose[n:])


@pytest.mark.parametrize("avoid_contact", [False, True])
def test_a_finish_draws_apart_what_crossed_before_it_if_it_is_asked_to(avoid_contact):
    lids = lids_of(REST)
    bodies = Bodies(REST, total_volume(REST), lids)
    constraints = bodies.constraints(bodies.numbers(np.flatnonzero(AWAY)))
    energy = CellEnergy.of(REST)
    weights = 100.0 * REST.vertex_areas
    finisher = Finisher(REST, energy, AWAY, constraints, weights, avoid_contact=avoid_contact)
    found = finisher.run(TOUCHING, TOUCHING[AWAY])
    assert (len(crossings().at(found.vertices)) == 0) == avoid_contact
    assert_array_equal(found.vertices[AWAY], TOUCHING[AWAY])
    assert max(abs(each.relative(found.vertices)) for each in constraints) < 1e-13


def test_of_two_tangles_the_one_that_can_be_drawn_apart_is():
    n, aside = len(TOUCHING), np.array([0.0, 9.0, 0.0])
    mesh = Mesh(
        np.concatenate([REST.vertices, REST.vertices + aside]),
        np.concatenate([REST.faces, REST.faces + n]),
    )
    pose = np.concatenate([TOUCHING, TOUCHING + aside])
    free, own = np.repeat([False, True], n), Crossings(mesh.vertices, mesh.faces)
    before = len(own.pairs(pose))
    apart = untangled(mesh, pose, free, own)
    assert len(own.pairs(apart)) == before // 2
    assert_array_equal(apart[~free], pose[~free])


def test_two_triangles_cross_in_a_segment_of_known_length_and_slope():
    """The second one stands upright on the first, its upper edge parallel to it."""
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 1], [2, 1, 1], [1.5, 1, -1.0]])
    faces, pairs = np.array([[0, 1, 2], [3, 4, 5]]), np.array([[0, 1]])
    length, slope = contour(points, faces, pairs)
    assert length == pytest.approx(0.5)
    assert contour(points, faces, pairs[:, ::-1])[0] == pytest.approx(0.5)
    # Raised by dz it is shorter by dz / 2, and wider at the top by dx it is longer by dx / 2.
    assert slope[3:, 2].sum() == pytest.approx(-0.5)
    assert slope[:3, 2].sum() == pytest.approx(0.5)
    assert_allclose(slope[3:5, 0], [-0.5, 0.5], atol=1e-12)
    assert_allclose(slope[:, 1], 0.0, atol=1e-12)
    apart = points + np.outer(np.arange(6) >= 3, [0.0, 0.0, 3.0])
    assert contour(apart, faces, pairs)[0] == 0.0


def test_two_triangles_with_a_common_corner_cross_from_there_on():
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [2, 1, 1], [1, 2, -1.0]])
    faces, pairs = np.array([[0, 1, 2], [0, 3, 4]]), np.array([[0, 1]])
    length, slope = contour(points, faces, pairs)
    assert length == pytest.approx(1.5 * np.sqrt(2.0))
    assert contour(points, faces, pairs[:, ::-1])[0] == pytest.approx(length)
    for way in np.eye(points.size).reshape(-1, *points.shape):
        ends = (contour(points + step * way, faces, pairs)[0] for step in (1e-6, -1e-6))
        assert np.subtract(*ends) / 2e-6 == pytest.approx(np.vdot(slope, way), abs=1e-6)


def test_the_gradient_is_bounded_where_an_edge_is_almost_in_the_plane():
    points = np.array(
        [[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 1e-6], [2, 1, -1e-6], [1.5, 2, 1e-6]]
    )
    length, slope = contour(points, np.array([[0, 1, 2], [3, 4, 5]]), np.array([[0, 1]]))
    assert length > 0.1
    assert 1.0 < np.abs(slope).max() <= 2.0 * untangling._STEEPEST
