"""Plain surfaces and grids in VTK's legacy format, .vtk, read without VTK.

As in `vtk_xml`, a file is read here if its structure can be checked completely, and left to VTK in
a child process otherwise.  It is read here if it consists of

    # vtk DataFile Version 1.0 to 4.2, or 5.1
    a title
    ASCII or BINARY
    DATASET POLYDATA or UNSTRUCTURED_GRID
    FIELD, POINTS, VERTICES, LINES, POLYGONS, TRIANGLE_STRIPS, CELLS, CELL_TYPES
    POINT_DATA, CELL_DATA:  SCALARS, VECTORS, NORMALS, TEXTURE_COORDINATES, TENSORS, GLOBAL_IDS,
                            PEDIGREE_IDS, COLOR_SCALARS, LOOKUP_TABLE, FIELD

with arrays of numbers, each with or without a block METADATA.  Lookup tables are left out.  Words
are separated by blanks, names are URL-encoded.  Numbers follow the line of their header: as words,
or in big-endian order.  Before version 5.1 a list of cells has for each cell the number of its
points and these; since then two arrays, OFFSETS and CONNECTIVITY.  Indices (`vtkIdType`) have 32
bits.

No memory is allocated for a count before that many numbers have been found.  A file that ends in
the middle of its numbers is refused: VTK would return zeros for what is missing.
"""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import unquote

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkDataSetAttributes

from ..arrays import IntArray
from ..errors import MeshError
from .vtk_parts import (
    LONGEST,
    NotPlainError,
    add_array,
    cells_of,
    count_of,
    demand,
    numbers_of_text,
    set_grid_cells,
    set_points,
)

_HEAD = re.compile(rb"# vtk DataFile Version (\d\.\d)\n([^\n]{0,250})\n(?i:(ascii)|binary)\n")
_OLD, _NEW = ("1.0", "2.0", "3.0", "4.0", "4.1", "4.2"), "5.1"
_WORD = re.compile(rb"\s*(\S{1,%d})(?=\s|$)" % (3 * LONGEST))
_REST = re.compile(rb"([^\n]{0,250})\n")
# Of ranges, which are computed again when they are needed.
_INFORMATION = re.compile(
    r"INFORMATION \d{1,9}|NAME L2_NORM(_FINITE)?_RANGE LOCATION vtkDataArray"
    r"|DATA 2 [-+.\w]+ [-+.\w]+"
)
_SHARES = " shares of 255"  # no type of a file
_TYPES = {
    "char": "i1", "signed_char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2",
    "int": "i4", "unsigned_int": "u4", "vtktypeint64": "i8", "vtktypeuint64": "u8", "float": "f4",
    "double": "f8", "vtkidtype": "i4",
    "long": np.dtype("l").str[1:], "unsigned_long": np.dtype("L").str[1:],  # those of the system
    _SHARES: "f4",
}  # fmt: skip
_CELLS = {
    "vertices": "SetVerts", "lines": "SetLines", "polygons": "SetPolys",
    "triangle_strips": "SetStrips",
}  # fmt: skip
# VTK's attribute, and the number of components; None: as the file says.
_ATTRIBUTES = {
    "scalars": (vtkDataSetAttributes.SCALARS, None),
    "vectors": (vtkDataSetAttributes.VECTORS, 3),
    "normals": (vtkDataSetAttributes.NORMALS, 3),
    "texture_coordinates": (vtkDataSetAttributes.TCOORDS, None),
    "tensors": (vtkDataSetAttributes.TENSORS, 9),
    "global_ids": (vtkDataSetAttributes.GLOBALIDS, 1),
    "pedigree_ids": (vtkDataSetAttributes.PEDIGREEIDS, 1),
    "color_scalars": (vtkDataSetAttributes.SCALARS, None),
}
_WIDEST = 4  # components of scalars
_CUT_OFF = (
    "ends before its numbers do: it was cut off, or a count is wrong; copy or export it again"
)
_SPACE = 0x20


def read_plain_legacy(data: bytes) -> pv.PolyData | pv.UnstructuredGrid | None:
    """Return what is in the bytes of a .vtk file; None if the file is not plain.

    Raises a `MeshError` if it was cut off.
    """
    try:
        return _File(data).read()
    except MeshError:
        raise
    except (NotPlainError, ValueError, FloatingPointError):
        return None


class _File:
    """A file, and how far it has been read."""

    def __init__(self, data: bytes) -> None:
        head = _HEAD.match(data)
        demand(head)
        assert head is not None
        version = head[1].decode()
        demand(version in (*_OLD, _NEW))
        self._data, self._at = data, head.end()
        self._is_new, self._is_text = version == _NEW, head[3] is not None
        if self._is_text:
            letters = np.frombuffer(data, dtype=np.uint8)
            is_word = letters > _SPACE
            is_word[1:] &= letters[:-1] <= _SPACE
            self._begins = np.append(np.flatnonzero(is_word), len(data))

    def read(self) -> pv.PolyData | pv.UnstructuredGrid:
        """Return the dataset; raise if anything in the file is not as expected."""
        demand(self._word().lower() == "dataset")
        sort = self._word().lower()
        demand(sort in ("polydata", "unstructured_grid"))
        result = pv.PolyData() if sort == "polydata" else pv.UnstructuredGrid()
        word = self._read_structure(result)
        done = set()
        while word:
            demand(word in ("point_data", "cell_data") and word not in done)
            done.add(word)
            of_points = word == "point_data"
            count = result.GetNumberOfPoints() if of_points else result.GetNumberOfCells()
            demand(self._count() == count)
            word = self._read_attributes(
                result.GetPointData() if of_points else result.GetCellData(), count
            )
        return result

    def _read_structure(self, result: Any) -> str:
        """Read points, cells and field data; return the word after them."""
        done: set[str] = set()
        cells = None
        while True:
            word = self._word_or_end().lower()
            demand(word not in done)
            done.add(word)
            if word == "points":
                count = self._count()
                set_points(result, self._array(self._word(), 3 * count))
            elif word == "field":
                self._read_field(result.GetFieldData(), None)
            elif word in _CELLS and isinstance(result, pv.PolyData):
                getattr(result, _CELLS[word])(self._cells(result.GetNumberOfPoints()))
            elif word == "cells" and isinstance(result, pv.UnstructuredGrid):
                cells = self._cells(result.GetNumberOfPoints())
            elif word == "cell_types" and cells is not None:
                types = self._array("int", self._count())
                demand(types.min() >= 0 and types.max() < 256)
                set_grid_cells(result, cells, types.astype(np.uint8))
            else:
                demand(result.GetNumberOfCells())
                return word

    def _read_attributes(self, attributes: Any, count: int) -> str:
        """Read arrays of *count* rows; return the word after them, "" at the end."""
        while word := self._word_or_end().lower():
            if word == "field":
                self._read_field(attributes, count)
            elif word == "lookup_table":
                self._word()
                size = self._count()
                self._array("float" if self._is_text else "unsigned_char", 4 * size)
            elif word in _ATTRIBUTES:
                kind, width = _ATTRIBUTES[word]
                name, sort = self._name(), "unsigned_char"
                if word == "color_scalars":
                    width, sort = self._count(), _SHARES if self._is_text else sort
                elif word == "texture_coordinates":
                    width, sort = self._count(), self._word()
                elif word == "scalars":
                    sort, *rest = self._rest_of_line().split()
                    demand(len(rest) < 2)
                    width = count_of((*rest, "1")[0])
                    demand(self._word().lower() == "lookup_table" and self._word())
                else:
                    sort = self._word()
                assert width is not None
                demand(0 < width <= max(_WIDEST, _ATTRIBUTES[word][1] or 0))
                self._add(attributes, name, sort, (count, width))
                if attributes.GetAbstractAttribute(kind) is None:
                    demand(attributes.SetActiveAttribute(name, kind) >= 0)
            else:
                return word
        return ""

    def _read_field(self, attributes: Any, count: int | None) -> None:
        """Read arrays of any widths, with *count* rows unless that is None."""
        self._word()
        for _ in range(self._count()):
            name = self._name()
            width, n_rows = self._count(), self._count()
            demand(width and n_rows and n_rows == (n_rows if count is None else count))
            self._add(attributes, name, self._word(), (n_rows, width))

    def _add(self, attributes: Any, name: str, sort: str, shape: tuple[int, int]) -> None:
        values = self._numbers(sort, shape[0] * shape[1]).reshape(shape)
        if sort == _SHARES:
            demand(values.min() >= 0.0 and values.max() <= 1.0)
            values = (255.0 * values.astype(np.float64) + 0.5).astype(np.uint8)
        is_ids = sort.lower() == "vtkidtype"
        values = values.astype(np.int64) if is_ids else values
        array = attributes.GetArray(name)
        if array is None:
            array = add_array(attributes, name, values, is_ids=is_ids)
        else:  # VTK writes an array again for each attribute that it is
            known = pv.convert_array(array).reshape(shape)
            demand(known.dtype == values.dtype and known.tobytes() == values.tobytes())
        for k, part in enumerate(self._metadata(shape[1])):
            array.SetComponentName(k, part)

    def _array(self, sort: str, count: int) -> Any:
        """Return *count* numbers; metadata are left out."""
        numbers = self._numbers(sort, count)
        self._metadata(1)
        return numbers

    def _cells(self, n_points: int) -> pv.CellArray:
        first, second = self._count(), self._count()
        demand(first)
        if self._is_new:
            demand(self._word().lower() == "offsets")
            starts = self._array(self._word(), first)
            demand(self._word().lower() == "connectivity")
            corners = self._array(self._word(), second)
            demand(starts.dtype.kind == corners.dtype.kind == "i")
            return cells_of(starts, corners, n_points)
        values = self._array("int", second)
        starts = _starts(values, first)
        is_corner = np.ones(len(values), dtype=bool)
        is_corner[starts[:-1]] = False
        return cells_of(starts - np.arange(len(starts)), values[is_corner], n_points)

    def _word(self) -> str:
        word = self._word_or_end()
        _demand_rest(word)
        return word

    def _word_or_end(self) -> str:
        """Return the next word; "" at the end."""
        found = _WORD.match(self._data, self._at)
        if found is None:
            demand(not self._data[self._at :].strip())
            return ""
        self._at = found.end()
        return found[1].decode("ascii")

    def _name(self) -> str:
        name = unquote(self._word(), errors="strict")
        demand(_is_name(name))
        return name

    def _count(self) -> int:
        return count_of(self._word())

    def _rest_of_line(self) -> str:
        found = _REST.match(self._data, self._at)
        demand(found)
        assert found is not None
        self._at = found.end()
        return found[1].decode("ascii")

    def _numbers(self, sort: str, count: int) -> Any:
        """Return *count* numbers, which begin on the next line."""
        demand(sort.lower() in _TYPES and count)
        kind = np.dtype(_TYPES[sort.lower()])
        demand(not self._rest_of_line().strip())
        if self._is_text:
            first = int(np.searchsorted(self._begins, self._at))
            _demand_rest(count < len(self._begins) - first)
            start, self._at = self._at, int(self._begins[first + count])
            numbers = numbers_of_text(self._data[start : self._at], kind)
            demand(len(numbers) == count)
            return numbers
        size = count * kind.itemsize
        _demand_rest(size <= len(self._data) - self._at)
        numbers = np.frombuffer(self._data, kind.newbyteorder(">"), count, self._at)
        self._at += size
        return numbers.astype(kind)

    def _metadata(self, width: int) -> list[str]:
        """Read a block of metadata, if there is one; return the names of components, or none."""
        found = _WORD.match(self._data, self._at)
        if found is None or found[1].lower() != b"metadata":
            return []
        self._at, names = found.end(), []
        demand(not self._rest_of_line().strip())
        while (self._at < len(self._data)) and (line := self._rest_of_line().strip()):
            if line == "COMPONENT_NAMES":
                names = [unquote(self._rest_of_line(), errors="strict") for _ in range(width)]
                demand(all(not name or _is_name(name) for name in names))
            else:
                demand(_INFORMATION.fullmatch(line))
        return names


def _demand_rest(found: object) -> None:
    if not found:
        raise MeshError(_CUT_OFF)


def _is_name(name: str) -> bool:
    return 0 < len(name) <= LONGEST and name.isprintable()


def _starts(values: IntArray, count: int) -> IntArray:
    """Return where each of *count* cells begins in *values*, its number of points first."""
    length = int(values[0]) + 1
    if length > 1 and length * count == len(values):
        first = values[::length]
        if (first == length - 1).all():
            return np.arange(0, len(values) + 1, length)
    lengths, starts, at = values.tolist(), [0], 0
    for _ in range(count):
        demand(at < len(lengths) and lengths[at] > 0)
        at += lengths[at] + 1
        starts.append(at)
    return np.array(starts, dtype=np.int64)
