"""Edges of a mesh as lines and vertices as small spheres, updated in place."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import reference, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray, IntArray


class Wireframe:
    """Edges and vertices in one colour, as one actor.

    Parameters
    ----------
    vertices : (m, 3) float
        Copied.
    edges : (e, 2) int
        Drawn as lines.
    spheres : (b,) int
        The vertices drawn as spheres.
    """

    def __init__(self, vertices: FloatArray, edges: IntArray, spheres: IntArray) -> None:
        points = points_of(vertices)
        self._data = vtkPolyData()
        self._data.SetPoints(points)
        self._data.SetLines(cells_of(edges))
        self._data.SetVerts(cells_of(spheres[:, None]))
        self._points = vtk_to_numpy(points.GetData())
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._data)
        # A mapper that resolves coincident topology shifts the points of all mappers backwards,
        # which would hide the spheres.  This cancels the shift.
        offset = reference(0.0)
        mapper.GetResolveCoincidentTopologyPointOffsetParameter(offset)
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-float(offset))
        self.actor = vtkActor()
        self.actor.SetMapper(mapper)
        self.actor.PickableOff()
        self.actor.GetProperty().RenderPointsAsSpheresOn()

    def set_style(self, colour: Any, *, line_width: float, sphere_size: float) -> None:
        """Set the *colour*, (3,) of 0 to 255, and the sizes in pixels."""
        style = self.actor.GetProperty()
        style.SetColor(*(np.asarray(colour) / 255.0))
        style.SetLineWidth(line_width)
        style.SetPointSize(sphere_size)

    def move(self, vertices: FloatArray) -> None:
        """Set the positions of the vertices, (m, 3)."""
        self._points[:] = vertices
        self._data.GetPoints().GetData().Modified()
        self._data.GetPoints().Modified()


def points_of(points: FloatArray) -> Any:
    """Return vtkPoints, a copy of *points* (n, 3)."""
    made = vtkPoints()
    made.SetData(numpy_to_vtk(np.array(points, dtype=np.float64), deep=True))
    return made


def cells_of(corners: IntArray) -> Any:
    """Return a vtkCellArray of cells of one length, with *corners* (c, length)."""
    count, length = corners.shape
    cells = vtkCellArray()
    offsets = numpy_to_vtkIdTypeArray(np.arange(count + 1, dtype=np.int64) * length, deep=True)
    connectivity = numpy_to_vtkIdTypeArray(corners.ravel().astype(np.int64), deep=True)
    cells.SetData(offsets, connectivity)
    return cells
