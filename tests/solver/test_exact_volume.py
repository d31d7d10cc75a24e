"""The last operation of a solve: the mesh is moved or scaled onto its exact volume."""

from __future__ import annotations

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
from vtk_segdeform.solver.exact_volume import scale_to_volume
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.solver.volume_constraints import total_volume
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
