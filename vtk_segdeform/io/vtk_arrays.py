"""A data set of VTK from the plain arrays of a `confined` process, each of them checked.

VTK does not check that cells and arrays fit the points, and its filters would read outside them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkStringArray

from ..errors import MeshError
from .array_names import storable

_CELLS = ("verts", "lines", "polys", "strips")


def data_set(part: dict[str, Any]) -> pv.PolyData | pv.UnstructuredGrid:
    """Return the surface or grid whose arrays are named as `reading_child` names them.

    Raises
    ------
    MeshError
        If its cells or arrays do not fit its points.
    """
    data = pv.UnstructuredGrid() if "types" in part else pv.PolyData()
    points = part.get("points", np.empty((0, 3)))
    if points.shape[1:] != (3,):
        raise MeshError(f"its points have {points.shape[1:]} coordinates; must be 3")
    if points.dtype.kind != "f":
        points = points.astype(np.float64)
    data.points = points
    if "types" in part:
        cells, types = _cells(part, "cells", len(points)), part["types"].ravel()
        if types.dtype != np.uint8 or len(types) != cells.GetNumberOfCells():
            raise MeshError("the numbers of cells and cell types differ")
        data.SetCells(numpy_to_vtk(types, deep=True), cells)
    else:
        for name in _CELLS:
            if f"{name}/offsets" in part:
                getattr(data, f"Set{name.title()}")(_cells(part, name, len(points)))
    _add_arrays(data.GetPointData(), part, "point", data.n_points)
    _add_arrays(data.GetCellData(), part, "cell", data.n_cells)
    _add_arrays(data.GetFieldData(), part, "field", None)
    return data


def _cells(part: dict[str, Any], name: str, n_points: int) -> pv.CellArray:
    starts, corners = (part[f"{name}/{each}"].ravel() for each in ("offsets", "corners"))
    if starts.dtype.kind != "i" or corners.dtype.kind != "i":
        raise MeshError("its cells are not given by integers")
    ends = (int(starts[0]), int(starts[-1])) if len(starts) else (0, len(corners))
    if ends != (0, len(corners)) or (starts[1:] < starts[:-1]).any():
        raise MeshError("its cells overlap or exceed their list of corners")
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_points:
        raise MeshError(
            f"cells use vertices {corners.min()} to {corners.max()}, but there are {n_points}"
        )
    return pv.CellArray.from_arrays(starts.astype(np.int64), corners.astype(np.int64))


def _add_arrays(attributes: Any, part: dict[str, Any], sort: str, count: int | None) -> None:
    """Give *attributes* the arrays of a *sort*, of *count* rows unless that is None."""
    k = 0
    while f"{sort}/{k}/name" in part:
        begin = f"{sort}/{k}/"
        each = {key.removeprefix(begin): part[key] for key in part if key.startswith(begin)}
        name, width = _text(each["name"].tobytes()), int(each["width"][0])
        array = _texts(each) if "lengths" in each else _numbers(each)
        array.SetName(name)
        if "lengths" in each:
            array.SetNumberOfComponents(max(width, 1))
        if count is not None and array.GetNumberOfTuples() != count:
            raise MeshError(
                f"its {sort} array {name!r} has {array.GetNumberOfTuples()} rows; must be {count}"
            )
        if "components" in each:
            names = each["components"].tobytes().split(b"\0")
            for j, component in enumerate(names[: array.GetNumberOfComponents()]):
                if component:
                    array.SetComponentName(j, _text(component))
        place = attributes.AddArray(array)
        for use in each["uses"].tolist():
            attributes.SetActiveAttribute(place, use)
        k += 1


def _numbers(each: dict[str, Any]) -> Any:
    values = np.ascontiguousarray(each["values"])
    if values.ndim > 2:
        raise MeshError("it has an array of more than two dimensions")
    if "ids" in each and values.dtype == np.int64:
        return numpy_to_vtkIdTypeArray(values, deep=True)
    return numpy_to_vtk(values, deep=True)


def _texts(each: dict[str, Any]) -> vtkStringArray:
    array, ends = vtkStringArray(), np.cumsum(each["lengths"])
    data = each["values"].tobytes()
    for start, end in zip((ends - each["lengths"]).tolist(), ends.tolist(), strict=True):
        array.InsertNextValue(_text(data[start:end]))
    return array


def _text(data: bytes) -> str:
    """Return a text of VTK, which may have any bytes and a mark of UTF-8 that belongs to it."""
    try:
        return storable(data.decode())
    except UnicodeDecodeError:
        return storable(data)
