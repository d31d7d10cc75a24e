"""Volume constraints of meshes with several bodies: each body keeps its own volume."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtk_segdeform import models, sizes
from vtk_segdeform.cages import fit_cages
from vtk_segdeform.deformer import Deformer
from vtk_segdeform.geometry import lids_of, signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session
from vtk_segdeform.solver import Bodies, total_volume

BAR = models.bar(size=(0.2, 0.2, 1.0), divisions=(2, 2, 10))
BALL = models.sphere(162)


def joined(*parts: tuple[Mesh, float, float, int]) -> Mesh:
    """Return one mesh of parts, each (mesh, shift along x, scale, orientation)."""
    vertices, faces, count = [], [], 0
    for mesh, shift, scale, side in parts:
        vertices.append(mesh.vertices * scale + [shift, 0.0, 0.0])
        faces.append((mesh.faces if side > 0 else mesh.faces[:, ::-1]) + count)
        count += mesh.n_vertices
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def constraints_of(mesh: Mesh, moved=()):
    lids = lids_of(mesh)
    bodies = Bodies(mesh, total_volume(mesh, lids), lids)
    return bodies.constraints(bodies.numbers(np.array(moved, dtype=np.int64)))


def test_one_body_has_the_constraint_of_the_whole():
    bodies = Bodies(BAR, whole := total_volume(BAR), lids_of(BAR))
    assert bodies.constraints(bodies.numbers(np.arange(1))) == (whole,)


@pytest.mark.parametrize("count", [2, 6, 9])
def test_the_volumes_of_all_bodies_add_up_to_the_whole(count):
    mesh = joined(*((BALL, 3.0 * k, 1.0 + 0.1 * k, 1) for k in range(count)))
    found = constraints_of(mesh)
    assert len(found) == min(count, 7)
    each = signed_volume(BALL.vertices, BALL.faces) * (1.0 + 0.1 * np.arange(count)) ** 3
    assert_allclose([c.target for c in found][:6], each[::-1][:6], rtol=1e-12)
    assert_allclose(sum(c.target for c in found), total_volume(mesh).target, rtol=1e-12)


def test_a_moved_body_has_its_own_constraint_however_small():
    mesh = joined(*((BALL, 3.0 * k, 1.0 - 0.05 * k, 1) for k in range(10)))
    last = mesh.n_vertices - 1
    target = signed_volume(BALL.vertices, BALL.faces) * 0.55**3
    assert_allclose(constraints_of(mesh, [last])[5].target, target, rtol=1e-12)


def test_a_cavity_belongs_to_the_body_around_it():
    mesh = joined((BALL, 0.0, 1.0, 1), (BALL, 0.0, 0.5, -1), (BALL, 4.0, 0.8, 1))
    ball = signed_volume(BALL.vertices, BALL.faces)
    targets = [each.target for each in constraints_of(mesh)]
    assert_allclose(targets, [ball * (1 - 0.5**3), ball * 0.8**3], rtol=1e-12)


def test_splinters_share_the_constraint_of_the_largest_body():
    mesh = joined((BALL, 0.0, 1.0, 1), (BALL, 4.0, 0.01, 1), (BALL, 8.0, 0.02, 1))
    (only,) = constraints_of(mesh)
    assert_allclose(only.target, total_volume(mesh).target, rtol=1e-14)


@pytest.mark.parametrize("separate", [True, False])
def test_large_bodies_are_scaled_one_by_one_unless_a_cage_moves_two(separate, monkeypatch):
    for size in ("COARSE_VOLUME", "SCALED_VOLUME"):
        monkeypatch.setattr(sizes, size, 100)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 80)
    ball = models.sphere(66)
    mesh = joined((ball, 0.0, 1.0, 1), (ball, 5.0, 1.5, 1))
    regions = Regions.from_labels(mesh, mesh.components) if separate else Regions.single(mesh)
    deformer = Deformer(mesh, regions, fit_cages(mesh, regions, 30))
    first, last = int(mesh.vertices[:, 0].argmin()), int(mesh.vertices[:, 0].argmax())
    deformer = deformer.hold(fixed=[first], handle=[last])
    solution = deformer.solve(mesh.vertices[[last]] + [0.5, 0.0, 0.7])
    assert (deformer._constraints.preserved.scaled is not None) is separate
    assert_allclose(
        [c.relative(solution.vertices) for c in deformer.preserved_volumes], 0, atol=3e-15
    )
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)
    assert deformer.hold(handle=[first]).preserved_volumes is deformer.preserved_volumes
    assert_allclose(solution.vertices[first], mesh.vertices[first], atol=5e-3)


def test_pulling_one_body_changes_the_volume_of_none():
    mesh = joined((BAR, 0.0, 1.0, 1), (BAR, 0.6, 1.0, 1))
    labels = mesh.components
    regions = Regions.from_labels(mesh, labels, overlap=0)
    deformer = Deformer(mesh, regions, fit_cages(mesh, regions, 60))
    height, first = mesh.vertices[:, 2], mesh.components == 0
    foot = np.flatnonzero((height < height.min() + 0.1) & first)
    tip = np.flatnonzero((height > height.max() - 0.1) & first)
    targets = mesh.vertices[tip] + [0.1, 0.0, 0.3]
    solution = deformer.hold(fixed=foot, handle=tip).solve(targets)
    n = BAR.n_vertices
    for x in (solution.vertices[:n], solution.vertices[n:]):
        assert abs(signed_volume(x, BAR.faces) / signed_volume(BAR.vertices, BAR.faces) - 1) < 1e-13
    session = Session(mesh)
    session.set_regions(regions)
    session.set_cages(deformer.cages)
    session.set_fixed(foot)
    session.add_handle(tip, "tip")
    session.drag({"tip": targets}, max_steps=3)
    session.drag({"tip": targets + [0.0, 0.1, 0.0]}, max_steps=3)
    for x in (session.vertices[:n], session.vertices[n:]):
        assert abs(signed_volume(x, BAR.faces) / signed_volume(BAR.vertices, BAR.faces) - 1) < 1e-13


def test_a_direction_that_is_only_rounding_moves_nothing(monkeypatch):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 100)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 40)
    mesh = joined((models.sphere(400), 0.0, 1.0, 1), (models.sphere(20), 1.3, 0.15, 1))
    regions = Regions.single(mesh)
    deformer = Deformer(mesh, regions, fit_cages(mesh, regions, 40))
    low, high = int(mesh.vertices[:, 2].argmin()), int(mesh.vertices[:, 2].argmax())
    deformer = deformer.hold(fixed=[low], handle=[high])
    target = mesh.vertices[[high]] + [0.0, 0.0, 0.3]
    expected = deformer.solve(target).vertices
    places = deformer._constraints.places(deformer._frame.inward(target))
    result = deformer._path.solve(places, deformer._options)
    noise = 1e-20 * np.random.default_rng(1).normal(size=result.p.shape)  # of a vanishing volume
    result = replace(result, directions=(result.directions[0], noise))
    x = deformer._frame.in_scene(deformer._with_exact_volume(result)[0])
    changes = [each.relative(x) for each in deformer.preserved_volumes]
    assert_allclose(changes, [0.0, 0.0], atol=1e-12)
    assert_allclose(x, expected, atol=1e-3)
