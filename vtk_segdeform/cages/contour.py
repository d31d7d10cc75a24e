"""Level set of a field on a grid: VTK's flying edges, in double precision."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

from ..arrays import FloatArray, IntArray


def contour_surface(values: FloatArray, level: float) -> tuple[FloatArray, IntArray]:
    """Return the outward oriented surface values = level on the unit grid."""
    image = vtkImageData()
    image.SetDimensions(*values.shape)
    image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F")))
    contour = vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, level)
    contour.ComputeNormalsOff()
    contour.ComputeScalarsOff()
    contour.Update()
    surface = contour.GetOutput()
    points = vtk_to_numpy(surface.GetPoints().GetData()).astype(np.float64)
    faces = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)

    # VTK rounds to float32.  Each point is on an edge of the grid; interpolate again in float64.
    rows, axis = np.arange(len(points)), np.abs(points - np.rint(points)).argmax(axis=1)
    low = np.rint(points).astype(np.int64)
    low[rows, axis] = np.floor(points[rows, axis]).astype(np.int64)
    high = low.copy()
    high[rows, axis] += 1
    at_low, at_high = values[tuple(low.T)] - level, values[tuple(high.T)] - level
    points = low.astype(np.float64)
    drop = at_low - at_high
    points[rows, axis] += at_low / np.where(drop == 0.0, 1.0, drop)  # 0 / 0 on a plateau
    a, b, c = (points - points.mean(axis=0))[faces.T]
    outward = np.einsum("fi,fi", a, np.cross(b, c)) > 0.0
    return points, (faces if outward else faces[:, ::-1]).astype(np.int64)
