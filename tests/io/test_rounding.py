"""Coordinates that a format rounds: the loss is told with its size, and avoided where it can be."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io import meshlab, read_polydata, to_polydata, triangles_of, write_mesh
from vtk_segdeform.io.gltf.buffers import Document

UTM = np.array([500_000.0, 5_400_000.0, 300.0])
BALL = models.sphere(500)
TOLD = re.compile(
    r"moved by up to (\S+) \((\S+) % of model size\)(, the volume changed by (\S+) %)?"
)


def at(place, mesh=BALL):
    return sd.Mesh(mesh.vertices + place, mesh.faces)


def told(caplog):
    """Return what a warning tells: the displacement, its share, and the change of the volume."""
    found = [match for text in caplog.messages if (match := TOLD.search(text))]
    assert len(found) <= 1
    return [float(found[0][k] or 0.0) for k in (1, 2, 4)] if found else None


def measured(path, mesh):
    """Return the same, of the file as it is read again."""
    again = read_polydata(path)
    points, middle = np.asarray(again.points), mesh.vertices.mean(axis=0)
    moved = cKDTree(points).query(mesh.vertices)[0].max()
    before = signed_volume(mesh.vertices - middle, mesh.faces)
    after = signed_volume(points - middle, triangles_of(again))
    return moved, 100.0 * moved / mesh.diagonal, 100.0 * (after - before) / before


@pytest.mark.parametrize("suffix", [".stl", *([".3ds"] if meshlab.available() else [])])
def test_a_body_far_from_the_origin_loses_what_is_told(tmp_path, caplog, suffix):
    mesh = at(UTM)
    write_mesh(tmp_path / f"a{suffix}", mesh)
    assert_allclose(told(caplog), measured(tmp_path / f"a{suffix}", mesh), rtol=0.06)
    assert told(caplog)[0] > 0.2


@pytest.mark.parametrize("suffix", [".stl", ".glb", ".gltf", ".ply", ".vtp", ".obj"])
@pytest.mark.parametrize("place", [0.0, 30.0])
def test_nothing_is_told_where_nothing_is_lost(tmp_path, caplog, suffix, place):
    write_mesh(tmp_path / f"a{suffix}", at(place))
    assert told(caplog) is None
    assert np.abs(measured(tmp_path / f"a{suffix}", at(place))).max() < 1e-3


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_new_gltf_file_has_a_translation_and_loses_nothing(tmp_path, caplog, suffix):
    path = tmp_path / f"a{suffix}"
    write_mesh(path, at(UTM))
    assert told(caplog) is None
    (node,) = Document(path.read_bytes()).items("nodes")
    shift = np.array(node["translation"])
    assert_allclose(shift, UTM, atol=1.0)
    assert np.array_equal(shift, shift.astype("f4"))  # for readers in single precision
    again = read_polydata(path)
    assert_allclose(again.points, at(UTM).vertices, rtol=0.0, atol=2e-7)
    moved = again.copy()
    moved.points = again.points + 0.1
    write_mesh(path, moved)
    assert told(caplog) is None
    assert_allclose(read_polydata(path).points, moved.points, rtol=0.0, atol=2e-7)


def test_a_gltf_file_that_is_moved_far_keeps_its_nodes_and_tells_the_loss(tmp_path, caplog):
    path = tmp_path / "a.glb"
    write_mesh(path, at(0.0))
    surface = read_polydata(path)
    surface.points = surface.points + UTM
    write_mesh(path, surface)
    assert Document(path.read_bytes()).items("nodes") == [{"mesh": 0}]
    assert_allclose(told(caplog), measured(path, at(UTM)), rtol=0.06)
    assert told(caplog)[0] > 0.2


def test_open_and_empty_and_infinite_surfaces_are_told_without_a_volume(tmp_path, caplog):
    sheet = to_polydata(models.sphere(200))
    sheet.points = sheet.points + UTM
    sheet = sheet.extract_cells(range(sheet.n_cells // 2)).extract_surface(algorithm=None)
    write_mesh(tmp_path / "a.stl", sheet)
    assert told(caplog)[0] > 0.2
    assert told(caplog)[2] == 0.0
    caplog.clear()
    sheet.points[3] = np.inf
    write_mesh(tmp_path / "a.stl", sheet)
    assert told(caplog)[0] > 0.2
    caplog.clear()
    write_mesh(tmp_path / "a.stl", pv.PolyData(np.zeros((1, 3))))
    assert told(caplog) is None
