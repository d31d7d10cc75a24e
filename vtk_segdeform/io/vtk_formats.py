"""Surfaces through VTK's own readers and writers, for .vtk, .vtp, .vtu and .vtkhdf.

Reading: the readers of VTK do not validate a file, so they run in a child process (`isolated`);
afterwards the cells and arrays are checked, and VTK's error messages become a MeshError.  Plain
.vtk, .vtp and .vtu files are read without VTK (`vtk_legacy`, `vtk_xml`).

Writing: names that a format cannot store are changed first.  VTK's XML writer does not escape
names, so that ``<`` makes the file unreadable.  Its HDF writer changes some names, possibly two to
the same one.  Its legacy writer uses names as format strings, so that ``{`` aborts the process, and
the legacy reader fails on long names and on active scalars of more than four components.
"""

from __future__ import annotations

import base64
import logging
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkPolyData
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
from .grids import grid_of, is_grid, surface_of_grid
from .isolated import read_isolated
from .vtk_legacy import read_plain_legacy
from .vtk_xml import read_plain_xml

_log = logging.getLogger(__name__)
_PREFIX = re.compile(r"^\w+ \(\w+\): ")
_XML = frozenset({".vtp", ".vtu"})
_PLAIN = {".vtk": read_plain_legacy, **dict.fromkeys(_XML, read_plain_xml)}
_DENSEST = 1100  # most bytes out of one compressed byte
_COUNTS = re.compile(rb'(NumberOf\w+)="(\d+)"')
_NORM_RANGE = re.compile(  # of bounded length, so that no file takes quadratic time
    rb'<InformationKey\s[^<>]{0,200}name="L2_NORM_(?:FINITE_)?RANGE"[^<>]{0,200}>'
    rb".{0,1000}?</InformationKey>",
    re.DOTALL,
)
_BINARY = re.compile(rb'format="binary"[^>]*>\s*([A-Za-z0-9+/=]{32})')
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
    """Read a surface by one of VTK's readers, in a child process."""
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        if not _BEGINS[suffix].match(file.read(1000)):
            raise MeshError(
                f"does not begin as a {suffix} file does; it is damaged, or of another format: "
                "give it the suffix of its format"
            )
    if suffix in _PLAIN:
        data = path.read_bytes()
        plain = _PLAIN[suffix](data)
        if plain is not None:
            return _with_title(_surface(plain, suffix), path)
        if suffix in _XML:
            _require_plausible_counts(data)
    try:
        with _without_ranges_of(path) as source, read_isolated("vtk", source) as folder:
            pieces = sorted(folder.iterdir(), key=lambda piece: int(piece.stem))
            for piece in pieces:
                if (plain := _without_ranges(data := piece.read_bytes())) != data:
                    piece.write_bytes(plain)
            parts = [_validated(pv.get_reader(piece).read()) for piece in pieces]
    except (MeshError, RuntimeError) as error:
        raise MeshError(f"is not a readable {suffix} file ({_first_message(error)})") from None
    surfaces = [_surface(part, suffix) for part in parts]
    if len(surfaces) > 1:  # of several grids nothing is restored
        surfaces = [_without_types(each) for each in surfaces]
    surface = surfaces[0].append_polydata(*surfaces[1:]) if surfaces else pv.PolyData()
    if suffix == ".vtkhdf":  # it does not store which arrays are active
        _activate_normals(surface)
    return _with_title(surface, path)


def _with_title(surface: pv.PolyData, path: Path) -> pv.PolyData:
    """Store the title of a legacy file as the field array `HEADER`, unless it is VTK's default."""
    if path.suffix.lower() == ".vtk":
        with path.open("rb") as file:
            found = _TITLE.match(file.read(1000))
        title = decoded(found[1]).strip() if found else ""
        is_new = title.isprintable() and title not in ("", _NO_TITLE)
        if is_new and HEADER not in surface.field_data:
            set_names(surface, HEADER, [title])
    return surface


def _without_ranges(data: bytes) -> bytes:
    """Return a file in XML without the ranges of norms, which VTK computes again when needed.

    VTK computes norms of integers with integers, writes "-nan" where these overflow, and cannot
    read that.
    """
    end = data.find(b"<AppendedData")
    head, rest = (data, b"") if end < 0 else (data[:end], data[end:])
    return _NORM_RANGE.sub(b"", head) + rest


@contextmanager
def _without_ranges_of(path: Path) -> Iterator[Path]:
    """Yield *path*, or that of a copy without ranges of norms if it has some."""
    data = path.read_bytes() if path.suffix.lower() in _XML else b""
    if (plain := _without_ranges(data)) == data:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="segdeform-") as folder:
        copy = Path(folder) / f"copy{path.suffix}"
        copy.write_bytes(plain)
        yield copy


def _activate_normals(surface: pv.PolyData) -> None:
    for attributes in (surface.point_data, surface.cell_data):
        normals = attributes.get("Normals")
        found = normals is not None and normals.shape[1:] == (3,) and normals.dtype.kind == "f"
        if found and attributes.active_normals_name is None:
            attributes.active_normals_name = "Normals"


def _validated(data: pv.DataSet) -> pv.DataSet:
    """Return *data* with its original names; MeshError if cells or arrays do not fit the points.

    VTK's readers do not check this, and its filters would read outside the arrays.
    """
    arrays = [data.GetCells()] if isinstance(data, pv.UnstructuredGrid) else _cell_arrays(data)
    for cells in arrays:
        starts = pv.convert_array(cells.GetOffsetsArray())
        corners = pv.convert_array(cells.GetConnectivityArray())
        ends = (int(starts[0]), int(starts[-1])) if len(starts) else (0, len(corners))
        if ends != (0, len(corners)) or (np.diff(starts) < 0).any():
            raise MeshError("its cells overlap or exceed their list of corners")
        if len(corners) and not 0 <= corners.min() <= corners.max() < data.n_points:
            raise MeshError(
                f"cells use vertices {corners.min()} to {corners.max()}, "
                f"but there are {data.n_points}"
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


def _require_plausible_counts(data: bytes) -> None:
    """Raise a MeshError if a file declares more than its bytes can contain.

    VTK's XML readers would allocate that much memory and crash.  Each block of an array, compressed
    or not, also begins with counts: a few integers in base64.
    """
    most = _DENSEST * len(data)
    for match in _COUNTS.finditer(data):
        if int(match[2]) > most:
            raise MeshError(f"declares {match[0].decode()}, too many for {len(data)} bytes")
    wide = b'header_type="UInt64"' in data[:1000]
    coded = b"compressor=" in data[:1000]
    order = ">" if b'byte_order="BigEndian"' in data[:1000] else "<"
    for match in _BINARY.finditer(data):
        words = np.frombuffer(_decoded(match[1]), order + ("u8" if wide else "u4"))
        counts = words[: 3 if coded else 1].astype(float)
        if (counts > most).any() or (coded and len(counts) > 1 and counts[0] * counts[1] > most):
            raise MeshError(f"declares an array that is too large for {len(data)} bytes")


def _decoded(word: bytes) -> bytes:
    """Return the first 24 bytes of base64 text; empty if it is invalid."""
    try:
        return base64.b64decode(word)[:24]
    except ValueError:
        return b""


def _surface(data: pv.DataSet, suffix: str) -> pv.PolyData:
    if isinstance(data, pv.PolyData):
        return data
    if not isinstance(data, pv.UnstructuredGrid):
        raise MeshError(f"contains a {type(data).__name__}, not a surface")
    return surface_of_grid(data, only_as_grid=suffix == ".vtk")


def _first_message(error: Exception) -> str:
    """Return the first error message of VTK; the others follow from it."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    messages = [line for line in lines if not line.startswith(("ERROR: In", "Generic Warning: In"))]
    return _PREFIX.sub("", messages[0]) if messages else type(error).__name__


def write_with_vtk(path: Path, surface: pv.PolyData) -> None:
    """Write a surface by one of VTK's writers; OSError if the file is incomplete.

    On a full disk VTK's XML writer aborts the process, and its HDF writer leaves an incomplete file
    without an error.  So the former writes to memory, and the output of the latter is read back.
    """
    suffix = path.suffix.lower()
    plain, title = _with_plain_names(surface, suffix), ""
    if suffix == ".vtk":
        title = _title_of(surface)
        if title:
            plain.GetFieldData().RemoveArray(HEADER)
    if suffix in _XML:
        writer = vtkXMLPolyDataWriter() if suffix == ".vtp" else vtkXMLUnstructuredGridWriter()
        writer.SetInputData(_without_types(plain) if suffix == ".vtp" else grid_of(plain))
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        path.write_bytes(_without_ranges(writer.GetOutputString().encode()))
        return
    try:
        with pv.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            is_legacy_grid = suffix == ".vtk" and is_grid(surface)
            writer = vtkUnstructuredGridWriter() if is_legacy_grid else _WRITERS[suffix]()
            writer.SetInputData(grid_of(plain) if is_legacy_grid else _without_types(plain))
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


def _title_of(surface: pv.PolyData) -> str:
    """Return the title by which a legacy file stores the field array `HEADER`.

    That is "" unless a reader finds the same text there; then it remains a field array.
    """
    (title, *others) = get_names(surface, HEADER) or [""]
    is_plain = title.isprintable() and title == title.strip() and not others
    return title if is_plain and len(title.encode()) <= _LONGEST_TITLE else ""


def _without_types(surface: Any) -> Any:
    surface.GetFieldData().RemoveArray(CELL_TYPES)
    return surface


def _with_plain_names(surface: pv.PolyData, suffix: str) -> Any:
    """Return a vtkPolyData whose arrays have names that the format can store."""
    copy = vtkPolyData()
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
