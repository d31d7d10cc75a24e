"""Poses of a live drag are near converged ones, also while the body buckles."""

from __future__ import annotations

import numpy as np

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.cli.live_pulls import converged
from vtk_segdeform.session import Session


def test_every_pose_shown_is_within_a_hundredth_of_the_one_it_converges_to():
    mesh = models.torus(400)
    regions, height = sd.Regions.single(mesh), mesh.vertices[:, 2] / np.ptp(mesh.vertices[:, 2])
    cages = sd.fit_cages(mesh, regions, 40)
    deformer = sd.Deformer(mesh, regions, cages, fixed=height < -0.38, handle=height > 0.38)
    rest, worst, behind = mesh.vertices[deformer.handle], 0.0, 0.0
    for press in 0.4 * mesh.diagonal * np.arange(1, 9) / 8:
        targets = rest - [0.0, 0.0, press]
        pose = deformer.solve(targets, max_steps=8)
        assert abs(pose.volume_change) <= 1e-12
        at = targets if pose.targets is None else pose.targets
        final = deformer.copy().solve(at)
        behind = max(behind, float(np.linalg.norm(targets - at, axis=1).max()))
        worst = max(worst, float(np.linalg.norm(final.vertices - pose.vertices, axis=1).max()))
    print(f"{worst / mesh.diagonal:.1%} away, {behind / mesh.diagonal:.1%} behind the hand")
    assert worst < 0.01 * mesh.diagonal
    assert behind < 0.3 * mesh.diagonal


def test_a_drag_ends_without_a_jump_while_the_body_buckles():
    """The search for weights finds another minimum, 6 % of the diagonal away."""
    mesh = models.bar()
    regions, height = sd.segment(mesh), mesh.vertices[:, 2]  # 0 to 1
    cages = sd.fit_cages(mesh, regions, suggested_size(regions))
    deformer = sd.Deformer(mesh, regions, cages, fixed=height < 0.08, handle=height > 0.93)
    rest, worst = mesh.vertices[deformer.handle], 0.0
    for press in 0.3 * mesh.diagonal * np.arange(1, 35) / 40:
        targets = rest + [0.0, 0.0, -press]
        pose = deformer.solve(targets, max_steps=8)
        if press > 0.22 * mesh.diagonal:
            at = targets if pose.targets is None else pose.targets
            final = deformer.copy().solve(at)
            moved = np.linalg.norm(final.vertices - pose.vertices, axis=1).max()
            worst = max(worst, float(moved))
    print(f"{worst / mesh.diagonal:.2%} away")
    assert worst < 0.01 * mesh.diagonal


def test_a_fast_pull_shows_no_pose_that_a_step_with_an_old_matrix_took_for_converged():
    """In a soft body, poses of almost equal merit are far apart."""
    mesh, vertex = models.dinosaur(1000), 351
    preparation = Session(mesh).preparation()
    worst, shown, start = 0.0, 0, mesh.vertices[vertex]
    is_far = np.linalg.norm(mesh.vertices - start, axis=1) > 0.15 * mesh.diagonal
    for sense in (1.0, -1.0):
        session = Session(mesh)
        session.accept(preparation)
        session.pull(vertex, start, max_steps=1)
        for share in np.linspace(0.03, 0.3, 10):
            before = session.vertices
            to = start + [sense * share * mesh.diagonal, 0.0, 0.0]
            session.pull(vertex, to, max_steps=3)
            if session.vertices is not before:
                off = np.linalg.norm(converged(session, preparation) - session.vertices, axis=1)
                worst, shown = max(worst, float(off[is_far].max())), shown + 1
    print(f"{worst / mesh.diagonal:.2%} away in {shown} poses")
    assert shown > 9
    assert worst < 0.01 * mesh.diagonal
