"""Surfaces through VTK's own readers and writers, for .vtk, .vtp, .vtu and .vtkhdf.

Reading: the readers of VTK do not validate a file, so they run in a `confined` process; the data
sets are made of its arrays (`vtk_arrays`), and VTK's error messages become a MeshError.

Writing: names that a format cannot store are changed first.  VTK's XML writer does not escape
names, so that ``<`` makes the file unreadable.  Its HDF writer changes some names, possibly two to
the same one.  Its legacy writer uses names as format strings, so that ``{`` aborts the process, and
the legacy reader fails on long names and on active scalars of more than four components.
"""

from __future__ import annotations

import logging
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkIOHDF import vtkHDFWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from ..errors import MeshError
from .array_names import (
    CELL_TYPES,
    HEADER,
    component_names,
    decoded,
    get_names,
    plain_names,
    replace_arrays,
    set_names,
    warn_renamed,
)
from .confined import read_confined
from .grids import grid_of, is_grid, surface_of_grid
from .reading_child import without_ranges
from .vtk_arrays import data_sets

_log = logging.getLogger(__name__)
_BEGIN_OF_MESSAGE = ("ERROR: In", "Warning: In", "Generic Warning: In")
_PREFIX = re.compile(r"^\w+ \(\w+\): ")
_XML = frozenset({".vtp", ".vtu"})
_TITLE, _NO_TITLE = re.compile(rb"[^\n]*\n([^\r\n]{1,255})\r?\n"), "vtk output"
_BEGINS = {
    ".vtk": re.compile(rb"# vtk DataFile"),
    ".vtp": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
    ".vtu": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
    ".vtkhdf": re.compile(rb"\x89HDF\r\n\x1a\n"),
}
_WRITERS = {".vtk": vtkPolyDataWriter, ".vtkhdf": vtkHDFWriter}
_REFUSED = {".vtk": "{}", ".vtp": '<>&"', ".vtu": '<>&"', ".vtkhdf": "/."}
_LONGEST_TITLE = 200  # bytes
_SCALARS, _MOST = 0, 4  # VTK's attribute index; most components in a legacy file


def read_with_vtk(path: Path) -> pv.PolyData:
    """Read a surface by one of VTK's readers, in a confined process."""
    suffix = path.suffix.lower()
    begin = _begin(path, suffix)
    try:
        surfaces = [_surface(each, suffix) for each in data_sets(read_confined("vtk", path))]
    except MeshError as error:
        raise MeshError(f"is not a readable {suffix} file ({_first_message(error)})") from None
    if len(surfaces) > 1:  # of several grids nothing is restored
        surfaces = [_without_types(each) for each in surfaces]
    surface = surfaces[0].append_polydata(*surfaces[1:]) if surfaces else pv.PolyData()
    if suffix == ".vtkhdf":  # before VTK 9.7 it does not store which arrays are active
        _activate(surface.point_data, "Normals", "normals", 3)
        _activate(surface.cell_data, "Normals", "normals", 3)
        _activate(surface.point_data, "TextureCoordinates", "texture_coordinates", 2)
    elif suffix == ".vtk":
        _set_title(surface, begin)
    return surface


def read_data_sets(path: Path) -> list[pv.PolyData | pv.UnstructuredGrid]:
    """Read all data sets of a file as they are, in a confined process; MeshError if it cannot."""
    suffix = path.suffix.lower()
    try:
        _begin(path, suffix)
        return list(data_sets(read_confined("vtk", path)))
    except (MeshError, OSError) as error:
        raise MeshError(
            f"{path}: is not a readable {suffix} file ({_first_message(error)})"
        ) from None


def _begin(path: Path, suffix: str) -> bytes:
    """Return the first bytes of a file; MeshError if its format begins in another way."""
    with path.open("rb") as file:
        begin = file.read(1000)
    if not _BEGINS[suffix].match(begin):
        raise MeshError(
            f"does not begin as a {suffix} file does; it is damaged, or of another format: "
            "give it the suffix of its format"
        )
    return begin


def _set_title(surface: pv.PolyData, begin: bytes) -> None:
    """Store the title of a legacy file as the field array `HEADER`, unless it is VTK's default."""
    found = _TITLE.match(begin)
    title = decoded(found[1]).strip() if found else ""
    is_new = title.isprintable() and title not in ("", _NO_TITLE)
    if is_new and HEADER not in surface.field_data:
        set_names(surface, HEADER, [title])


def _activate(attributes: pv.DataSetAttributes, name: str, role: str, width: int) -> None:
    """Give an array the role that its name says, if no other array has it."""
    values, active = attributes.get(name), f"active_{role}_name"
    found = values is not None and values.shape[1:] == (width,) and values.dtype.kind == "f"
    if found and getattr(attributes, active) is None:
        setattr(attributes, active, name)


def _surface(data: pv.DataSet, suffix: str) -> pv.PolyData:
    if isinstance(data, pv.PolyData):
        return data
    if not isinstance(data, pv.UnstructuredGrid):
        raise MeshError(f"contains a {type(data).__name__}, not a surface")
    return surface_of_grid(data, only_as_grid=suffix == ".vtk")


def _first_message(error: Exception) -> str:
    """Return the first error message of VTK; the others follow from it."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    messages = [line for line in lines if not line.startswith(_BEGIN_OF_MESSAGE)]
    return _PREFIX.sub("", messages[0]) if messages else type(error).__name__


def write_with_vtk(path: Path, surface: pv.PolyData | pv.UnstructuredGrid) -> None:
    """Write a surface, or a grid to .vtu or .vtk; OSError if the file is incomplete.

    On a full disk VTK's XML writer aborts the process, and its HDF writer leaves an incomplete file
    without an error.  So the former writes to memory, and the output of the latter is read back.
    """
    suffix = path.suffix.lower()
    plain, title = _with_plain_names(surface, suffix), ""
    is_cells = isinstance(surface, pv.UnstructuredGrid)
    if suffix == ".vtk":
        title = _title_of(surface)
        if title:
            plain.GetFieldData().RemoveArray(HEADER)
    if suffix in _XML:
        writer = vtkXMLPolyDataWriter() if suffix == ".vtp" else vtkXMLUnstructuredGridWriter()
        writer.SetInputData(_as_written(plain, is_grid=suffix == ".vtu"))
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        path.write_bytes(without_ranges(writer.GetOutputString().encode()))
        return
    try:
        with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            is_legacy_grid = is_cells or (suffix == ".vtk" and is_grid(surface))
            writer = vtkUnstructuredGridWriter() if is_legacy_grid else _WRITERS[suffix]()
            writer.SetInputData(_as_written(plain, is_grid=is_legacy_grid))
            again = surface
            if title:
                writer.SetHeader(title)
            if suffix != ".vtkhdf":
                writer.SetFileName(str(path))
                writer.SetFileTypeToBinary()
                writer.Write()
            else:  # HDF5 locks its file, but *path* is locked already
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


def _title_of(surface: Any) -> str:
    """Return the title by which a legacy file stores the field array `HEADER`.

    That is "" unless a reader finds the same text there; then it remains a field array.
    """
    (title, *others) = get_names(surface, HEADER) or [""]
    is_plain = title.isprintable() and title == title.strip() and not others
    return title if is_plain and len(title.encode()) <= _LONGEST_TITLE else ""


def _as_written(plain: Any, *, is_grid: bool) -> Any:
    """Return what VTK's writer of surfaces, or of grids, takes."""
    if plain.IsA("vtkUnstructuredGrid"):
        return plain
    return grid_of(plain) if is_grid else _without_types(plain)


def _without_types(surface: Any) -> Any:
    surface.GetFieldData().RemoveArray(CELL_TYPES)
    return surface


def _with_plain_names(surface: Any, suffix: str) -> Any:
    """Return a shallow copy whose arrays have names that the format can store."""
    copy = vtkUnstructuredGrid() if surface.IsA("vtkUnstructuredGrid") else vtkPolyData()
    copy.ShallowCopy(surface)
    for sort in ("Point", "Cell", "Field"):
        attributes = getattr(copy, f"Get{sort}Data")()
        if suffix == ".vtkhdf":
            _warn_of_components(attributes, f"{sort.lower()} array")
        if suffix == ".vtkhdf" and sort != "Field":
            _remove_texts(attributes, f"{sort.lower()} array")
        arrays = [attributes.GetAbstractArray(k) for k in range(attributes.GetNumberOfArrays())]
        refused, measure = _REFUSED.get(suffix, ""), _quoted if suffix == ".vtk" else len
        names = plain_names((a.GetName() for a in arrays), refused=refused, measure=measure)
        parts = [name for array in arrays for name in component_names(array) if name]
        components = plain_names(parts, refused=refused, measure=measure)
        warn_renamed(f"{sort.lower()} array", names)
        warn_renamed("component", components)
        if any(name != plain for name, plain in (names | components).items()):
            new = [_renamed(a, names[a.GetName()], components) for a in arrays]
            replace_arrays(attributes, new)
        if suffix == ".vtk" and sort != "Field":
            scalars = attributes.GetScalars()
            if scalars is not None and scalars.GetNumberOfComponents() > _MOST:
                attributes.SetActiveAttribute(-1, _SCALARS)
    return copy


def _remove_texts(attributes: Any, what: str) -> None:
    """Remove arrays of text, which VTK's HDF writer cannot write; log a warning for each."""
    for k in reversed(range(attributes.GetNumberOfArrays())):
        array = attributes.GetAbstractArray(k)
        if array.IsA("vtkStringArray"):
            _log.warning("VTKHDF cannot store %s %r: left out", what, array.GetName())
            attributes.RemoveArray(k)


def _warn_of_components(attributes: Any, what: str) -> None:
    """Log a warning for each array whose components have names, which VTKHDF does not store."""
    for k in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(k)
        if any(component_names(array)):
            _log.warning(
                "VTKHDF cannot store the names of the components of %s %r: left out",
                what, array.GetName(),
            )  # fmt: skip


def _renamed(array: Any, name: str, components: dict[str, str]) -> Any:
    """Return a copy of an array with other names."""
    copy = array.NewInstance()
    copy.DeepCopy(array)
    copy.SetName(name)
    for k, component in enumerate(component_names(array)):
        copy.SetComponentName(k, components[component] if component else "")
    return copy


def _quoted(name: str) -> int:
    """Return the length of a name in a legacy file, where a space is %20."""
    return len(quote(name, safe=""))
