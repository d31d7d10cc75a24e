"""Surfaces through VTK's own readers and writers, whose complaints become errors of ours."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyvista as pv
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from ..errors import MeshError
from .polygons import polydata_of

_SPEAKER = re.compile(r"^\w+ \(\w+\): ")
_SURFACE_CELLS = frozenset({5, 7, 9})  # VTK's numbers of triangle, polygon, quadrangle


def read_with_vtk(path: Path) -> pv.PolyData:
    """Return the surface that one of VTK's readers finds; its complaints become a MeshError."""
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
            surface.save(path)
        again = read_with_vtk(path) if path.suffix == ".vtkhdf" else surface
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
