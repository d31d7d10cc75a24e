"""Poses have exact volumes: small meshes are moved onto them, large ones scaled, with cages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import joined, sausage
from solids import icosphere, rotation

from vtk_segdeform import models, sizes
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions import Regions, segment
from vtk_segdeform.solver.solution import Status

SCENE = sausage(2, is_coarse=True)
TARGETS = SCENE.turned(40)
VOLUME = signed_volume(SCENE.mesh.vertices, SCENE.mesh.faces)


@pytest.mark.usefixtures("coarse")
def test_a_mesh_with_a_coarse_volume_is_moved_onto_its_own_and_its_cages_with_it():
    deformer = SCENE.deformer()
    solution = deformer.solve(TARGETS)
    assert solution.status is Status.CONVERGED
    assert abs(signed_volume(solution.vertices, SCENE.mesh.faces) / VOLUME - 1.0) < 1e-14
    assert abs(solution.volume_change) < 1e-14
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)
    assert deformer._constraints.preserved.scaled is None


@pytest.mark.usefixtures("scaled")
def test_a_large_mesh_is_scaled_and_its_cages_with_it():
    deformer = SCENE.deformer()
    assert deformer._constraints.preserved.scaled is not None
    solution = deformer.solve(TARGETS)
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-14
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)
    assert deformer._path.solver.volumes.constraints[0].target != pytest.approx(
        deformer._constraints.preserved.volumes.constraints[0].target, rel=1e-9
    )  # the coarse volume of the pose in which the mesh has its own


@pytest.mark.usefixtures("scaled")
def test_a_scaled_pose_does_not_depend_on_the_poses_before():
    direct = SCENE.deformer().solve(TARGETS)
    deformer = SCENE.deformer()
    for degrees in (-30.0, 10.0, 60.0, 50.0):
        assert abs(deformer.solve(SCENE.turned(degrees), max_steps=2).volume_change) < 1e-13
    there = deformer.solve(TARGETS)
    deformer.resume(there.cage_vertices, TARGETS)
    steps = deformer._path.solver.volumes  # which go on preserving the coarse volume of this pose
    at = steps.surface.map(deformer._path.p)
    assert max(abs(each.relative(at)) for each in steps.constraints) < 1e-12
    resumed = deformer.solve(TARGETS)
    for other in (there, resumed):
        away = np.linalg.norm(other.vertices - direct.vertices, axis=1).max()
        assert away < 1e-4 * SCENE.mesh.diagonal
    deformer.reset()
    assert_array_equal(deformer.solve(TARGETS).vertices, direct.vertices)


@pytest.mark.usefixtures("scaled")
def test_a_scaled_pose_is_near_that_with_the_whole_mesh(monkeypatch):
    by_size = SCENE.deformer().solve(TARGETS)
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 10**9)
    whole = SCENE.deformer().solve(TARGETS)
    away = np.linalg.norm(by_size.vertices - whole.vertices, axis=1).max()
    assert away < 3e-3 * SCENE.mesh.diagonal


@pytest.mark.usefixtures("scaled")
def test_volumes_of_regions_are_restored_one_by_one():
    solution = SCENE.deformer(preserve_region_volumes=True).solve(TARGETS)
    assert np.abs(solution.region_volume_change).max() < 1e-12


def test_bodies_whose_coarse_volume_vanishes_keep_theirs(monkeypatch):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 250)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 40)
    plate, faces = icosphere(2)
    plate = plate * [1.5, 0.6, 0.05]  # a dozen points of both sides enclose nothing
    count = 4
    at = np.arange(count)[:, None, None] * [0.0, 1.0, 0.02]
    vertices = (plate + at).reshape(-1, 3)
    mesh = Mesh(vertices, (np.arange(count)[:, None, None] * len(plate) + faces).reshape(-1, 3))
    deformer = Deformer(mesh, regions := segment(mesh, 1), fit_cages(mesh, regions, 40))
    x = mesh.vertices
    fixed, handle = np.flatnonzero(x[:, 0] < -1.0), np.flatnonzero(x[:, 0] > 1.0)
    held = deformer.hold(fixed=fixed, handle=handle)
    coarse = held._constraints.preserved.volumes.constraints
    assert min(abs(each.target) for each in coarse) < 1e-3 * max(
        abs(each.target) for each in coarse
    )
    solution = held.solve(x[handle] @ rotation([0.0, 1.0, 0.0], 0.5).T)
    for body in held.preserved_volumes:
        assert abs(body.relative(solution.vertices)) < 1e-13


@pytest.mark.parametrize(("separate", "shift"), [(True, 1e3), (False, 0.0)])
def test_large_bodies_are_scaled_one_by_one_unless_a_cage_moves_two(separate, shift, monkeypatch):
    for size in ("COARSE_VOLUME", "SCALED_VOLUME"):
        monkeypatch.setattr(sizes, size, 100)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 80)
    ball = models.sphere(66)
    mesh = joined((ball, 0.0, 1.0, 1), (ball, 5.0, 1.5, 1))
    mesh = mesh.with_vertices(mesh.vertices + shift)
    rounding = 3e-15 + 2.0**-52 * shift
    regions = Regions.from_labels(mesh, mesh.components) if separate else Regions.single(mesh)
    deformer = Deformer(mesh, regions, fit_cages(mesh, regions, 30))
    first, last = int(mesh.vertices[:, 0].argmin()), int(mesh.vertices[:, 0].argmax())
    deformer = deformer.hold(fixed=[first], handle=[last])
    solution = deformer.solve(mesh.vertices[[last]] + [0.5, 0.0, 0.7])
    assert (deformer._constraints.preserved.scaled is not None) is separate
    if separate:  # about the fixed vertex and the middle of the body without one
        centres = deformer._constraints.anchors + deformer._problem.frame.centre
        middle = mesh.vertices[mesh.components == mesh.components[last]].mean(axis=0)
        expected = [mesh.vertices[first], middle]
        assert_allclose(centres[np.argsort(centres[:, 0])], expected, atol=1e-6 + rounding)
    assert_allclose(
        [c.relative(solution.vertices) for c in deformer.preserved_volumes], 0, atol=rounding
    )
    there = deformer.surface(solution.cage_vertices)
    assert_allclose(there, solution.vertices, rtol=0, atol=1e-13 + rounding)
    assert deformer.hold(handle=[first]).preserved_volumes is deformer.preserved_volumes
    assert_allclose(solution.vertices[first], mesh.vertices[first], atol=5e-3)


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
    goal = deformer._problem.frame.inward(target)
    result = deformer._path.solve(goal, deformer._limits).result
    noise = 1e-20 * np.random.default_rng(1).normal(size=result.p.shape)  # of a vanishing volume
    result = replace(result, directions=(result.directions[0], noise))
    x = deformer._problem.frame.in_scene(deformer._path._with_exact_volume(result)[0])
    changes = [each.relative(x) for each in deformer.preserved_volumes]
    assert_allclose(changes, [0.0, 0.0], atol=1e-12)
    assert_allclose(x, expected, atol=1e-3)
