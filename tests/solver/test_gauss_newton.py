"""The solver on a sausage in two overlapping cages: exact volumes, falling merits, minima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.solver.extrapolation import Way
from vtk_segdeform.solver.gauss_newton import GaussNewton, SolverOptions, _State
from vtk_segdeform.solver.newton import Step
from vtk_segdeform.solver.other_measures import area_of
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.solver.volumes import Together

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)  # 258 vertices in two overlapping cages


def distance(a, b):
    """Return the largest distance of a vertex in two poses, in diagonals of the mesh."""
    return np.linalg.norm(a.vertices - b.vertices, axis=1).max() / SCENE.mesh.diagonal


@pytest.mark.parametrize("options", [{}, {"rotation_groups": SCENE.mesh.n_vertices}])
def test_volume_is_exact_and_the_merit_never_rises(options):
    deformer = SCENE.deformer(**options)
    solution = deformer.solve(SCENE.turned(60))
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-13
    merits = np.array(solution.merits)
    assert (np.diff(merits) <= 1e-9 * merits[0]).all()
    assert merits[-1] < merits[0]


def test_without_the_constraint_the_volume_does_change():
    solution = SCENE.held(preserve_volume=False).solve(SCENE.turned(90))
    assert abs(solution.volume_change) > 1e-3


def test_every_region_volume_is_preserved():
    scene = sausage(3, is_coarse=True)
    solution = scene.held(preserve_region_volumes=True).solve(scene.turned(60))
    assert np.abs(solution.region_volume_change).max() < 1e-12
    assert abs(solution.volume_change) < 1e-12
    free = scene.held().solve(scene.turned(60))
    assert np.abs(free.region_volume_change).max() > 1e-4


def test_a_steady_drag_starts_ahead_and_ends_in_the_same_poses():
    ahead, behind = SCENE.held(), SCENE.held()
    for angle in (1.0, 2.0, 3.0, 4.0):
        behind._path.solver._way = Way()
        fast, slow = (each.solve(SCENE.turned(angle), max_steps=50) for each in (ahead, behind))
        assert abs(fast.volume_change) < 1e-13
        assert distance(fast, slow) < 1e-4
        if angle > 2.0:
            assert np.ptp(fast.merits) < 0.3 * np.ptp(slow.merits)
    assert distance(*(each.solve(SCENE.turned(4.0)) for each in (ahead, behind))) < 1e-5


class Limit:
    """A term that is never active, and allows motions of a cage vertex up to a length."""

    def __init__(self, longest):
        self.longest = longest

    is_always_active = False

    def renewed(self, p):
        return self

    def value_and_slope(self, p, x=None):
        return 0.0, np.zeros_like(p)

    def hessian(self, p, x=None):
        return None

    def share(self, p, step):
        return min(1.0, self.longest / np.linalg.norm(step, axis=1).max())


@pytest.mark.parametrize("longest", [0.003, 10.0])
def test_no_start_and_no_step_is_farther_than_a_term_allows(longest, monkeypatch):
    deformer, motions = SCENE.held(), []
    deformer._path.solver.terms = (Limit(longest),)
    for name in ("_ahead", "_step"):
        made = getattr(GaussNewton, name)

        def remembered(self, here, given, made=made):
            found = made(self, here, given)
            motions.append(found.h if isinstance(found, Step) else found.at - here.at)
            return found

        monkeypatch.setattr(GaussNewton, name, remembered)
    for angle in (1.0, 2.0, 3.0, 4.0, 5.0):
        deformer.solve(SCENE.turned(angle), max_steps=50)
    lengths = [np.linalg.norm(each, axis=1).max() for each in motions]
    assert max(lengths) <= 1.01 * longest
    assert max(lengths) > (0.99 if longest < 1.0 else 0.001) * longest


def test_the_directions_of_the_volume_do_not_depend_on_the_way_to_a_pose():
    """A large mesh is moved along them, so its pose would depend on the way, too."""
    straight, roundabout = SCENE.held(), SCENE.held()
    for angle in (10.0, 20.0, 30.0, 38.0, 39.5):
        roundabout.solve(SCENE.turned(angle))
    ends = []
    for deformer in (straight, roundabout):
        deformer.solve(SCENE.turned(40.0))
        ends.append(deformer._path.solver._way.ends[-1])
    (first,), (second,) = (end.directions for end in ends)
    assert np.linalg.norm(first - second) < 1e-4 * np.linalg.norm(first)


def test_cages_land_on_other_volumes_unless_that_leads_nowhere():
    deformer = SCENE.held()
    solver, p = deformer._path.solver.copy(), deformer._path.p
    volumes, (volume,) = solver.volumes, solver.volumes.constraints
    area = area_of(volumes.surface.map(p), volume.faces)

    def landed(*goals):
        solver.preserve(replace(volumes, constraints=Together(goals)))
        return solver.landed(p)

    for share in (1.2, 0.7):
        goal = replace(volume, target=share * volume.target)
        assert abs(goal.relative(volumes.surface.map(landed(goal)))) < 1e-13
    assert landed(volume, replace(area, target=0.3 * area.target)) is p  # less than of a ball
    assert landed() is p


def test_at_the_end_the_slope_is_a_multiple_of_the_volume_gradient():
    # Karush-Kuhn-Tucker: the slope is a multiple of the gradient of the constraint.
    deformer = SCENE.deformer(tolerance=1e-10, max_steps=2000, rotation_groups=50)
    deformer.solve(SCENE.turned(40))
    solver, targets = deformer._path.solver, deformer._constraints.places(deformer._path.targets)
    x = solver.energy.subspace.map(deformer._path.p)
    _, slope = solver.energy.value_and_slope(deformer._path.p)
    slope = slope + solver.positions.value_and_slope(deformer._path.p, targets)[1]
    gradient = solver.energy.subspace.adjoint(solver.volumes.constraints[0].gradient(x))
    factor = np.vdot(slope, gradient) / np.vdot(gradient, gradient)
    assert np.linalg.norm(slope - factor * gradient) < 1e-5 * np.linalg.norm(slope)


def test_an_almost_singular_hessian_does_not_stop_the_solver(monkeypatch):
    """Its steps are too long at any of their shares, so those of the paper replace them."""
    of_h, asked = GaussNewton._factor_at, []

    def almost_singular(self, *args):
        factor = of_h(self, *args)
        asked.append(factor)
        return replace(factor, triangle=np.asfortranarray(1e-3 * factor.triangle))

    expected, deformer = SCENE.held().solve(SCENE.turned(60)), SCENE.held()
    with monkeypatch.context() as wrong:
        wrong.setattr(GaussNewton, "_factor_at", almost_singular)
        for _ in range(20):
            found = deformer.solve(SCENE.turned(60), max_steps=3)
    assert len(asked) > 1
    assert distance(found, expected) < 5e-3


def is_slow(lengths, *, age=1, has_begun=True, is_new=False):
    """Tell whether H is computed for the last of steps with these *lengths*; tolerance 1e-4.

    *age* is that of the present H at the start of the call, in steps.
    """
    nowhere = np.zeros((0, 3))
    state = _State(None, age, has_begun)
    state.begin(nowhere, nowhere, SolverOptions(tolerance=1e-4))
    state.is_new = is_new
    *taken, last = (Step(nowhere, (), length) for length in lengths)
    for step in taken:
        state.took(step)
    return state.is_slow(last)


def test_the_first_h_is_computed_where_there_is_a_step_to_take():
    assert is_slow([1e-3], has_begun=False)
    assert not is_slow([1e-4], has_begun=False)
    assert not is_slow([1e-3])


def test_h_is_computed_again_where_steps_would_not_converge_in_that_time():
    halved, to_a_third = [1e-2, 5e-3], [9e-3, 3e-3]
    assert is_slow(halved)  # 5e-3 / 2^5 > 1e-4
    assert not is_slow(to_a_third)
    assert not is_slow(halved, age=0)  # after one step with it its rate is not known
    assert not is_slow([1e-2], age=9)  # of a call that has just begun
    assert is_slow([2e-3, 5e-3])  # longer and longer
    assert not is_slow([1e-5, 1e-4])


@pytest.mark.parametrize(("age", "slow"), [(3, False), (4, True)])
def test_an_h_of_the_same_call_serves_five_steps(age, slow):
    assert is_slow([1e-2, 9e-3], age=age, is_new=True) is slow


def test_h_is_computed_where_a_pose_is_far_and_saves_steps_there(monkeypatch):
    of_h, computed = GaussNewton._factor_at, []
    monkeypatch.setattr(
        GaussNewton, "_factor_at", lambda *given: computed.append(0) or of_h(*given)
    )
    SCENE.held().solve(SCENE.turned(0))
    assert not computed
    quick = SCENE.held().solve(SCENE.turned(28))
    assert computed
    monkeypatch.setattr(_State, "is_slow", lambda *_: False)
    slow = SCENE.held().solve(SCENE.turned(28))
    assert quick.steps < slow.steps
    assert distance(quick, slow) < 1e-4


def test_near_a_minimum_the_step_with_h_is_as_long_as_the_way_left():
    """Newton's, so what it leaves falls with the square; without the volumes in H it does not."""
    deformer = SCENE.deformer(tolerance=1e-12)
    deformer.solve(SCENE.turned(25))
    path = deformer._path
    solver, places, end = path.solver, deformer._constraints.places(path.targets), path.end
    here = solver._at(end, places)
    way = np.random.default_rng(3).normal(size=end.shape)
    left = []
    for size in (1e-2, 1e-3):
        start = solver.moved(end + size * way, solver.directions(here.rows))
        step = solver._step(start, solver._factor_at(start))
        ahead = solver.moved(start.at + step.h, step.directions)
        left.append(solver.farthest(ahead.at - end) / solver.farthest(start.at - end))
    assert left[1] < 0.2 * left[0] < 0.1


def test_where_no_share_of_a_step_helps_h_is_that_of_the_pose_then_that_of_the_paper(on_its_way):
    """Also of a solver that has not begun, so whose H is not of this pose."""
    begun, p, targets = on_its_way
    solver = begun.fresh()
    here = solver._at(p, targets)
    exact, plain = solver.another(here), solver.another(here)
    assert_allclose(exact.h, solver._step(here, solver._factor_at(here)).h, rtol=1e-12)
    assert_allclose(plain.h, solver._step(here, solver._factor).h, rtol=1e-12)
    assert np.abs(exact.h - plain.h).max() > 1e-3 * np.abs(plain.h).max()
    assert solver.another(here) is None


def test_the_compliance_is_how_far_points_move_under_unit_forces():
    solver = SCENE.held()._constraints.solver
    rows = solver.energy.subspace.at(np.array([100, 400]))
    h, compliance = solver._hessian, solver.compliance(rows)
    assert_allclose(compliance, rows @ np.linalg.solve(h, rows.T), rtol=1e-6)


@pytest.fixture(scope="module")
def on_its_way():
    """Return a solver without contact, cages and places, far from a minimum."""
    deformer = SCENE.held().copy()
    deformer.solve(SCENE.turned(40), max_steps=1)
    path = deformer._path
    return path.solver, path.p, deformer._constraints.places(path.targets)


def objective(solver, p, targets):
    return solver.energy.value_and_slope(p)[0] + solver.positions.value_and_slope(p, targets)[0]


def test_the_unbalanced_force_is_the_slope_beside_the_volume(on_its_way):
    solver, p, targets = on_its_way
    force = solver.unbalanced(p, targets)
    x = solver.volumes.surface.map(p)
    row = solver.volumes.surface.adjoint(solver.volumes.constraints[0].gradient(x))
    assert abs(np.vdot(force, row)) < 1e-9 * np.linalg.norm(force) * np.linalg.norm(row)
    way = np.random.default_rng(1).normal(size=p.shape)
    way -= np.vdot(way, row) / np.vdot(row, row) * row  # which keeps the volume
    t = 1e-5
    slope = (objective(solver, p + t * way, targets) - objective(solver, p - t * way, targets)) / t
    assert 4.0 * np.vdot(force, way) == pytest.approx(slope, rel=1e-5)


def test_a_response_is_the_step_of_the_dense_equations(on_its_way):
    """With the derivative of the slope, by differences, in place of the Hessian."""
    solver, p, targets = on_its_way
    free = solver.fresh()
    x = solver.volumes.surface.map(p)
    row = solver.volumes.surface.adjoint(solver.volumes.constraints[0].gradient(x)).ravel()

    def slope(q):
        own = solver.energy.value_and_slope(q)[1] + solver.positions.value_and_slope(q, targets)[1]
        return own.ravel()

    units = 1e-6 * np.eye(p.size).reshape(-1, *p.shape)
    hessian = np.array([(slope(p + unit) - slope(p - unit)) / 2e-6 for unit in units])
    least = np.linalg.eigvalsh(0.5 * (hessian + hessian.T))[0]
    assert least > 0.0  # else the response has less of the rotations' derivatives
    force = np.random.default_rng(2).normal(size=p.shape)
    dense = np.block([[hessian, row[:, None]], [row[None], np.zeros((1, 1))]])
    expected = np.linalg.solve(dense, np.append(-force.ravel(), 0.0))[:-1]
    found = free.response(p, force, [row.reshape(p.shape)])
    assert abs(found.ravel() @ row) < 1e-9 * np.linalg.norm(found) * np.linalg.norm(row)
    assert_allclose(found.ravel(), expected, rtol=0, atol=1e-3 * np.abs(expected).max())


def test_what_remains_is_about_as_far_as_the_minimum():
    deformer = SCENE.held().copy()
    deformer.solve(SCENE.turned(20), max_steps=4)
    path = deformer._path
    targets = deformer._constraints.places(path.targets)
    p, told = path.p, path.solver.remaining(path.p, targets)
    end = path.solver.fresh().minimise(p, targets, SolverOptions(tolerance=1e-10))
    moves = path.solver.volumes.surface.map(end.p - p)
    far = np.linalg.norm(moves, axis=1).max()
    assert path.solver.farthest(end.p - p) == pytest.approx(far)
    assert 0.3 * far < told < 3.0 * far


def test_without_positions_the_mesh_stays_where_its_mean_is():
    nothing = np.array([], dtype=int)
    deformer = replace(SCENE, fixed=nothing, handle=nothing).held().copy()
    solver, p = deformer._path.solver, deformer._path.p
    bent = p + 0.05 * np.sin(5.0 * p[:, [1, 2, 0]])
    x = solver.energy.subspace.map(bent)
    result = solver.minimise(bent, np.empty((0, 3)), SolverOptions())
    there = solver.energy.subspace.map(result.p)
    assert np.abs(there - x).max() > 1e-3
    assert_allclose(there.mean(axis=0), x.mean(axis=0), atol=1e-9)


def test_a_copy_continues_and_a_fresh_solver_begins():
    deformer = SCENE.held().copy()
    deformer.solve(SCENE.turned(10), max_steps=3)
    path, places = deformer._path, deformer._constraints.places(deformer._path.targets)
    begun, options = path.solver, SolverOptions(max_steps=3)
    first, second = (
        each.minimise(path.p, places, options) for each in (begun.copy(), begun.copy())
    )
    assert np.array_equal(first.p, second.p)
    anew = [begun.fresh().minimise(path.p, places, options).p for _ in range(2)]
    assert np.array_equal(*anew)
    assert not np.array_equal(anew[0], first.p)
    assert np.array_equal(begun.minimise(path.p, places, options).p, first.p)


@pytest.mark.parametrize(
    ("option", "says"),
    [
        ({"tolerance": 0.0}, "tolerance must be a positive number; got 0.0"),
        ({"tolerance": "fine"}, "tolerance must be a positive number; got 'fine'"),
        ({"max_steps": 0}, "max_steps must be a whole number, 1 or more; got 0"),
        ({"max_steps": 2.5}, "max_steps must be a whole number"),
    ],
)
def test_options_are_checked(option, says):
    with pytest.raises(ArgumentError, match=says):
        SolverOptions(**option)
    assert SolverOptions(tolerance=1e-9, max_steps=1).max_steps == 1
