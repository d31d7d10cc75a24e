"""The given surface of a session in an archive: points, cells and arrays, as they are in VTK.

    surface_points.npy         (p, 3)       in the precision given
    surface_verts.npy ...      (c,) int     cells of one kind: corners, one cell after another,
    surface_verts_ends.npy     (k,) int     and where each cell ends; also lines, polys, strips
    surface_7.npy              any shape    a point, cell or field array; of texts, their UTF-8,
    surface_7_ends.npy         (t,) int     and where each text ends
    surface_vertex_of.npy      (p,) int     the vertex of the mesh that each point follows
    surface_workarounds.npy    (w,) int     the points of all workarounds, one after another

The header has their sizes and types, the names of arrays and which of them are active, and the
workarounds.  All of it is checked when it is read, since files may be damaged or malicious.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray

from ..arrays import IntArray
from ..io import Surface
from ..mesh import Kind, Mesh, Soup, Workaround
from .archive import Archive, field, list_of, map_of, optional, row_of, text, type_of, whole

_CELLS = ("Verts", "Lines", "Polys", "Strips")
_DATA = ("point_data", "cell_data", "field_data")
_TEXT = "text"


def surface_parts(surface: Surface) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the entry of the header, and the arrays, by which `read_surface` restores *surface*.

    Raises
    ------
    OSError
        If it has an array that cannot be stored.
    """
    given = surface.given
    points = np.asarray(given.points)
    arrays: dict[str, Any] = {"points": points, "vertex_of": surface.vertex_of}
    header: dict[str, Any] = {"points": [type_of(points), len(points)], "cells": {}}
    for kind in _CELLS:
        cells = getattr(given, f"Get{kind}")()
        if cells.GetNumberOfCells():
            ends = pv.convert_array(cells.GetOffsetsArray())[1:].astype(np.int64)
            corners = pv.convert_array(cells.GetConnectivityArray()).astype(np.int64)
            header["cells"][kind] = [len(ends), len(corners)]
            arrays[kind.lower()], arrays[f"{kind.lower()}_ends"] = corners, ends
    header["arrays"], header["active"] = [], {}
    for place in _DATA:
        data = getattr(given, place)
        for k in range(data.VTKObject.GetNumberOfArrays()):
            number = len(header["arrays"])
            stored = data.VTKObject.GetAbstractArray(k)
            name, parts = stored.GetName(), stored.GetNumberOfComponents()
            if stored.IsA("vtkStringArray"):
                texts = [_bytes(stored.GetValue(j)) for j in range(stored.GetNumberOfValues())]
                ends = np.cumsum([len(text) for text in texts], dtype=np.int64)
                arrays[f"{number}_ends"] = ends
                values = np.frombuffer(b"".join(texts), dtype=np.uint8)
                header["arrays"].append([place, name, _TEXT, [len(ends), len(values)], parts])
            else:
                values = np.asarray(data[name] if name else pv.convert_array(stored))
                shape = list(values.shape)
                header["arrays"].append([place, name, type_of(values), shape, parts])
            arrays[str(number)] = values
        if place != "field_data":
            of_kind = map(data.VTKObject.GetAbstractAttribute, range(data.VTKObject.NUM_ATTRIBUTES))
            header["active"][place] = [None if each is None else each.GetName() for each in of_kind]
    workarounds = surface.workarounds
    header["workarounds"] = [
        [each.text, len(each.points), each.kind and each.kind.name, each.count]
        for each in workarounds
    ]
    of_all = [np.empty(0, dtype=np.int64), *(each.points for each in workarounds)]
    arrays["workarounds"] = np.concatenate(of_all)
    return header, {f"surface_{name}": array for name, array in arrays.items()}


def read_surface(archive: Archive, header: Mapping[str, Any], mesh: Mesh) -> Surface:
    """Return the surface in *archive* that follows *mesh*.

    Raises
    ------
    ValueError, OSError
        If it is damaged.
    """
    kind, p = field(header, "points", row_of(text, whole))
    given = pv.PolyData()
    given.SetPoints(pv.vtk_points(_array(archive, "points", kind, (p, 3)), deep=True))
    cells_of = map_of(row_of(whole, whole))
    for name, (n_cells, n_corners) in field(header, "cells", cells_of).items():
        require(name in _CELLS, f"{name} is not a kind of cells")
        corners = _array(archive, name.lower(), "i", (n_corners,))
        ends = _ends(archive, f"{name.lower()}_ends", n_cells, n_corners)
        require(((corners >= 0) & (corners < p)).all(), f"a corner of {name} is not a point")
        cells = vtkCellArray()
        starts = np.insert(ends, 0, 0)
        cells.SetData(*(pv.convert_array(each, deep=True) for each in (starts, corners)))
        getattr(given, f"Set{name}")(cells)
    arrays = list_of(row_of(text, optional(text), text, list_of(whole), whole))
    for number, (place, name, kind, shape, parts) in enumerate(field(header, "arrays", arrays)):
        require(place in _DATA, f"{place} is not a place of arrays")
        rows = {"point_data": p, "cell_data": given.GetNumberOfCells()}.get(place)
        values = _values(archive, str(number), kind, shape)
        require(parts > 0, "an array has no components")
        n_rows = len(values) // parts if kind == _TEXT else shape[0] if shape else -1
        require(rows in (None, n_rows) and n_rows >= 0, f"{place} has an array of other length")
        _add(getattr(given, place), name, values, parts)
    for place, names in field(header, "active", map_of(list_of(optional(text)))).items():
        require(place in _DATA[:2], f"{place} has no active arrays")
        data = getattr(given, place).VTKObject
        require(not any(names[data.NUM_ATTRIBUTES :]), "there is no such active array")
        for attribute, active in enumerate(names[: data.NUM_ATTRIBUTES]):
            index = data.SetActiveAttribute(-1 if active is None else active, attribute)
            require(active is None or index >= 0, f"{active} cannot be the active array")
    vertex_of = _array(archive, "vertex_of", "i", (p,))
    in_mesh = ((vertex_of >= 0) & (vertex_of < mesh.n_vertices)).all()
    require(in_mesh, "a point follows no vertex of the mesh")
    points = np.asarray(given.points, dtype=np.float64)
    soup = Soup(points, mesh, vertex_of, _workarounds(archive, header, p))
    own = np.unique(np.delete(vertex_of, soup.loose))
    require(len(own) == mesh.n_vertices, "a vertex of the mesh is not a point")
    return Surface.of(given, soup)


def require(condition: Any, words: str) -> None:
    """Raise ValueError with *words* if the *condition* is false."""
    if not condition:
        raise ValueError(f"the given surface is damaged: {words}")


def _workarounds(archive: Archive, header: Mapping[str, Any], p: int) -> tuple[Workaround, ...]:
    listed = field(header, "workarounds", list_of(row_of(text, whole, optional(text), whole)))
    sizes = [size for _, size, _, _ in listed]
    points = _array(archive, "workarounds", "i", (sum(sizes),))
    require(((points >= 0) & (points < p)).all(), "a workaround is not at a point")
    for _, _, kind, _ in listed:
        require(kind is None or kind in Kind.__members__, f"{kind} is not a kind of workarounds")
    parts = np.split(points, np.cumsum(sizes))
    return tuple(
        Workaround(words, part, None if kind is None else Kind[kind], count)
        for (words, _, kind, count), part in zip(listed, parts, strict=False)
    )


def _add(data: Any, name: str | None, values: Any, parts: int) -> None:
    """Add an array of numbers, or a list of texts in *parts* components."""
    if isinstance(values, list):
        require(len(values) % parts == 0, f"{name} has missing texts")
        stored = vtkStringArray()
        stored.SetName(name)
        stored.SetNumberOfComponents(parts)
        stored.SetNumberOfValues(len(values))
        for k, words in enumerate(values):
            stored.SetValue(k, words)
        data.VTKObject.AddArray(stored)
    elif name is None:
        require(values.dtype.kind in "iuf", "an array of its type needs a name")
        data.VTKObject.AddArray(pv.convert_array(values, deep=True))
    else:
        data.set_array(values, name, deep_copy=True)


def _values(archive: Archive, number: str, kind: str, shape: list[int]) -> Any:
    if kind != _TEXT:
        return _array(archive, number, kind, tuple(shape))
    n_texts, n_bytes = row_of(whole, whole)(shape, "the shape of texts")
    ends = _ends(archive, f"{number}_ends", n_texts, n_bytes)
    content = _array(archive, number, "u1", (n_bytes,)).tobytes()
    pairs = itertools.pairwise([0, *ends.tolist()])
    return [content[a:b] for a, b in pairs]


def _ends(archive: Archive, name: str, count: int, total: int) -> IntArray:
    """Return where *count* parts of *total* items end."""
    ends: IntArray = _array(archive, name, "i", (count,))
    in_order = (np.diff(np.insert(ends, 0, 0)) >= 0).all()
    require(in_order and (not len(ends) or ends[-1] == total), f"{name} is not in order")
    return ends


def _array(archive: Archive, name: str, kind: str, shape: tuple[int, ...]) -> Any:
    return archive.array(f"surface_{name}", kind, shape)


def _bytes(text: str | bytes) -> bytes:
    return text if isinstance(text, bytes) else text.encode()
