"""Conversion of surfaces from and to vtkPolyData, without pyvista."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from ..geometry import NormalTransport


def surface(polydata: Any) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and faces (m, 3) of a vtkPolyData; its polygons are triangulated.

    Raises
    ------
    MeshError
        If it has no points or no polygons.
    """
    if not polydata.GetNumberOfPoints() or not (
        polydata.GetNumberOfPolys() or polydata.GetNumberOfStrips()
    ):
        raise MeshError("the input has no surface; it must have points and polygons")
    faces = vtk_to_numpy(_triangulated(polydata).GetPolys().GetConnectivityArray())
    vertices = vtk_to_numpy(polydata.GetPoints().GetData())
    return vertices.astype(np.float64), faces.astype(np.int64).reshape(-1, 3)


def point_array(polydata: Any, name: str) -> Any:
    """Return the point array *name*, (n,), or None if there is none."""
    array = polydata.GetPointData().GetArray(name)
    return None if array is None else vtk_to_numpy(array)


def pieces(data: Any) -> Iterator[Any]:
    """Yield *data*, or the datasets of which it is composed."""
    if not isinstance(data, vtkCompositeDataSet):
        yield data
        return
    item = data.NewIterator()
    item.InitTraversal()
    while not item.IsDoneWithTraversal():
        yield item.GetCurrentDataObject()
        item.GoToNextItem()


def move(polydata: Any, points: FloatArray) -> None:
    """Replace the points (n, 3) of a vtkPolyData; its point and cell normals follow the surface."""
    rest, faces = surface(polydata)
    cells = _cell_of(polydata)
    for data, of_corner, place in (
        (polydata.GetPointData(), faces.ravel(), np.arange(len(rest))),
        (polydata.GetCellData(), np.repeat(cells, 3), None),
    ):
        given = data.GetNormals()
        if given is None:
            continue
        corners, counts = faces.ravel(), np.full(len(faces), 3)
        carried = NormalTransport(
            rest, counts, corners, vtk_to_numpy(given), of_corner=of_corner, place=place
        )
        normals = carried.normals(points).astype(vtk_to_numpy(given).dtype)
        fresh = numpy_to_vtk(normals, deep=True)
        fresh.SetName(given.GetName())
        data.AddArray(fresh)  # at the same place: it remains the active array
    moved = vtkPoints()
    moved.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    polydata.SetPoints(moved)


def add_array(attributes: Any, name: str, values: Any) -> None:
    """Add an array of numbers, or of a single text, to point, cell or field data."""
    if isinstance(values, str):
        array = vtkStringArray()
        array.InsertNextValue(values)
    else:
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    attributes.AddArray(array)


def _triangulated(polydata: Any) -> Any:
    cut = vtkTriangleFilter()
    cut.PassVertsOff()
    cut.PassLinesOff()
    cut.SetInputData(polydata)
    cut.Update()
    return cut.GetOutput()


def _cell_of(polydata: Any) -> IntArray:
    """Return the cell of each triangle of `surface`, (m,) int."""
    bare = vtkPolyData()
    bare.CopyStructure(polydata)
    add_array(bare.GetCellData(), "cell", np.arange(polydata.GetNumberOfCells()))
    cells = _triangulated(bare).GetCellData().GetArray("cell")
    return vtk_to_numpy(cells).astype(np.int64)
