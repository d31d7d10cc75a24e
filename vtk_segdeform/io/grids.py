"""Unstructured grids of surface cells as PolyData.

A PolyData has its vertices first, then lines, polygons and strips; a grid has its cells in any
order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkIdList

from ..arrays import IntArray
from ..errors import MeshError
from .polygons import polydata_of

_PIXEL, _QUAD = 8, 9
# VTK's types of the cells of a grid, by where PolyData has them.
_KINDS = {"verts": (1, 2), "lines": (3, 4), "faces": (5, 7, 9), "strips": (6,)}


def surface_of_grid(grid: pv.UnstructuredGrid) -> pv.PolyData:
    """Return the surface cells of a *grid* as a PolyData; empty if there are no polygons.

    Pixels, whose sides are parallel to axes, become quads, which may bend.
    """
    if not grid.n_cells:
        return pv.PolyData()
    types, cells = grid.celltypes, grid.GetCells()
    starts = pv.convert_array(cells.GetOffsetsArray())
    corners = pv.convert_array(cells.GetConnectivityArray())
    if len(pixels := np.flatnonzero(types == _PIXEL)):
        types, corners = np.where(types == _PIXEL, _QUAD, types), corners.copy()
        third = starts[pixels] + 2
        corners[third], corners[third + 1] = corners[third + 1], corners[third]
    if not set(types.tolist()) <= {each for kind in _KINDS.values() for each in kind}:
        raise MeshError(
            "contains cells other than triangles and polygons; extract its surface first"
        )
    if not np.isin(types, (*_KINDS["faces"], *_KINDS["strips"])).any():
        return pv.PolyData()
    kind = np.select([np.isin(types, each) for each in _KINDS.values()], range(len(_KINDS)))
    order, points = np.argsort(kind, kind="stable"), np.asarray(grid.points, dtype=float)
    if np.isin(types, _KINDS["faces"]).all():
        surface = polydata_of(points, np.diff(starts), corners)
    else:
        surface = pv.PolyData()
        surface.points = points
        for name, kinds in _KINDS.items():
            rows = np.flatnonzero(np.isin(types, kinds))
            parts = [corners[starts[k] : starts[k + 1]] for k in rows]
            if parts:
                setattr(surface, name, np.concatenate([[len(part), *part] for part in parts]))
    surface.GetPointData().ShallowCopy(grid.GetPointData())
    surface.GetFieldData().ShallowCopy(grid.GetFieldData())
    _copy_rows(grid.GetCellData(), surface.GetCellData(), order)
    return surface


def _copy_rows(given: Any, result: Any, rows: IntArray) -> None:
    """Give the attributes *result* the *rows* (m,) of all arrays of those *given*, of m rows."""
    if (rows == np.arange(len(rows))).all():
        result.ShallowCopy(given)
        return
    result.CopyAllOn()
    result.CopyAllocate(given, len(rows))
    result.CopyData(given, _ids(rows), _ids(np.arange(len(rows))))


def _ids(numbers: IntArray) -> vtkIdList:
    ids = vtkIdList()
    ids.SetNumberOfIds(len(numbers))
    for k, number in enumerate(numbers.tolist()):
        ids.SetId(k, number)
    return ids
