"""Objects of VTK, trimesh and meshio, pairs of arrays and meshes are taken as surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import CUBE, icosphere
from vtkmodules.vtkCommonDataModel import (
    vtkMultiBlockDataSet,
    vtkPartitionedDataSetCollection,
    vtkPolyData,
    vtkUnstructuredGrid,
)

import vtk_segdeform as sd
from vtk_segdeform.errors import ArgumentError, MeshError
from vtk_segdeform.io import from_polydata, repair_surface, to_polydata, with_vertices
from vtk_segdeform.io.array_names import get_names
from vtk_segdeform.io.convert import read_polydata, write_mesh


def ball():
    return to_polydata(sd.Mesh(*icosphere(1)))


def raw(data, kind):
    """Return *data* as an object of VTK itself."""
    made = kind()
    made.ShallowCopy(data)
    return made


def blocks():
    inlet, wall = ball(), ball().translate((3.0, 0.0, 0.0))
    for each in (inlet, wall):
        each.point_data["heat"] = np.arange(each.n_points, dtype=float)
    return pv.MultiBlock({"inlet": inlet, "more": pv.MultiBlock({"wall": wall, "none": None})})


def trimesh_ball():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(*icosphere(1), process=False, metadata={"made by": object()})
    mesh.vertex_attributes["heat"] = np.arange(18.0)
    return mesh


def meshio_ball():
    meshio = pytest.importorskip("meshio")
    vertices, faces = icosphere(1)
    heat = {"heat": np.arange(18.0)}
    return meshio.Mesh(vertices, [("triangle", faces)], point_data=heat, cell_sets={"some": [[3]]})


TAKEN = {
    "PolyData": ball,
    "vtkPolyData": lambda: raw(ball(), vtkPolyData),
    "UnstructuredGrid": lambda: ball().cast_to_unstructured_grid(),
    "vtkUnstructuredGrid": lambda: raw(ball().cast_to_unstructured_grid(), vtkUnstructuredGrid),
    "MultiBlock": blocks,
    "vtkMultiBlockDataSet": lambda: raw(blocks(), vtkMultiBlockDataSet),
    "Mesh": lambda: sd.Mesh(*icosphere(1)),
    "pair": lambda: icosphere(1),
    "lists": lambda: tuple(each.tolist() for each in icosphere(1)),
    "trimesh": lambda: trimesh_ball(),
    "meshio": lambda: meshio_ball(),
}


@pytest.mark.parametrize("name", list(TAKEN))
def test_what_holds_a_surface_is_taken_everywhere(tmp_path, name):
    given = TAKEN[name]()
    n = 2 if "Multi" in name else 1
    surface = sd.Surface(given)
    assert surface.mesh.n_vertices == n * 18
    assert from_polydata(given).n_faces == n * 32
    assert repair_surface(given)[0].n_cells == n * 32
    assert with_vertices(given, surface.mesh.vertices + 1.0).n_points == n * 18
    write_mesh(tmp_path / "a.vtp", given)
    assert read_polydata(tmp_path / "a.vtp").n_cells == n * 32
    if name in ("Mesh", "pair", "lists"):
        return
    with pytest.raises(MeshError, match=r"Make one with Surface\(mesh\)\.mesh$"):
        sd.Session(given)
    with pytest.raises(ArgumentError, match=r"faces \(m, 3\); got .*Surface\(mesh\)\.mesh"):
        sd.Mesh(given)


def test_names_of_blocks_are_groups_and_lost_arrays_are_told(tmp_path, caplog):
    given = blocks()
    surface = sd.Surface(given)
    assert get_names(surface.given, "GroupNames") == ["inlet", "wall"]
    assert surface.given.cell_data["Group"].tolist() == 32 * [0] + 32 * [1]
    assert_array_equal(surface.given.point_data["heat"], np.tile(np.arange(18.0), 2))
    assert given["inlet"].cell_data.keys() == []
    surface.write(tmp_path / "a.stl", surface.mesh.vertices)
    text = (tmp_path / "a.stl").read_text()
    assert [line for line in text.split("\n") if line.startswith("solid")] == [
        "solid inlet", "solid wall",
    ]  # fmt: skip
    assert "only some blocks" not in caplog.text
    del given["more"]["wall"].point_data["heat"]
    assert "heat" not in sd.Surface(given).given.point_data
    assert "only some blocks have the point arrays heat: left out" in caplog.text
    unnamed = pv.MultiBlock([ball(), None, ball()])
    unnamed.set_block_name(2, "last")
    raw_blocks = vtkMultiBlockDataSet()
    for k in range(2):
        raw_blocks.SetBlock(k, ball())
    assert get_names(sd.Surface(unnamed).given, "GroupNames") == ["Block-00", "last"]
    assert get_names(sd.Surface(raw_blocks).given, "GroupNames") == ["block 0", "block 1"]
    alone = sd.Surface(pv.MultiBlock({"inlet": ball()})).given
    assert alone.cell_data.keys() == []


def test_an_image_is_refused_with_the_line_that_converts_it(tmp_path):
    image, line = pv.ImageData(), "Surface(pyvista.wrap(mesh).extract_surface(algorithm=None))"
    for call in (
        sd.Surface, from_polydata, repair_surface, lambda it: with_vertices(it, CUBE[0]),
        lambda it: write_mesh(tmp_path / "a.ply", it), sd.segment,
        lambda it: sd.pull(it, 0, [0, 0, 0]),
    ):  # fmt: skip
        with pytest.raises(ArgumentError) as fault:
            call(image)
        assert str(fault.value).endswith(f". Convert it: {line}")
    with pytest.raises(MeshError) as fault:
        sd.Session(image)
    assert str(fault.value).endswith(f". Make one with {line}.mesh")


def test_a_scene_is_refused_with_the_line_that_converts_it():
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene([trimesh_ball()])
    with pytest.raises(ArgumentError, match=r"Convert it: Surface\(mesh.to_mesh\(\)\)$"):
        sd.Surface(scene)
    assert sd.Surface(scene.to_mesh()).mesh.n_vertices == 18


def test_the_lines_for_grids_and_images_work():
    image = pv.ImageData(dimensions=(3, 3, 3))
    surface = sd.Surface(pv.wrap(image).extract_surface(algorithm=None))
    assert surface.mesh.is_closed
    grid = image.cast_to_unstructured_grid()
    with pytest.raises(MeshError, match=r"not of a surface: Surface\(mesh\.extract_surface\(alg"):
        sd.Surface(grid)
    assert sd.Surface(grid.extract_surface(algorithm=None)).mesh.is_closed


@pytest.mark.parametrize(
    "wrong",
    [pv.MultiBlock(), pv.MultiBlock([None]), vtkPartitionedDataSetCollection(), 3, None, "a.ply"],
)
def test_anything_else_is_refused(wrong):
    with pytest.raises(ArgumentError, match="polydata must be a PolyData; got"):
        sd.Surface(wrong)
    with pytest.raises(ArgumentError, match="of a MultiBlock all blocks must be surfaces"):
        sd.Surface(pv.MultiBlock([ball(), pv.ImageData()]))
