"""The shape energy of open surfaces: natural boundary, refinement, halves of closed bodies."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sheets import bent, cup, fin, plate, tube
from solids import icosphere, rotation

from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.deformer.pull import pull
from vtk_segdeform.energy.energy import shape_energy
from vtk_segdeform.energy.operators import surface_operators
from vtk_segdeform.geometry.differential import inner_vertices
from vtk_segdeform.geometry.intrinsic import IntrinsicTriangulation
from vtk_segdeform.geometry.kmeans import cluster_positions
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.subspace.subspace import Subspace

BOTH = pytest.mark.parametrize("n_clusters", [None, 12], ids=["per vertex", "clusters"])
STRETCHES = pytest.mark.parametrize("stretch", [0.0, 10.0])


def operators(mesh):
    surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
    clusters = np.arange(mesh.n_vertices)
    return surface_operators(surface, clusters, inner=inner_vertices(mesh))


def energy_of(mesh, stretch, n_clusters=None):
    """Return the energy over the vertices themselves: W~ is the identity."""
    n = mesh.n_vertices
    clusters = cluster_positions(mesh.vertices, n if n_clusters is None else n_clusters)
    return shape_energy(mesh, Subspace(n, (np.arange(n),), (np.eye(n),)), stretch, clusters)


def value(energy, x):
    return energy.value_and_slope(x)[0]


def on_border(mesh):
    border = np.zeros(mesh.n_vertices, dtype=bool)
    border[mesh.boundary] = True
    return border


@pytest.mark.parametrize("solid", [plate(6, 5), tube(), cup()], ids=["plate", "tube", "cup"])
def test_the_inner_vertices_are_those_that_are_on_no_border(solid):
    mesh = Mesh(*solid)
    assert_array_equal(inner_vertices(mesh), ~on_border(mesh))


def test_inside_its_border_a_mesh_has_the_rows_of_the_body_it_was_cut_from():
    whole = Mesh(*icosphere(3))
    kept = (whole.vertices[whole.faces][:, :, 2] > -0.3).all(axis=1)
    ids, faces = np.unique(whole.faces[kept], return_inverse=True)
    half = Mesh(whole.vertices[ids], faces.reshape(-1, 3))
    inner, one, other = inner_vertices(half), operators(half), operators(whole)
    assert 0 < inner.sum() < half.n_vertices
    assert_array_equal(one.bends, inner)
    assert_allclose(one.delta[inner], other.delta[ids[inner]], rtol=0.0, atol=1e-12)
    assert_allclose(one.areas[inner], other.areas[ids[inner]], rtol=1e-12)
    rows = (3 * ids[:, None] + np.arange(3)).reshape(-1)
    for mine, its in ((one.detail, other.detail), (one.fans, other.fans)):
        of_half = mine.toarray().reshape(-1, 3, half.n_vertices)[inner]
        of_whole = its.toarray()[rows][:, ids].reshape(-1, 3, half.n_vertices)[inner]
        assert_allclose(of_half, of_whole, rtol=0.0, atol=1e-12)


def test_bending_a_plate_converges_to_the_integral_of_the_squared_curvature():
    radius, errors = 0.7, []
    for n in (8, 16, 32):
        mesh = Mesh(*plate(n, n))
        found = value(energy_of(mesh, 0.0), bent(mesh.vertices, radius))
        errors.append(abs(found - 0.25 / radius**2))  # mean curvature 1 / 2 r, over area 1
    # Of first order: a strip half an edge wide, along the border, has no detail.
    assert_array_equal(np.divide(errors[:-1], errors[1:]) > 1.8, True)
    assert errors[-1] < 0.15 * 0.25 / radius**2


@pytest.mark.parametrize("shear", [0.0, 0.2])
def test_deforming_a_plate_in_its_plane_takes_no_bending(shear):
    mesh = Mesh(*plate(9, 7))
    x = mesh.vertices @ np.array([[1.1, shear, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 1.0]])
    energy = energy_of(mesh, 0.0)  # p^T Q p, whose terms cancel: rounding depends on the processor
    assert abs(value(energy, x)) < 1e-16 * np.vdot(np.abs(x), np.abs(energy.quadratic) @ np.abs(x))
    assert value(energy_of(mesh, 10.0), x) > 0.0


@BOTH
@STRETCHES
@pytest.mark.parametrize("solid", [plate(9, 7), cup(10, 6), fin()], ids=["plate", "cup", "fin"])
def test_it_is_zero_with_no_gradient_under_rigid_motion(solid, stretch, n_clusters):
    mesh = Mesh(*solid)
    energy = energy_of(mesh, stretch, n_clusters)
    size = np.abs(energy.quadratic).max()
    turn = rotation([1, 2, 3], 2.0)
    for x in (mesh.vertices, mesh.vertices @ turn.T + [3.0, 2.0, 1.0]):
        energy_there, slope = energy.value_and_slope(x)
        assert abs(energy_there) < 1e-10 * size
        assert np.abs(slope).max() < 1e-10 * size
    moved = mesh.vertices + 0.02 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    rotated = value(energy, moved @ turn.T + [3.0, 2.0, 1.0])
    assert_allclose(rotated, value(energy, moved), rtol=1e-9)


@BOTH
def test_the_slope_is_half_the_gradient(n_clusters):
    mesh, rng = Mesh(*plate(9, 7)), np.random.default_rng(0)
    energy = energy_of(mesh, 10.0, n_clusters)
    x = bent(mesh.vertices, 0.5) + 0.01 * rng.normal(size=mesh.vertices.shape)
    direction = rng.normal(size=x.shape)
    here, slope = energy.value_and_slope(x)
    errors = []
    for t in (2e-4, 1e-4):
        ahead = value(energy, x + t * direction)
        errors.append(abs(ahead - here - 2.0 * t * np.vdot(slope, direction)))
    assert 3.5 < errors[0] / errors[1] < 4.5


@STRETCHES
def test_a_plate_stays_flat_under_handles_in_its_plane(stretch):
    """While it is pulled; a plate that is compressed buckles, as it should."""
    mesh = Mesh(*plate(20, 20))
    regions = Regions.single(mesh)
    x = mesh.vertices[:, 0]
    fixed, handle = np.flatnonzero(x < 0.12), np.flatnonzero(x > 0.88)
    about = np.array([1.0, 0.5, 0.0])
    turn = rotation([0, 0, 1], 0.2)
    targets = (mesh.vertices[handle] - about) @ turn.T + about + [0.3, 0.1, 0.0]
    solution = Deformer(
        mesh,
        regions,
        fit_cages(mesh, regions, 60),
        fixed=fixed,
        handle=handle,
        stretch=stretch,
        preserve_volume=False,
    ).solve(targets)
    assert solution.handle_error < 1e-3
    assert np.abs(solution.vertices[:, 2]).max() < 1e-5  # steps of 1e-7


def test_a_strip_with_one_inner_vertex_can_be_pulled():
    x, y = np.meshgrid(np.linspace(0.0, 4.0, 41), [0.0, 0.2], indexing="ij")
    corners = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = 2 * np.arange(40)
    halves = [a, a + 2, a + 1], [a + 1, a + 2, a + 3]
    strip = np.concatenate([np.column_stack(half) for half in halves])
    n = len(corners)  # at the end a fan around a vertex
    more = [[4.1, 0.1, 0.0], [4.2, 0.0, 0.0], [4.2, 0.2, 0.0]]
    fan = [[n, n - 2, n + 1], [n, n + 1, n + 2], [n, n + 2, n - 1], [n, n - 1, n - 2]]
    mesh = Mesh(np.vstack([corners, more]), np.concatenate([strip, fan]))
    assert inner_vertices(mesh).all()
    at = int(np.argmin(np.abs(mesh.vertices[:, 0] - 1.0)))
    solution = pull(mesh, at, mesh.vertices[at] + [0.0, 0.0, 0.3], refine=False)
    assert solution.status is Status.CONVERGED
    assert solution.handle_error < 1e-4
