"""Meshes are moved or scaled onto their exact volumes, in pieces, body by body, or on a GPU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.solver import exact_volume
from vtk_segdeform.solver.exact_volume import (
    ScaledSurface,
    are_met,
    scale_bodies,
    scale_to_volume,
)
from vtk_segdeform.solver.volume_constraints import VolumeConstraint, total_volume
from vtk_segdeform.subspace import Subspace
from vtk_segdeform.subspace.gpu import GPUError, GPUSurface

SCENE = sausage(2, is_coarse=True)
TARGETS = SCENE.turned(40)


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


SPHERES = [3.0, -2.0, 1.0], [-4.0, 0.0, 2.0], [0.0, 5.0, 0.0]


def bodies():
    """Return three balls, their constraints, and the body of each vertex."""
    ball, faces = icosphere(2)
    points = np.concatenate([ball + centre for centre in SPHERES])
    corners = [faces + k * len(ball) for k in range(3)]
    constraints = [VolumeConstraint(own, signed_volume(points, own)) for own in corners]
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
