"""STL, a triangle soup in single precision, binary or text: reader and writer.

    binary   80 bytes, the number of triangles, and 50 bytes each: normal, corners, 2 more
    text     solid ... facet normal ... outer loop, vertex x y z three times, endloop ... endsolid

Equal corners are merged, also those of different solids; vertices are numbered in the order of
their first corner.  All triangles are kept, in their order.  Normals are ignored and computed
again.  Of a binary file, the 2 bytes are the cell array "Attribute" unless all are 0, the 80 bytes
the field array "Header".  The named solids of a text, of which there may be several, are the cell
array "Group" and the field array "GroupNames", as the groups of OBJ.

Only text has several names, so a surface with groups, or else objects, is written as text, any
other one as a binary file.  Triangles remain in their order: a solid is begun, as a group of OBJ
is, wherever the group changes.  Names are written in ASCII.

A text without its last "endsolid" is read with a warning if its last triangle is complete.
"""

from __future__ import annotations

import codecs
import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import IntArray
from ..errors import MeshError
from ..mesh import first_equal_row
from .array_names import (
    HEADER,
    cut,
    decoded,
    get_names,
    plain_names,
    set_names,
    warn_left_out,
    warn_of_rounding,
    warn_renamed,
)
from .groups import GROUP, OBJECT, groups_of, names_key, set_groups
from .number_lines import are_numbers, numbers_of
from .polygons import cells_of, cut_into_triangles, polydata_of, polygons_of

_START, _SIZE = 84, 50  # bytes before the triangles, and per triangle
_BLANKS = b"\0\t\n\r\x1a "  # that may fill up a file
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
_FORMAT = (
    "facet normal %.9g %.9g %.9g\nouter loop\n"
    + 3 * "vertex %.9g %.9g %.9g\n"
    + "endloop\nendfacet\n"
)
_PIECE = 10_000  # triangles that are written at a time
_SOLID = re.compile(rb"\n[ \t]*[sS][oO][lL][iI][dD](?=\s|\Z)[ \t]*([^\n]*)")
# In lower case, which is found in half the time
_VERTEX = re.compile(rb"\n[ \t]*vertex[ \t]+(\S+[ \t]+\S+[ \t]+\S+)")
_log = logging.getLogger(__name__)


def read_stl(path: Path) -> pv.PolyData:
    """Read the triangles of an STL file, with equal corners merged."""
    data = path.read_bytes()
    text = _text_of(data)
    if text is not None:
        return _read_text(path, text)
    rows = _of_bytes(data)
    surface = _surface(rows["corners"].reshape(-1, 3))
    if rows["more"].any():
        surface.cell_data["Attribute"] = rows["more"]
    if title := decoded(data[:80].partition(b"\0")[0]).strip():
        set_names(surface, HEADER, [title])
    return surface


def _text_of(data: bytes) -> bytes | None:
    """Return the text of a file, without blanks before it; None if the file is binary.

    The title of a binary file may begin with "solid" as well.  But text has no zero bytes, and a
    binary file has one in the number of its triangles, if these are fewer than 2^24, or else in
    its title or its first triangle.
    """
    text = data.removeprefix(codecs.BOM_UTF8).lstrip()
    is_binary = text[:5].lower() != b"solid" or b"\0" in data[: _START + _SIZE]
    return None if is_binary else text


def _of_bytes(data: bytes) -> Any:
    """Return the triangles of a binary file, (m,) of `_ROW`.

    Blanks may follow them, or a part of a triangle.  More than that is an error, since either the
    number is wrong or the rest is, and both could be wrong without a trace.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and b"s\0o\0l\0" in data[:99]:
        raise MeshError("is UTF-16 text; save it as UTF-8 or ASCII text")
    if len(data) < _START:
        raise MeshError(f"ends after {len(data)} bytes, in its header: it was cut off")
    count, stored = int.from_bytes(data[80:_START], "little"), (len(data) - _START) // _SIZE
    if stored < count or (stored > count and data[_START + _SIZE * count :].strip(_BLANKS)):
        why = "it was cut off" if stored < count else "its header is wrong"
        raise MeshError(
            f"declares {count} triangles, but its {len(data)} bytes contain {stored}: {why}, "
            "export it again"
        )
    return np.frombuffer(data, _ROW, count, _START)


def _read_text(path: Path, text: bytes) -> pv.PolyData:
    """Return the surface of a text, with the names of its solids."""
    names, parts, numbers = dict[str, int](), list[Any](), list[IntArray]()
    has_end = is_named = False
    for solid, name, piece in _solids(text.replace(b"\r", b"\n")):
        corners, is_whole, has_end = _corners_of_text(piece)
        if not is_whole:
            raise MeshError("is truncated, or has a facet without three vertices")
        if len(corners):
            with np.errstate(over="ignore"):
                parts.append(corners.astype(np.float32))
            number = names.setdefault(name or f"solid {solid}", len(names))
            numbers.append(np.full(len(corners) // 3, number))
            is_named |= bool(name) or len(names) > 1
    if not (parts or has_end):
        raise MeshError("is truncated: it has no facet")
    surface = _surface(np.concatenate([np.empty((0, 3), np.float32), *parts]))
    if not has_end:
        _log.warning(
            "%s: there is no endsolid; the file may be truncated after %d triangles",
            path, surface.n_cells,
        )  # fmt: skip
    if is_named:
        set_groups(surface, GROUP, np.concatenate(numbers), names)
    return surface


def _solids(text: bytes) -> Iterator[tuple[int, str, bytes]]:
    """Yield the number from 1, the name, and the lines of each solid."""
    text = b"\n" + text
    found = list(_SOLID.finditer(text))
    ends = [match.start() for match in found[1:]] + [len(text)]
    if not found:
        yield 1, "", text
    for number, (match, end) in enumerate(zip(found, ends, strict=True), 1):
        yield number, decoded(match[1]).strip(), text[match.end() : end]


def _surface(corners: Any) -> pv.PolyData:
    with np.errstate(invalid="ignore"):  # NaN is reported when the mesh is checked
        corners = corners + np.float32(0.0)  # -0 becomes 0
    points, numbers = _merged(corners)
    return polydata_of(points, np.full(len(corners) // 3, 3), numbers)


def write_stl(path: Path, surface: pv.PolyData) -> None:
    """Write the triangles, in their order, to an STL file; polygons are cut.

    It is text, with several solids, if the surface has groups or objects, and binary otherwise.
    """
    counts, corners = polygons_of(surface)
    points = np.asarray(surface.points, dtype=float)
    faces, polygon = cut_into_triangles(points, counts, corners)
    with np.errstate(over="ignore"):
        single = points.astype("<f4")
    if (np.isinf(single) & np.isfinite(points)).any():
        raise MeshError("has positions that STL cannot store: over 3e38")
    kept: dict[str, list[str]] = {"cell": [], "field": []}
    rows = np.zeros(len(faces), _ROW)
    rows["corners"] = single[faces]
    a, b, c = np.moveaxis(rows["corners"].astype(float), 1, 0)
    with np.errstate(invalid="ignore", over="ignore"):
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        rows["normal"] = normals / np.where(length > 0, length, 1.0)
    warn_of_rounding("STL stores single precision", faces, points, single)
    cells = cells_of(surface)[polygon]
    for key in (GROUP, OBJECT):
        if len(rows) and (found := groups_of(surface, key)) is not None:
            kept = {"cell": [key], "field": [names_key(key)]}
            warn_left_out("a text STL", surface, kept)
            _write_text(path, rows, found[0][cells], found[1])
            return
    attributes = surface.cell_data.get("Attribute")
    if attributes is not None and attributes.dtype == np.uint16 and attributes.ndim == 1:
        rows["more"] = np.asarray(attributes)[cells]
        kept["cell"].append("Attribute")
    title = " ".join(get_names(surface, HEADER))
    sound = f"_{title}" if title.lower().startswith("solid") else title  # it would be text
    header = cut(sound, 80)
    warn_renamed("header", {title: header.decode()})
    kept["field"] += [HEADER] if header else []
    warn_left_out("STL", surface, kept)
    with path.open("wb") as file:
        file.write(header.ljust(80, b"\0") + len(rows).to_bytes(4, "little"))
        file.write(rows.tobytes())


def _write_text(path: Path, rows: Any, group: IntArray, names: list[str]) -> None:
    """Write triangles of `_ROW` as text; a solid ends where the *group* (m,) changes."""
    # MeshLab takes a file with other letters for a binary one, and loses triangles after names of
    # several words, of which OpenFOAM reads the first.
    refused = {letter for letter in "".join(names) if not letter.isascii() or letter.isspace()}
    written = plain_names(names, refused="".join(refused))
    warn_renamed("group", written)
    values = np.column_stack([rows["normal"], rows["corners"].reshape(-1, 9)])
    ends = [*(np.flatnonzero(np.diff(group)) + 1).tolist(), len(rows)]
    begin = 0
    with path.open("w", encoding="ascii", newline="\n") as file:
        for end in ends:
            name = written[names[group[begin]]]
            file.write(f"solid {name}\n")
            for at in range(begin, end, _PIECE):
                piece = values[at : min(at + _PIECE, end)]
                file.write(len(piece) * _FORMAT % tuple(piece.ravel().tolist()))
            file.write(f"endsolid {name}\n")
            begin = end


def _corners_of_text(data: bytes) -> tuple[Any, bool, bool]:
    """Return the corners (k, 3) of the facets, whether all are complete, and there is an end."""
    data = b"\n" + data.lower()
    has_end = b"endsolid" in data
    facets = data.partition(b"endsolid")[0]
    n_facets = facets.count(b"endfacet")
    rows = _VERTEX.findall(data)
    numbers = numbers_of(b"\n".join(rows), np.float64, 3 * len(rows))
    if rows and numbers is None:
        wrong = decoded(next(row for row in rows if not are_numbers(row.split())))
        raise MeshError(f"has the vertex {wrong[:60]!r}; must be 3 numbers")
    corners = np.reshape(numbers if rows else (), (-1, 3))
    is_whole = len(rows) == 3 * n_facets and facets.count(b"facet") == 2 * n_facets
    return corners, is_whole, has_end


def _merged(corners: Any) -> tuple[Any, Any]:
    """Return the unique rows (n, 3), by first occurrence, and the index of each corner's row."""
    points = corners.astype(np.float64)
    first = first_equal_row(points)
    is_first = first == np.arange(len(first))
    return points[is_first], (np.cumsum(is_first) - 1)[first]
