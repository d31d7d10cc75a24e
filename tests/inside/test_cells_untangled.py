"""The inside of a volume mesh: no cell inverted, the energy's derivatives, what is impossible."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from volumes import TYPES, bar, bent

import vtk_segdeform as sd
from vtk_segdeform.inside.cells import Corners
from vtk_segdeform.inside.untangling import _Energy, inner_points
from vtk_segdeform.kernels import dispatch


def corners_of(grid):
    [(kind, ids)] = grid.cells_dict.items()
    return Corners.of(np.array(grid.points, dtype=float), [(kind, np.arange(len(ids)), ids)])


def inner(corners, n):
    free = np.zeros(n, dtype=bool)
    free[corners.points] = True
    free[corners.faces] = False
    return free


@pytest.mark.parametrize("kind", every(2, TYPES))
def test_a_bar_bent_by_60_degrees_keeps_its_cells(kind):
    volume, x = bent(bar(kind), 60.0)
    pose = volume.pose(x)
    assert not len(pose.inverted)
    assert pose.smallest > 0.3 * pose.smallest_before
    on_surface = volume.surface.moved(x).points
    used = np.unique(volume.surface.mesh.faces)
    own = np.isin(volume.surface.vertex_of, used) & ~inner(corners_of(volume.grid), len(on_surface))
    assert_array_equal(pose.points[own], np.asarray(on_surface)[own])


def test_cells_that_the_harmonic_start_inverts_at_a_dent_are_turned_back():
    grid = bar("hexahedron", 8, 32, taper=0.0)
    corners, rest = corners_of(grid), np.array(grid.points, dtype=float)
    start, side = rest.copy(), rest[:, 0] > 0.49
    start[side, 0] -= 0.8 * np.exp(-((rest[side, 1:] - [0.0, 2.0]) ** 2).sum(axis=1) / 0.06)
    free = inner(corners, len(rest))
    harmonic = _Energy(corners, rest, free).harmonic(start)
    assert (corners.scaled_jacobians(harmonic, grid.n_cells) <= 0.0).any()
    found = inner_points(corners, rest, start, free)
    assert corners.scaled_jacobians(found, grid.n_cells).min() > 0.2


@pytest.mark.parametrize("kind", TYPES)
def test_scaled_jacobians_are_those_of_vtk(kind):
    grid = bar(kind, 3, 6)
    rng = np.random.default_rng(3)
    for shaken in (0.0, 0.02):
        grid.points = np.array(grid.points) + shaken * rng.normal(size=(grid.n_points, 3))
        expected = grid.cell_quality("scaled_jacobian")["scaled_jacobian"]
        found = corners_of(grid).scaled_jacobians(np.array(grid.points), grid.n_cells)
        if kind != "pyramid":  # VTK measures pyramids by other tetrahedra
            assert_allclose(found[expected > 0.0], expected[expected > 0.0], atol=1e-9)
        assert_array_equal(found > 0.0, expected > 0.0)


@pytest.mark.parametrize("eps", [0.0, 0.1])
def test_the_slope_is_that_of_the_energy(eps):
    grid = bar("tetra", 3, 4)
    corners, rest = corners_of(grid), np.array(grid.points, dtype=float)
    free = inner(corners, len(rest))
    energy, rng = _Energy(corners, rest, free), np.random.default_rng(5)
    x = rest.copy()
    x[free] += (0.2 if eps else 0.02) * rng.normal(size=x[free].shape)
    assert (energy.at(x, 1.0).d.min() < 0.0) == (eps > 0.0)
    move = rng.normal(size=x[free].shape)
    state = energy.at(x, eps)

    def value(step):
        there = x.copy()
        there[free] += step * move
        return energy.at(there, eps).value

    expected = (value(1e-5) - value(-1e-5)) / 2e-5
    assert_allclose(np.vdot(energy.slope(state), move), expected, rtol=1e-6)
    assert energy.at(rest, 1e-9).value == pytest.approx(energy.at(rest, 0.0).value)
    hessian, diagonal = energy.hessian(state)
    assert np.vdot(move, hessian(move)) > 0.0
    one = np.zeros_like(move)
    one[2, 1] = 1.0
    assert_allclose(hessian(one)[2, 1], diagonal[2, 1])


@pytest.mark.parametrize("eps", [0.0, 0.1])
def test_compiled_and_plain_energies_agree(eps, monkeypatch):
    pytest.importorskip("numba")
    grid = bar("hexahedron", 3, 5)
    corners, rest = corners_of(grid), np.array(grid.points, dtype=float)
    free, rng = inner(corners, len(rest)), np.random.default_rng(9)
    x = rest + (0.2 if eps else 0.02) * rng.normal(size=rest.shape)
    moves = rng.normal(size=(int(free.sum()), 3))

    def found():
        energy = _Energy(corners, rest, free)
        state = energy.at(x, eps)
        product, diagonal = energy.hessian(state)
        return state.value, state.d, state.terms, energy.slope(state), diagonal, product(moves)

    dispatch.wait_until_compiled()
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED", 0)
    quick = found()
    monkeypatch.setattr(dispatch, "_kernels", lambda: None)
    plain = found()
    assert (quick[1].min() < 0.0) == (eps > 0.0)
    assert not np.array_equal(quick[2], plain[2])  # by two programs
    for own, other in zip(quick, plain, strict=True):
        assert_allclose(own, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())


def test_the_hessian_of_tetrahedra_is_exact_at_rest():
    """The part left out is that of the volume, which inner points do not change."""
    grid = bar("tetra", 3, 4)
    corners, rest = corners_of(grid), np.array(grid.points, dtype=float)
    free = inner(corners, len(rest))
    energy, move = _Energy(corners, rest, free), np.random.default_rng(6).normal(size=(12, 3))
    x = [rest.copy() for _ in range(2)]
    for each, sign in zip(x, (1.0, -1.0), strict=True):
        each[free] += 1e-6 * sign * move
    slopes = [energy.slope(energy.at(each, 0.0)) for each in x]
    expected = (slopes[0] - slopes[1]) / 2e-6
    assert_allclose(energy.hessian(energy.at(rest, 0.0))[0](move), expected, atol=1e-6)


def test_a_stretched_surface_stretches_the_inside():
    volume = sd.VolumeMesh(bar("wedge"))
    matrix = np.array([[1.3, 0.2, 0.0], [0.0, 0.9, 0.1], [0.3, 0.0, 1.1]])
    pose = volume.pose(volume.surface.mesh.vertices @ matrix)
    assert_allclose(pose.points, np.asarray(volume.grid.points) @ matrix, atol=2e-3)


def test_a_cell_that_the_surface_inverts_is_told():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
    grid = pv.UnstructuredGrid({10: np.array([[0, 1, 2, 3], [1, 2, 3, 4]])}, points)
    volume = sd.VolumeMesh(grid)
    x = volume.surface.mesh.vertices.copy()
    x[0] = 0.5
    pose = volume.pose(x)
    assert_array_equal(pose.inverted, [0])
    assert_array_equal(pose.without_inner_points, [0])
    assert "1 inverted, 1 of them with all points on the surface" in pose.summary()
    assert "no cell inverted" in volume.at_rest.summary()


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["cactus", "dinosaur", *range(1, 9)])
def test_ten_bodies_bent_by_60_degrees(name, monkeypatch, tmp_path):
    pytetwild = pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)  # where it writes files
    from vtk_segdeform.benchmarks.tasks import Hand

    make = {"cactus": sd.models.cactus, "dinosaur": sd.models.dinosaur}
    body = make[name](2500) if name in make else sd.models.random_limbs(2500, seed=name)
    points, cells = pytetwild.tetrahedralize(
        np.array(body.vertices), np.array(body.faces, dtype=np.int32), edge_length_fac=0.03
    )
    volume = sd.VolumeMesh(pv.UnstructuredGrid({10: np.asarray(cells, dtype=int)}, points))
    hand = Hand.on(volume.surface.mesh)
    targets = hand.targets(np.radians(60.0))
    solution = sd.deform(volume.surface.mesh, hand.fixed, hand.handle, targets)
    pose = volume.pose(solution.vertices)
    assert not len(pose.inverted)
    assert pose.smallest > 0.3 * pose.smallest_before
