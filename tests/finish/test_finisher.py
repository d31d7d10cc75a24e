"""The finish of a pose on the mesh itself: what is exact, what falls, and what stays."""

from __future__ import annotations

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from scipy import optimize
from solids import exact_volume_change, icosphere, rotation

from vtk_segdeform import deform, sizes
from vtk_segdeform.errors import ArgumentError, Cancelled
from vtk_segdeform.finish import CellEnergy, Finish, Finisher, Folds, cell_energy
from vtk_segdeform.finish import finisher as finishing
from vtk_segdeform.finish.creases import smoothed
from vtk_segdeform.finish.unfolding import unfolded
from vtk_segdeform.geometry import closest_rotations, lids_of, triangle_distortion
from vtk_segdeform.mesh import Mesh, new_crossings
from vtk_segdeform.solver import Bodies, total_volume

SCENE = sausage(2, is_coarse=True)


@dataclass(frozen=True, eq=False)
class Problem:
    """A mesh whose ends are held, the right one at other places, and a pose to start from."""

    mesh: Mesh
    held: np.ndarray
    places: np.ndarray
    start: np.ndarray

    def finish(self, progress=None) -> Finish:
        """Return the finish of the start."""
        volume = total_volume(self.mesh)
        lids = lids_of(self.mesh)
        moved = np.flatnonzero(self.held)
        bodies = Bodies(self.mesh, volume, lids)
        constraints = bodies.constraints(bodies.numbers(moved))
        energy = CellEnergy.of(self.mesh)
        return Finisher(self.mesh, energy, self.held, constraints).run(
            self.start, self.places, progress
        )

    def moved(self, turn, scale, shift) -> Problem:
        """Return the same, turned, scaled and shifted."""
        places, start = (scale * x @ turn.T + shift for x in (self.places, self.start))
        mesh = self.mesh.with_vertices(scale * self.mesh.vertices @ turn.T + shift)
        return Problem(mesh, self.held, places, start)


def bent(mesh: Mesh, degrees: float = 60.0) -> Problem:
    """Return the problem of *mesh*, long along x, with all of it sheared as a start."""
    x = mesh.vertices
    h = np.clip((x[:, :1] - x[:, 0].min()) / np.ptp(x[:, 0]), 0.2, 0.8) / 0.6 - 1.0 / 3.0
    turned = x @ rotation([0, 0, 1], np.radians(degrees)).T
    start = (1.0 - h) * x + h * turned
    held = ((h <= 0.0) | (h >= 1.0)).ravel()
    start += np.where(held[:, None], 0.0, 0.01 * np.sin(7.0 * x[:, [1, 2, 0]]))
    return Problem(mesh, held, start[held], start)


def sheet() -> Mesh:
    """Return a wavy sheet of 200 triangles, long along x."""
    u, v = np.meshgrid(np.linspace(0, 4, 21), np.linspace(0, 1, 6), indexing="ij")
    a = (np.arange(20)[:, None] * 6 + np.arange(5)).ravel()
    faces = np.concatenate([np.stack([a, a + 6, a + 7], 1), np.stack([a, a + 7, a + 1], 1)])
    return Mesh(np.stack([u.ravel(), v.ravel(), 0.1 * np.sin(5 * u.ravel())], 1), faces)


def until_nothing_is_gained(monkeypatch) -> None:
    """Let a finish converge, since where it ends early depends on rounding."""
    monkeypatch.setattr(finishing, "_STEPS", 200)
    monkeypatch.setattr(finishing, "_TOLERANCE", 1e-9)
    monkeypatch.setattr(finishing, "_GAIN", 0.0)


SAUSAGE = bent(SCENE.mesh)


def distortion(problem: Problem, x: np.ndarray) -> float:
    """Return the root mean square distortion of the triangles."""
    return float(np.sqrt((triangle_distortion(problem.mesh, x) ** 2).mean()))


@pytest.mark.parametrize("closed", [True, False])
def test_places_and_volume_are_exact_and_the_energy_falls(closed):
    problem = SAUSAGE if closed else bent(sheet())
    found = problem.finish()
    assert_array_equal(found.vertices[problem.held], problem.places)
    if closed:
        assert (
            abs(exact_volume_change(found.vertices, problem.mesh.vertices, problem.mesh.faces))
            < 1e-13
        )
    rises = np.diff(found.merits) > 1e-12 * found.merits[0]
    assert found.steps > 4
    assert not rises.any()
    assert found.merits[-1] < 0.999 * found.merits[0]
    assert distortion(problem, found.vertices) < 0.5 * distortion(problem, problem.start)


@pytest.mark.parametrize(("scale", "shift"), [(1e-7, 0.0), (1e6, 1e6)])
def test_a_motion_or_another_unit_moves_the_finish_alike(monkeypatch, scale, shift):
    until_nothing_is_gained(monkeypatch)
    turn = rotation([1, 2, 3], 1.2)
    shift = shift * np.array([0.6, -0.8, 0.0])
    moved = SAUSAGE.moved(turn, scale, shift).finish()
    plain = SAUSAGE.finish()
    error = (moved.vertices - shift) / scale - plain.vertices @ turn.T
    assert np.abs(error).max() < 1e-4 * SCENE.mesh.diagonal


def test_a_pose_is_better_if_it_has_less_energy_and_no_more_folds():
    mesh, start, found = SAUSAGE.mesh, SAUSAGE.start, SAUSAGE.finish().vertices
    finisher = Finisher(mesh, CellEnergy.of(mesh), SAUSAGE.held, [])
    assert finisher.is_better(start, found)
    assert not finisher.is_better(found, start)
    folded = mesh.vertices.copy()
    (free,) = np.flatnonzero(~SAUSAGE.held)[:1]
    folded[free] += 2.0 * (mesh.vertices[mesh.adjacency[[free]].indices[0]] - folded[free])
    assert Folds.of(mesh).at(folded).any()
    assert not Folds.of(mesh).at(start).any()
    assert finisher.is_better(start, mesh.vertices)
    assert not finisher.is_better(start, folded)


def test_at_rest_the_mesh_stays_bit_for_bit():
    mesh = SCENE.mesh
    rest = Problem(mesh, SAUSAGE.held, mesh.vertices[SAUSAGE.held], mesh.vertices)
    found = rest.finish()
    assert found.vertices is mesh.vertices
    assert found.steps == 0


def test_components_without_places_stay_where_they_are(monkeypatch):
    until_nothing_is_gained(monkeypatch)
    one, n = SAUSAGE, SCENE.mesh.n_vertices
    aside = SCENE.mesh.vertices + [0.0, 5.0, 0.0]
    points = np.concatenate([SCENE.mesh.vertices, aside])
    mesh = Mesh(points, np.concatenate([SCENE.mesh.faces, SCENE.mesh.faces + n]))
    held = np.concatenate([one.held, np.zeros(n, bool)])
    start = np.concatenate([one.start, aside + 0.1])
    found = Problem(mesh, held, one.places, start).finish()
    assert_array_equal(found.vertices[n:], start[n:])
    assert_allclose(found.vertices[:n], one.finish().vertices, atol=1e-6)


def test_a_body_in_the_way_that_nothing_holds_stays_where_it_is():
    x, (ball, faces) = SCENE.mesh.vertices, icosphere(2)
    start = np.concatenate([x, 0.4 * ball + [0.0, 0.9, 0.0]])
    mesh = Mesh(start, np.concatenate([SCENE.mesh.faces, faces + len(x)]))
    held = np.append(np.abs(x[:, 0]) > 2.4, np.zeros(len(ball), dtype=bool))
    places = start.copy()
    right = np.flatnonzero(held & (start[:, 0] > 0.0))  # pushed to the left: the middle bulges
    places[right] = start[right] @ rotation([0, 0, 1], 0.6).T - [0.8, 0.0, 0.0]
    found = Problem(mesh, held, places[held], start).finish()
    assert not len(new_crossings(found.vertices, start, mesh.faces))
    assert_array_equal(found.vertices[len(x) :], start[len(x) :])


def test_all_vertices_held_are_put_in_their_places():
    mesh = SCENE.mesh
    places = mesh.vertices + 1.0
    found = Problem(mesh, np.ones(mesh.n_vertices, bool), places, mesh.vertices).finish()
    assert_array_equal(found.vertices, places)


def test_the_energy_and_its_gradient_are_those_of_the_formula(monkeypatch):
    """E is summed here over cells and triangles, and the gradient is a difference of energies."""
    ball, faces = icosphere(1)
    mesh = Mesh(ball * [1.0, 0.7, 0.5], faces)
    energy, rng = CellEnergy.of(mesh), np.random.default_rng(0)
    x = [1.0, 1.0, 0.6] * (mesh.vertices + 0.1 * rng.normal(size=mesh.vertices.shape))
    monkeypatch.setattr("vtk_segdeform.finish.cell_energy.SHARE", t := 0.4)

    n, a = mesh.n_vertices, mesh.adjacency.toarray() > 0.0
    p = (1.0 - t) * np.eye(n) + t * a / a.sum(axis=0)
    share = np.zeros((n, mesh.n_faces))
    share[mesh.faces.T, np.arange(mesh.n_faces)] = 1.0 / 3.0
    share = p @ share
    gradients, areas = [], []
    for face in mesh.faces:
        e, y = (np.diff(points[face], axis=0).T for points in (mesh.vertices, x))
        gradients.append(y @ np.linalg.pinv(e))
        areas.append(0.5 * np.linalg.norm(np.cross(*e.T)))
    total = 0.0
    for i in range(n):
        weights = share[i] * areas
        s = sum(w * j.T for w, j in zip(weights, gradients, strict=True))
        r = closest_rotations(s[None])[0]
        for w, j, face in zip(weights, gradients, mesh.faces, strict=True):
            e = np.diff(mesh.vertices[face], axis=0).T
            total += w * np.sum((j - r @ e @ np.linalg.pinv(e)) ** 2)
    value, slope = energy.value_and_slope(x)
    band, _ = energy.band.value_and_slope(x)
    assert band > 1e-3 * total
    assert value == pytest.approx(total + band, rel=1e-10)
    way = rng.normal(size=x.shape)
    both = [energy.value_and_slope(x + h * way)[0] for h in (1e-6, -1e-6)]
    assert 2.0 * np.vdot(slope, way) == pytest.approx((both[0] - both[1]) / 2e-6, rel=1e-6)


def test_a_finish_ends_before_it_gains_nothing(monkeypatch):
    problem = bent(sausage(3).mesh, 40.0)
    early = problem.finish()
    until_nothing_is_gained(monkeypatch)
    late = problem.finish()
    assert 2 * early.steps < late.steps
    assert early.merits[-1] < 1e-4 * early.merits[0]


def test_far_from_what_moves_there_is_no_energy():
    """Near a bump of a bent tube, values differ by the same, and forces are the same."""
    problem, rng = bent(sausage(3).mesh, 40.0), np.random.default_rng(0)
    mesh, x = problem.mesh, problem.start
    moving = np.linalg.norm(mesh.vertices - mesh.vertices[0], axis=1) < 0.5
    whole = CellEnergy.of(mesh)
    near = whole.near(moving)
    assert 20 < moving.sum() < 0.1 * len(x)
    assert len(near.laplacian.data) < 0.3 * len(whole.laplacian.data)
    assert near.value_and_slope(mesh.vertices)[0] == pytest.approx(0.0, abs=1e-12)
    there = x + 0.02 * moving[:, None] * rng.normal(size=x.shape)
    (value, slope), (least, part) = (each.value_and_slope(there) for each in (whole, near))
    assert_allclose(part[moving], slope[moving], atol=1e-12)
    rise, more = (each.value_and_slope(x)[0] for each in (whole, near))
    assert value - rise == pytest.approx(least - more, rel=1e-9)
    rows = whole.laplacian[moving] - near.laplacian[moving]
    assert_allclose(rows.toarray(), 0.0, atol=1e-12)


def test_a_general_minimiser_finds_the_same_minimum(monkeypatch):
    until_nothing_is_gained(monkeypatch)
    ball, faces = icosphere(1)
    problem = bent(Mesh(ball * [2.0, 0.7, 0.6], faces), 30.0)
    found = problem.finish().vertices
    energy, volume = CellEnergy.of(problem.mesh), total_volume(problem.mesh)
    free = ~problem.held

    def at(z):
        x = found.copy()
        x[free] = z.reshape(-1, 3)
        return x

    def value(z):
        e, slope = energy.value_and_slope(at(z))
        return e, 2.0 * slope[free].ravel()

    exact = {
        "type": "eq",
        "fun": lambda z: volume.violation(at(z)),
        "jac": lambda z: volume.gradient(at(z))[free].ravel(),
    }
    begin = problem.start[free].ravel()
    told = optimize.minimize(
        value, begin, jac=True, constraints=[exact], method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    assert_allclose(told.x.reshape(-1, 3), found[free], atol=1e-4)


def test_a_start_with_folds_has_none_after_it_and_a_good_one_gets_none():
    folds = Folds.of(SCENE.mesh)
    assert not folds.at(SAUSAGE.finish().vertices).any()
    noise = np.random.default_rng(1).normal(size=SAUSAGE.start.shape)
    start = SAUSAGE.start + np.where(SAUSAGE.held[:, None], 0.0, 0.15 * noise)
    crumpled = Problem(SCENE.mesh, SAUSAGE.held, SAUSAGE.places, start)
    assert np.count_nonzero(folds.at(start)) > 9
    found = crumpled.finish().vertices
    assert not folds.at(found).any()
    assert_array_equal(found[SAUSAGE.held], SAUSAGE.places)


def test_folds_are_opened_and_nothing_else_moves():
    """Folded are: a triangle turned over its edge, and one pressed flat."""
    mesh = sheet()
    folds, free = Folds.of(mesh), np.ones(mesh.n_vertices, dtype=bool)
    free[:6] = False
    for vertex, to in ((62, mesh.vertices[62] + [0.6, 0.0, 0.0]), (62, mesh.vertices[68])):
        x = mesh.vertices.copy()
        x[vertex] = to
        assert np.count_nonzero(folds.at(x)) > 0
        opened = unfolded(mesh, folds, x, free)
        assert not folds.at(opened).any()
        far = np.abs(mesh.vertices[:, 0] - mesh.vertices[vertex, 0]) > 1.5
        assert_array_equal(opened[far], x[far])
    free[:] = False
    assert_array_equal(unfolded(mesh, folds, x, free), x)


def creased() -> tuple[Mesh, np.ndarray]:
    """Return a sheet with bumps, and a bend of 160 degrees narrower than they are high."""
    n, w, z = 121, 25, 0.12
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(-2, 2, n), np.linspace(0, 0.8, w)))
    u, v = (each.reshape(w, n).T.ravel() for each in (u, v))
    height = z * np.cos(20.0 * (u + 2.0)) * np.cos(20.0 * v)
    a = (np.arange(n - 1)[:, None] * w + np.arange(w - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + w, a + w + 1], 1), np.stack([a, a + w + 1, a + 1], 1)])
    s = np.linspace(-2.0, 2.0, 4001)
    angle = np.clip(s / 0.2 + 0.5, 0.0, 1.0) * np.radians(160.0)
    x, y = (np.cumsum(f(angle)) * (s[1] - s[0]) for f in (np.cos, np.sin))
    t, x, y = (np.interp(u, s, each) for each in (angle, x, y))
    pose = np.stack([x - np.sin(t) * height, v, y + np.cos(t) * height], 1)
    return Mesh(np.stack([u, v, height], 1), faces), pose


def test_creases_that_cross_themselves_are_smoothed_and_nothing_else_moves():
    mesh, x = creased()
    folds, free = Folds.of(mesh), np.ones(mesh.n_vertices, dtype=bool)

    def crossing(pose):
        return new_crossings(pose, mesh.vertices, mesh.faces)

    assert len(crossing(x)) > 30
    smooth = smoothed(mesh, x, free, crossing)
    assert not len(crossing(smooth))
    assert folds.at(smooth).sum() <= folds.at(x).sum()
    moved = (smooth != x).any(axis=1)
    assert np.abs(mesh.vertices[moved, 0]).max() < 0.4
    assert moved.mean() < 0.1
    # In another unit and place, the same.
    turn, scale = rotation([1, 2, 3], 1.0), 1e3
    larger = mesh.with_vertices(scale * mesh.vertices)
    elsewhere = smoothed(larger, scale * x @ turn.T, free, crossing)
    assert_allclose(elsewhere, scale * smooth @ turn.T, atol=1e-9 * scale)
    free[mesh.vertices[:, 1] < 0.4] = False
    partly = smoothed(mesh, x, free, crossing)
    assert_array_equal(partly[~free], x[~free])
    # The finish leaves none either, although its start has some.
    held = np.abs(mesh.vertices[:, 0]) > 0.3
    found = Finisher(mesh, CellEnergy.of(mesh), held, []).run(x, x[held])
    assert not len(crossing(found.vertices))
    assert_array_equal(found.vertices[held], x[held])


def test_a_vertex_of_flat_triangles_only_stays_where_it_is():
    mesh = sheet()
    faces = mesh.faces
    flat = mesh.vertices.copy()
    flat[faces[(faces == 62).any(axis=1)]] = flat[62]
    mesh, free = mesh.with_vertices(flat), np.ones(mesh.n_vertices, dtype=bool)
    pose = flat + 0.1 * np.sin(3.0 * flat[:, [1, 2, 0]])
    answers = [np.flatnonzero((faces == 62).any(axis=1)), np.array([], dtype=int)]
    smooth = smoothed(mesh, pose, free, lambda _: answers.pop(0))
    assert np.isfinite(smooth).all()
    assert (smooth != pose).any()
    assert_array_equal(smooth[62], pose[62])


def test_parts_pushed_through_each_other_are_not_smoothed():
    one, mesh = sheet(), creased()[0]
    across = one.vertices[:, [2, 0, 1]] - [0.0, 1.5, 0.3]
    faces = np.concatenate([mesh.faces, one.faces + mesh.n_vertices])
    rest = np.concatenate([mesh.vertices, one.vertices + [0.0, 0.0, 5.0]])
    both, pose = Mesh(rest, faces), np.concatenate([mesh.vertices, across])
    free = np.ones(both.n_vertices, dtype=bool)
    assert len(new_crossings(pose, rest, faces)) > 20
    searched = []

    def crossing(y):
        searched.append(y)
        return new_crossings(y, rest, faces)

    assert_array_equal(smoothed(both, pose, free, crossing), pose)
    assert len(searched) == 2  # given up after the first averages


@pytest.mark.parametrize("height", [1.5, 0.2])
def test_an_arch_over_a_sheet_stays_over_it(height):
    """Held at its lower ends, it would end in a plane that crosses the sheet."""
    one = sheet()
    x, n = one.vertices, one.n_vertices
    flat = np.stack([2.5 - x[:, 1], x[:, 0] - 1.5, np.full(n, 0.5)], 1)
    mesh = Mesh(np.concatenate([x, flat]), np.concatenate([one.faces, one.faces + n]))
    ends = (x[:, 0] < 0.1) | (x[:, 0] > 3.9)
    arch = flat + np.stack([0.0 * x[:, 0]] * 2 + [height * np.sin(0.25 * np.pi * x[:, 0]) - 0.5], 1)
    start = np.concatenate([x, arch])
    held = np.concatenate([ends, ends])
    problem = Problem(mesh, held, start[held], start)
    assert not len(new_crossings(start, mesh.vertices, mesh.faces))
    found = Finisher(mesh, CellEnergy.of(mesh), held, []).run(start, start[held])
    assert not len(new_crossings(found.vertices, mesh.vertices, mesh.faces))
    assert_array_equal(found.vertices[held], start[held])
    assert found.merits  # it is not the start
    if height > 1.0:
        assert distortion(problem, found.vertices) < 0.9 * distortion(problem, start)
    through = start.copy()
    through[n:] = flat - [0.0, 0.0, 0.6]
    found = Finisher(mesh, CellEnergy.of(mesh), held, []).run(through, start[held])
    assert distortion(problem, found.vertices) < 0.5 * distortion(problem, start)


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


def test_two_finishes_at_once_of_one_deformer_give_the_same_as_one_after_the_other(monkeypatch):
    """Both threads have run each kernel before either of them continues with its result."""
    pytest.importorskip("numba")
    monkeypatch.setattr(sizes, "COMPILED", 0)
    deformer = SCENE.held()
    solution = deformer.solve(SCENE.turned(40))
    starts = solution, deformer.finish(solution)  # a finished pose is finished further
    expected = [deformer.finish(start).vertices for start in starts]
    assert np.abs(expected[0] - expected[1]).max() > 1e-6
    together, met = threading.Barrier(2, timeout=20.0), []
    run_kernel = cell_energy.in_parallel

    def in_turns(*task):
        run_kernel(*task)
        with suppress(threading.BrokenBarrierError):  # the other finish has ended
            met.append(together.wait())

    def finish(start):
        try:
            return deformer.finish(start).vertices
        finally:
            together.abort()

    monkeypatch.setattr(cell_energy, "in_parallel", in_turns)
    with ThreadPoolExecutor(2) as threads:
        found = [*threads.map(finish, starts)]
    assert len(met) > 20
    for each, alone in zip(found, expected, strict=True):
        assert_array_equal(each, alone)


def test_a_pose_whose_volume_a_finish_would_lose_is_returned_as_it_is():
    held = np.setdiff1d(np.arange(SCENE.mesh.n_vertices), SCENE.handle)
    deformer = SCENE.held().hold(fixed=held, handle=SCENE.handle)
    solution = deformer.solve(SCENE.mesh.vertices[SCENE.handle] + [0.02, 0.0, 0.0])
    assert abs(solution.volume_change) < 1e-13
    assert deformer.finish(solution) is solution


@pytest.mark.parametrize("scale", [2.0**200, 2.0**-200])
def test_the_finish_of_a_huge_or_tiny_mesh_is_that_of_the_mesh(scale):
    mesh, ends = SCENE.mesh, (SCENE.fixed, SCENE.handle)
    options = {"n_regions": 1, "n_cage_vertices": 40}
    one = deform(mesh, *ends, SCENE.turned(30), **options)
    scaled = mesh.with_vertices(scale * mesh.vertices)
    other = deform(scaled, *ends, scale * SCENE.turned(30), **options)
    assert one.steps == other.steps
    assert_allclose(other.vertices / scale, one.vertices, rtol=0, atol=1e-9)


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
    assert np.abs(deformer.finish(finished).vertices - finished.vertices).max() < 1e-2
    deformer.solve(SCENE.turned(10))
    with pytest.raises(ArgumentError, match="last solve"):
        deformer.finish(solution)


def test_a_hat_lifted_off_a_head_leaves_both_as_they_are():
    head, faces = icosphere(3)
    hat = 0.7 * head + [0.0, 0.0, 1.2]  # into the head
    mesh = Mesh(np.vstack([head, hat]), np.vstack([faces, faces + len(head)]))
    x = mesh.vertices
    fixed = np.flatnonzero(x[:, 2] < -0.7)
    handle = np.flatnonzero(x[:, 2] > 1.6)
    solution = deform(mesh, fixed, handle, x[handle] + [0.0, 0.0, 1.0])
    lifted = np.where(np.arange(len(x)) < len(head), 0.0, 1.0)[:, None] * [0.0, 0.0, 1.0]
    assert_allclose(solution.vertices, x + lifted, atol=1e-5)
