"""The way to a pose: waypoints, the goal, and the scaling of large meshes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation

from vtk_segdeform.deformer.path import Path
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.solver import Contact, SolverOptions, Status, waypoints

SCENE = sausage(2, is_coarse=True)
OPTIONS = SolverOptions(tolerance=1e-6, max_steps=400)


@pytest.fixture
def solves(monkeypatch):
    """Return the list of minimisations: targets, options and result of each."""
    solves, minimise = [], Path._minimise

    def remembered(self, targets, options):
        result = minimise(self, targets, options)
        solves.append((targets, options, result))
        return result

    monkeypatch.setattr(Path, "_minimise", remembered)
    return solves


def begun(degrees, **volumes):
    """Return a path at rest, and a goal *degrees* away."""
    deformer = SCENE.held(**volumes)
    return deformer._path, deformer._problem.frame.inward(SCENE.turned(degrees))


def test_a_far_goal_is_reached_by_rough_solves_for_its_waypoints(solves):
    path, goal = begun(100)
    start, told = path.targets, []
    way = waypoints(start, goal, path.constraints.handles)
    pose = path.solve(goal, SolverOptions(1e-6, 400, lambda share, _: told.append(share)))
    assert len(solves) == len(way) > 3
    for (targets, _, _), expected in zip(solves, way, strict=True):
        assert_array_equal(targets, expected)
    *rough, last = [(options.tolerance, options.max_steps) for _, options, _ in solves]
    assert last == (1e-6, 400)
    assert set(rough) == {(1e-3, 12)}
    assert pose.steps == sum(result.steps for *_, result in solves) > pose.result.steps > 0
    assert len(told) > pose.steps  # before each step, also toward waypoints
    assert path.targets is goal
    nearer, count = path.constraints.problem.frame.inward(SCENE.turned(95)), len(solves)
    path.solve(nearer, OPTIONS)
    assert len(solves) == count + 1  # from there on, not from rest


LIVE = SolverOptions(tolerance=1e-6, max_steps=8)


def test_a_live_solve_stops_on_its_way_and_the_next_one_goes_on_from_there(solves):
    path, goal = begun(170)
    way = waypoints(path.targets, goal, path.constraints.handles)
    poses = [path.solve(goal, LIVE, is_live=True)]
    while path.way:
        assert poses[-1].result.status is Status.STEP_LIMIT
        poses.append(path.solve(goal, LIVE, is_live=True))
    assert len(poses) > 2
    assert max(pose.steps for pose in poses) < 2 * LIVE.max_steps
    assert sum(pose.steps for pose in poses) == sum(result.steps for *_, result in solves)
    assert len(solves) == len(way)
    for (targets, _, _), expected in zip(solves, way, strict=True):
        np.testing.assert_allclose(targets, expected, atol=1e-12)
    full, _ = begun(170)
    end, other = path.solve(goal, OPTIONS), full.solve(goal, OPTIONS)
    np.testing.assert_allclose(end.x, other.x, atol=1e-4)


@pytest.mark.parametrize(
    ("goals", "way"), [([90, 180, 270], [30.0, 60.0, 90.0]), ([90, -60], [30.0, 0.0])]
)
def test_goals_that_wind_a_handle_up_are_passed_and_others_are_left_out(goals, way, solves):
    """Faster than live solves follow, of which each gets one waypoint farther."""
    path, start = begun(0)
    frame = path.constraints.problem.frame

    def angle():
        turns = [
            rigid_fit(a, b)[0] for a, b in itertools.pairwise([start, *[t for t, *_ in solves]])
        ]
        return np.degrees(sum(Rotation.from_matrix(R).as_rotvec()[0] for R in turns))

    angles = []
    for degrees in goals:
        goal = frame.inward(SCENE.turned(degrees, axis=(1.0, 0.0, 0.0)))
        path.solve(goal, SolverOptions(1e-6, 1), is_live=True)
        angles.append(angle())
    np.testing.assert_allclose(angles, way, atol=1e-6)
    while path.way:
        path.solve(goal, LIVE, is_live=True)
    assert angle() == pytest.approx(goals[-1])


@pytest.mark.parametrize(("first", "then"), [(0.0, 0.0), (0.05, 0.05), (0.1, 0.1), (0.1, 0.0)])
@pytest.mark.parametrize("degrees", [2, 40, 90])
def test_legs_toward_a_contact_are_little_longer_than_the_clearance(
    first, then, degrees, monkeypatch
):
    """By half a sample, but as long as one at least; without a contact they are of usual length."""
    found = itertools.chain([first], itertools.repeat(then))
    monkeypatch.setattr(Contact, "clearance", lambda _, p, most: min(next(found), most))
    free, goal = begun(degrees)
    avoiding, start = SCENE.held(avoid_contact=True)._path, free.targets
    usual = [start, *waypoints(start, goal, free.constraints.handles)]
    assert_array_equal([start, *free._way_to(goal), goal], usual)
    way = [start, *avoiding._way_to(goal), goal]
    legs = [np.linalg.norm(b - a, axis=1).max() for a, b in itertools.pairwise(way)]
    spacing = avoiding.constraints.contact.surface.spacing
    assert 0.05 < spacing < 0.06
    if degrees == 2:  # shorter than a sample
        assert len(legs) == 1
        return
    longest = [max(each + 0.5 * spacing, spacing) for each in (first, then)]
    assert 0.7 * longest[0] < legs[0] <= longest[0]
    assert 0.7 * longest[1] < min(legs[1:-1])
    assert max(legs[1:]) <= longest[1]


@pytest.mark.parametrize("volumes", [{}, {"preserve_volume": False}])
def test_a_small_mesh_is_solved_once_for_a_near_goal(volumes, solves):
    path, goal = begun(4, **volumes)
    path.solve(goal, OPTIONS)
    assert len(solves) == 1


@pytest.mark.parametrize(("tolerance", "steps"), [(1e-7, 400), (1e-4, 8)])
def test_with_parts_in_contact_a_solve_may_end_sooner(tolerance, steps, solves, monkeypatch):
    """Poses with contacts converge slowly; never by more steps, or nearer, than asked for."""
    for is_active in (False, True):
        monkeypatch.setattr(Contact, "is_active", lambda *_, found=is_active: found)
        path, goal = begun(5, avoid_contact=True)
        path.solve(goal, SolverOptions(tolerance, steps))
    without, with_contact = [(options.tolerance, options.max_steps) for _, options, _ in solves]
    assert without == (tolerance, steps)
    assert with_contact == (max(tolerance, 1e-5), min(steps, 300))


@pytest.mark.usefixtures("scaled")
def test_a_mesh_that_was_scaled_by_much_is_solved_again(solves, monkeypatch):
    """With the coarse volumes of the scaled mesh, so that it is hardly scaled the next time."""
    scales, scaled = [], Path._scaled

    def remembered(self, surface):
        x, scaled_by = scaled(self, surface)
        scales.append(scaled_by)
        return x, scaled_by

    monkeypatch.setattr(Path, "_scaled", remembered)
    deformer = SCENE.deformer()
    path, frame = deformer._path, deformer._problem.frame
    path.solve(frame.inward(SCENE.turned(5)), OPTIONS)
    assert len(scales) == len(solves) == 1
    assert scales[0] < 3e-5
    path.solve(goal := frame.inward(SCENE.turned(30)), OPTIONS)
    assert len(scales) == 3
    assert scales[2] < 3e-5 < scales[1]
    assert_array_equal(solves[-2][0], solves[-1][0])
    assert {solves[-2][1], solves[-1][1]} == {OPTIONS}
    for limit, count in ((1, 1), (400, 5)):  # once if it has not converged, else five times at most
        monkeypatch.setattr("vtk_segdeform.deformer.path._SCALED", -1.0)
        solves.clear()
        again = deformer.copy()._path
        again.solve(goal + 1e-3, SolverOptions(1e-6, limit))
        assert len(solves) == count
        assert (solves[0][2].status is Status.STEP_LIMIT) == (limit == 1)
