"""Surfaces through VTK's own readers and writers, for .vtk, .vtp and .vtu.

Reading: the readers of VTK do not validate a file, so they run in a `confined` process; the data
sets are made of its arrays (`vtk_arrays`), and VTK's error messages become a MeshError.

Writing: names that a format cannot store are changed first.  VTK's XML writer does not escape
names, so that ``<`` makes the file unreadable.  Its legacy writer uses names as format strings, so
that ``{`` aborts the process, and the legacy reader fails on long names and on active scalars of
more than four components.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkAppendFilter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from ..errors import MeshError
from .array_names import (
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
from .grids import surface_of_grid
from .reading_child import without_ranges
from .vtk_arrays import data_set

_BEGIN_OF_MESSAGE = ("ERROR: In", "Warning: In", "Generic Warning: In")
_PREFIX = re.compile(r"^\w+ \(\w+\): ")
_XML = frozenset({".vtp", ".vtu"})
_TITLE, _NO_TITLE = re.compile(rb"[^\n]*\n([^\r\n]{1,255})\r?\n"), "vtk output"
_BEGINS = {
    ".vtk": re.compile(rb"# vtk DataFile"),
    ".vtp": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
    ".vtu": re.compile(rb"[^<]*<[\s\S]*<?VTKFile\b"),
}
_REFUSED = {".vtk": "{}", ".vtp": '<>&"', ".vtu": '<>&"'}
_LONGEST_TITLE = 200  # bytes
_SCALARS, _MOST = 0, 4  # VTK's attribute index; most components in a legacy file


def read_with_vtk(path: Path) -> pv.PolyData:
    """Read a surface by one of VTK's readers, in a confined process."""
    suffix = path.suffix.lower()
    begin = _begin(path, suffix)
    try:
        surface = _surface(data_set(read_confined("vtk", path)))
    except MeshError as error:
        raise MeshError(f"is not a readable {suffix} file ({_first_message(error)})") from None
    if suffix == ".vtk":
        _set_title(surface, begin)
    return surface


def read_data_set(path: Path) -> pv.PolyData | pv.UnstructuredGrid:
    """Read the data set of a file as it is, in a confined process; MeshError if it cannot."""
    suffix = path.suffix.lower()
    try:
        _begin(path, suffix)
        return data_set(read_confined("vtk", path))
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


def _surface(data: pv.PolyData | pv.UnstructuredGrid) -> pv.PolyData:
    return data if isinstance(data, pv.PolyData) else surface_of_grid(data)


def _first_message(error: Exception) -> str:
    """Return the first error message of VTK; the others follow from it."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    messages = [line for line in lines if not line.startswith(_BEGIN_OF_MESSAGE)]
    return _PREFIX.sub("", messages[0]) if messages else type(error).__name__


def write_with_vtk(path: Path, surface: pv.PolyData | pv.UnstructuredGrid) -> None:
    """Write a surface, or a grid to .vtu or .vtk; OSError if the file cannot be written.

    On a full disk VTK's XML writer aborts the process, so it writes to memory.
    """
    suffix = path.suffix.lower()
    plain = _with_plain_names(surface, suffix)
    is_cells = isinstance(surface, pv.UnstructuredGrid)
    if suffix == ".vtk":
        legacy = vtkUnstructuredGridWriter() if is_cells else vtkPolyDataWriter()
        if title := _title_of(surface):
            plain.GetFieldData().RemoveArray(HEADER)
            legacy.SetHeader(title)
        legacy.SetInputData(plain)
        legacy.SetFileName(str(path))
        legacy.SetFileTypeToBinary()
        try:
            with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
                legacy.Write()
        except (RuntimeError, ValueError) as error:
            raise OSError(" ".join(str(error).split())) from None
        return
    writer = vtkXMLPolyDataWriter() if suffix == ".vtp" else vtkXMLUnstructuredGridWriter()
    writer.SetInputData(plain if is_cells or suffix == ".vtp" else _grid_of(plain))
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_bytes(without_ranges(writer.GetOutputString().encode()))


def _grid_of(surface: vtkPolyData) -> vtkUnstructuredGrid:
    """Return the cells of a surface as a grid, in the same order."""
    append = vtkAppendFilter()
    append.SetInputData(surface)
    append.Update()
    grid = append.GetOutput()
    for sort in ("Point", "Cell", "Field"):
        getattr(grid, f"Get{sort}Data")().ShallowCopy(getattr(surface, f"Get{sort}Data")())
    return grid


def _title_of(surface: Any) -> str:
    """Return the title by which a legacy file stores the field array `HEADER`.

    That is "" unless a reader finds the same text there; then it remains a field array.
    """
    (title, *others) = get_names(surface, HEADER) or [""]
    is_plain = title.isprintable() and title == title.strip() and not others
    return title if is_plain and len(title.encode()) <= _LONGEST_TITLE else ""


def _with_plain_names(surface: Any, suffix: str) -> Any:
    """Return a shallow copy whose arrays have names that the format can store."""
    copy = vtkUnstructuredGrid() if surface.IsA("vtkUnstructuredGrid") else vtkPolyData()
    copy.ShallowCopy(surface)
    for sort in ("Point", "Cell", "Field"):
        attributes = getattr(copy, f"Get{sort}Data")()
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
