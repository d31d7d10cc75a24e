"""A PolyData at other positions: cells and arrays stay, normals and tangents follow the surface.

    normals    point and cell arrays "Normals" and "NORMAL", and active normals, (n, 3);
               "NormalCorners": one per corner of a polygon, as `polygons.padded_corners`
    tangents   point arrays "Tangents" and "TANGENT", and active tangents, (n, 3) or (n, 4) with
               their sign, beside point normals

Other arrays of vectors do not change.  Precision and lengths are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..geometry import NormalTransport
from .polygons import cells_of, corner_values, padded_corners, polygons_of

_NORMALS, _TANGENTS = ("Normals", "NORMAL"), ("Tangents", "TANGENT")
CORNER_NORMALS = "NormalCorners"
_Update = Callable[[FloatArray], Any]


class MovingSurface:
    """A surface whose points take other positions any number of times.

    Parameters
    ----------
    polydata : pyvista.PolyData
        The surface at rest; not changed.
    """

    def __init__(self, polydata: pv.PolyData) -> None:
        self._given = polydata

    def at(self, points: FloatArray) -> pv.PolyData:
        """Return a copy with the points at *points* (n, 3) float, in the same order."""
        field, shared = self._given.field_data, {}
        moved = self._given.copy(deep=False)
        for name in list(field):  # it may contain textures: not copied
            shared[name] = moved.GetFieldData().GetAbstractArray(name)
            moved.GetFieldData().RemoveArray(name)
        moved = moved.copy(deep=True)
        for array in shared.values():
            moved.GetFieldData().AddArray(array)
        moved.points = np.array(points, dtype=np.float64)
        for of_points, name, update in self._updates:
            attributes = moved.point_data if of_points else moved.cell_data
            attributes[name] = update(moved.points)
        return moved

    @cached_property
    def _updates(self) -> list[tuple[bool, str, _Update]]:
        """What follows the surface: whether a point array, its name, and its new values."""
        given = self._given
        of_points = _vectors(given.point_data, _NORMALS, given.point_data.active_normals_name)
        of_cells = _vectors(given.cell_data, _NORMALS, given.cell_data.active_normals_name)
        wide = given.cell_data.get(CORNER_NORMALS)
        if not (of_points or of_cells or wide is not None):
            return []
        counts, corners = polygons_of(given)
        rest = np.asarray(given.points, dtype=np.float64)
        updates: list[tuple[bool, str, _Update]] = []
        tangents = _tangents_of(given)
        for name, normals in of_points.items():
            carried = NormalTransport(
                rest, counts, corners, normals, of_corner=corners, place=np.arange(len(rest))
            )
            updates.append((True, name, _normals_of(carried, normals)))
            updates += [(True, key, _tangents(carried, values)) for key, values in tangents.items()]
            tangents = {}
        for name, normals in of_cells.items():
            carried = NormalTransport(
                rest, counts, corners, normals, place=None,
                of_corner=np.repeat(cells_of(given), counts),
            )  # fmt: skip
            updates.append((False, name, _normals_of(carried, normals)))
        rows = cells_of(given)
        each = None if wide is None else corner_values(np.asarray(wide)[rows], counts, 3)
        if each is not None and len(np.unique(rows)) == len(rows):
            carried = NormalTransport(
                rest, counts, corners, each, of_corner=np.arange(len(corners)), place=corners
            )
            updates.append((False, CORNER_NORMALS, _of_corners(carried, counts, rows, wide)))
        return updates


def _vectors(attributes: Any, names: tuple[str, ...], active: str | None) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in dict.fromkeys((*names, active or names[0])):
        values = attributes.get(name)
        if values is not None and values.shape[1:] == (3,) and values.dtype.kind == "f":
            found[name] = np.array(values)
    return found


def _tangents_of(given: pv.PolyData) -> dict[str, Any]:
    active = given.GetPointData().GetTangents()
    found: dict[str, Any] = {}
    for name in dict.fromkeys((*_TANGENTS, *([] if active is None else [str(active.GetName())]))):
        values = given.point_data.get(name)
        if values is not None and values.shape[1:] in ((3,), (4,)) and values.dtype.kind == "f":
            found[name] = np.array(values)
    return found


def with_points(
    data: pv.PolyData | pv.UnstructuredGrid, points: FloatArray
) -> pv.PolyData | pv.UnstructuredGrid:
    """Return a copy of *data* with its points at *points* (n, 3) float."""
    if isinstance(data, pv.PolyData):
        return MovingSurface(data).at(points)
    moved = data.copy()
    moved.points = np.array(points, dtype=np.float64)
    return moved


def _normals_of(carried: NormalTransport, given: Any) -> _Update:
    return lambda points: carried.normals(points).astype(given.dtype)


def _tangents(carried: NormalTransport, given: Any) -> _Update:
    def update(points: FloatArray) -> Any:
        moved = given.copy()
        moved[:, :3] = carried.tangents(given[:, :3], points)
        return moved

    return update


def _of_corners(carried: NormalTransport, counts: IntArray, rows: IntArray, given: Any) -> _Update:
    def update(points: FloatArray) -> Any:
        moved = np.array(given)
        wide = padded_corners(counts, carried.normals(points))
        moved[rows, : wide.shape[1]] = wide
        return moved

    return update
