"""Automatic cages are valid, enclose any region, and move with the mesh."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, rotation, torus, two_components

from vtk_segdeform.cages import fit
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.cages.contour import contour_surface
from vtk_segdeform.cages.fit import fit_cage, fit_cages, suggested_size
from vtk_segdeform.cages.region_solid import Patch, Surface, _filled, solid_field
from vtk_segdeform.cages.simplify import roundness
from vtk_segdeform.errors import CageError, Cancelled, RegionError
from vtk_segdeform.mesh.inside import (
    distance_to_surface,
    winding_number,
)
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions

TURN = rotation([1.0, 2.0, -0.5], 1.234)


def squeezed(*factors):
    vertices, faces = icosphere(3)
    return vertices * factors, faces


ZOO = {
    "sphere": icosphere(3),
    "torus": torus(),
    "two components": two_components(),
    "plate": squeezed(1.0, 0.8, 0.01),
    "rod": squeezed(1.0, 0.02, 0.02),
    "wire": torus(120, 6, 1.0, 0.02),
}


@pytest.fixture(params=ZOO)
def mesh(request):
    return Mesh(*ZOO[request.param])


def thirds(mesh):
    """Cut a mesh in three overlapping slices along x."""
    x = mesh.vertices[:, 0]
    place = (x - x.min()) / np.ptp(x)
    return Regions(mesh, np.array([place < 0.4, (place > 0.3) & (place < 0.7), place > 0.6]))


def around(mesh, rings):
    """Return a vertex and *rings* rings of its neighbours."""
    members = np.arange(mesh.n_vertices) == mesh.n_vertices // 3
    for _ in range(rings):
        members = members | (mesh.adjacency @ members > 0)
    return members


def assert_holds(cage, mesh, members):
    # `Cage` has checked that it is closed, outward and without self-intersections.
    assert (winding_number(mesh.vertices[members], cage.vertices, cage.faces) > 0.99).all()
    assert distance_to_cage(cage, mesh, members).min() > 1e-4 * np.ptp(cage.vertices, axis=0).max()
    assert roundness(cage.vertices, cage.faces).min() > 0.05


def distance_to_cage(cage, mesh, members):
    return distance_to_surface(mesh.vertices[members], cage.vertices, cage.faces)


@pytest.mark.parametrize("name", every(3, ZOO))
def test_a_cage_encloses_a_region_of_any_shape(name):
    mesh = Mesh(*ZOO[name])
    scattered = np.random.default_rng(3).random(mesh.n_vertices) < 0.02
    stripes = np.sin(20.0 * mesh.vertices[:, 0] / mesh.diagonal) > 0.0
    one, ring = around(mesh, 0), around(mesh, 1)
    for members, n_vertices in ((one, 8), (ring, 25), (scattered, 8), (stripes, 25)):
        cage = fit_cage(mesh, members, n_vertices)
        assert cage.n_vertices == n_vertices
        assert_holds(cage, mesh, members)


def test_a_cage_has_the_requested_offset():
    mesh = Mesh(*icosphere(3))
    for offset in (0.1, 0.3):
        cage = fit_cage(mesh, np.arange(mesh.n_vertices), 100, offset=offset)
        gap = distance_to_cage(cage, mesh, slice(None))
        assert gap.min() > 0.4 * offset
        assert gap.max() < 2.0 * offset
        assert gap.mean() == pytest.approx(offset, rel=0.35)


def every_other(mesh):
    return np.arange(mesh.n_vertices) % 2 == 0


@functools.cache
def every_other_caged(name):
    mesh = Mesh(*ZOO[name])
    return fit_cage(mesh, every_other(mesh), 30)


MOTIONS = [(TURN, 1.0, 0.0), (np.eye(3), 1.0, 1e4), (np.eye(3), 1e-3, 0.0), (TURN, 1e3, 0.0)]


@pytest.mark.parametrize(
    ("name", "turn", "scale", "shift"),
    every(3, [(name, *each) for each in MOTIONS for name in ("plate", "sphere", "two components")]),
)
def test_a_cage_moves_with_its_mesh(name, turn, scale, shift):
    mesh = Mesh(*ZOO[name])
    by = shift * mesh.diagonal * np.array([1.0, 0.5, -0.3])
    moved = Mesh(scale * mesh.vertices @ turn.T + by, mesh.faces)
    cage, same = every_other_caged(name), fit_cage(moved, every_other(moved), 30)
    assert_array_equal(same.faces, cage.faces)
    expected = scale * cage.vertices @ turn.T + by
    assert_allclose(same.vertices, expected, rtol=0, atol=1e-9 * scale * mesh.diagonal)


def test_the_last_resort_is_an_ellipsoid_and_logs_one_warning(mesh, monkeypatch, caplog):
    monkeypatch.setattr(fit, "_fault", lambda *_: "it is to fail")
    monkeypatch.setattr(fit, "_ATTEMPTS", 1)
    for members in (around(mesh, 0), around(mesh, 3)):
        caplog.clear()
        cage = fit_cage(mesh, members, 12)
        assert (winding_number(mesh.vertices[members], cage.vertices, cage.faces) > 0.99).all()
        assert cage.n_vertices == 12
        assert [record.levelname for record in caplog.records] == ["WARNING"]


@pytest.mark.parametrize("n", [4, 5, 8, 50])
def test_the_ellipsoid_of_a_patch_is_a_cage_around_it(mesh, n):
    patch = Patch.of(Surface.of(mesh), around(mesh, 2))
    cage = Cage(*patch.ellipsoid(n))
    assert cage.n_vertices == n
    assert cage.contains(patch.surface.points[patch.weights > 0]).all()


def test_invalid_arguments_are_errors():
    mesh = Mesh(*icosphere(2))
    with pytest.raises(CageError, match="24 to 1600, at least 8 for each of 3 regions; got 23"):
        fit_cages(mesh, thirds(mesh), 23)
    with pytest.raises(CageError, match="offset must be a positive length; got -1"):
        fit_cage(mesh, [0, 1, 2], 12, offset=-1.0)
    with pytest.raises(RegionError, match="members is empty"):
        fit_cage(mesh, np.zeros(mesh.n_vertices, dtype=bool), 12)


def test_progress_increases_to_one_and_can_cancel():
    mesh = Mesh(*icosphere(2))
    seen = []
    fit_cages(mesh, thirds(mesh), 60, progress=lambda fraction, _: seen.append(fraction))
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)

    def cancel(fraction, _):
        if fraction > 0.3:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        fit_cages(mesh, thirds(mesh), 60, progress=cancel)


def test_the_contour_is_exact_beyond_single_precision():
    x, y, z = np.indices((7, 8, 9)).astype(float)
    points, _ = contour_surface(x + 0.3 * y - 0.7 * z, 1.2345678901234)
    assert_allclose(points @ [1.0, 0.3, -0.7], 1.2345678901234, atol=1e-13)


def test_cavities_are_filled_and_islands_without_members_removed():
    values = np.full((20, 12, 12), 9.0)
    values[2:9, 2:9, 2:9] = 0.0
    values[4:7, 4:7, 4:7] = 9.0  # a cavity
    values[14:17, 3:6, 3:6] = 0.0  # an island
    filled, n_shells = _filled(values, 1.5, np.array([[3.2, 3.1, 2.9]]))
    expected = np.zeros(values.shape, dtype=bool)
    expected[2:9, 2:9, 2:9] = True
    assert_array_equal(filled < 1.5, expected)
    assert n_shells == 1
    assert _filled(values, 1.5, np.array([[3.0, 3.0, 3.0], [15.0, 4.0, 4.0]]))[1] == 2


def test_too_many_cage_vertices_are_an_error_before_any_work():
    mesh = Mesh(*icosphere(4))
    reports = []

    def progress(fraction, message):
        reports.append(message)

    with pytest.raises(CageError, match="n_vertices must be 24 to 1600, at least 8 for each of 3"):
        fit_cages(mesh, thirds(mesh), 5000, progress=progress)
    many = Regions.from_labels(mesh, np.arange(mesh.n_vertices) % 300, overlap=0)
    with pytest.raises(CageError, match=r"300 regions need 2400 .* use 200 regions or fewer"):
        fit_cages(mesh, many, 3000, progress=progress)
    assert reports == []


def test_regions_that_are_parts_get_twice_as_many_cage_vertices_as_whole_bodies():
    ball, faces = icosphere(1)
    at = 3.0 * np.stack(np.unravel_index(np.arange(12), (3, 2, 2)), axis=1)
    every = (np.arange(12)[:, None, None] * len(ball) + faces).reshape(-1, 3)
    balls = Mesh((at[:, None] + ball).reshape(-1, 3), every)
    bodies = Regions(balls, balls.components == np.arange(12)[:, None])
    assert_array_equal(bodies.components, np.eye(12, dtype=bool))
    assert suggested_size(bodies) == 12 * 15
    halves = np.array([ball[:, 0] < 0.3, ball[:, 0] > -0.3])
    masks = [np.kron(np.arange(12) == k, half) for k in range(12) for half in halves]
    assert suggested_size(Regions(balls, np.array(masks, dtype=bool))) == 24 * 30
    assert suggested_size(Regions.single(balls)) == 155


def test_the_regions_of_another_pose_are_fitted_at_this_one():
    mesh = Mesh(*icosphere(2))
    away = mesh.with_vertices(mesh.vertices + [100.0, 0.0, 0.0])
    (cage,) = fit_cages(mesh, Regions.single(away), 40)
    assert cage.contains(mesh.vertices).all()


@pytest.mark.parametrize("offset", [1e-13, 1e7, 0.0, np.nan])
def test_offsets_beyond_the_limits_are_refused(offset):
    mesh = Mesh(*icosphere(2))
    with pytest.raises(CageError, match="offset must be"):
        fit_cages(mesh, Regions.single(mesh), 40, offset=offset * mesh.diagonal)


def test_the_quality_of_a_cage_is_one_where_it_is_round_and_away_from_the_surface():
    mesh = Mesh(*icosphere(3))
    patch = Patch.of(Surface.of(mesh), np.ones(mesh.n_vertices, dtype=bool))
    field = solid_field(patch, 0.3, 0.1, most_nodes=3e5)
    ball, faces = icosphere(2)

    def quality(radius, faces=faces):
        return fit._quality(field.grid.to_nodes(radius * ball), faces, field)

    assert quality(1.4) >= 1.0
    assert quality(1.05) < quality(1.1) < 1.0
    close = distance_to_surface(mesh.vertices, 1.1 * ball, faces).min() / 0.3 / 0.2
    assert quality(1.1) == pytest.approx(close, rel=1e-6)
    far = field.grid.to_nodes(1.4 * ball)
    assert fit._fault(far, faces, field, len(ball)) == ""
    assert (
        fit._fault(field.grid.to_nodes(1.4 * ball), faces, field, 7) == "it has 66 vertices, not 7"
    )
    assert fit._fault(field.grid.to_nodes(0.9 * ball), faces, field, 66) == (
        "part of the region is outside"
    )
    assert "inside-out" in fit._fault(field.grid.to_nodes(1.4 * ball), faces[:, ::-1], field, 66)


def test_faces_too_close_are_moved_away_and_others_stay():
    mesh = Mesh(*icosphere(3))
    patch = Patch.of(Surface.of(mesh), np.ones(mesh.n_vertices, dtype=bool))
    field = solid_field(patch, 0.3, 0.1, most_nodes=3e5)
    ball, faces = icosphere(2)
    far = field.grid.to_nodes(1.4 * ball)
    assert_array_equal(fit._cleared(far, faces, field), far)
    cleared = field.grid.to_points(fit._cleared(field.grid.to_nodes(1.02 * ball), faces, field))
    assert_allclose(cleared / np.linalg.norm(cleared, axis=1, keepdims=True), ball, atol=0.05)
    assert distance_to_surface(mesh.vertices, cleared, faces).min() > 0.4 * 0.3
    assert np.linalg.norm(cleared, axis=1).max() < 1.35
