"""Points, cells and arrays of VTK's file formats, checked, for `vtk_xml` and `vtk_legacy`.

A reader demands everything that it relies on; what is not met ends in a `NotPlainError`, and the
file is left to VTK.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from ..arrays import IntArray
from .number_lines import numbers_of

LONGEST = 200  # characters of a name


class NotPlainError(Exception):
    """The file is damaged, or has something that is left to VTK."""


def demand(plain: Any) -> None:
    """Raise a `NotPlainError` unless *plain* is true."""
    if not plain:
        raise NotPlainError


def count_of(word: str) -> int:
    """Return the number that *word* is, decimal digits."""
    demand(word.isascii() and word.isdigit() and len(word) < 16)
    return int(word)


def numbers_of_text(text: bytes, kind: Any) -> Any:
    """Return the numbers of *text*, as *kind*, if they are in its range."""
    numbers = numbers_of(text, np.float64 if kind.kind == "f" else np.int64)
    demand(numbers is not None and kind != np.uint64)
    if kind.kind != "f" and len(numbers):
        bounds = np.iinfo(kind)
        demand(bounds.min <= numbers.min() and numbers.max() <= bounds.max)
    with np.errstate(over="raise"):
        return numbers.astype(kind)


def set_points(data: pv.DataSet, values: Any) -> None:
    """Give *data* points, (3n,) numbers."""
    demand(values.dtype.kind == "f" and len(values))
    data.points = np.require(values.reshape(-1, 3), requirements="W")


def cells_of(starts: IntArray, corners: IntArray, n_points: int) -> pv.CellArray:
    """Return cells; cell k has the points corners[starts[k] : starts[k + 1]] of *n_points*."""
    demand(len(starts) > 1 and len(corners))
    demand(starts[0] == 0 and (starts[1:] >= starts[:-1]).all() and starts[-1] == len(corners))
    demand(corners.min() >= 0 and corners.max() < n_points)
    return pv.CellArray.from_arrays(
        starts.astype(np.int64, copy=False), corners.astype(np.int64, copy=False)
    )


def set_grid_cells(grid: pv.UnstructuredGrid, cells: pv.CellArray, types: Any) -> None:
    """Give *grid* cells of the given *types* (m,) uint8."""
    demand(types.dtype == np.uint8 and len(types) == cells.GetNumberOfCells())
    grid.SetCells(numpy_to_vtk(types, 1), cells)


def add_array(attributes: Any, name: str, values: Any, *, is_ids: bool = False) -> Any:
    """Give *attributes* an array of *values* (n, w), and return it; its name must be new."""
    demand(name and values.size and not attributes.HasArray(name))
    array = numpy_to_vtkIdTypeArray(values, 1) if is_ids else numpy_to_vtk(values, 1)
    array.SetName(name)
    attributes.AddArray(array)
    return array
