"""PLY, Stanford's polygon format, text or binary: reader and writer in full precision.

VTK's reader and writer keep 7 digits.  A surface consists of these elements and properties:

    vertex     x y z; nx ny nz; red green blue (alpha); s t, u v or texture_u texture_v
    face       vertex_indices or vertex_index, a list; texcoord, a list of (u, v) per corner
    tristrips  vertex_indices, a list: any three in sequence are a triangle, -1 ends a strip

Normals become "Normals", colours arrays "RGB" or "RGBA", texture coordinates "TextureCoordinates"
of vertices and "TextureCorners" of corners, all other numbers arrays of the same name.  Arrays are
written as properties of the same name, unless the name is listed here or contains white space.
Numbers of any other element are field arrays "element.property", comments the field array
"Comments".
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .array_names import (
    COMMENTS,
    get_names,
    plain_names,
    set_names,
    warn_left_out,
    warn_renamed,
)
from .ply_tables import Lists, Table, comments_of, tables_of
from .polygons import (
    cells_of,
    corner_values,
    padded_corners,
    polydata_of,
    polygons_of,
    texture_of,
    unstripped,
)

_log = logging.getLogger(__name__)
_WORDS = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint",
    "f4": "float", "f8": "double",
}  # fmt: skip
_TEXTURE = [("s", "t"), ("u", "v"), ("texture_u", "texture_v")]
_COLOUR = ["red", "green", "blue", "alpha"]
_WIDTHS = {"RGB": 3, "RGBA": 4}
_NORMAL = ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_POINT_TEXTURE, _CORNER_TEXTURE = "TextureCoordinates", "TextureCorners"
_LINES = {"comment": COMMENTS, "obj_info": "ObjectInfo"}  # field arrays of lines of the header
_PLAIN = re.compile(r"[!-~]+")
_COMMON = 255  # corners of a face; VTK and MeshLab store the number in a byte
_NO_NUMBERS = np.empty(0, dtype=np.int64)
_OF_POINTS = frozenset({*"xyz", *_NORMAL, *_COLOUR, *(name for pair in _TEXTURE for name in pair)})
_OF_FACES = frozenset({*_CORNERS, "texcoord", *_COLOUR})


def read_ply(path: Path) -> pv.PolyData:
    """Read a surface from a PLY file, with colours as "RGB"(A) and other properties by name."""
    data = path.read_bytes()
    tables = tables_of(data)
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    if not _has_numbers(vertex, "xyz"):
        raise MeshError("the PLY file has no vertices with x, y, z")
    points = np.stack([vertex.pop(name).astype(float) for name in "xyz"], axis=-1)
    polygons, strips = _corners(face), _corners(tables.get("tristrips", {}))
    if polygons is None and strips is None:
        raise MeshError("the PLY file has no faces and no triangle strips")
    counts, corners = polygons or (_NO_NUMBERS, _NO_NUMBERS)
    if strips is not None:
        triangles = unstripped(*strips)
        face = {} if len(triangles) else face  # its rows do not correspond to triangles
        counts = np.concatenate([counts, np.full(len(triangles), 3)])
        corners = np.concatenate([corners, triangles.ravel()])
    surface = polydata_of(points, counts, corners)
    if _has_numbers(vertex, _NORMAL):
        surface.point_data["Normals"] = np.stack([vertex.pop(name) for name in _NORMAL], axis=-1)
        surface.point_data.active_normals_name = "Normals"
    for pair in _TEXTURE:
        if _has_numbers(vertex, pair):
            texture = np.stack([vertex.pop(name) for name in pair], axis=-1)
            surface.point_data[_POINT_TEXTURE] = texture
            surface.point_data.active_texture_coordinates_name = _POINT_TEXTURE
    seams = face.pop("texcoord", None)
    if isinstance(seams, Lists) and np.array_equal(seams.lengths, 2 * counts):
        pairs = seams.values.reshape(-1, 2)
        surface.cell_data[_CORNER_TEXTURE] = padded_corners(counts, pairs)
    _keep_arrays(vertex, surface.point_data)
    _keep_arrays(face, surface.cell_data)
    for element in tables.keys() - {"vertex", "face", "tristrips"}:
        for name, values in tables[element].items():
            if isinstance(values, np.ndarray) and len(values):
                surface.field_data[f"{element}.{name}"] = values
    for word, name in _LINES.items():
        if lines := comments_of(data, word):
            set_names(surface, name, lines)
    lost = [
        f"{element} property {name!r}"
        for element, table in (("vertex", vertex), ("face", face), *tables.items())
        for name, values in table.items()
        if isinstance(values, Lists) and element != "tristrips"
    ]
    if lost:
        _log.warning("lists of numbers are not read: %s", ", ".join(dict.fromkeys(lost)))
    return surface


def ply_points(path: Path) -> FloatArray:
    """Return the vertices (n, 3) of a PLY file, which may have no faces."""
    vertex = tables_of(path.read_bytes()).get("vertex", {})
    if not _has_numbers(vertex, "xyz"):
        raise MeshError("the PLY file has no vertices with x, y, z")
    return np.stack([np.asarray(vertex[name], dtype=float) for name in "xyz"], axis=-1)


def _has_numbers(table: Table, names: Iterable[str]) -> bool:
    return all(isinstance(table.get(name), np.ndarray) for name in names)


def _corners(table: Table) -> Lists | None:
    """Remove and return the vertex indices of polygons or strips; None if there are none."""
    found = [table.pop(name) for name in _CORNERS if isinstance(table.get(name), Lists)]
    if not found:
        return None
    lengths, values = found[0]
    if values.dtype.kind == "f" and not (
        (np.abs(values) < 2**53).all() and (values == np.rint(values)).all()
    ):
        raise MeshError("a face of the PLY file has a corner that is not an integer")
    return Lists(lengths, values.astype(np.int64))


def _keep_arrays(table: Table, attributes: Any) -> None:
    colour = [table[name] for name in _COLOUR if name in table]
    if _has_numbers(table, _COLOUR[:3]) and all(_is_colour(values) for values in colour):
        table = {name: values for name, values in table.items() if name not in _COLOUR}
        if colour[0].dtype.kind == "f":
            colour = [np.rint(255.0 * values) for values in colour]
        attributes["RGB" if len(colour) == 3 else "RGBA"] = np.stack(colour, -1).astype("u1")
    for name, values in table.items():
        if isinstance(values, np.ndarray):
            attributes[name] = values


def _is_colour(values: Any) -> bool:
    """Return whether a column is bytes, or floating-point numbers from 0 to 1."""
    if not isinstance(values, np.ndarray) or values.dtype.kind == "f":
        return isinstance(values, np.ndarray) and bool(((values >= 0) & (values <= 1)).all())
    return bool(values.dtype == np.uint8)


def write_ply(path: Path, surface: pv.PolyData) -> None:
    """Write a binary PLY file in double precision, with colours, texture coordinates and scalars.

    Warnings are logged for arrays that are renamed or left out.
    """
    counts, corners = polygons_of(surface)
    points, columns = surface.points, dict[str, Any]()
    kept: dict[str, list[str]] = {"point": [], "cell": [], "field": []}
    texture, texture_name = texture_of(surface), ""
    if texture is not None:
        # In single precision by the names that Blender reads too, else by those of MeshLab
        texture_name, pairs = texture
        columns |= dict(zip(_TEXTURE[0 if pairs.dtype == "f4" else -1], pairs.T, strict=True))
    arrays = {name: v for name, v in surface.point_data.items() if name != texture_name}
    normals = arrays.get("Normals")
    if normals is not None and normals.shape[1:] == (3,) and normals.dtype.str[1:] in ("f4", "f8"):
        columns |= dict(zip(_NORMAL, np.asarray(arrays.pop("Normals")).T, strict=True))
        kept["point"].append("Normals")
    of_points, written = _columns("point", arrays, _OF_POINTS)
    vertex = dict(zip("xyz", np.asarray(points, dtype="f8").T, strict=True)) | columns | of_points
    cells = cells_of(surface)
    arrays = {name: np.asarray(values)[cells] for name, values in surface.cell_data.items()}
    seams = corner_values(arrays.get(_CORNER_TEXTURE), counts)
    if seams is not None:
        del arrays[_CORNER_TEXTURE]
    face, written_cells = _columns("cell", arrays, _OF_FACES)
    kept["point"] += [*written, texture_name]
    kept["cell"] += written_cells
    kept["cell"] += [_CORNER_TEXTURE] if seams is not None else []
    elements = _other_elements(surface, kept["field"])
    lines = [
        f"{word} {' '.join(line.split())}"
        for word, name in _LINES.items()
        for line in get_names(surface, name)
    ]
    kept["field"] += _LINES.values()
    warn_left_out("PLY", surface, kept)
    if counts.max(initial=0) > _COMMON:
        _log.warning("PLY faces of over %d corners cannot be read by some programs", _COMMON)
    lists = [("vertex_indices", counts, corners.astype("<i4"))]
    if seams is not None:  # MeshLab reads single precision only
        lists.append(("texcoord", 2 * counts, seams.astype("<f4").ravel()))
    header = ["ply", "format binary_little_endian 1.0", *lines]
    header += [f"element vertex {len(points)}"]
    header += [f"property {_WORDS[c.dtype.str[1:]]} {name}" for name, c in vertex.items()]
    header += [f"element face {len(counts)}"]
    for name, lengths, values in lists:
        words = _WORDS[_length_type(lengths)], _WORDS[values.dtype.str[1:]]
        header += [f"property list {words[0]} {words[1]} {name}"]
    header += [f"property {_WORDS[c.dtype.str[1:]]} {name}" for name, c in face.items()]
    for element, properties in elements.items():
        header += [f"element {element} {len(next(iter(properties.values())))}"]
        header += [f"property {_WORDS[v.dtype.str[1:]]} {name}" for name, v in properties.items()]
    with path.open("wb") as file:
        file.write("\n".join([*header, "end_header", ""]).encode())
        file.write(_packed(len(points), list(vertex.values())).tobytes())
        file.write(_face_rows([(n, v) for _, n, v in lists], list(face.values())))
        for properties in elements.values():
            count = len(next(iter(properties.values())))
            file.write(_packed(count, list(properties.values())).tobytes())


def _other_elements(surface: pv.PolyData, kept: list[str]) -> dict[str, dict[str, Any]]:
    """Return the columns of further elements, from field arrays "element.property"."""
    elements: dict[str, dict[str, Any]] = {}
    for name in list(surface.field_data.keys()):
        element, dot, key = name.partition(".")
        plain = _PLAIN.fullmatch(element) and _PLAIN.fullmatch(key) and dot
        if not plain or element in ("vertex", "face", "tristrips"):
            continue
        values = _column(np.asarray(surface.field_data[name]))
        known = elements.get(element, {})
        if values is not None and all(
            len(each) == len(values) > 0 for each in (*known.values(), values)
        ):
            elements[element] = known | {key: values}
            kept.append(name)
    return elements


def _columns(
    sort: str, arrays: dict[str, Any], reserved: frozenset[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the arrays that PLY can store, as columns by property name, and their names."""
    columns: dict[str, Any] = {}
    numbers: dict[str, Any] = {}
    kept = []
    for name, values in arrays.items():
        if values.dtype == np.uint8 and values.shape[1:] == (_WIDTHS.get(name),) and not columns:
            columns |= dict(zip(_COLOUR, np.asarray(values).T, strict=False))
            kept.append(name)
        elif (numeric := _column(values)) is not None:
            numbers[name] = numeric
    names = plain_names(numbers, reserved, refused=" ")
    warn_renamed(f"{sort} array", names)
    return columns | {names[name]: values for name, values in numbers.items()}, [*kept, *numbers]


def _column(values: Any) -> Any:
    """Return numbers (n,) converted exactly to a type of PLY; None if there is no such type."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "biuf":
        return None
    if array.dtype.kind == "b":
        return array.astype("u1")
    if array.dtype.str[1:] in _WORDS:
        return array
    if array.dtype.kind == "f":
        return array.astype("f4") if array.dtype.itemsize == 2 else None
    low, high = int(array.min(initial=0)), int(array.max(initial=0))
    for kind, least, most in (("i4", -(2**31), 2**31), ("u4", 0, 2**32), ("f8", -(2**53), 2**53)):
        if least <= low and high < most:
            return array.astype(kind)
    return None


def _length_type(lengths: IntArray) -> str:
    return "u1" if lengths.max(initial=0) <= _COMMON else "i4"


def _packed(count: int, columns: list[Any]) -> Any:
    """Return the bytes of rows of numbers, (count, size), from their columns."""
    parts = [np.ascontiguousarray(c, dtype=c.dtype.newbyteorder("<")) for c in columns]
    sized = [part.view("u1").reshape(count, -1 if count else 0) for part in parts]
    return np.hstack(sized) if sized else np.empty((count, 0), dtype="u1")


def _face_rows(lists: list[tuple[IntArray, Any]], columns: list[Any]) -> bytes:
    """Return the bytes of the rows of faces: *lists* of (lengths, values), then *columns*.

    Faces with equal numbers of corners are packed together.
    """
    counts = lists[0][0]
    tail = _packed(len(counts), columns)
    sizes = np.full(len(counts), tail.shape[1])
    for lengths, values in lists:
        sizes += np.dtype(_length_type(lengths)).itemsize + lengths * values.itemsize
    row_starts = np.cumsum(sizes) - sizes
    result = np.empty(int(sizes.sum()), dtype="u1")
    for count in np.unique(counts):
        rows = np.flatnonzero(counts == count)
        parts = []
        for lengths, values in lists:
            starts = (np.cumsum(lengths) - lengths)[rows]
            length = int(lengths[rows[0]])
            items = values[starts[:, None] + np.arange(length)]
            parts += [lengths[rows].astype(_length_type(lengths)), *items.T]
        packed = np.hstack([_packed(len(rows), parts), tail[rows]])
        if len(rows) == len(counts):
            return bytes(packed.tobytes())
        result[row_starts[rows, None] + np.arange(packed.shape[1])] = packed
    return result.tobytes()
