"""Grids of surface cells are read as surfaces, with the arrays of their cells."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from test_vtk_formats import contents
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkIdTypeArray, vtkStringArray

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.convert import read_polydata
from vtk_segdeform.io.surface import Surface

RING = np.arange(6) * np.pi / 3.0
POINTS = np.stack([np.cos(RING), np.sin(RING), 0.0 * RING], axis=1)
POINTS = np.concatenate([POINTS, POINTS + [0.0, 0.0, 1.0], [[9.0, 9.0, 9.0]]])
SIDES = [[k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6] for k in range(6)]
# Types of VTK and corners, in no order of a PolyData.
CELLS = [
    (9, SIDES[0]), (1, [12]), (7, SIDES[1]), (5, [0, 2, 1]), (5, [0, 3, 2]), (3, [0, 12]),
    (7, [0, 5, 4, 3]), (6, [6, 7, 11, 8]), (4, [1, 12, 2]), (5, [8, 10, 11]), (2, [12, 12]),
    (7, [8, 9, 10]), *((9, side) for side in SIDES[2:]),
]  # fmt: skip


def grid(cells=CELLS):
    rows = np.concatenate([[len(corners), *corners] for _, corners in cells])
    made = pv.UnstructuredGrid(rows, np.array([kind for kind, _ in cells]), POINTS)
    made.cell_data["number"] = np.arange(len(cells))
    made.cell_data["wide"] = np.arange(3.0 * len(cells)).reshape(-1, 3)
    made.point_data["place"] = np.arange(len(POINTS)) * 0.5
    made.field_data["times"] = [1.0, 2.0]
    for attributes in (made.GetPointData(), made.GetCellData()):  # in no alphabetical order
        n = attributes.GetArray(0).GetNumberOfTuples()
        ids, named = vtkIdTypeArray(), vtkFloatArray()
        for array, name, width in ((ids, "ids", 1), (named, "a named one", 2)):
            array.SetName(name)
            array.SetNumberOfComponents(width)
            array.SetNumberOfTuples(n)
            for k in range(n * width):
                array.SetValue(k, 3 * k)
            attributes.AddArray(array)
        named.SetComponentName(1, "second")
    for attributes in (made.GetPointData(), made.GetCellData()):
        attributes.SetActiveAttribute(-1, 0)
    return made


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
@pytest.mark.parametrize("cells", [CELLS, [*CELLS[:1], *CELLS[3:5]]], ids=["all", "plain"])
def test_the_cells_of_a_grid_are_read_with_their_arrays_and_written(tmp_path, suffix, cells):
    given = grid(cells)
    names = vtkStringArray()
    names.SetName("names")
    for k in range(given.n_cells):
        names.InsertNextValue(f"Körper {k}")
    given.GetCellData().AddArray(names)
    given.save(tmp_path / f"a{suffix}")
    surface = Surface.read(tmp_path / f"a{suffix}")
    kinds = [(1, 2), (3, 4), (5, 7, 9), (6,)]
    order = [k for kind in kinds for k, (type_, _) in enumerate(cells) if type_ in kind]
    found = surface.given
    assert_array_equal(found.cell_data["number"], order)
    assert_array_equal(found.cell_data["wide"], given.cell_data["wide"][order])
    texts = found.GetCellData().GetAbstractArray("names")
    assert [texts.GetValue(k) for k in range(len(order))] == [f"Körper {k}" for k in order]
    assert [found.get_cell(k).point_ids for k in range(len(order))] == [cells[k][1] for k in order]
    surface.write(tmp_path / f"b{suffix}", surface.mesh.vertices)
    once, twice = (contents(read_polydata(tmp_path / f"{name}{suffix}")) for name in "ab")
    assert once == twice


@pytest.mark.parametrize("sort", [pv.StructuredGrid, pv.RectilinearGrid, pv.ImageData])
@pytest.mark.parametrize("binary", [True, False])
def test_structured_grids_of_two_dimensions_are_quads(tmp_path, sort, binary):
    x, y = np.linspace(0.0, 3.0, 7), np.linspace(0.0, 1.0, 5)
    made = {
        pv.StructuredGrid: lambda: pv.StructuredGrid(*np.meshgrid(x, y, [0.5], indexing="ij")),
        pv.RectilinearGrid: lambda: pv.RectilinearGrid(x, y, [0.5]),
        pv.ImageData: lambda: pv.ImageData(
            dimensions=(7, 5, 1), spacing=(0.5, 0.25, 1.0), origin=(0.0, 0.0, 0.5)
        ),
    }[sort]()
    made.point_data["place"] = np.arange(35)
    made.cell_data["number"] = np.arange(24)
    made.save(tmp_path / "a.vtk", binary=binary)
    surface = Surface.read(tmp_path / "a.vtk")
    assert (surface.mesh.n_vertices, surface.mesh.n_faces) == (35, 48)
    assert surface.given.area == pytest.approx(3.0, rel=1e-6)
    surface.write(tmp_path / "b.vtk", surface.mesh.vertices + [0.0, 0.0, 1.0])
    back = pv.read(tmp_path / "b.vtk")
    assert set(back.faces[::5]) == {4}
    assert_array_equal(back["place"], made["place"])
    assert_array_equal(back["number"], made["number"])
    assert_array_equal(back.points[:, 2], 1.5)


def test_grids_of_three_dimensions_say_what_to_do(tmp_path):
    pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "a.vtk")
    with pytest.raises(MeshError, match=r"a\.vtk: .* extract its surface first"):
        Surface.read(tmp_path / "a.vtk")
