"""Poses of open surfaces from Botsch and Sorkine's benchmark, as given: the bar and the plane.

Botsch and Sorkine's own Laplacian results have distortion 0.321 (bar) and 0.237 (plane);
as-rigid-as-possible (libigl) has 0.064, with 442 crossing faces, and 0.024.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from real_meshes import botsch_sorkine, path_of

from vtk_segdeform.deformer.deform import deform
from vtk_segdeform.geometry.distortion import distortion, triangle_distortion
from vtk_segdeform.io.surface import Surface
from vtk_segdeform.mesh.intersections import self_intersections
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.mesh.topology import HalfEdges
from vtk_segdeform.solver.solution import Status


def given(name):
    vertices, _, selection, matrix = botsch_sorkine(name)
    mesh = Surface.read(path_of(f"botsch-sorkine/{name}.off")).mesh
    assert_array_equal(mesh.vertices, vertices)
    return mesh, selection, matrix


def coarser_plane(step):
    """Return the plane with every *step*-th vertex along both sides."""
    mesh, selection, matrix = given("plane")
    kept = np.arange(mesh.n_vertices).reshape(201, 201)[::step, ::step].ravel()
    n = 200 // step + 1
    a = np.arange(n * n).reshape(n, n)[:-1, :-1].ravel()
    faces = np.concatenate([np.stack(f, 1) for f in ([a, a + n, a + n + 1], [a, a + n + 1, a + 1])])
    return Mesh(mesh.vertices[kept], faces), selection[kept], matrix


def posed(mesh, selection, matrix, n_regions, n_cage_vertices=155):
    vertices = mesh.vertices
    fixed, handle = np.flatnonzero(selection == 0), np.flatnonzero(selection == 2)
    targets = vertices[handle] @ matrix[:3, :3].T + matrix[:3, 3]
    solution = deform(
        mesh, fixed, handle, targets, n_regions=n_regions, n_cage_vertices=n_cage_vertices
    )
    assert solution.status in (Status.CONVERGED, Status.STEP_LIMIT)  # not MISSED
    return mesh, solution


def sharpest(mesh, vertices):
    """Return the least cosine between the normals of two neighbouring faces."""
    a, b, c = vertices[mesh.faces.T]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    one, other = HalfEdges(mesh.faces, mesh.n_vertices).pairs.T // 3
    return np.einsum("ij,ij->i", normal[one], normal[other]).min()


def coarser_bar(sides=4, rings=26):
    """Return a bar of the size and the pose of the given one, open at both ends."""
    mesh, selection, matrix = given("bar")
    x = mesh.vertices
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    at = np.arange(4 * sides) / sides
    square = np.column_stack([np.interp(at, np.arange(5), corner) for corner in corners.T])
    u, z = np.meshgrid(np.arange(4 * sides), np.linspace(0.0, 1.0, rings), indexing="ij")
    points = np.column_stack([square[u.ravel()], z.ravel()]) * np.ptp(x, axis=0) + x.min(axis=0)
    ids = np.arange(u.size).reshape(u.shape)
    a, b = ids[:, :-1], np.roll(ids, -1, axis=0)[:, :-1]
    faces = [[a, b, b + 1], [a, b + 1, a + 1]]
    mesh = Mesh(points, np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in faces]))
    fixed, handle = (x[selection == role, 2] for role in (0, 2))
    roles = np.where(points[:, 2] <= fixed.max(), 0, np.where(points[:, 2] >= handle.min(), 2, 1))
    return mesh, roles, matrix


@pytest.mark.parametrize(
    ("bar", "n_regions"),
    every(3, [(coarser_bar, 3), (lambda: given("bar"), 3), (lambda: given("bar"), 1)]),
    ids=["coarser", "given, 3 regions", "given, 1 region"],
)
def test_the_bar_twists_by_135_degrees_at_its_volume_without_crossings(bar, n_regions):
    mesh, solution = posed(*bar(), n_regions)
    assert distortion(mesh, solution.vertices) < 0.15
    assert abs(solution.volume_change) < 1e-12
    assert not len(self_intersections(solution.vertices, mesh.faces))


@pytest.mark.parametrize(
    ("step", "n_cage_vertices"), every(5, [(10, 60), (8, 155), (4, 155), (2, 155), (1, 155)])
)
def test_the_plane_does_not_fold_and_hardly_stretches(step, n_cage_vertices):
    mesh, solution = posed(*coarser_plane(step), 3, n_cage_vertices)
    assert distortion(mesh, solution.vertices) < 0.06  # it stays near the cages, which are few
    assert triangle_distortion(mesh, solution.vertices).max() < 0.5
    assert sharpest(mesh, solution.vertices) > sharpest(mesh, mesh.vertices) - 0.2
