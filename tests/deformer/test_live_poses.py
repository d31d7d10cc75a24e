"""Poses of a live drag are near converged ones, also while the body buckles."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.benchmarks.drags import converged
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.session import Session


def farthest(a, b):
    return float(np.linalg.norm(a - b, axis=1).max())


def held_at_its_ends(mesh: sd.Mesh, share: float = 0.1) -> sd.Deformer:
    """Return a deformer that holds the lower end of a standing body and moves the upper one."""
    height = mesh.vertices[:, 2] - mesh.vertices[:, 2].min()
    height /= height.max()
    regions = sd.segment(mesh)
    cages = sd.fit_cages(mesh, regions, suggested_size(regions))
    return sd.Deformer(mesh, regions, cages, fixed=height < share, handle=height > 1.0 - share)


def bar() -> sd.Mesh:
    return models.bar(divisions=(4, 4, 16))


@pytest.mark.parametrize(
    "body", every(2, [functools.partial(models.cactus, 600), bar]), ids=["cactus", "bar"]
)
def test_every_frame_of_a_drag_is_near_the_pose_it_converges_to(body):
    mesh = body()
    deformer, worst = held_at_its_ends(mesh), 0.0
    rest, pivot = mesh.vertices[deformer.handle], mesh.vertices.mean(axis=0)
    for k, degrees in enumerate([*range(4, 84, 4), *range(76, -50, -8)]):
        bend = Rotation.from_rotvec([np.radians(degrees), 0.0, np.radians(0.3 * degrees)])
        targets = bend.apply(rest - pivot) + pivot
        pose = deformer.solve(targets, max_steps=3)
        assert abs(pose.volume_change) <= 1e-12
        assert pose.handle_error < 1e-3
        if k % 3 == 0:
            worst = max(worst, farthest(deformer.copy().solve(targets).vertices, pose.vertices))
    print(f"{worst / mesh.diagonal:.1e} away")
    assert worst < 5e-3 * mesh.diagonal


@pytest.mark.campaign  # test_deform winds a body up
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_twist_to_270_degrees_and_back_never_jumps(sense):
    mesh = bar()
    deformer, last = held_at_its_ends(mesh), mesh.vertices
    rest = mesh.vertices[deformer.handle]
    middle = mesh.vertices.mean(axis=0)
    for degrees in [*range(5, 275, 5), *range(265, -5, -5)]:
        turn = Rotation.from_rotvec([0.0, 0.0, np.radians(sense * degrees)])
        pose = deformer.solve(turn.apply(rest - middle) + middle, max_steps=8)
        assert farthest(pose.vertices, last) < 0.03 * mesh.diagonal, f"at {degrees} degrees"
        assert abs(pose.volume_change) <= 1e-12
        last = pose.vertices
    # A frame ends with a step of 1e-5 mesh sizes, root mean square; at the slowest rate at which
    # steps go on, 0.8, those that would follow move the mesh by 5 times as much.
    assert farthest(last, mesh.vertices) < 6e-5 * mesh.diagonal


@pytest.mark.campaign  # frames of a pull are compared in test_locality as well
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_pull_of_a_soft_body_keeps_the_point_and_follows(sense):
    """Where it buckles, poses of almost equal merit are far apart, and frames lag behind."""
    mesh, vertex = models.dinosaur(1000), 351
    preparation = Session(mesh).preparation()
    worst, start = 0.0, mesh.vertices[vertex]
    session = Session(mesh)
    session.accept(preparation)
    session.pull(vertex, start, max_steps=1)
    for share in np.linspace(0.03, 0.3, 8):
        to = start + [sense * share * mesh.diagonal, 0.0, 0.0]
        session.pull(vertex, to, max_steps=8)
        assert np.linalg.norm(session.vertices[vertex] - to) < 1e-4 * mesh.diagonal
        if share > 0.15:
            worst = max(worst, farthest(converged(session, preparation), session.vertices))
    print(f"{worst / mesh.diagonal:.2%} away")
    assert worst < 0.02 * mesh.diagonal
