"""Pulls of points in faces and on edges: the point itself reaches its target."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.deformer.pull import pull
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.mesh import Mesh, SurfacePoint, distance_to_surface
from vtk_segdeform.regions.regions import Regions

MESH = Mesh(*icosphere(2))
X = MESH.vertices


@pytest.fixture(scope="module")
def deformer() -> Deformer:
    return Deformer(MESH, Regions.single(MESH), [Cage(*icosphere(1, 1.4))])


def pulled(deformer, point, shift, *, refine=False):
    """Return the pose of a pull of *point* by *shift*, (n, 3), and its solution."""
    local = deformer.hold(handle=[point.vertex]).local(point, 1.0, 0.2)
    solution = local.solve(X[[point.vertex]] + shift)
    return local.finish(solution) if refine else solution


def test_the_nearest_point_of_a_surface_is_on_it_and_as_far_as_the_surface():
    rng = np.random.default_rng(0)
    for place in rng.normal(size=(50, 3)):
        point = SurfacePoint.nearest(MESH, place)
        away = np.linalg.norm(point.at(X) - place)
        assert away == pytest.approx(distance_to_surface(place[None], X, MESH.faces)[0])
    corners, shares = MESH.faces[7], rng.dirichlet([1.0, 1.0, 1.0])
    point = SurfacePoint.in_face(X, corners, shares @ X[corners])
    assert_allclose(point.at(X), shares @ X[corners], atol=1e-12)
    assert SurfacePoint.nearest(MESH, X[5]) == SurfacePoint.at_vertex(5)


@pytest.mark.parametrize("refine", [False, True])
@pytest.mark.parametrize("shares", [(0.2, 0.5, 0.3), (0.5, 0.5, 0.0), (0.02, 0.0, 0.98)])
def test_a_pulled_point_reaches_its_target_exactly(shares, refine, deformer):
    point = SurfacePoint.of(MESH.faces[40], shares)
    shift = np.array([0.2, -0.1, 0.3])
    solution = pulled(deformer, point, shift, refine=refine)
    off = np.linalg.norm(point.at(solution.vertices) - point.at(X) - shift)
    assert off < (1e-12 if refine else 1e-4) * MESH.diagonal
    assert solution.handle_error == pytest.approx(off / MESH.diagonal, abs=1e-12)
    assert abs(solution.volume_change) < 1e-12
    assert np.linalg.norm(solution.vertices[point.vertex] - X[point.vertex] - shift) > 1e-4


def test_a_pulled_point_of_a_rigid_part_takes_the_part_along(deformer):
    point, shift = SurfacePoint.of(MESH.faces[40], (0.2, 0.5, 0.3)), np.array([0.2, -0.1, 0.3])
    is_rigid = np.linalg.norm(X - point.at(X), axis=1) < 0.5
    part = deformer.stiffened(np.where(is_rigid, np.inf, 1.0))
    solution = pulled(part, point, shift, refine=True)
    turn, moved = rigid_fit(X[is_rigid], solution.vertices[is_rigid])
    assert_allclose(solution.vertices[is_rigid], X[is_rigid] @ turn.T + moved, atol=1e-9)
    off = np.linalg.norm(point.at(solution.vertices) - point.at(X) - shift)
    assert off < 1e-2 * MESH.diagonal
    assert solution.handle_error == pytest.approx(off / MESH.diagonal, abs=1e-12)
    assert abs(solution.volume_change) < 1e-12


def test_a_pull_of_a_vertex_is_the_same_by_its_number_and_as_a_point(deformer):
    held = deformer.hold(handle=[40])
    targets = X[[40]] + [0.0, 0.2, 0.2]
    one = held.local(40, 1.0, 0.2).solve(targets)
    other = held.local(SurfacePoint.at_vertex(40), 1.0, 0.2).solve(targets)
    assert_array_equal(one.vertices, other.vertices)


def test_pull_takes_a_position_a_point_or_a_vertex():
    quick = {"n_regions": 1, "n_cage_vertices": 30, "radius": 1.0}
    point = SurfacePoint.of(MESH.faces[40], [0.2, 0.5, 0.3])
    place = point.at(X)
    for grabbed in (place, point):
        x = pull(MESH, grabbed, 1.3 * place, **quick).vertices
        assert_allclose(point.at(x), 1.3 * place, atol=1e-4)
    one, other = (pull(MESH, each, 1.3 * X[3], **quick).vertices for each in (3, X[3]))
    assert_array_equal(one, other)
    with pytest.raises(ConstraintError, match=r"away from the surface; .* The nearest one is at"):
        pull(MESH, 2.0 * place, place, **quick)
    for wrong in (
        SurfacePoint((0, 40, 80), (0.2, 0.3, 0.5)),
        SurfacePoint((0,), (0.5,)),
        SurfacePoint((), ()),
        SurfacePoint((1, 2, 999), (0.2, 0.3, 0.5)),
    ):
        with pytest.raises(ConstraintError, match=r"positive shares|vertex must be"):
            pull(MESH, wrong, place, **quick)


def test_a_face_without_a_vertex_within_the_radius_is_refused():
    corners = np.array([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], dtype=float)
    top = corners + [0.0, 0.0, 1.0]
    sides = [[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
    ends = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    box = Mesh(np.concatenate([corners, top]), np.array(sides + ends))
    with pytest.raises(ConstraintError, match=r"49.* % .*segdeform subdivide"):
        pull(box, [4.5, 0.0, 0.0], [4.5, -1.0, 0.0])
    solution = pull(box, [0.5, 0.0, 0.0], [0.5, -0.5, 0.0], n_regions=1, n_cage_vertices=20)
    point = SurfacePoint.nearest(box, np.array([0.5, 0.0, 0.0]))
    assert_allclose(point.at(solution.vertices), [0.5, -0.5, 0.0], atol=1e-3)
