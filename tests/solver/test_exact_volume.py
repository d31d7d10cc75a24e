"""The last operation of a solve: the mesh is moved or scaled onto its exact volume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere, rotation

from vtk_segdeform import sizes
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.segmentation import segment
from vtk_segdeform.solver import exact_volume
from vtk_segdeform.solver.exact_volume import (
    ScaledSurface,
    are_met,
    scale_bodies,
    scale_to_volume,
)
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.solver.volume_constraints import VolumeConstraint, total_volume
from vtk_segdeform.subspace import Subspace
from vtk_segdeform.subspace.gpu import GPUError, GPUSurface

SCENE = sausage(2, is_coarse=True)
TARGETS = SCENE.turned(40)
VOLUME = signed_volume(SCENE.mesh.vertices, SCENE.mesh.faces)


@pytest.fixture
def coarse(monkeypatch):
    """Compute the volume of small meshes over a coarse surface in each step, as of larger ones."""
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 250)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 175)


@pytest.fixture
def scaled(coarse, monkeypatch):
    """Scale small meshes to their volume, as large ones are."""
    monkeypatch.setattr(sizes, "SCALED_VOLUME", 250)


@pytest.mark.parametrize("missing", [-0.3, -1e-5, 1e-9, 0.4])
def test_scaling_restores_the_volume_and_keeps_the_centre(missing):
    points, faces = icosphere(3)
    points = points * [2.0, 1.0, 0.5] + [5.0, -3.0, 1.0]
    constraint = total_volume(Mesh(points, faces))
    x = points + 0.0
    x[:, 2] *= 1.0 + missing
    before, centre = x.copy(), x[7].copy()
    scale = scale_to_volume(constraint, x, centre)
    assert signed_volume(x, faces) / constraint.target == pytest.approx(1.0, abs=1e-14)
    assert scale**3 == pytest.approx(1.0 / (1.0 + missing), rel=1e-12)
    assert_allclose(x[7], centre, atol=1e-14)
    assert_allclose(x, centre + scale * (before - centre), atol=1e-13)


def test_a_surface_that_is_inside_out_stays_as_it_is():
    points, faces = icosphere(2)
    constraint = total_volume(Mesh(points, faces))
    mirrored = points * [1.0, 1.0, -1.0]
    x = mirrored.copy()
    assert scale_to_volume(constraint, x, np.zeros(3)) == 1.0
    assert_array_equal(x, mirrored)


@pytest.mark.usefixtures("coarse")
def test_a_mesh_with_a_coarse_volume_is_moved_onto_its_own_and_its_cages_with_it():
    deformer = SCENE.deformer()
    solution = deformer.solve(TARGETS)
    assert solution.status is Status.CONVERGED
    assert abs(signed_volume(solution.vertices, SCENE.mesh.faces) / VOLUME - 1.0) < 1e-14
    assert abs(solution.volume_change) < 1e-14
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)


@pytest.mark.usefixtures("scaled")
def test_a_large_mesh_is_scaled_and_its_cages_with_it():
    deformer = SCENE.deformer()
    solution = deformer.solve(TARGETS)
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-14
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)
    assert deformer._path.solver.volumes.constraints[0].target != pytest.approx(
        deformer.step_volumes.constraints[0].target, rel=1e-9
    )  # the coarse volume of the pose in which the mesh has its own


@pytest.mark.usefixtures("scaled")
def test_a_scaled_pose_does_not_depend_on_the_poses_before():
    direct = SCENE.deformer().solve(TARGETS)
    deformer = SCENE.deformer()
    for degrees in (-30.0, 10.0, 60.0, 50.0):
        assert abs(deformer.solve(SCENE.turned(degrees), max_steps=2).volume_change) < 1e-13
    there = deformer.solve(TARGETS)
    deformer.resume(there.cage_vertices, TARGETS)
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


@pytest.mark.campaign
@pytest.mark.usefixtures("scaled")
def test_a_rotated_and_shifted_scene_is_scaled_alike():
    turn, shift = rotation([1.0, 2.0, 3.0], 1.1), np.array([300.0, -20.0, 7.0])
    here = SCENE.deformer().solve(TARGETS)
    there = SCENE.transformed(turn, 0.5, shift).deformer().solve(0.5 * TARGETS @ turn.T + shift)
    assert abs(there.volume_change) < 1e-13
    assert_allclose(there.vertices, 0.5 * here.vertices @ turn.T + shift, atol=1e-7)


@pytest.mark.usefixtures("scaled")
def test_volumes_of_regions_are_restored_one_by_one():
    solution = SCENE.deformer(preserve_region_volumes=True).solve(TARGETS)
    assert np.abs(solution.region_volume_change).max() < 1e-12


@pytest.mark.usefixtures("scaled")
def test_a_gpu_and_the_processor_give_the_same_mesh(monkeypatch):
    here = SCENE.deformer().solve(TARGETS)
    monkeypatch.setattr(exact_volume, "gpu_arrays", lambda: np)  # the lines that a GPU runs
    used = []
    monkeypatch.setattr(
        GPUSurface,
        "map",
        lambda *given, plain=GPUSurface.map: used.append(1) or plain(*given),
    )
    there = SCENE.deformer().solve(TARGETS)
    assert used
    assert_allclose(there.vertices, here.vertices, rtol=0, atol=1e-12)
    assert abs(there.volume_change) < 1e-14


@pytest.mark.usefixtures("scaled")
@pytest.mark.parametrize("when", every(4, ["map", "__init__", "scale_to_volume", "host"]))
def test_after_a_failure_of_the_gpu_the_processor_is_used(monkeypatch, when):
    here = SCENE.deformer().solve(TARGETS)
    monkeypatch.setattr(exact_volume, "gpu_arrays", lambda: np)

    def failing(*_):
        raise GPUError("out of memory")

    monkeypatch.setattr(GPUSurface, when, failing)
    deformer = SCENE.deformer()
    there = deformer.solve(TARGETS)
    assert_array_equal(there.vertices, here.vertices)
    assert deformer._constraints.preserved.scaled._gpu is None


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
    coarse = held.step_volumes.constraints
    assert min(abs(each.target) for each in coarse) < 1e-3 * max(
        abs(each.target) for each in coarse
    )
    solution = held.solve(x[handle] @ rotation([0.0, 1.0, 0.0], 0.5).T)
    for body in held.preserved_volumes:
        assert abs(body.relative(solution.vertices)) < 1e-13


SPHERES = [3.0, -2.0, 1.0], [-4.0, 0.0, 2.0], [0.0, 5.0, 0.0]


def bodies():
    """Return three balls, their constraints, and the body of each vertex."""
    ball, faces = icosphere(2)
    points = np.concatenate([ball + centre for centre in SPHERES])
    corners = [faces + k * len(ball) for k in range(3)]
    constraints = [
        VolumeConstraint(own, signed_volume(points, own)) for own in corners
    ]
    return points, constraints, np.repeat(np.arange(3), len(ball))


def test_bodies_are_scaled_about_their_own_centres_each_to_its_volume(monkeypatch):
    monkeypatch.setattr(exact_volume, "_CACHED", 50)  # several pieces
    points, constraints, body = bodies()
    factors, centres = np.array([0.7, 1.4, 1.0]), np.array(SPHERES) + [0.1, 0.2, 0.3]
    wrong = centres[body] + (points - centres[body]) / factors[body, None]
    x = wrong.copy()
    assert_allclose(scale_bodies(constraints, x, body, centres), factors, rtol=1e-12)
    assert_allclose(x, points, atol=1e-12)
    assert are_met(constraints, x)
    assert not are_met(constraints, wrong)


def test_bodies_that_are_inside_out_or_enclose_nothing_stay():
    points, constraints, body = bodies()
    x = points.copy()
    x[body == 0, 0] *= -1.0
    constraints[1] = VolumeConstraint(constraints[1].faces, 0.0)
    before = x.copy()
    scales = scale_bodies(constraints, x, body, np.array(SPHERES))
    assert_allclose(scales, 1.0, rtol=1e-12)
    assert_allclose(x, before, atol=1e-12)


def test_a_large_mesh_is_moved_and_scaled_in_pieces_alike(monkeypatch):
    points, faces = icosphere(3)
    constraint, centre = total_volume(Mesh(points, faces)), np.array([0.3, -0.2, 0.1])
    paths, t = np.hstack([points, points[:, ::-1], points**2]), np.array([0.3, -0.7])
    expected = points + 0.3 * points[:, ::-1] - 0.7 * points**2
    for size in (7, 1 << 14):
        monkeypatch.setattr(exact_volume, "_CACHED", size)
        assert_allclose(exact_volume.moved_along(paths, t), expected, atol=1e-15)
        x = 0.8 * points
        scale = scale_to_volume(constraint, x, centre)
        assert scale == pytest.approx(1.25, rel=1e-12)
        assert_allclose(x, centre + 1.25 * (0.8 * points - centre), atol=1e-12)


def test_a_surface_of_bodies_needs_a_cage_of_its_own_for_each():
    points, constraints, body = bodies()
    subspace = Subspace(
        len(points),
        (np.flatnonzero(body != 1), np.flatnonzero(body == 1)),
        (np.ones((132, 4)) / 4.0, np.ones((66, 2)) / 2.0),
    )
    assert ScaledSurface.of(subspace, points, constraints, body) is None
    two = np.where(body == 1, 1, 0)  # the first and the last as one body
    surface = ScaledSurface.of(subspace, points, constraints[:2], two)
    assert_array_equal(surface.body_of_column, [0, 0, 0, 0, 1, 1])
    expected = [points[two == k].mean(axis=0) for k in range(2)]
    assert_allclose(surface.middles, expected, atol=1e-14)
    empty = replace(subspace, rows=(subspace.rows[0][:0], subspace.rows[1]),
                    blocks=(np.empty((0, 4)), subspace.blocks[1]))  # fmt: skip
    own = ScaledSurface.of(empty, points, constraints, body)
    assert_array_equal(own.body_of_column, [0, 0, 0, 0, 1, 1])
