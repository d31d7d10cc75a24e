"""Conversion of surfaces from and to vtkPolyData, without pyvista."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkCompositeDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter, vtkTriangleMeshPointNormals

from ..arrays import FloatArray, IntArray
from ..errors import MeshError


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
    cut = vtkTriangleFilter()
    cut.PassVertsOff()
    cut.PassLinesOff()
    cut.SetInputData(polydata)
    cut.Update()
    faces = vtk_to_numpy(cut.GetOutput().GetPolys().GetConnectivityArray())
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


def move(polydata: Any, vertices: FloatArray, faces: IntArray) -> None:
    """Replace the points (n, 3) of a vtkPolyData, and compute point normals again if it has any."""
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices), deep=True))
    polydata.SetPoints(points)
    normals = polydata.GetPointData().GetNormals()
    if normals is None:
        return
    bare = vtkPolyData()
    bare.SetPoints(points)
    bare.SetPolys(_triangles(faces))
    computed = vtkTriangleMeshPointNormals()
    computed.SetInputData(bare)
    computed.Update()
    fresh = computed.GetOutput().GetPointData().GetNormals()
    fresh.SetName(normals.GetName())
    polydata.GetPointData().SetNormals(fresh)


def add_array(attributes: Any, name: str, values: Any) -> None:
    """Add an array of numbers, or of a single text, to point, cell or field data."""
    if isinstance(values, str):
        array = vtkStringArray()
        array.InsertNextValue(values)
    else:
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    attributes.AddArray(array)


def _triangles(faces: IntArray) -> Any:
    cells = vtkCellArray()
    starts = np.arange(0, 3 * len(faces) + 1, 3)
    cells.SetData(numpy_to_vtk(starts, deep=True), numpy_to_vtk(faces.ravel(), deep=True))
    return cells
