"""Vertex normals agree with VTK and the volume gradient, in any frame and unit."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from open_surfaces import moebius
from solids import icosphere, rotation
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkTriangleMeshPointNormals

from vtk_segdeform import Mesh, models
from vtk_segdeform.geometry.normals import VertexNormals
from vtk_segdeform.io.polygons import polydata_of

MESHES = {
    "sphere": lambda: Mesh(*icosphere(4)),
    "torus": lambda: models.torus(3000),
    "cactus": lambda: models.cactus(1200),
}
MESHES = {name: functools.cache(made) for name, made in MESHES.items()}


def posed(mesh: Mesh) -> np.ndarray:
    x = mesh.vertices
    return x + 0.1 * np.sin(3.0 * x[:, [1, 2, 0]])


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("name", MESHES)
def test_they_agree_with_vtk(name):
    mesh = MESHES[name]()
    x = posed(mesh)
    drawn = vtkTriangleMeshPointNormals()
    drawn.SetInputData(polydata_of(x, np.full(mesh.n_faces, 3), mesh.faces.ravel()))
    drawn.Update()
    theirs = vtk_to_numpy(drawn.GetOutput().GetPointData().GetNormals())
    assert_allclose(VertexNormals(mesh).of(x), theirs, atol=1e-6)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("unit", [1e-60, 1e-6, 1e60])
def test_they_rotate_with_the_mesh_and_do_not_depend_on_its_unit(unit):
    mesh, turn = MESHES["torus"](), rotation([1.0, 2.0, -0.5], 1.1)
    before = VertexNormals(mesh).of(posed(mesh))
    moved = Mesh(unit * mesh.vertices, mesh.faces)
    after = VertexNormals(moved).of(unit * posed(mesh) @ turn.T)
    assert_allclose(after, before @ turn.T, atol=1e-6)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("coordinate", [0.0, np.nan])
def test_a_mesh_without_area_has_zero_normals(coordinate):
    mesh = MESHES["sphere"]()
    normals = VertexNormals(mesh).of(np.full(mesh.vertices.shape, coordinate))
    assert_array_equal(normals, np.zeros(mesh.vertices.shape))


def cut_ball() -> Mesh:
    """Return a ball with five holes."""
    points, faces = icosphere(5)
    spots = points[[0, 1, 2, 3, 700]]
    near = np.linalg.norm(points[faces].mean(axis=1)[:, None] - spots, axis=2).min(axis=1) < 0.3
    used, kept = np.unique(faces[~near], return_inverse=True)
    return Mesh(points[used], kept.reshape(-1, 3))


def finned_ball() -> Mesh:
    """Return a ball with a fin, at an edge with three faces, and another ball at one vertex."""
    points, faces = icosphere(4)
    n, edge = len(points), faces[0, :2]
    fin = [[edge[0], edge[1], 2 * n - 1]]
    top, bottom = points[:, 2].argmax(), points[:, 2].argmin()
    other = np.arange(n) + n
    other[bottom], other[np.arange(n) > bottom] = top, other[np.arange(n) > bottom] - 1
    aside = (points - points[bottom]) @ rotation((1.0, 0.0, 0.0), 1.5).T + points[top]
    apart = np.delete(aside, bottom, axis=0)
    tip = 1.5 * points[edge].mean(axis=0)
    return Mesh(np.vstack([points, apart, tip]), np.vstack([faces, other[faces], fin]))


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("make", [cut_ball, finned_ball])
def test_at_borders_and_non_manifold_vertices_they_are_sums_over_the_faces(make):
    mesh = make()
    x = posed(mesh)
    expected = np.zeros_like(x)
    a, b, c = x[mesh.faces.T]
    for corner in mesh.faces.T:
        np.add.at(expected, corner, np.cross(b - a, c - a))
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert_allclose(VertexNormals(mesh).of(x), expected, atol=1e-6)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("flipped", [0, 700])
def test_on_a_surface_with_one_side_they_agree_with_the_faces_up_to_the_turned_corners(flipped):
    strip = moebius()  # a seam moves with the faces that are flipped
    faces = np.array(strip.regular_faces)
    faces[:flipped] = faces[:flipped, ::-1]
    mesh = Mesh(strip.points, faces)
    x = mesh.vertices @ rotation([1.0, 2.0, -0.5], 1.1).T
    normals = VertexNormals(mesh)
    signs = np.ones(mesh.faces.size)
    signs[normals.turned] = -1.0
    assert len(np.unique(mesh.faces.ravel()[normals.turned])) == 8  # the seam, all across
    a, b, c = x[mesh.faces.T]
    of_face = np.cross(b - a, c - a)
    of_face /= np.linalg.norm(of_face, axis=1, keepdims=True)
    of_corner = normals.of(x)[mesh.faces] * signs.reshape(-1, 3, 1)
    assert np.einsum("fci,fi->fc", of_corner, of_face).min() > 0.99


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("count", every(2, [3, 300]))
@pytest.mark.parametrize("has_one_side", [False, True])
def test_those_of_some_vertices_are_theirs_among_all(has_one_side, count):
    strip = moebius()
    mesh = Mesh(strip.points, strip.regular_faces) if has_one_side else MESHES["cactus"]()
    some = np.random.default_rng(2).choice(mesh.n_vertices, count, replace=False)
    normals = VertexNormals(mesh)
    x = mesh.vertices * [1.0, 0.7, 1.2]
    assert_allclose(normals.subset(some)(x), normals.of(x)[some], atol=1e-6)
