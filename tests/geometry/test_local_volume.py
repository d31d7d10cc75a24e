"""Local volume change is exact for affine maps and local for other poses."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import bottle, open_box, sheet, together
from solids import CUBE, icosphere, rotation, torus

from vtk_segdeform import sizes
from vtk_segdeform.geometry import local_volume
from vtk_segdeform.geometry.local_volume import LocalVolume, local_volume_change
from vtk_segdeform.mesh.mesh import Mesh

MESHES = {"sphere": icosphere(3), "torus": torus(), "cube": CUBE}


@pytest.fixture(params=[False, True], ids=["vertices", "cells"])
def either(request, monkeypatch):
    """Compute on all vertices, as for small meshes, and on cells, as for large ones."""
    if request.param:
        monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", 100)
        monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 400)
        monkeypatch.setattr(local_volume, "ROWS_AT_ONCE", 300)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("solid", MESHES.values(), ids=MESHES)
def test_it_is_zero_under_rigid_motion_and_the_determinant_under_affine_maps(solid):
    mesh = Mesh(*solid)
    local = LocalVolume(mesh)
    x = mesh.vertices
    assert_allclose(local.change(x @ rotation([1, 2, 3], 1.0).T + [5, 6, 7]), 0.0, atol=1e-12)
    matrix = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, -0.1], [0.2, 0.0, 1.1]])
    assert_allclose(local.change(x @ matrix.T), np.linalg.det(matrix) - 1.0, atol=1e-12)


@pytest.mark.usefixtures("either")
def test_a_body_that_reached_into_another_can_be_moved_away():
    vertices, faces = icosphere(3)
    count = len(vertices)
    both = np.vstack([vertices, 0.7 * vertices + [0.0, 0.0, 1.2]])
    local = LocalVolume(Mesh(both, np.vstack([faces, faces + count])))
    apart = both + np.repeat([[0.0, 0.0, 0.0], [0.3, 0.0, 2.0]], count, axis=0)
    assert_allclose(local.change(apart), 0.0, atol=1e-12)


def test_cells_agree_with_vertices_and_interpolate_smoothly(monkeypatch):
    ball, faces = icosphere(5)
    mesh = Mesh(ball * [3.0, 0.8, 0.8], faces)
    x = mesh.vertices
    girth = 1.0 - 0.3 * np.exp(-(x[:, :1] ** 2) / 0.5)
    pose = x * np.hstack([np.ones_like(girth), girth, girth])
    whole = local_volume_change(mesh, pose)
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", 100)
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 500)
    local = LocalVolume(mesh)
    cells = local.change(pose)
    assert_allclose(cells, whole, atol=0.12)  # of 0.44: the smoothing differs slightly
    assert np.sqrt(np.square(cells - whole).mean()) < 0.03
    i, j = mesh.edges.T
    steps, smooth = np.abs(cells[i] - cells[j]), np.abs(whole[i] - whole[j])
    assert steps.max() < 2.5 * smooth.max()
    assert steps.mean() < 1.2 * smooth.mean()


def test_cells_on_one_side_of_a_thin_plate_do_not_affect_the_other(monkeypatch):
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", 100)
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 1500)
    ball, faces = icosphere(5)
    local = LocalVolume(Mesh(ball * [1.0, 1.0, 0.02], faces))
    (matrix,) = local._interpolation
    rows = np.repeat(np.arange(len(ball)), np.diff(matrix.indptr))
    height = (local._means @ ball)[matrix.indices, 2]
    high = np.abs(ball[rows, 2]) > 0.7
    assert np.count_nonzero(high) > 3000
    assert (np.sign(height[high]) == np.sign(ball[rows[high], 2])).all()


@pytest.mark.parametrize("with_a_body", [False, True])
def test_tiny_components_are_handled_and_do_not_affect_a_body_beside_them(monkeypatch, with_a_body):
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    places = 4.0 * np.stack(np.meshgrid(*[np.arange(8.0)] * 3), axis=-1).reshape(-1, 3)
    x = (places[:, None] + 0.1 * corners).reshape(-1, 3)
    faces = (4 * np.arange(len(places))[:, None, None] + triangles).reshape(-1, 3)
    if with_a_body:
        ball, more = icosphere(4)
        x, faces = np.vstack([x, 9.0 * ball - 50.0]), np.vstack([faces, len(x) + more])
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", 100)
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 200)
    change = local_volume_change(Mesh(x, faces), x * [1.0, 1.0, 1.1])
    assert np.isfinite(change).all()
    assert_allclose(change[4 * len(places) :] if with_a_body else change, 0.1, atol=1e-9)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("mesh", [open_box(), bottle(24, 24)], ids=["box", "bottle"])
def test_an_open_body_has_local_volume_up_to_its_border(mesh):
    local, x = LocalVolume(mesh), mesh.vertices
    assert_allclose(local.change(x @ rotation([1, 2, 3], 1.0).T + [5, 6, 7]), 0.0, atol=1e-12)
    change = local.change(x * [1.0, 1.0, 1.2])
    known = np.abs(change) > 0.0
    assert known.mean() > 0.9
    assert_allclose(change[known], 0.2, atol=1e-12)


def waves(n=20):
    return sheet(lambda u, v: (u, v, 0.1 * np.sin(9 * u)), n, n)


@pytest.mark.usefixtures("either")
def test_an_open_sheet_has_no_local_volume():
    mesh = waves()
    posed = np.random.default_rng(0).normal(size=mesh.vertices.shape)
    assert not local_volume_change(mesh, posed).any()


@pytest.mark.usefixtures("either")
def test_a_sheet_beside_a_body_does_not_change_its_local_volume():
    body = Mesh(*MESHES["sphere"])
    both = together(waves(), body)
    posed = both.vertices + 0.1 * np.sin(5.0 * both.vertices[:, [1, 2, 0]])
    change = local_volume_change(both, posed)
    n = waves().n_vertices
    assert not change[:n].any()
    assert_allclose(change[n:], local_volume_change(body, posed[n:]), atol=1e-12)
