"""The finish of a pose on the mesh itself: what is exact, what falls, and what stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import combined
from scenes import sausage
from scipy import optimize, sparse
from solids import exact_volume_change, icosphere, rotation

from vtk_segdeform import sizes
from vtk_segdeform.errors import MeshError
from vtk_segdeform.finish import CellEnergy, Finish, Finisher
from vtk_segdeform.finish import finisher as finishing
from vtk_segdeform.finish.factor import factored
from vtk_segdeform.geometry import closest_rotations, lids_of, triangle_distortion
from vtk_segdeform.mesh import Mesh, new_crossings
from vtk_segdeform.solver import Bodies, Status, exact_volume, total_volume

SCENE = sausage(2, is_coarse=True)
PER_CAGE = 60.0  # vertices, so that the cells are larger than a ring


@dataclass(frozen=True, eq=False)
class Problem:
    """A mesh whose ends are held, the right one at other places, and a pose to start from."""

    mesh: Mesh
    held: np.ndarray
    places: np.ndarray
    start: np.ndarray

    def finisher(self, length: float = 0.06, **options) -> Finisher:
        """Return the problem, with l in diagonals."""
        bodies = Bodies(self.mesh, total_volume(self.mesh), lids_of(self.mesh))
        constraints = bodies.constraints(bodies.numbers(np.flatnonzero(self.held)))
        weights = self.mesh.vertex_areas / (length * self.mesh.diagonal) ** 2
        energy = CellEnergy.of(self.mesh, PER_CAGE)
        return Finisher(self.mesh, energy, self.held, constraints, weights, **options)

    def finish(self, length: float = 0.06, **options) -> Finish:
        """Return the finish of the start."""
        return self.finisher(length, **options).run(self.start, self.places)

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


def converging(monkeypatch) -> None:
    """Let a finish converge to rounding, to compare it with another."""
    monkeypatch.setattr(finishing, "_STEPS", 500)
    monkeypatch.setattr(finishing, "_TOLERANCE", 1e-10)


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
    assert found.steps > 2
    assert not rises.any()
    assert distortion(problem, found.vertices) < 0.95 * distortion(problem, problem.start)


@pytest.mark.parametrize(("scale", "shift"), [(1e-7, 0.0), (1e6, 1e6)])
def test_a_motion_or_another_unit_moves_the_finish_alike(monkeypatch, scale, shift):
    converging(monkeypatch)
    turn = rotation([1, 2, 3], 1.2)
    shift = shift * np.array([0.6, -0.8, 0.0])
    moved = SAUSAGE.moved(turn, scale, shift).finish()
    plain = SAUSAGE.finish()
    error = (moved.vertices - shift) / scale - plain.vertices @ turn.T
    assert np.abs(error).max() < 1e-4 * SCENE.mesh.diagonal


def test_components_without_places_stay_where_they_are(monkeypatch):
    converging(monkeypatch)
    one, n = SAUSAGE, SCENE.mesh.n_vertices
    aside = SCENE.mesh.vertices + [0.0, 5.0, 0.0]
    points = np.concatenate([SCENE.mesh.vertices, aside])
    mesh = Mesh(points, np.concatenate([SCENE.mesh.faces, SCENE.mesh.faces + n]))
    held = np.concatenate([one.held, np.zeros(n, bool)])
    start = np.concatenate([one.start, aside + 0.1])
    length = 0.06 * SCENE.mesh.diagonal / mesh.diagonal
    found = Problem(mesh, held, one.places, start).finish(length)
    assert_array_equal(found.vertices[n:], start[n:])
    assert_allclose(found.vertices[:n], one.finish().vertices, atol=1e-6)


def test_all_vertices_held_are_put_in_their_places():
    mesh = SCENE.mesh
    places = mesh.vertices + 1.0
    found = Problem(mesh, np.ones(mesh.n_vertices, bool), places, mesh.vertices).finish()
    assert_array_equal(found.vertices, places)


@pytest.mark.parametrize("rounds", [0, 1, 3])
def test_the_energy_and_its_gradient_are_those_of_the_formula(rounds):
    """E is summed here over cells and triangles."""
    ball, faces = icosphere(1)
    mesh = Mesh(ball * [1.0, 0.7, 0.5], faces)
    energy, rng = CellEnergy.of(mesh, 7.0 * rounds), np.random.default_rng(0)
    x = [1.0, 1.0, 0.6] * (mesh.vertices + 0.1 * rng.normal(size=mesh.vertices.shape))
    t = 0.7  # 7 vertices per cage vertex: that of one round

    n, a = mesh.n_vertices, mesh.adjacency.toarray() > 0.0
    p = (1.0 - t) * np.eye(n) + t * a / a.sum(axis=0)
    share = np.zeros((n, mesh.n_faces))
    share[mesh.faces.T, np.arange(mesh.n_faces)] = 1.0 / 3.0
    share = np.linalg.matrix_power(p, rounds) @ share
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
    assert energy.value_and_slope(x)[0] == pytest.approx(total, rel=1e-10)


def test_the_gradient_of_the_objective_is_its_derivative():
    """The error of f(x + h d) - f(x - h d) falls with the square of h."""
    finisher, rng = SAUSAGE.finisher(), np.random.default_rng(0)
    finisher.run(SAUSAGE.start, SAUSAGE.places)  # which sets y
    x, way = (rng.normal(size=SAUSAGE.start.shape) for _ in range(2))
    x, way[finisher._held] = SAUSAGE.start + 0.02 * x, 0.0
    exact = 2.0 * np.vdot(finisher._evaluated(x).slope, way)
    errors = []
    for h in (1e-3, 5e-4):
        ahead, behind = (finisher._evaluated(x + s * h * way).merit for s in (1.0, -1.0))
        errors.append(abs((ahead - behind) / (2.0 * h) - exact))
    assert errors[0] < 1e-2 * abs(exact)
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_a_general_minimiser_finds_the_same_minimum(monkeypatch):
    converging(monkeypatch)
    ball, faces = icosphere(1)
    problem = bent(Mesh(ball * [2.0, 0.7, 0.6], faces), 30.0)
    found = problem.finish().vertices
    energy, volume = CellEnergy.of(problem.mesh, PER_CAGE), total_volume(problem.mesh)
    free, mesh = ~problem.held, problem.mesh
    w = mesh.vertex_areas[:, None] / (0.06 * mesh.diagonal) ** 2
    y = problem.start

    def at(z):
        x = found.copy()
        x[free] = z.reshape(-1, 3)
        return x

    def value(z):
        x = at(z)
        e, slope = energy.value_and_slope(x)
        return e + np.sum(w * (x - y) ** 2), 2.0 * (slope + w * (x - y))[free].ravel()

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


def test_without_length_the_cages_stay_and_with_an_infinite_one_the_energy_alone_counts(
    monkeypatch,
):
    converging(monkeypatch)
    start = SAUSAGE.start
    lengths = [1e-4, 0.04, 0.08, 1e4]
    found = [SAUSAGE.finish(length).vertices for length in lengths]
    off = [np.linalg.norm(x - found[0], axis=1).max() for x in found]
    near = np.linalg.norm(found[0] - start, axis=1).max()
    assert near < 0.02 * SCENE.mesh.diagonal  # on the volume, which the start is not
    assert off == sorted(off)
    energy = CellEnergy.of(SCENE.mesh, PER_CAGE)
    values = [energy.value_and_slope(x)[0] for x in found]
    assert values == sorted(values, reverse=True)
    finisher = SAUSAGE.finisher()
    finisher._factor(np.zeros(SCENE.mesh.n_vertices), None)
    alone = finisher.run(start, SAUSAGE.places)
    assert_allclose(found[3], alone.vertices, atol=1e-4)


def test_waves_longer_than_the_length_stay_and_shorter_ones_relax():
    """A flat sheet with bumps as the pose of the cages; its ends are held."""
    u, v = np.meshgrid(np.linspace(0, 4, 161), np.linspace(0, 0.5, 21), indexing="ij")
    a = (np.arange(160)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([np.stack([a, a + 21, a + 22], 1), np.stack([a, a + 22, a + 1], 1)])
    mesh = Mesh(np.stack([u.ravel(), v.ravel(), 0.0 * u.ravel()], 1), faces)
    held = (mesh.vertices[:, 0] < 0.1) | (mesh.vertices[:, 0] > 3.9)

    def left(wavelength: float) -> float:
        wave = np.where(held, 0.0, np.sin(2.0 * np.pi / wavelength * mesh.vertices[:, 0]))
        pose = mesh.vertices + wave[:, None] * [1e-3, 0.0, 0.0]  # in the sheet
        found = Problem(mesh, held, pose[held], pose).finish(0.4 / mesh.diagonal).vertices
        return float(np.vdot(found[:, 0] - mesh.vertices[:, 0], wave) / (1e-3 * wave @ wave))

    long, short = left(4.0), left(0.4)
    assert long > 0.5
    assert short < 0.1


def test_what_would_come_to_cross_is_kept_apart_if_it_is_asked_for(monkeypatch):
    """Between its ends, a sheet above another one is an arch, which would relax through it."""
    one = sheet()
    x, n = one.vertices, one.n_vertices
    flat = np.stack([2.5 - x[:, 1], x[:, 0] - 1.5, np.full(n, 0.5)], 1)
    mesh = Mesh(np.concatenate([x, flat]), np.concatenate([one.faces, one.faces + n]))
    ends = (x[:, 0] < 0.1) | (x[:, 0] > 3.9)
    arch = flat + np.stack([0.0 * x[:, 0]] * 2 + [np.sin(0.25 * np.pi * x[:, 0]) - 0.5], 1)
    start = np.concatenate([x, arch])
    held = np.concatenate([ends, ends])
    problem = Problem(mesh, held, start[held], start)
    assert not len(new_crossings(start, mesh.vertices, mesh.faces))
    crossing, apart = (problem.finish(10.0, avoid_contact=each).vertices for each in (False, True))
    assert len(new_crossings(crossing, mesh.vertices, mesh.faces))
    assert not len(new_crossings(apart, mesh.vertices, mesh.faces))
    assert_array_equal(apart[held], start[held])
    assert distortion(problem, apart) < distortion(problem, start)
    monkeypatch.setattr(finishing, "_FIRMER", 1.0)
    never = problem.finish(10.0, avoid_contact=True)
    assert never.status is Status.STALLED
    assert_array_equal(never.vertices, start)  # which does not cross


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


def test_with_all_vertices_held_no_step_is_taken():
    mesh = SCENE.mesh
    everything = np.ones(mesh.n_vertices, bool)
    found = Problem(mesh, everything, mesh.vertices + 1.0, mesh.vertices).finish()
    assert (found.steps, found.merits, found.remaining) == (0, (), 0.0)
    assert found.status is Status.CONVERGED


def test_a_pose_that_is_not_finite_is_lower_than_none():
    problem = bent(sheet())  # without a volume
    finisher = problem.finisher()
    finisher.run(problem.start, problem.places)
    assert finisher.moved(problem.start * np.nan, []).merit == np.inf
    assert finisher.moved(problem.start, []).merit < np.inf


def test_a_step_is_that_of_the_dense_equations():
    """H is the Laplacian of the free vertices and w; the volume changes by its violation."""
    finisher = SAUSAGE.finisher()
    finisher.run(SAUSAGE.start, SAUSAGE.places)  # which sets y
    free, mesh = ~SAUSAGE.held, SAUSAGE.mesh
    x = SAUSAGE.start + np.where(free[:, None], 0.01 * np.cos(4.0 * SAUSAGE.start), 0.0)
    here, volume = finisher._evaluated(x), total_volume(mesh)
    weights = mesh.vertex_areas / (0.06 * mesh.diagonal) ** 2
    matrix = CellEnergy.of(mesh).laplacian.toarray() + np.diag(weights)
    h = np.kron(matrix[free][:, free], np.eye(3))
    row = volume.gradient(x)[free].reshape(1, -1)
    dense = np.block([[h, row.T], [row, np.zeros((1, 1))]])
    right = -np.append(here.slope[free].ravel(), volume.violation(x))
    step = finisher.step(here)
    assert_allclose(step.h[free].ravel(), np.linalg.solve(dense, right)[:-1], atol=1e-9)
    assert not step.h[SAUSAGE.held].any()
    assert not here.slope[SAUSAGE.held].any()
    assert step.length == pytest.approx(np.linalg.norm(step.h, axis=1).max())


@pytest.mark.parametrize("compiled", [True, False])
def test_a_uniform_growth_has_the_energy_of_its_area(compiled, monkeypatch):
    """|s R - R|^2 is 2 (s - 1)^2 for a triangle, with whatever cells; a rigid motion has none."""
    monkeypatch.setattr(sizes, "COMPILED", 0 if compiled else 10**9)
    mesh, turn = SCENE.mesh, rotation([1.0, 2.0, 3.0], 2.0)
    area = mesh.face_areas.sum()
    for per_cage in (0.0, 40.0, 170.0):
        energy = CellEnergy.of(mesh, per_cage)
        for s in (1.0, 1.3, 0.6):
            value, slope = energy.value_and_slope(s * mesh.vertices @ turn.T + [1.0, -2.0, 0.5])
            assert value == pytest.approx(2.0 * (s - 1.0) ** 2 * area, abs=1e-9 * area)
            expected = (s - 1.0) * (energy.laplacian @ mesh.vertices) @ turn.T
            assert_allclose(slope, expected, atol=1e-9)


@pytest.mark.parametrize("rounds", [0, 2])
def test_with_and_without_compiled_kernels_energies_are_the_same(rounds, monkeypatch):
    pytest.importorskip("numba")
    energy, found = CellEnergy.of(SCENE.mesh, 40.0 * rounds), []
    for size in (0, 10**9):
        monkeypatch.setattr(sizes, "COMPILED", size)
        found.append(energy.value_and_slope(SAUSAGE.start))
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-12)
    assert_allclose(found[0][1], found[1][1], atol=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("n", [0, 1, 40])
def test_the_factored_matrix_solves_as_the_dense_one(n, compiled, monkeypatch):
    monkeypatch.setattr(sizes, "COMPILED", 0 if compiled else 10**9)
    rng = np.random.default_rng(n)
    some = sparse.random_array((n, n), density=0.1, rng=rng)
    matrix = (
        sparse.csr_array(some @ some.T + sparse.eye_array(n)) if n else sparse.csr_array((0, 0))
    )
    right = rng.normal(size=(n, 3))
    expected = np.linalg.solve(matrix.toarray(), right) if n else right
    assert_allclose(factored(matrix)(right), expected, atol=1e-12)


def test_a_singular_matrix_is_refused():
    with pytest.raises(MeshError, match="the pose cannot be finished on this mesh"):
        factored(sparse.csr_array(np.ones((2, 2))))


def test_a_pose_with_its_held_vertices_at_other_places_is_on_the_volume():
    mesh, held = SCENE.mesh, SAUSAGE.held
    places = mesh.vertices[held] + np.where(mesh.vertices[held, :1] > 0.0, 0.4, 0.0) * [1, 0, 0]
    x = SAUSAGE.finisher()._at_places(mesh.vertices, places)
    assert_array_equal(x[held], places)
    offset, free = np.zeros(mesh.n_vertices), np.ones(mesh.n_vertices, dtype=bool)
    offset[held], free[held] = places[:, 0] - mesh.vertices[held, 0], False
    beside = free & (mesh.adjacency @ offset > 0.0)
    assert (x - mesh.vertices)[beside, 0].min() > 0.05  # they were moved along
    assert abs(exact_volume_change(mesh.vertices, x, mesh.faces)) < 1e-13


def test_a_mirrored_pose_far_from_its_volume_is_not_moved_there():
    mesh, held = SCENE.mesh, np.arange(SCENE.mesh.n_vertices) > 2
    swollen = Problem(mesh, held, 1.5 * mesh.vertices[held], mesh.vertices)
    finisher = swollen.finisher()
    found = finisher.run(swollen.start, swollen.places)
    made = finisher.made(found, lambda x: x)
    assert np.abs(made.vertices - found.vertices).max() < mesh.diagonal


def test_a_mirrored_pose_lands_again_where_it_misses_several_volumes(monkeypatch):
    monkeypatch.setattr(exact_volume, "_NEWTON_STEPS", 3)
    mesh, count = SCENE.mesh, SCENE.mesh.n_vertices
    pair = combined(mesh, mesh.with_vertices(mesh.vertices + [0.0, 5.0, 0.0]))
    held = np.tile(SAUSAGE.held, 2)
    finisher = Problem(pair, held, pair.vertices[held], pair.vertices).finisher()
    factor = np.where(held, 1.0, 1.2)[:, None]
    found = Finish(pair.vertices * factor, (), 0, 0.0, Status.CONVERGED)
    made = finisher.made(found, lambda x: x).vertices
    for x, rest in ((made[:count], mesh.vertices), (made[count:], pair.vertices[count:])):
        assert abs(exact_volume_change(rest, x, mesh.faces)) < 1e-13
