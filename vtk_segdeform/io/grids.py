"""Unstructured grids of surface cells as PolyData, and back.

A PolyData has its vertices first, then lines, polygons and strips.  A grid has its cells in any
order, and several types for the same corners: a quad may be a polygon, too.  So the field array
`CELL_TYPES` has the types of a grid in its own order, from which `grid_of` restores it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkIdList

from ..arrays import IntArray
from ..errors import MeshError
from ..mesh import ragged_arange
from .array_names import CELL_TYPES
from .polygons import polydata_of

_PIXEL, _QUAD = 8, 9
# VTK's types of the cells of a grid, by where PolyData has them.
_KINDS = {"verts": (1, 2), "lines": (3, 4), "faces": (5, 7, 9), "strips": (6,)}
_SIZES = {1: 1, 3: 2, 5: 3, 9: 4}  # numbers of corners of types for which there is one


def surface_of_grid(grid: pv.UnstructuredGrid, *, only_as_grid: bool) -> pv.PolyData:
    """Return the surface cells of a *grid* as a PolyData; empty if there are no polygons.

    The types are stored if a grid that is made from the result would have others, or another order.
    With *only_as_grid* they are always stored, because the format has PolyData as well.  Pixels,
    whose sides are parallel to axes, become quads, which may bend.
    """
    types = grid.celltypes
    starts, corners = _rows(grid.GetCells())
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
    order, points = _order(types), np.asarray(grid.points, dtype=float)
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
    usual = _usual(_kind(types), np.diff(starts))
    is_usual = (types == usual).all() and (np.diff(order) == 1).all()
    if only_as_grid or not is_usual:
        surface.field_data[CELL_TYPES] = types
    return surface


def grid_of(surface: Any) -> pv.UnstructuredGrid:
    """Return the cells of a PolyData as a grid, with the types and the order that are stored."""
    given = pv.wrap(surface)
    kinds, sizes, corners = _cells_of(given)
    types = _stored(given)
    if types is None:
        types = _usual(kinds, sizes).astype(np.uint8)
    place = np.argsort(_order(types))  # of each cell of the grid in the PolyData
    cell, corner = ragged_arange(sizes[place])
    starts = np.cumsum(sizes) - sizes
    moved = corners[starts[place[cell]] + corner]
    result = pv.UnstructuredGrid()
    result.SetPoints(given.GetPoints())
    ends = np.append(0, np.cumsum(sizes[place]))
    result.SetCells(numpy_to_vtk(types, deep=True), pv.CellArray.from_arrays(ends, moved))
    result.GetPointData().ShallowCopy(given.GetPointData())
    result.GetFieldData().ShallowCopy(given.GetFieldData())
    result.GetFieldData().RemoveArray(CELL_TYPES)
    _copy_rows(given.GetCellData(), result.GetCellData(), place)
    return result


def is_grid(surface: pv.PolyData) -> bool:
    """Return whether a PolyData was read from a grid and still has its cells."""
    return _stored(surface) is not None


def _stored(surface: pv.PolyData) -> Any:
    """Return the types of a grid, (m,) uint8, if they are stored and fit the cells."""
    types = surface.field_data.get(CELL_TYPES)
    if types is None or types.dtype != np.uint8 or types.shape != (surface.n_cells,):
        return None
    types = np.asarray(types)
    kinds, sizes, _ = _cells_of(surface)
    wanted = types[_order(types)]
    fits = _kind(wanted) == kinds
    for kind, size in _SIZES.items():
        fits &= (wanted != kind) | (sizes == size)
    return types if fits.all() else None


def _cells_of(surface: pv.PolyData) -> tuple[IntArray, IntArray, IntArray]:
    """Return the kinds of the cells of a PolyData, their numbers of corners, and these."""
    found = [
        (len(starts) - 1, np.diff(starts), corners)
        for starts, corners in map(
            _rows, (surface.GetVerts(), surface.GetLines(), surface.GetPolys(), surface.GetStrips())
        )
    ]
    kinds = np.repeat(np.arange(len(found)), [count for count, _, _ in found])
    sizes, corners = (np.concatenate([each[k] for each in found]) for k in (1, 2))
    return kinds, sizes.astype(np.int64), corners.astype(np.int64)


def _rows(cells: Any) -> tuple[IntArray, IntArray]:
    """Return where each cell begins in the list of corners, and this list."""
    starts = pv.convert_array(cells.GetOffsetsArray())
    corners = pv.convert_array(cells.GetConnectivityArray())
    return (starts if len(starts) else np.zeros(1, dtype=np.int64)), corners


def _order(types: Any) -> IntArray:
    """Return the cells of a grid in the order of a PolyData, (m,) int."""
    return np.argsort(_kind(types), kind="stable")


def _kind(types: Any) -> IntArray:
    """Return where a PolyData has cells of these *types*, 0 to 3, or 4 if nowhere."""
    kind = np.full(len(types), len(_KINDS))
    for number, each in enumerate(_KINDS.values()):
        kind[np.isin(types, each)] = number
    return kind


def _usual(kinds: IntArray, sizes: IntArray) -> IntArray:
    """Return the types that VTK gives to cells of a PolyData, (m,) int."""
    usual = np.array([2, 4, 7, 6])[kinds]
    for kind, size in _SIZES.items():
        usual[(kinds == _kind([kind])) & (sizes == size)] = kind
    return usual


def _copy_rows(given: Any, result: Any, rows: IntArray) -> None:
    """Give the attributes *result* the *rows* (m,) of all arrays of those *given*, of m rows."""
    if (rows == np.arange(len(rows))).all():
        result.ShallowCopy(given)
        return
    for k in range(given.GetNumberOfArrays()):
        array = given.GetAbstractArray(k)
        made = array.NewInstance()
        made.SetName(array.GetName())
        made.SetNumberOfComponents(array.GetNumberOfComponents())
        made.SetNumberOfTuples(len(rows))
        made.InsertTuples(_ids(np.arange(len(rows))), _ids(rows), array)
        made.CopyComponentNames(array)
        result.AddArray(made)
    for kind in range(given.NUM_ATTRIBUTES):
        active = given.GetAbstractAttribute(kind)
        if active is not None:
            result.SetActiveAttribute(active.GetName(), kind)


def _ids(numbers: IntArray) -> vtkIdList:
    ids = vtkIdList()
    ids.SetNumberOfIds(len(numbers))
    for k, number in enumerate(numbers.tolist()):
        ids.SetId(k, number)
    return ids
