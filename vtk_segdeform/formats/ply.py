"""PLY, Stanford's polygon format, text or binary: read and write, every digit kept.

VTK's own reader and writer hold 7 digits.  A PLY file is a header that lists elements (vertex,
face, ...) and their properties, and then each element as a table.  A property may be a list, in
which case its length comes first in every row:

    element face 12
    property list uchar int vertex_indices

A text file is read as if it were a binary one of doubles, so that there is one reader.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..errors import MeshError
from .polygons import polydata_of, polygons_of

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_WORDS = {"u1": "uchar", "i4": "int", "i8": "int", "f4": "float", "f8": "double"}
_TEXTURE = [("s", "t"), ("u", "v"), ("texture_u", "texture_v")]
_COLOUR = ["red", "green", "blue", "alpha"]


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)  # (name, type) in order
    lists: dict[str, str] = field(default_factory=dict)  # list properties: the type of the length


def read_ply(path: Path) -> pv.PolyData:
    """Return the surface in a PLY file: colours as "RGB"(A), other properties under their names."""
    data = path.read_bytes()
    kind, elements, start = _header(data)
    order = ">" if kind == "binary_big_endian" else "<"
    if kind == "ascii":
        data, start = np.array(data[start:].split(), dtype="<f8").tobytes(), 0
    tables: dict[str, dict[str, Any]] = {}
    for element in elements:
        stored = _as_doubles(element) if kind == "ascii" else element
        tables[element.name], start = _table(data, start, stored, order)
        for name, type_ in element.properties:
            values = tables[element.name][name]
            if isinstance(values, np.ndarray) and type_[0] in "iu":
                tables[element.name][name] = values.astype(type_)
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    lists = [face.pop(name) for name in ("vertex_indices", "vertex_index") if name in face]
    if not {"x", "y", "z"} <= set(vertex) or not lists:
        raise MeshError("the PLY file has no vertices with x, y, z, or no faces")
    counts, corners = lists[0]
    points = np.stack([vertex.pop(name).astype(float) for name in "xyz"], axis=-1)
    surface = polydata_of(points, counts, corners.astype(np.int64))
    for name in ("nx", "ny", "nz"):
        vertex.pop(name, None)
    for pair in _TEXTURE:
        if set(pair) <= set(vertex):
            texture = np.stack([vertex.pop(name) for name in pair], axis=-1)
            surface.point_data["TextureCoordinates"] = texture
            surface.point_data.active_texture_coordinates_name = "TextureCoordinates"
    if "texcoord" in face:
        lengths, values = face.pop("texcoord")
        if (lengths == lengths[0]).all() and lengths[0] == 2 * counts.max(initial=0):
            surface.cell_data["TextureCorners"] = values.reshape(len(counts), -1)
    for table, attributes in ((vertex, surface.point_data), (face, surface.cell_data)):
        if set(_COLOUR[:3]) <= set(table):
            colour = [table.pop(name) for name in _COLOUR if name in table]
            attributes["RGB" if len(colour) == 3 else "RGBA"] = np.stack(colour, -1).astype("u1")
        for name, values in table.items():
            if isinstance(values, np.ndarray):
                attributes[name] = values
    return surface


def write_ply(path: Path, surface: pv.PolyData) -> None:
    """Write a binary PLY file with doubles; of the arrays, colours, texture and plain numbers."""
    counts, corners = polygons_of(surface)
    vertex = _columns(surface.point_data, surface.n_points)
    texture = surface.active_texture_coordinates
    if texture is not None:
        places = np.asarray(texture, dtype="f8").T  # by the names that MeshLab reads as doubles
        vertex |= dict(zip(_TEXTURE[-1], places, strict=False))
    points = np.asarray(surface.points, dtype="f8")
    vertex = {name: points[:, k] for k, name in enumerate("xyz")} | vertex
    face = _columns(surface.cell_data, len(counts))
    header = [b"ply", b"format binary_little_endian 1.0", f"element vertex {len(points)}".encode()]
    header += [f"property {_WORDS[c.dtype.str[1:]]} {n}".encode() for n, c in vertex.items()]
    header += [f"element face {len(counts)}".encode(), b"property list uchar int vertex_indices"]
    even = len(set(counts.tolist())) == 1
    seams = surface.cell_data.get("TextureCorners") if even else None  # (m, 2 per corner)
    if seams is not None:  # the one type that MeshLab reads
        header += [b"property list uchar float texcoord"]
    header += [f"property {_WORDS[c.dtype.str[1:]]} {n}".encode() for n, c in face.items()]
    with path.open("wb") as file:
        file.write(b"\n".join([*header, b"end_header", b""]))
        file.write(_packed(vertex))
        if even:
            rows = corners.reshape(len(counts), -1).astype("<i4")
            first = {"#": counts.astype("u1")} | {f"#{k}": c for k, c in enumerate(rows.T)}
            if seams is not None:
                seams = np.asarray(seams, dtype="f4").T
                first["#uv"] = np.full(len(counts), len(seams), dtype="u1")
                first |= {f"#uv{k}": c for k, c in enumerate(seams)}
            file.write(_packed(first | face))
            return
        size = len(_packed(face)) // max(len(counts), 1)
        tail, at = _packed(face), 0
        for k, count in enumerate(counts.tolist()):
            file.write(bytes([count]) + corners[at : at + count].astype("<i4").tobytes())
            file.write(tail[k * size : (k + 1) * size])
            at += count


def _columns(attributes: Any, length: int) -> dict[str, Any]:
    """Return the arrays PLY can hold, as columns by property name."""
    columns: dict[str, Any] = {}
    for name, values in attributes.items():
        values = np.asarray(values)
        if len(values) != length or values.dtype.str[1:] not in _WORDS:
            continue
        if values.ndim == 2 and values.dtype == np.uint8 and name in ("RGB", "RGBA"):
            columns |= dict(zip(_COLOUR, values.T, strict=False))
        elif values.ndim == 1 and " " not in name:
            columns[name] = values.astype("i4") if values.dtype == np.int64 else values
    return columns


def _packed(columns: dict[str, Any]) -> bytes:
    if not columns:
        return b""
    length = len(next(iter(columns.values())))
    table = np.empty(length, [(n, c.dtype.newbyteorder("<")) for n, c in columns.items()])
    for name, values in columns.items():
        table[name] = values
    return table.tobytes()


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise MeshError("the file does not begin with a PLY header")
    kind, elements = "", list[_Element]()
    for line in data[:end].decode("ascii", "replace").splitlines():
        word, *rest = line.split() or [""]
        if word == "format":
            kind = rest[0]
        elif word == "element":
            elements.append(_Element(rest[0], int(rest[1])))
        elif word == "property" and rest[0] == "list":
            elements[-1].properties.append((rest[3], _TYPES[rest[2]]))
            elements[-1].lists[rest[3]] = _TYPES[rest[1]]
        elif word == "property":
            elements[-1].properties.append((rest[1], _TYPES[rest[0]]))
    return kind, elements, data.index(b"\n", end) + 1


def _as_doubles(element: _Element) -> _Element:
    doubles = [(name, "f8") for name, _ in element.properties]
    return _Element(element.name, element.count, doubles, dict.fromkeys(element.lists, "f8"))


def _table(data: bytes, start: int, element: _Element, order: str) -> tuple[dict[str, Any], int]:
    """Return an element's columns, and where it ends; a list's column is (lengths, values)."""
    if not element.count:
        nothing = np.empty(0)
        names = [name for name, _ in element.properties]
        return {n: (nothing, nothing) if n in element.lists else nothing for n in names}, start
    first, _ = _row(data, start, element, order)
    parts: list[Any] = []  # of a row, if all are as long as the first
    for name, kind in element.properties:
        if name in element.lists:
            parts.append((f"#{name}", order + element.lists[name]))
            parts.append((name, order + kind, (len(first[name]),)))
        else:
            parts.append((name, order + kind))
    even = np.dtype(parts)
    if start + element.count * even.itemsize <= len(data):
        table = np.frombuffer(data, even, element.count, start)
        if all((table[f"#{name}"] == len(first[name])).all() for name in element.lists):
            columns: dict[str, Any] = {name: table[name] for name, _ in element.properties}
            for name in element.lists:
                columns[name] = table[f"#{name}"].astype(np.int64), table[name].ravel()
            return columns, start + element.count * even.itemsize
    read = []
    for _ in range(element.count):
        row, start = _row(data, start, element, order)
        read.append(row)
    columns = {}
    for name, _ in element.properties:
        joined = np.concatenate([row[name] for row in read])
        lengths = np.array([len(row[name]) for row in read])
        columns[name] = (lengths, joined) if name in element.lists else joined
    return columns, start


def _row(data: bytes, start: int, element: _Element, order: str) -> tuple[dict[str, Any], int]:
    """Return one row's values, each as an array, and where the row ends."""
    row = {}
    for name, kind in element.properties:
        n = 1
        if name in element.lists:
            length = np.frombuffer(data, order + element.lists[name], 1, start)
            n, start = int(length[0]), start + length.itemsize
        if n < 0:
            raise MeshError(f"a {element.name} has a list of length {n}")
        row[name] = np.frombuffer(data, order + kind, n, start)
        start += row[name].nbytes
    return row, start
