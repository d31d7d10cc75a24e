"""Surfaces through VTK's own readers and writers, whose complaints become errors of ours."""

from __future__ import annotations

import base64
import re
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from ..errors import MeshError
from .polygons import polydata_of

_SPEAKER = re.compile(r"^\w+ \(\w+\): ")
_XML = frozenset({".vtp", ".vtu"})
_DENSEST = 1100  # bytes out of one that is compressed, at most
_COUNTS = re.compile(rb'(NumberOf\w+)="(\d+)"')
_BINARY = re.compile(rb'format="binary"[^>]*>\s*([A-Za-z0-9+/=]{32})')
_SURFACE_CELLS = frozenset({5, 7, 9})  # VTK's numbers of triangle, polygon, quadrangle


def read_with_vtk(path: Path) -> pv.PolyData:
    """Return the surface that one of VTK's readers finds; its complaints become a MeshError."""
    if path.suffix.lower() in _XML:
        _require_room_for_counts(path)
    try:
        with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            data = pv.get_reader(path).read()
    except RuntimeError as error:
        raise MeshError(f"is no readable {path.suffix} file ({_said(error)})") from None
    if isinstance(data, pv.MultiBlock):
        parts = [part for part in data.recursive_iterator(skip_none=True) if part.n_cells]
        surfaces = [_surface(part) for part in parts]
        return surfaces[0].append_polydata(*surfaces[1:]) if surfaces else pv.PolyData()
    return _surface(data)


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


def write_with_vtk(path: Path, surface: pv.PolyData) -> None:
    """Write a surface through one of VTK's writers; OSError unless it is there, and whole.

    On a full disk VTK's XML writer ends the process, and its HDF writer leaves half a file and
    says nothing.  So the first writes into memory, and what the second wrote is read again.
    """
    if path.suffix == ".vtp":
        writer = vtkXMLPolyDataWriter()
        writer.SetInputData(surface)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        path.write_text(writer.GetOutputString(), encoding="utf-8")
        return
    try:
        with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            if path.suffix != ".vtkhdf":
                surface.save(path)
                again = surface
            else:  # HDF5 locks what it writes, and so does whoever named this place
                with tempfile.TemporaryDirectory() as folder:
                    whole = Path(folder) / path.name
                    surface.save(whole)
                    again = read_with_vtk(whole)
                    shutil.copyfile(whole, path)
    except (RuntimeError, MeshError) as error:
        raise OSError(_said(error)) from None
    if not np.array_equal(again.points, surface.points, equal_nan=True):
        raise OSError("what was written is not all of it")


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
