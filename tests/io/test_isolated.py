"""Files of VTK and PyMeshLab are read in a child process with limits, or without it."""

from __future__ import annotations

import logging
import sys

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import CUBE, icosphere
from vtkmodules.vtkCommonCore import vtkOutputWindow

from vtk_segdeform import Mesh
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import isolated, meshlab
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.surface import read_mesh

NAMES = ["<&\">'", "a\nb", "100%", "%3C", "Größe", "身体", "a b"]


def named(tmp_path):
    """Write a legacy file, which can store any name; return the surface with all its arrays."""
    surface = to_polydata(Mesh(*CUBE))
    for k, name in enumerate(NAMES):
        surface.point_data[name] = np.arange(8.0) + k
        surface.cell_data[name] = np.arange(12) + k
    surface.field_data["maker"] = ["somebody", "<else>"]
    surface.point_data["uv"] = np.arange(16.0).reshape(8, 2)
    surface.point_data.active_texture_coordinates_name = "uv"
    surface.save(tmp_path / "a.vtk")
    return surface


@pytest.mark.parametrize("frozen", [False, True])
def test_the_whole_file_is_read_with_or_without_the_child_process(
    tmp_path, monkeypatch, caplog, frozen
):
    surface = named(tmp_path)
    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    window = vtkOutputWindow.GetInstance()
    with caplog.at_level(logging.WARNING):
        again = read_polydata(tmp_path / "a.vtk")
    assert [("without protection" in text) for text in caplog.messages] == [True] * frozen
    assert vtkOutputWindow.GetInstance() is window
    assert_array_equal(again.points, surface.points)
    assert_array_equal(again.faces, surface.faces)
    assert set(again.point_data) == {*NAMES, "uv"}
    for name in NAMES:
        assert_array_equal(again.point_data[name], surface.point_data[name])
        assert_array_equal(again.cell_data[name], surface.cell_data[name])
    assert list(again.field_data["maker"]) == ["somebody", "<else>"]
    assert again.point_data.active_texture_coordinates_name == "uv"


@pytest.mark.usefixtures("vtk_without_child")
@pytest.mark.parametrize("suffix", [".vtp", ".vtk", ".vtkhdf"])
def test_names_of_components_do_not_make_a_file_unreadable(tmp_path, suffix):
    surface = to_polydata(Mesh(*CUBE))
    surface.point_data["way"] = np.arange(16.0).reshape(8, 2)
    for k, name in enumerate(["<{", "Süd 1%"]):
        surface.GetPointData().GetArray("way").SetComponentName(k, name)
    write_mesh(tmp_path / f"a{suffix}", surface)
    assert surface.GetPointData().GetArray("way").GetComponentName(0) == "<{"
    again = read_polydata(tmp_path / f"a{suffix}").GetPointData().GetArray("way")
    if suffix != ".vtkhdf":  # which stores none
        expected = {".vtp": "_{", ".vtk": "<_"}[suffix]
        assert [again.GetComponentName(k) for k in (0, 1)] == [expected, "Süd 1%"]


@pytest.mark.usefixtures("vtk_without_child")
def test_pieces_of_a_file_are_one_surface(tmp_path):
    parts = [pv.Cube().triangulate(), pv.Cube(center=(5, 0, 0)).triangulate()]
    pv.MultiBlock(parts).save(tmp_path / "a.vtkhdf")
    assert read_polydata(tmp_path / "a.vtkhdf").n_cells == 24


def test_reading_that_takes_too_long_is_stopped(tmp_path, monkeypatch):
    write_mesh(tmp_path / "a.vtkhdf", Mesh(*CUBE))
    monkeypatch.setattr(isolated, "_SECONDS", 0.01)
    monkeypatch.setattr(isolated, "_PER_MEGABYTE", 0.0)
    with pytest.raises(MeshError, match=r"a\.vtkhdf: .*reading was stopped after 0 s"):
        read_mesh(tmp_path / "a.vtkhdf")


@pytest.mark.skipif(sys.platform != "linux", reason="needs limits of memory")
def test_reading_that_needs_too_much_memory_is_an_error(tmp_path, monkeypatch):
    write_mesh(tmp_path / "a.vtkhdf", Mesh(*icosphere(4)))
    monkeypatch.setattr(isolated, "_MEMORY", 1)
    monkeypatch.setattr(isolated, "_PER_BYTE", 0)
    with pytest.raises(MeshError, match=r"a\.vtkhdf: "):
        read_mesh(tmp_path / "a.vtkhdf")


@pytest.mark.skipif(not meshlab.available(), reason="needs PyMeshLab")
def test_error_messages_of_pymeshlab_are_passed_on(tmp_path):
    (tmp_path / "a.x3d").write_text("<X3D><unfinished")
    with pytest.raises(MeshError, match=r"a\.x3d: PyMeshLab cannot read it: Unable to open"):
        read_mesh(tmp_path / "a.x3d")


def test_no_temporary_files_are_left_behind(tmp_path, monkeypatch):
    write_mesh(tmp_path / "a.vtkhdf", Mesh(*CUBE))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    read_mesh(tmp_path / "a.vtkhdf")
    (tmp_path / "a.vtkhdf").write_bytes((tmp_path / "a.vtkhdf").read_bytes()[:-200])
    with pytest.raises(MeshError):
        read_mesh(tmp_path / "a.vtkhdf")
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtkhdf"]
