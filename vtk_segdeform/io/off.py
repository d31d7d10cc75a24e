"""OFF, the Object File Format of Geomview: reader and writer in full precision.

OFF             or STCNOFF, some of its letters: what comes after each position; may be missing
n m e           numbers of vertices, faces and edges (the last is not used)
x y z [...]     n lines: normal (N), colour (C), texture coordinates (ST)
k i j l [...]   m lines: a polygon with k corners, numbered from 0, possibly a colour

MeshLab writes the letters in the order NCST, and colours before normals.  Binary files and
positions in other than three dimensions (4OFF, nOFF) are not supported.

Normals become the point array "Normals", texture coordinates "TextureCoordinates", colours of
vertices "RGBA" or "RGB", colours of faces cell arrays of these names if all faces have them.
Colours are bytes or fractions.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .array_names import text_of, warn_left_out
from .number_lines import are_numbers, colour_bytes, colour_numbers, numbers_of, words_per_line
from .polygons import cells_of, polydata_of, polygons_of, rows, texture_of

_log = logging.getLogger(__name__)
_KIND = re.compile(r"((?:ST)?C?N?|N?C?(?:ST)?)OFF\b|(?=\d)", re.IGNORECASE)
_OTHER = re.compile(rb"(?:\s|#[^\n]*\n)*(?:ST|[CN])*(4?n?OFF(?:[ \t]+BINARY)?)\b")
_WIDTHS_OF_COLOURS = (3, 4)

# Positions and more of vertices, numbers and indices of corners, colours of faces (none: no row)
_Tables: TypeAlias = tuple[FloatArray, IntArray, IntArray, FloatArray]
_NO_COLOURS, _NO_CORNERS = np.empty((0, 3)), np.empty(0, dtype=np.int64)


def read_off(path: Path) -> pv.PolyData:
    """Read a surface from an OFF file; with normals, texture coordinates and colours."""
    data = path.read_bytes()
    other = _OTHER.match(data)
    if other is not None and other[1] != b"OFF":
        raise MeshError(f"is {_described(other[1].decode())}, which is not supported")
    text = text_of(data).replace("\r", "\n")
    if "#" in text:
        text = re.sub(r"#[^\n]*", "", text)
    text = text.lstrip()
    kind = _KIND.match(text)
    if kind is None:
        raise MeshError("the first line is not OFF")
    rest = text[kind.end() :]
    table, counts, corners, colours = _plain_tables(rest.encode() + b"\n") or _tables(rest)
    surface = polydata_of(table[:, :3], counts, corners)
    _keep_columns(surface, (kind[1] or "").upper(), table[:, 3:])
    if len(colours):
        _keep_colour(surface.cell_data, colours)
    return surface


def _described(kind: str) -> str:
    if kind.endswith("BINARY"):
        return "a binary OFF file; save it as text"
    return f"{kind}, with positions in other than three dimensions; save it as OFF"


def _keep_columns(surface: pv.PolyData, letters: str, columns: FloatArray) -> None:
    """Store the numbers after the positions (n, k), which the *letters* of the header announce."""
    order = "CNS" if letters.startswith("NC") else "NCS"
    widths = {"N": 3 * ("N" in letters), "S": 2 * ("S" in letters)}
    widths["C"] = columns.shape[1] - sum(widths.values()) if "C" in letters else 0
    if sum(widths.values()) != columns.shape[1] or widths["C"] not in (0, *_WIDTHS_OF_COLOURS):
        if len(columns):
            _log.warning(
                "the vertices of %sOFF have %d numbers: only the positions are read",
                letters, 3 + columns.shape[1],
            )  # fmt: skip
        return
    ends = np.cumsum([widths[each] for each in order])
    parts = dict(zip(order, np.split(columns, ends[:-1], axis=1), strict=True))
    if widths["N"]:
        surface.point_data["Normals"] = parts["N"]
        surface.point_data.active_normals_name = "Normals"
    if widths["S"]:
        surface.point_data["TextureCoordinates"] = parts["S"]
        surface.point_data.active_texture_coordinates_name = "TextureCoordinates"
    if widths["C"]:
        _keep_colour(surface.point_data, parts["C"])


def _plain_tables(text: bytes) -> _Tables | None:
    """Return `_tables` if vertices have rows of equal length, and faces integers only."""
    begins, lengths = words_per_line(text)
    lengths = lengths[lengths > 0]
    sizes = text[: begins[lengths[0]]].split() if len(lengths) > 1 else []
    if len(sizes) < 2 or not (sizes[0].isdigit() and sizes[1].isdigit()):
        return None
    n, m = int(sizes[0]), int(sizes[1])
    if not 0 < n < len(lengths) - m or not m:
        return None
    of_faces = lengths[1 + n : 1 + n + m]
    ends = np.cumsum([lengths[0], lengths[1 : 1 + n].sum(), of_faces.sum()])
    start, middle, end = (int(k) for k in np.append(begins, len(text))[ends])
    width = int(lengths[1])
    table = numbers_of(text[start:middle], np.float64, n * width)
    values = numbers_of(text[middle:end], np.int64, int(of_faces.sum()))
    if (lengths[1 : 1 + n] != width).any() or table is None or values is None:
        return None
    starts = np.cumsum(of_faces) - of_faces
    counts = values[starts]
    n_colour = int(of_faces[0] - counts[0] - 1)
    if counts.min() < 0 or (of_faces != counts + (1 + n_colour)).any() or n_colour < 0:
        return None
    place = np.arange(len(values)) - np.repeat(starts, of_faces)
    colour = values[place > np.repeat(counts, of_faces)].reshape(m, n_colour).astype(float)
    return (
        table.reshape(n, width),
        counts,
        values[(place > 0) & (place <= np.repeat(counts, of_faces))],
        _checked(colour),
    )


def _tables(text: str) -> _Tables:
    """Return what is after the first word of a file.

    That is a row of numbers for each vertex, the numbers and indices of corners, and the colours
    of faces if all have one.
    """
    lines = [line for line in text.split("\n") if line.strip()]
    sizes = lines[0].split()[:2] if lines else []
    if len(sizes) < 2 or not all(word.isdecimal() and len(word) < 16 for word in sizes):
        raise MeshError(
            f"declares {' '.join(sizes)[:40]!r} vertices and faces; must be two whole numbers"
        )
    n, m = map(int, sizes)
    if len(lines) < 1 + n + m:
        raise MeshError(
            f"declares {n} vertices and {m} faces, but ends after {len(lines) - 1} lines"
        )
    words = [line.split() for line in lines[1 : 1 + n]]
    width = len(words[0]) if n else 3
    for k, row in enumerate(words):
        if len(row) != width or width < 3 or not are_numbers(row):
            raise MeshError(
                f"vertex {k} is {' '.join(row)[:60]!r}; must be {max(width, 3)} numbers"
            )
    table = np.array(words, dtype=float).reshape(n, width)
    of_faces = lines[1 + n : 1 + n + m]
    counts, corners = _polygons(of_faces)
    return table, counts, corners, _colours_of_faces(of_faces, counts)


def _keep_colour(attributes: Any, colour: FloatArray) -> None:
    attributes["RGB" if colour.shape[1] == 3 else "RGBA"] = colour_bytes(colour)


def _colours_of_faces(lines: list[str], counts: IntArray) -> FloatArray:
    words = [line.split()[k + 1 :] for line, k in zip(lines, counts.tolist(), strict=True)]
    try:
        return _checked(np.array(words, dtype=float))
    except ValueError:
        _log.warning("only some faces have a colour, or not of numbers: they are not read")
        return _NO_COLOURS


def _checked(colours: FloatArray) -> FloatArray:
    """Return *colours* (m, k) if they are RGB or RGBA, else none, with a warning if k > 0."""
    if colours.ndim > 1 and colours.shape[1] in _WIDTHS_OF_COLOURS:
        return colours
    if colours.size:
        _log.warning("the faces have colours of %d numbers: they are not read", colours.shape[1])
    return _NO_COLOURS


def write_off(path: Path, surface: pv.PolyData) -> None:
    """Write positions in full precision, polygons, normals, texture coordinates and colours."""
    counts, corners = polygons_of(surface)
    polygons = rows(counts, corners)
    kept: dict[str, list[str]] = {"point": [], "cell": []}
    columns, kind = [np.asarray(surface.points, dtype=float)], ""
    data = surface.point_data
    normals = data.get("Normals")
    if normals is not None and normals.shape[1:] == (3,) and normals.dtype.kind == "f":
        columns, kind = [*columns, np.asarray(normals, dtype=float)], "N"
        kept["point"].append("Normals")
    name, colour = _colour(data)
    if colour is not None:
        columns, kind = [*columns, colour_numbers(colour)], f"C{kind}"
        kept["point"].append(name)
    texture = texture_of(surface)
    if texture is not None:
        columns, kind = [*columns, texture[1].astype(float)], f"ST{kind}"
        kept["point"].append(texture[0])
    name, of_faces = _colour(surface.cell_data)
    tails = [""] * len(polygons)
    if of_faces is not None:
        of_faces = colour_numbers(of_faces[cells_of(surface)])
        tails = [f" {' '.join(map(str, row))}" for row in of_faces.tolist()]
        kept["cell"].append(name)
    warn_left_out("OFF", surface, kept)
    table = zip(*(column.tolist() for column in columns), strict=True)
    with path.open("w", newline="\n") as file:
        file.write(f"{kind}OFF\n{surface.n_points} {len(polygons)} 0\n")
        file.writelines(f"{' '.join(repr(v) for each in row for v in each)}\n" for row in table)
        file.writelines(
            f"{len(row)} {' '.join(map(str, row))}{tail}\n"
            for row, tail in zip(polygons, tails, strict=True)
        )


def _colour(attributes: Any) -> tuple[str, Any]:
    """Return the name and the bytes of colours in point or cell data; None if there are none."""
    for name, width in (("RGBA", 4), ("RGB", 3)):
        values = attributes.get(name)
        if values is not None and values.dtype == np.uint8 and values.shape[1:] == (width,):
            return name, np.asarray(values)
    return "", None


def _polygons(lines: list[str]) -> tuple[IntArray, IntArray]:
    counts, corners = [], []
    for k, line in enumerate(lines):
        words = line.split()
        try:
            count = int(words[0])
            row = np.array(words[1 : max(count, 0) + 1], dtype=np.int64)
        except (ValueError, OverflowError):
            raise MeshError(f"face {k} is {line[:60]!r}; must be whole numbers") from None
        if len(row) != count:
            raise MeshError(f"the line of face {k} ends before its last corner")
        counts.append(count)
        corners.append(row)
    return np.array(counts, dtype=np.int64), np.concatenate([_NO_CORNERS, *corners])
