"""Surfaces through VTK's own writers: names that its files cannot hold are changed first.

VTK's XML writer does not escape names, so that ``<`` makes the file unreadable.  Its HDF writer
changes some names, perhaps two into the same one.  Its legacy writer uses names as format strings,
so that ``{`` aborts the process, and the legacy reader fails on long names and on active scalars of
more than four components.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOHDF import vtkHDFWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from .array_names import plain_names, warn_left_out, warn_renamed

_WRITERS = {".stl": vtkSTLWriter, ".vtk": vtkPolyDataWriter, ".vtkhdf": vtkHDFWriter}
_REFUSED = {".vtk": "{}", ".vtp": '<>&"', ".vtkhdf": "/."}
_SCALARS, _MOST = 0, 4  # VTK's number of the attribute; components in a legacy file


def write_with_vtk(path: Path, surface: pv.PolyData) -> None:
    """Write a surface through one of VTK's writers; OSError if the file is incomplete.

    On a full disk VTK's XML writer aborts the process, and its HDF writer leaves half a file
    without an error.  So the former writes into memory, and the output of the latter is read back.
    """
    suffix = path.suffix.lower()
    if suffix == ".stl":
        warn_left_out("STL", surface, {})
    plain = surface if suffix == ".stl" else _with_plain_names(surface, suffix)
    if suffix == ".vtp":
        writer = vtkXMLPolyDataWriter()
        writer.SetInputData(plain)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        path.write_text(writer.GetOutputString(), encoding="utf-8")
        return
    try:
        with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            writer = _WRITERS[suffix]()
            writer.SetInputData(plain)
            again = surface
            if suffix != ".vtkhdf":
                writer.SetFileName(str(path))
                writer.SetFileTypeToBinary()
                writer.Write()
            else:  # HDF5 locks the file it writes, and *path* is locked already
                with tempfile.TemporaryDirectory() as folder:
                    whole = Path(folder) / path.name
                    writer.SetFileName(str(whole))
                    writer.Write()
                    again = pv.read(whole)
                    shutil.copyfile(whole, path)
    except (RuntimeError, ValueError) as error:
        raise OSError(" ".join(str(error).split())) from None
    if not np.array_equal(again.points, surface.points, equal_nan=True):
        raise OSError("the file is incomplete")


def _with_plain_names(surface: pv.PolyData, suffix: str) -> Any:
    """Return a vtkPolyData whose arrays have names that the format can store."""
    copy = vtkPolyData()
    copy.ShallowCopy(surface)
    for sort in ("Point", "Cell", "Field"):
        attributes = getattr(copy, f"Get{sort}Data")()
        arrays = [attributes.GetAbstractArray(k) for k in range(attributes.GetNumberOfArrays())]
        refused, measure = _REFUSED.get(suffix, ""), _quoted if suffix == ".vtk" else len
        names = plain_names((a.GetName() for a in arrays), refused=refused, measure=measure)
        parts = {name for array in arrays for name in _components(array) if name}
        components = plain_names(parts, refused=refused, measure=measure)
        warn_renamed(f"{sort.lower()} array", names)
        warn_renamed("component", components)
        if any(name != plain for name, plain in (names | components).items()):
            _rename(attributes, arrays, list(names.values()), components)
        if suffix == ".vtk" and sort != "Field":
            scalars = attributes.GetScalars()
            if scalars is not None and scalars.GetNumberOfComponents() > _MOST:
                attributes.SetActiveAttribute(-1, _SCALARS)
    return copy


def _components(array: Any) -> list[str]:
    """Return the names of an array's components; "" where one has none."""
    if not array.HasAComponentName():
        return []
    return [array.GetComponentName(k) or "" for k in range(array.GetNumberOfComponents())]


def _rename(
    attributes: Any, arrays: list[Any], names: list[str], components: dict[str, str]
) -> None:
    """Replace *arrays* by renamed copies, which stay the active normals, scalars ..."""
    parts = [
        attributes.IsArrayAnAttribute(k) if hasattr(attributes, "IsArrayAnAttribute") else -1
        for k in range(len(arrays))
    ]
    attributes.Initialize()
    for array, name, part in zip(arrays, names, parts, strict=True):
        renamed = array.NewInstance()
        renamed.DeepCopy(array)
        renamed.SetName(name)
        for k, component in enumerate(_components(array)):
            renamed.SetComponentName(k, components[component] if component else "")
        place = attributes.AddArray(renamed)
        if part >= 0:
            attributes.SetActiveAttribute(place, part)


def _quoted(name: str) -> int:
    """Return how long a name is in a legacy file, which has %20 for a space."""
    return len(quote(name, safe=""))
