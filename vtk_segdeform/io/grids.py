"""Unstructured grids of surface cells as PolyData, and back.

A PolyData has its vertices first, then lines, polygons and strips; so have the grids that are made
of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkIdList

from ..arrays import IntArray
from ..errors import MeshError
from ..mesh import ragged_arange
from .array_names import CELL_TYPES

_PIXEL, _QUAD = 8, 9
# VTK's types of the cells of a grid, by where PolyData has them.
_KINDS = {"Verts": (1, 2), "Lines": (3, 4), "Polys": (5, 7, 9), "Strips": (6,)}
_POLYS = list(_KINDS).index("Polys")


def surface_of_grid(grid: pv.UnstructuredGrid, *, only_as_grid: bool) -> pv.PolyData:
    """Return the surface cells of a *grid* as a PolyData; empty if there are no polygons.

    With *only_as_grid* a field array says that it was a grid, because the format has PolyData as
    well.  Pixels, whose sides are parallel to axes, become quads, which may bend.
    """
    types, cells = grid.celltypes, grid.GetCells()
    starts = pv.convert_array(cells.GetOffsetsArray())
    corners = pv.convert_array(cells.GetConnectivityArray())
    if len(pixels := np.flatnonzero(types == _PIXEL)):
        types, corners = np.where(types == _PIXEL, _QUAD, types), corners.copy()
        third = starts[pixels] + 2
        corners[third], corners[third + 1] = corners[third + 1], corners[third]
    kind = np.full(len(types), len(_KINDS))
    for number, own in enumerate(_KINDS.values()):
        kind[np.isin(types, own)] = number
    if kind.max(initial=0) == len(_KINDS):
        raise MeshError(
            "contains cells other than triangles and polygons; extract its surface first"
        )
    surface = pv.PolyData()
    if not (kind >= _POLYS).any():
        return surface
    surface.points = np.asarray(grid.points, dtype=float)
    sizes = np.diff(starts).astype(np.int64)
    for number, name in enumerate(_KINDS):
        rows = np.flatnonzero(kind == number)
        cell, corner = ragged_arange(sizes[rows])
        own = corners[starts[rows][cell] + corner].astype(np.int64)
        ends = np.append(0, np.cumsum(sizes[rows]))
        getattr(surface, f"Set{name}")(pv.CellArray.from_arrays(ends, own))
    surface.GetPointData().ShallowCopy(grid.GetPointData())
    surface.GetFieldData().ShallowCopy(grid.GetFieldData())
    given, attributes = grid.GetCellData(), surface.GetCellData()
    if (np.diff(kind) >= 0).all():
        attributes.ShallowCopy(given)
    else:
        attributes.CopyAllOn()
        attributes.CopyAllocate(given, len(kind))
        attributes.CopyData(
            given, _ids(np.argsort(kind, kind="stable")), _ids(np.arange(len(kind)))
        )
    if only_as_grid:
        surface.field_data[CELL_TYPES] = types
    return surface


def grid_of(surface: Any) -> pv.UnstructuredGrid:
    """Return the cells of a PolyData as a grid."""
    grid = pv.wrap(surface).cast_to_unstructured_grid()
    for sort in ("Point", "Cell", "Field"):  # in their order
        getattr(grid, f"Get{sort}Data")().ShallowCopy(getattr(surface, f"Get{sort}Data")())
    grid.GetFieldData().RemoveArray(CELL_TYPES)
    return grid


def _ids(numbers: IntArray) -> vtkIdList:
    ids = vtkIdList()
    for number in numbers.tolist():
        ids.InsertNextId(number)
    return ids
