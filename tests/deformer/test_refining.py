"""The finish of poses: by default in one call, on request by a deformer; what it keeps."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.deformer import deform, pull
from vtk_segdeform.errors import ArgumentError, Cancelled, ConstraintError, MeshError
from vtk_segdeform.geometry.distortion import distortion

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)
TARGETS = SCENE.mesh.vertices[SCENE.handle] + [0.0, 0.6, -0.6]
OPTIONS = {"n_regions": 1, "n_cage_vertices": 40}


def bent(refine=None, **named):
    options = {**OPTIONS, **named}
    return deform(SCENE.mesh, SCENE.fixed, SCENE.handle, TARGETS, refine=refine, **options)


def pulled(refine=None, **named):
    tip, options = int(SCENE.mesh.vertices[:, 0].argmax()), {**OPTIONS, **named}
    to = SCENE.mesh.vertices[tip] + [0.0, 0.0, 0.8]
    return pull(SCENE.mesh, tip, to, refine=refine, **options)


def pulled_apart(refine=None, **named):
    return pulled(refine, avoid_contact=True, **named)


@pytest.mark.parametrize("make", every(2, [bent, pulled_apart]))
def test_small_meshes_are_finished_and_large_ones_on_request(make, monkeypatch):
    plain, finished = make(False), make()
    assert distortion(SCENE.mesh, finished.vertices) < distortion(SCENE.mesh, plain.vertices)
    assert finished.handle_error < 1e-12
    assert abs(finished.volume_change) < 1e-12
    monkeypatch.setattr(sizes, "FINISHED", SCENE.mesh.n_vertices - 1)
    assert_array_equal(make().vertices, plain.vertices)
    assert_array_equal(make(True).vertices, finished.vertices)


@pytest.mark.parametrize("make", [bent, pulled])
def test_progress_is_about_the_share_of_the_time(make):
    """The solve begins after 23 to 75 % of it, the finish after 29 to 88 %, by the size."""
    for refine, begin in ((True, 0.4), (False, 0.4 / 0.6)):
        first, told = {}, []

        def tell(fraction, message, first=first, told=told):
            first.setdefault(message, fraction)
            told.append(fraction)

        make(refine, progress=tell)
        assert told == sorted(told)
        assert refine or told[-1] == 1.0
        assert first["measuring regions"] < 0.15
        assert first["solving"] == pytest.approx(begin)
        assert first.get("finishing on the mesh", 0.6) == pytest.approx(0.6)


def test_a_pose_that_cannot_be_finished_is_returned_as_it_is(monkeypatch):
    def factor(*_, **__):
        raise RuntimeError("Factor is exactly singular")

    monkeypatch.setattr("vtk_segdeform.finish.factor.splu", factor)
    assert_array_equal(bent().vertices, bent(False).vertices)
    with pytest.raises(MeshError, match="cannot be finished on this mesh: Factor is exactly"):
        bent(True)
    with pytest.raises(ArgumentError, match="refine"):
        bent("yes")


@pytest.mark.parametrize("handle", [[], np.zeros(SCENE.mesh.n_vertices, dtype=bool)])
def test_a_pose_without_a_handle_is_an_error(handle):
    with pytest.raises(
        ConstraintError,
        match=r"at least one vertex in handle, or goals for volumes; got none",
    ):
        deform(SCENE.mesh, SCENE.fixed, handle, [], **OPTIONS)


def test_the_finish_of_a_pull_moves_its_reach_only():
    mesh, tip = SCENE.mesh, int(np.argmax(SCENE.mesh.vertices[:, 0]))
    deformer = SCENE.held().hold(handle=[tip])
    x, size = mesh.vertices, mesh.diagonal
    pulled = deformer.local(tip, 0.2 * size, 0.05 * size)
    solution = pulled.solve(x[[tip]] + [0.0, 0.05 * size, 0.0])
    found = pulled.finish(solution)
    away = np.linalg.norm(x - x[tip], axis=1)
    moved = np.linalg.norm(found.vertices - solution.vertices, axis=1)
    assert moved[away > 0.23 * size].max() == 0.0
    assert moved[away < 0.04 * size].max() < 1e-5 * size
    assert moved.max() > 1e-4 * size
    assert abs(found.volume_change) < 1e-13


def test_a_pose_whose_volume_a_finish_would_lose_is_returned_as_it_is():
    held = np.setdiff1d(np.arange(SCENE.mesh.n_vertices), SCENE.handle)
    deformer = SCENE.held().hold(fixed=held, handle=SCENE.handle)
    solution = deformer.solve(SCENE.mesh.vertices[SCENE.handle] + [0.02, 0.0, 0.0])
    assert abs(solution.volume_change) < 1e-13
    assert deformer.finish(solution) is solution


def test_cancelling_at_any_step_changes_nothing_of_the_solution():
    deformer = SCENE.held()
    targets = SCENE.turned(40)
    solution = deformer.solve(targets)
    before, steps = solution.vertices.copy(), itertools.count()

    def cancel(fraction, text):
        assert 0.0 <= fraction <= 1.0
        assert text
        if next(steps) == 5:
            raise Cancelled

    with pytest.raises(Cancelled):
        deformer.finish(solution, progress=cancel)
    assert_array_equal(solution.vertices, before)
    finished = deformer.finish(solution)
    assert finished.handle_error < 1e-15
    assert finished.fixed_error == 0.0
    assert abs(finished.volume_change) < 1e-13
    assert_array_equal(finished.cage_vertices, solution.cage_vertices)
    assert finished.steps > solution.steps
    assert finished.status is solution.status
    assert_allclose(deformer.solve(targets).vertices, before, atol=1e-6)
    deformer.solve(SCENE.turned(10))
    with pytest.raises(ArgumentError, match="last solve"):
        deformer.finish(solution)
