"""What a solution tells about its pose is measured on that pose."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from scenes import sausage
from solids import rotation, torus

from vtk_segdeform import models
from vtk_segdeform.cages import fit_cages
from vtk_segdeform.deformer.deform import deform
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.finish import finisher
from vtk_segdeform.geometry import turned_over
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.models.implicit import Limb, implicit_surface
from vtk_segdeform.regions import Regions, segment
from vtk_segdeform.solver import CONVERGED, Status, newton

SCENE = sausage(2, is_coarse=True)
D = SCENE.mesh.diagonal
NEAR = 1e-3  # diagonals: what a converged pose may still move


def bent_sausage():
    return SCENE.held(), SCENE.turned(50)


def bent_bar():
    mesh = models.bar(size=(0.2, 0.2, 1.0), divisions=(2, 2, 10))
    z, regions = mesh.vertices[:, 2], segment(mesh, 2)
    fixed, handle = np.flatnonzero(z < 0.05), np.flatnonzero(z > 0.95)
    cages = fit_cages(mesh, regions, 90)
    deformer = Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    x = mesh.vertices[handle]
    return deformer, np.stack([x[:, 2] - 0.3, x[:, 1], 0.7 - x[:, 0]], axis=1)


def pulled_sausage():
    tip = int(SCENE.mesh.vertices[:, 0].argmax())
    deformer = SCENE.held().hold(fixed=SCENE.fixed, handle=[tip]).local(tip, 0.3 * D, 0.1 * D)
    return deformer, SCENE.mesh.vertices[[tip]] + 0.1 * D * np.array([-1.0, 0.2, 1.0])


def bent_snake():
    """Return a thin body, whose finish has far to go."""
    points = [(0.25 * k, 0.12 * np.sin(1.1 * k), 0.05 * np.cos(2.0 * k)) for k in range(9)]
    limb = Limb(points, [0.09] * 9)
    box = np.array([[-0.4, -0.5, -0.5], [2.4, 0.5, 0.5]])
    mesh = implicit_surface(limb, box, 900)
    x = mesh.vertices[:, 0]
    fixed, handle = np.flatnonzero(x < 0.15), np.flatnonzero(x > 1.85)
    regions = segment(mesh, 3)
    cages = fit_cages(mesh, regions, 90)
    turn = rotation([0.3, 1.0, 0.2], 1.4)
    at = mesh.vertices[handle]
    deformer = Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    return deformer, (at - [1.0, 0.0, 0.0]) @ turn.T + [1.0, 0.0, 0.0]


BENT = [bent_sausage, bent_bar, bent_snake, pulled_sausage]
made = functools.cache(lambda bent: bent())


def moved(a, b) -> float:
    """Return the largest distance of a vertex in two solutions, in diagonals."""
    diagonal = np.linalg.norm(np.ptp(a.vertices, axis=0))  # about that at rest
    return float(np.linalg.norm(a.vertices - b.vertices, axis=1).max() / diagonal)


@functools.cache
def finished(bent):
    """Return a deformer, and its solutions finished again until that is of no use."""
    deformer, targets = made(bent)
    deformer = deformer.copy()
    solutions = [deformer.solve(targets)]
    while len(solutions) < 40:
        solutions.append(deformer.finish(solutions[-1]))
        if solutions[-1].status is not Status.STEP_LIMIT:
            break
    return deformer, solutions


@pytest.mark.parametrize("bent", every(2, BENT))
def test_one_finish_converges_and_finishing_again_hardly_moves_the_pose(bent, monkeypatch):
    deformer, solutions = finished(bent)
    last = again = solutions[-1]
    assert last.status is Status.CONVERGED
    assert last.is_finished
    assert len(solutions) == 2
    monkeypatch.setattr(finisher, "_TOLERANCE", 1e-9)  # else it ends before its first step
    for _ in range(3):
        again = deformer.finish(again)
        assert again.status is Status.CONVERGED
    assert moved(again, last) < NEAR


@pytest.mark.parametrize("bent", every(1, BENT))
def test_a_converged_pose_of_the_cages_hardly_moves_if_another_deformer_solves_from_it(bent):
    deformer, targets = made(bent)
    solution = deformer.copy().solve(targets)
    assert solution.status is Status.CONVERGED
    assert not solution.is_finished
    assert 0.0 <= solution.remaining <= CONVERGED
    other = deformer.copy()
    other.resume(solution.cage_vertices, targets)
    assert moved(other.solve(targets), solution) < NEAR


def test_missed_handles_are_told_before_all_else(monkeypatch):
    deformer, solutions = finished(bent_sausage)
    monkeypatch.setattr("vtk_segdeform.deformer.deformer._MET", -1.0)
    assert deformer.finish(solutions[-1]).status is Status.MISSED


def test_a_finish_that_cannot_move_the_pose_stalls(monkeypatch):
    deformer, (solution, _) = finished(bent_snake)
    monkeypatch.setattr(finisher, "_STEPS", 1)
    first = deformer.finish(solution)
    monkeypatch.setattr(newton, "_lower", lambda *_: None)
    again = deformer.finish(first)
    assert_array_equal(again.vertices, first.vertices)
    assert again.status is Status.STALLED


# Folds


BALL = models.sphere(300)


def pulled_across(mesh: Mesh, vertex: int) -> np.ndarray:
    """Return the vertices with one of them beyond a neighbour, in the surface."""
    x = mesh.vertices.copy()
    beside = x[mesh.adjacency[[vertex]].indices[0]]
    x[vertex] = beside + (beside - x[vertex])
    return x


@pytest.mark.parametrize("vertex", [0, 7, 100])
def test_triangles_that_a_pose_turns_over_are_folds(vertex):
    folded = turned_over(pulled_across(BALL, vertex), BALL.vertices, BALL.faces)
    assert 1 <= len(folded) <= 4
    at_vertex = (BALL.faces == vertex).any(axis=1)
    assert at_vertex[folded].all()


def test_folds_do_not_depend_on_the_motion_of_the_whole():
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    here = pulled_across(BALL, 7)
    there = 30.0 * here @ turn.T + [5.0, 0.0, 1.0]
    expected = turned_over(here, BALL.vertices, BALL.faces)
    assert_array_equal(turned_over(there, BALL.vertices, BALL.faces), expected)
    assert not len(turned_over(BALL.vertices @ turn.T, BALL.vertices, BALL.faces))


def test_what_is_folded_at_rest_is_none_and_opened_again_is_one():
    folded = pulled_across(BALL, 7)
    assert not len(turned_over(folded, folded, BALL.faces))
    assert len(turned_over(BALL.vertices, folded, BALL.faces))


@pytest.mark.parametrize("degrees", [90, 180, 350])
def test_a_bend_is_no_fold_however_far_it_goes(degrees):
    bar = models.bar(size=(0.04, 0.2, 1.0), divisions=(2, 4, 60))
    x, y, z = bar.vertices.T
    angle, radius = z * np.radians(degrees), 1.0 / np.radians(degrees)
    at = radius - x
    bent = np.stack([radius - at * np.cos(angle), y, at * np.sin(angle)], axis=1)
    assert not len(turned_over(bent, bar.vertices, bar.faces))


def test_needles_and_flat_triangles_are_no_folds():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.5, 0.0]], dtype=float)
    faces = np.array([[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4], [0, 4, 4]])
    assert not len(turned_over(x, x, faces))
    flat = x.copy()
    flat[4] = [0.5, 0.0, 0.0]  # the first triangle has no area in this pose
    assert not len(turned_over(flat, x, faces))


# Parts that nothing moves


def arm_and_ring(links: bool) -> Deformer:
    """Return a bar through a ring; the ring shares a region with it, if *links*."""
    bar = models.bar(size=(0.1, 0.1, 1.0), divisions=(2, 2, 20))
    ring, faces = torus(16, 8, 0.2, 0.05)
    x = np.concatenate([bar.vertices, ring + [0.0, 0.0, 0.5]])
    mesh = Mesh(x, np.concatenate([bar.faces, faces + bar.n_vertices]))
    of_bar = mesh.components == 0
    masks = [np.ones(mesh.n_vertices, dtype=bool)] if links else [of_bar, ~of_bar]
    regions = Regions.from_masks(mesh, np.array(masks))
    z = mesh.vertices[:, 2]
    ends = of_bar & (z < 0.05), of_bar & (z > 0.95)
    return Deformer(mesh, regions, fit_cages(mesh, regions, 80), fixed=ends[0], handle=ends[1])


def test_a_part_that_no_handle_moves_is_named():
    deformer = arm_and_ring(links=False)
    mesh, rest = deformer.mesh, deformer.mesh.vertices
    solution = deformer.solve(rest[deformer.handle] + [0.3, 0.0, -0.1])
    assert_array_equal(solution.unmoved, [1])
    stays = mesh.components == 1
    assert np.abs(solution.vertices - rest)[stays].max() < 1e-12
    count = np.count_nonzero(stays)
    expected = (
        f"part 2 ({count} vertices) has no handle and no fixed vertices: it stays where it is"
    )
    assert solution.unmoved_summary(mesh) == expected
    assert deformer.finish(solution).unmoved_summary(mesh) == expected
    many = replace(solution, unmoved=np.arange(6))
    assert many.unmoved_summary(mesh).startswith("parts 1, 2, 3 and 3 more (")
    assert many.unmoved_summary(mesh).endswith("they stay where they are")


def test_ends_that_are_put_into_each_other_cross_and_are_told_if_contact_is_avoided():
    mesh = models.bar(size=(0.2, 0.2, 1.0), divisions=(2, 2, 7))
    x = mesh.vertices
    fixed, handle = np.flatnonzero(x[:, 2] < 0.05), np.flatnonzero(x[:, 2] > 0.95)
    for shift, avoids, status in [
        (-0.05, True, Status.CONVERGED),
        (-0.9, True, Status.CROSSED),
        (-0.9, False, Status.CONVERGED),
    ]:
        to = x[handle] + [0.0, 0.0, shift]
        few = {"n_regions": 1, "n_cage_vertices": 20, "avoid_contact": avoids}
        pose = deform(mesh, fixed, handle, to, **few)
        assert pose.status is status
        assert (len(pose.crossings()) > 0) is (shift == -0.9)
