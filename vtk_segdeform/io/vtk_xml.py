"""Plain surfaces and grids in VTK's XML formats, .vtp and .vtu, read without VTK.

VTK's reader does not validate a file, so `isolated` runs it in a child process, which takes longer
than reading.  Most files have a structure that is simple enough to be checked completely:

    VTKFile  PolyData or UnstructuredGrid  one Piece
             PointData, CellData, FieldData, Points, Verts, Lines, Strips, Polys, Cells
             DataArray of numbers: ascii, binary or appended, compressed by zlib or not

Everything else is left to VTK: other elements and attributes, comments, entities, several pieces,
texts, counts that do not fit, more than so many bytes out of a compressed one.  No memory is
allocated for a count before that many numbers have been found, so a false one does no harm.

An array is coded as the number of its bytes and these bytes; or, compressed, as the number of
blocks, the sizes of a block and of the last one (0 if it is full), the compressed sizes, and the
blocks.  In base64 the counts of a compressed array have a padding of their own.
"""

from __future__ import annotations

import base64
import re
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkDataSetAttributes

from .vtk_parts import (
    NotPlainError,
    add_array,
    cells_of,
    count_of,
    demand,
    numbers_of_text,
    set_grid_cells,
    set_points,
)

_TAG = re.compile(rb'<(/?)(\w+)((?:\s+\w+="[^"<>&]*")*)\s*(/?)>')
_ATTRIBUTE = re.compile(rb'(\w+)="([^"]*)"')
_DECLARATION = re.compile(rb'\s*<\?xml version="1.0"( encoding="(?i:utf-8)")?\s*\?>')
_APPENDED = re.compile(rb'<AppendedData\s+encoding="(raw|base64)"\s*>\s*_')
_TYPES = {
    "Int8": "<i1", "UInt8": "<u1", "Int16": "<i2", "UInt16": "<u2", "Int32": "<i4",
    "UInt32": "<u4", "Int64": "<i8", "UInt64": "<u8", "Float32": "<f4", "Float64": "<f8",
}  # fmt: skip
_HEADERS = {"UInt32": 4, "UInt64": 8}
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_COMPRESSORS = ("", "vtkZLibDataCompressor")
_KINDS = {
    "Scalars": vtkDataSetAttributes.SCALARS, "Vectors": vtkDataSetAttributes.VECTORS,
    "Normals": vtkDataSetAttributes.NORMALS, "TCoords": vtkDataSetAttributes.TCOORDS,
    "Tensors": vtkDataSetAttributes.TENSORS, "GlobalIds": vtkDataSetAttributes.GLOBALIDS,
    "PedigreeIds": vtkDataSetAttributes.PEDIGREEIDS, "Tangents": vtkDataSetAttributes.TANGENTS,
}  # fmt: skip
_CELLS = {"Verts": "SetVerts", "Lines": "SetLines", "Polys": "SetPolys", "Strips": "SetStrips"}
_COUNTS = {f"NumberOf{name}" for name in ("Points", "Cells", *_CELLS)}
# By element, the attributes that are understood.
_KNOWN = {
    "VTKFile": {"type", "version", "byte_order", "header_type", "compressor"},
    "PolyData": set[str](), "UnstructuredGrid": set[str](), "FieldData": set[str](),
    "Piece": _COUNTS, "PointData": set(_KINDS), "CellData": set(_KINDS),
    "Points": set[str](), "Cells": set[str](), **{name: set[str]() for name in _CELLS},
    "DataArray": {"type", "IdType", "Name", "NumberOfComponents", "NumberOfTuples", "format",
                  "offset", "RangeMin", "RangeMax"},
    "InformationKey": {"name", "location", "length"}, "Value": {"index"},
}  # fmt: skip
_COMPONENT = re.compile(r"ComponentName(\d{1,3})")
_SPACE = 0x20
_VALUE = re.compile(rb"\s*[-+.\w]*\s*")
_WITH_TEXT = ("DataArray", "Value")
_RANGES = ("L2_NORM_RANGE", "L2_NORM_FINITE_RANGE")  # computed again when they are needed
_DEEPEST, _DENSEST = 8, 64  # elements in each other, bytes out of one compressed byte


@dataclass
class _Element:
    name: str
    values: dict[str, str]
    start: int  # of its text
    text: bytes = b""
    children: list[_Element] = field(default_factory=list)

    def child(self, name: str) -> _Element | None:
        """Return the only child of this name, or None."""
        found = [each for each in self.children if each.name == name]
        demand(len(found) <= 1)
        return found[0] if found else None

    def count(self, name: str) -> int:
        return count_of(self.values.get(name, "0"))


@dataclass
class _Coding:
    """The encoding of arrays, and the appended data."""

    header: int
    order: str  # of bytes: < or >
    compressed: bool
    raw: bool
    appended: bytes
    left: int  # bytes that may still come out of compressed ones


def read_plain_xml(data: bytes) -> pv.PolyData | pv.UnstructuredGrid | None:
    """Return what is in the bytes of a .vtp or .vtu file; None if the file is not plain."""
    try:
        return _read(data)
    except (NotPlainError, ValueError, FloatingPointError, zlib.error):
        return None


def _read(data: bytes) -> pv.PolyData | pv.UnstructuredGrid:
    head, appended, raw = data, b"", False
    if found := _APPENDED.search(data):
        rest, _, after = data.rpartition(b"</AppendedData>")
        head, appended, raw = data[: found.start()] + after, rest[found.end() :], found[1] == b"raw"
    _demand_text(head)
    file = _tree(head)
    compressor, header = file.values.get("compressor", ""), file.values.get("header_type", "UInt32")
    order = _ORDERS.get(file.values.get("byte_order", ""))
    demand(file.name == "VTKFile" and order)
    assert order is not None
    demand(file.values.get("version") in ("0.1", "1.0") and header in _HEADERS)
    demand(compressor in _COMPRESSORS and len(file.children) == 1)
    is_dense, most = bool(compressor), _DENSEST * len(data)
    coding = _Coding(_HEADERS[header], order, is_dense, raw, appended, most)
    body, piece = file.children[0], file.children[0].child("Piece")
    demand(body.name == file.values.get("type") and piece is not None)
    assert piece is not None
    result = {"PolyData": _polydata, "UnstructuredGrid": _grid}[body.name](piece, coding)
    n_points, n_cells = result.GetNumberOfPoints(), result.GetNumberOfCells()
    for attributes, element, count in (
        (result.GetPointData(), piece.child("PointData"), n_points),
        (result.GetCellData(), piece.child("CellData"), n_cells),
        (result.GetFieldData(), body.child("FieldData"), None),
    ):
        _add_arrays(attributes, element, count, coding)
    return result


def _demand_text(text: bytes) -> None:
    """Demand UTF-8 without control characters."""
    letters = np.frombuffer(text, dtype=np.uint8)
    n_blank = sum(text.count(each) for each in (b" ", b"\t", b"\n", b"\r"))
    demand(np.count_nonzero(letters <= _SPACE) == n_blank)
    if not text.isascii():
        text.decode("utf-8")


def _tree(text: bytes) -> _Element:
    """Return the first element of *text*, with all elements in it."""
    begun = _DECLARATION.match(text)
    at = begun.end() if begun else 0
    root = _Element("", {}, at)
    path = [root]
    n_tags = 0
    for tag in _TAG.finditer(text, at):
        n_tags += 1
        name = tag[2].decode()
        parent = path[-1]
        demand(parent.name in _WITH_TEXT or not text[at : tag.start()].strip())
        at = tag.end()
        if tag[1]:
            demand(parent.name == name and not tag[3] and not tag[4])
            demand(name != "Value" or _VALUE.fullmatch(text, parent.start, tag.start()))
            if not parent.children:
                parent.text = text[parent.start : tag.start()]
            path.pop()
            continue
        values = {key.decode(): value.decode() for key, value in _ATTRIBUTE.findall(tag[3])}
        known = _KNOWN.get(name)
        demand(known is not None and len(path) < _DEEPEST)
        demand(len(values) == tag[3].count(b'="'))  # none is there twice
        assert known is not None
        names = {key for key in values if name != "DataArray" or not _COMPONENT.fullmatch(key)}
        demand(names <= known)
        if name == "InformationKey":
            demand(values.get("name") in _RANGES)
            parent.text = parent.text or text[parent.start : tag.start()]
        parent.children.append(_Element(name, values, tag.end()))
        if not tag[4]:
            path.append(parent.children[-1])
    demand(path == [root] and len(root.children) == 1 and not text[at:].strip())
    demand(n_tags == text.count(b"<", root.start))
    return root.children[0]


def _polydata(piece: _Element, coding: _Coding) -> pv.PolyData:
    surface = pv.PolyData()
    n_points = _set_points(surface, piece, coding)
    for name, setter in _CELLS.items():
        count = piece.count(f"NumberOf{name}")
        if count:
            element = _demanded(piece.child(name))
            getattr(surface, setter)(_cells(element, count, n_points, coding))
    return surface


def _grid(piece: _Element, coding: _Coding) -> pv.UnstructuredGrid:
    grid = pv.UnstructuredGrid()
    n_points, n_cells = _set_points(grid, piece, coding), piece.count("NumberOfCells")
    element = _demanded(piece.child("Cells"))
    cells = _cells(element, n_cells, n_points, coding)
    demand(len(element.children) == 3)
    set_grid_cells(grid, cells, _numbers(_array_of(element, "types"), n_cells, coding))
    return grid


def _demanded(element: _Element | None) -> _Element:
    if element is None:
        raise NotPlainError
    return element


def _set_points(data: Any, piece: _Element, coding: _Coding) -> int:
    count, element = piece.count("NumberOfPoints"), _demanded(piece.child("Points"))
    demand(count and len(element.children) == 1)
    values = _numbers(element.children[0], 3 * count, coding)
    demand(element.children[0].count("NumberOfComponents") == 3)
    set_points(data, values)
    return count


def _cells(element: _Element, count: int, n_points: int, coding: _Coding) -> pv.CellArray:
    corners = _numbers(_array_of(element, "connectivity"), None, coding)
    ends = _numbers(_array_of(element, "offsets"), count, coding)
    demand(corners.dtype.kind == ends.dtype.kind == "i")
    return cells_of(np.append(0, ends), corners, n_points)


def _array_of(element: _Element, name: str) -> _Element:
    found = [each for each in element.children if each.values.get("Name") == name]
    demand(len(found) == 1)
    return found[0]


def _add_arrays(
    attributes: Any, element: _Element | None, count: int | None, coding: _Coding
) -> None:
    """Give *attributes* the arrays of an element, of *count* rows unless that is None."""
    if element is None:
        return
    names = [each.values.get("Name", "") for each in element.children]
    for name, each in zip(names, element.children, strict=True):
        width = each.count("NumberOfComponents") if "NumberOfComponents" in each.values else 1
        n_rows = each.count("NumberOfTuples") if count is None else count
        demand(width)
        values = _numbers(each, n_rows * width, coding).reshape(n_rows, width)
        is_ids = "IdType" in each.values
        demand(each.values.get("IdType", "1") == "1")
        demand(not is_ids or values.dtype == np.int64)
        array = add_array(attributes, name, values, is_ids=is_ids)
        for key, part in each.values.items():
            if found := _COMPONENT.fullmatch(key):
                demand(int(found[1]) < width)
                array.SetComponentName(int(found[1]), part)
    for kind, name in element.values.items():
        demand(name in names and attributes.SetActiveAttribute(name, _KINDS[kind]) >= 0)


def _numbers(element: _Element, count: int | None, coding: _Coding) -> Any:
    """Return the numbers of an array, (count,); as many as there are if *count* is None."""
    values = element.values
    demand(element.name == "DataArray" and values.get("type") in _TYPES)
    kind = np.dtype(_TYPES[values["type"]])
    if values.get("format") == "ascii":
        result = numbers_of_text(element.text, kind)
    else:
        if values.get("format") == "appended":
            code = memoryview(coding.appended)[element.count("offset") :]
            demand("offset" in values and len(code))
        else:
            demand(values.get("format") == "binary")
            code = memoryview(element.text.strip())
        raw = coding.raw and values["format"] == "appended"
        decoded = (_decompressed if coding.compressed else _stored)(code, raw, coding)
        given = np.dtype(coding.order + kind.str[1:])
        result = np.frombuffer(decoded, given).astype(kind, copy=False)
    demand(count is None or len(result) == count)
    return result


def _stored(code: memoryview, raw: bool, coding: _Coding) -> bytes:
    """Return the bytes of an array that is not compressed."""
    size = int(_words(code, 1, raw, coding)[0])
    demand(size <= len(code))
    return _decoded(code, coding.header + size, raw)[coding.header :]


def _decompressed(code: memoryview, raw: bool, coding: _Coding) -> bytes:
    n_blocks, block, last = _words(code, 3, raw, coding).tolist()
    demand(n_blocks <= len(code))
    sizes = _words(code, 3 + n_blocks, raw, coding)[3:].tolist()
    full = [block] * n_blocks
    if n_blocks and last:
        full[-1] = last
    coding.left -= sum(full)
    demand(coding.left >= 0 and sum(sizes) <= len(code))
    blocks = _decoded(code[_length((3 + n_blocks) * coding.header, raw) :], sum(sizes), raw)
    parts, at = [], 0
    for size, expected in zip(sizes, full, strict=True):
        tool = zlib.decompressobj()
        parts.append(tool.decompress(blocks[at : at + size], expected + 1))
        demand(len(parts[-1]) == expected and tool.eof and not tool.unused_data)
        at += size
    return b"".join(parts)


def _words(code: memoryview, count: int, raw: bool, coding: _Coding) -> Any:
    return np.frombuffer(
        _decoded(code, count * coding.header, raw), f"{coding.order}u{coding.header}"
    )


def _length(size: int, raw: bool) -> int:
    """Return the number of characters for so many bytes."""
    return size if raw else 4 * (-(-size // 3))


def _decoded(code: memoryview, size: int, raw: bool) -> bytes:
    """Return the first *size* bytes of *code*, which may go on in base64 without a padding."""
    length = _length(size, raw)
    demand(length <= len(code))
    result = bytes(code[:length]) if raw else base64.b64decode(code[:length], validate=True)
    demand(len(result) >= size)
    return result[:size]
