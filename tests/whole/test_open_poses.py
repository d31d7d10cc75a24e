"""Poses of open surfaces from Botsch and Sorkine's benchmark, as given: the bar and the plane.

Botsch and Sorkine's own Laplacian results have distortion 0.321 (bar) and 0.237 (plane);
as-rigid-as-possible (libigl) has 0.064, with 442 crossing faces, and 0.024.
"""

from __future__ import annotations

import numpy as np
import pytest
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


def posed(mesh, selection, matrix, n_regions):
    vertices = mesh.vertices
    fixed, handle = np.flatnonzero(selection == 0), np.flatnonzero(selection == 2)
    targets = vertices[handle] @ matrix[:3, :3].T + matrix[:3, 3]
    solution = deform(mesh, fixed, handle, targets, n_regions=n_regions)
    assert solution.status is Status.CONVERGED
    return mesh, solution


def sharpest(mesh, vertices):
    """Return the least cosine between the normals of two neighbouring faces."""
    a, b, c = vertices[mesh.faces.T]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    one, other = HalfEdges(mesh.faces, mesh.n_vertices).pairs.T // 3
    return np.einsum("ij,ij->i", normal[one], normal[other]).min()


@pytest.mark.parametrize("n_regions", [pytest.param(1, marks=pytest.mark.campaign), 3])
def test_the_bar_twists_by_135_degrees_at_its_volume_without_crossings(n_regions):
    mesh, solution = posed(*given("bar"), n_regions)
    assert distortion(mesh, solution.vertices) < 0.15
    assert abs(solution.volume_change) < 1e-12
    assert not len(self_intersections(solution.vertices, mesh.faces))


@pytest.mark.parametrize(
    "step", [*(pytest.param(k, marks=pytest.mark.campaign) for k in (1, 2, 4)), 8]
)
def test_the_plane_does_not_fold_and_hardly_stretches(step):
    mesh, solution = posed(*coarser_plane(step), 3)
    assert distortion(mesh, solution.vertices) < 0.035
    assert triangle_distortion(mesh, solution.vertices).max() < 0.5
    assert sharpest(mesh, solution.vertices) > sharpest(mesh, mesh.vertices) - 0.2
