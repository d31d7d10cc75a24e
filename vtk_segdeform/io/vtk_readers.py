"""Surfaces through VTK's own readers, whose error messages become MeshErrors."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pyvista as pv

from ..errors import MeshError
from .isolated import read_apart
from .polygons import polydata_of

_SPEAKER = re.compile(r"^\w+ \(\w+\): ")
_XML = frozenset({".vtp", ".vtu"})
_DENSEST = 1100  # bytes out of one that is compressed, at most
_COUNTS = re.compile(rb'(NumberOf\w+)="(\d+)"')
_BINARY = re.compile(rb'format="binary"[^>]*>\s*([A-Za-z0-9+/=]{32})')
_BEGINS = {
    ".vtk": re.compile(rb"# vtk DataFile"),
    ".vtp": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
    ".vtu": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
    ".vtkhdf": re.compile(rb"\x89HDF\r\n\x1a\n"),
}
_SURFACE_CELLS = frozenset({5, 7, 9})  # VTK's numbers of triangle, polygon, quadrangle


def read_with_vtk(path: Path) -> pv.PolyData:
    """Return the surface read by one of VTK's readers; its error messages become a MeshError.

    The reader runs in a child process, which a damaged file may crash.
    """
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        if not _BEGINS[suffix].match(file.read(1000)):
            raise MeshError(
                f"does not begin as a {suffix} file does; it is damaged, or of another format: "
                "give it the suffix of its format"
            )
    if suffix in _XML:
        _require_room_for_counts(path)
    try:
        with read_apart("vtk", path) as folder:
            pieces = sorted(folder.iterdir(), key=lambda piece: int(piece.stem))
            parts = [_sound(pv.get_reader(piece).read()) for piece in pieces]
    except (MeshError, RuntimeError) as error:
        raise MeshError(f"is no readable {suffix} file ({_said(error)})") from None
    surfaces = [_surface(part) for part in parts]
    return surfaces[0].append_polydata(*surfaces[1:]) if surfaces else pv.PolyData()


def _sound(data: pv.DataSet) -> pv.DataSet:
    """Return *data* with its original names; MeshError if cells or arrays do not fit its points.

    VTK's readers do not check this, and its filters would read outside of the arrays.
    """
    arrays = [data.GetCells()] if isinstance(data, pv.UnstructuredGrid) else _cell_arrays(data)
    for cells in arrays:
        starts = pv.convert_array(cells.GetOffsetsArray())
        corners = pv.convert_array(cells.GetConnectivityArray())
        ends = (int(starts[0]), int(starts[-1])) if len(starts) else (0, len(corners))
        if ends != (0, len(corners)) or (np.diff(starts) < 0).any():
            raise MeshError("its cells overlap, or end outside their list of corners")
        if len(corners) and not 0 <= corners.min() <= corners.max() < data.n_points:
            raise MeshError(
                f"cells use vertices {corners.min()} to {corners.max()}; there are {data.n_points}"
            )
    if isinstance(data, pv.UnstructuredGrid) and len(data.celltypes) != data.n_cells:
        raise MeshError("the numbers of cells and cell types differ")
    for sort, attributes, count in (
        ("point", data.GetPointData(), data.n_points),
        ("cell", data.GetCellData(), data.n_cells),
        ("field", data.GetFieldData(), 0),
    ):
        for k in range(attributes.GetNumberOfArrays()):
            array = attributes.GetAbstractArray(k)
            array.SetName(unquote(array.GetName()))
            for j in range(array.GetNumberOfComponents() * array.HasAComponentName()):
                array.SetComponentName(j, unquote(array.GetComponentName(j) or ""))
            if array.GetNumberOfTuples() != count and sort != "field":
                raise MeshError(
                    f"its {sort} array {array.GetName()!r} has {array.GetNumberOfTuples()} rows; "
                    f"must be {count}"
                )
    return data


def _cell_arrays(data: pv.PolyData) -> list[Any]:
    return [data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()]


def _require_room_for_counts(path: Path) -> None:
    """Raise a MeshError if a file says that it has more than its bytes could ever hold.

    VTK's XML readers believe it, ask for the memory, and end the process.  Each block of an array,
    compressed or not, begins with its counts too: base64 of a few whole numbers.
    """
    data = path.read_bytes()
    most = _DENSEST * len(data)
    for match in _COUNTS.finditer(data):
        if int(match[2]) > most:
            raise MeshError(f"says {match[0].decode()}, which {len(data)} bytes cannot hold")
    wide = b'header_type="UInt64"' in data[:1000]
    coded = b"compressor=" in data[:1000]
    for match in _BINARY.finditer(data):
        words = np.frombuffer(_decoded(match[1]), "<u8" if wide else "<u4")
        told = words[: 3 if coded else 1].astype(float)
        if (told > most).any() or (coded and len(told) > 1 and told[0] * told[1] > most):
            raise MeshError(f"an array says that it is larger than {len(data)} bytes can hold")


def _decoded(word: bytes) -> bytes:
    """Return what the first characters of base64 stand for, in whole numbers of 8 bytes."""
    try:
        return base64.b64decode(word)[:24]
    except ValueError:
        return b""


def _surface(data: pv.DataSet) -> pv.PolyData:
    if isinstance(data, pv.PolyData):
        return data
    if not isinstance(data, pv.UnstructuredGrid):
        raise MeshError(f"holds a {type(data).__name__}, not a surface")
    if not set(data.celltypes.tolist()) <= _SURFACE_CELLS:
        raise MeshError("holds cells other than triangles and polygons; extract its surface first")
    counts = np.diff(pv.convert_array(data.GetCells().GetOffsetsArray()))
    surface = polydata_of(np.asarray(data.points, dtype=float), counts, data.cell_connectivity)
    for mine, theirs in (
        (surface.point_data, data.point_data),
        (surface.cell_data, data.cell_data),
        (surface.field_data, data.field_data),
    ):
        for name, values in theirs.items():
            mine[name] = values
    return surface


def _said(error: Exception) -> str:
    """Return the first of VTK's complaints, from which the others follow."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    told = [line for line in lines if not line.startswith("ERROR: In")]
    return _SPEAKER.sub("", told[0]) if told else type(error).__name__
