"""The child process that reads a file with VTK or PyMeshLab; `isolated` starts it.

    python reading_child.py vtk|meshlab FILE FOLDER BYTES

It allocates at most about BYTES of memory, unless that is 0.  It writes its results to FOLDER:
0.vtp, 1.vtu ... for surfaces and grids, or mesh.npz for vertices and faces.  Characters of names
that XML cannot store are escaped as %XX.  If the file cannot be read, error.txt has the reason.
Both libraries may crash, hence the separate process.  This module imports nothing of the package,
so that it starts in a fraction of a second.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

# Readers of the VTK formats: module and class.
_READERS = {
    ".vtk": ("vtkIOLegacy", "vtkDataSetReader"),
    ".vtp": ("vtkIOXML", "vtkXMLPolyDataReader"),
    ".vtu": ("vtkIOXML", "vtkXMLUnstructuredGridReader"),
    ".vtkhdf": ("vtkIOHDF", "vtkHDFReader"),
}
_WRITERS = {
    "vtkPolyData": (".vtp", "vtkXMLPolyDataWriter"),
    "vtkUnstructuredGrid": (".vtu", "vtkXMLUnstructuredGridWriter"),
}
_STRUCTURED = (
    "vtkStructuredGrid", "vtkRectilinearGrid", "vtkStructuredPoints", "vtkImageData",
)  # fmt: skip
_REFUSED = re.compile(r"[%<>&\"\x00-\x1f\x7f-\x9f]")
# In VTK's messages.  The second is only a warning, but missing numbers are returned as zeros.
_FAILURE = re.compile(r"ERROR:|Error reading")
_TEXT = re.compile(rb"[^\n]*\n[^\n]*\n\s*ASCII\b", re.IGNORECASE)
_END = b"end_of_the_file"
_LEGACY = (
    "ColorScalars", "Fields", "Normals", "Scalars", "TCoords", "Tensors", "Vectors",
)  # fmt: skip


def main(tool: str, path: str, folder: str, limit: str) -> None:
    """Read one file, and write the results or the reason of the failure."""
    try:
        {"vtk": _with_vtk, "meshlab": _with_meshlab}[tool](Path(path), Path(folder), int(limit))
    except (RuntimeError, ValueError, MemoryError, OSError, ImportError) as error:
        reason = str(error) or type(error).__name__
        (Path(folder) / "error.txt").write_text(reason, encoding="utf-8", errors="replace")


def _with_vtk(path: Path, folder: Path, limit: int) -> None:
    core = importlib.import_module("vtkmodules.vtkCommonCore")
    module, name = _READERS[path.suffix.lower()]
    reader = getattr(importlib.import_module(f"vtkmodules.{module}"), name)()
    writers = importlib.import_module("vtkmodules.vtkIOXML")
    _limit_memory(limit)
    window, before = core.vtkStringOutputWindow(), core.vtkOutputWindow.GetInstance()
    core.vtkOutputWindow.SetInstance(window)
    try:
        _update(reader, path)
        if _FAILURE.search(window.GetOutput()):
            raise ValueError(window.GetOutput())
        if path.suffix.lower() == ".vtk" and _TEXT.match(data := path.read_bytes()):
            own = core.vtkStringOutputWindow()
            core.vtkOutputWindow.SetInstance(own)
            _require_whole(type(reader)(), data, own)
            core.vtkOutputWindow.SetInstance(window)
        for number, piece in enumerate(_pieces(reader.GetOutputDataObject(0))):
            if piece.GetClassName() in _STRUCTURED:
                piece = _unstructured(piece)
            _write_piece(piece, folder / str(number), writers)
            if _FAILURE.search(window.GetOutput()):
                raise ValueError(window.GetOutput())
    finally:
        core.vtkOutputWindow.SetInstance(before)


def _update(reader: Any, path: Path) -> None:
    reader.SetFileName(str(path))
    if path.suffix.lower() == ".vtk":
        for sort in _LEGACY:
            getattr(reader, f"ReadAll{sort}On")()
    reader.Update()


def _require_whole(reader: Any, data: bytes, window: Any) -> None:
    """Raise ValueError unless *reader* reaches the end of *data*, a legacy file in text.

    VTK returns zeros for missing numbers, and silently omits everything after a word that it does
    not expect.  So an unknown keyword is appended, which VTK reports once it gets there.
    """
    whole = data + b"\n\n" + _END + b" 1\n"
    reader.ReadFromInputStringOn()
    reader.SetBinaryInputString(whole, len(whole))
    for sort in _LEGACY:
        getattr(reader, f"ReadAll{sort}On")()
    reader.Update()
    if _END.decode() not in window.GetOutput():
        raise ValueError("its numbers do not fit their counts: it is damaged, or was cut off")


def _unstructured(grid: Any) -> Any:
    """Return the cells of a structured *grid*: of two dimensions, quads and pixels."""
    append = importlib.import_module("vtkmodules.vtkFiltersCore").vtkAppendFilter()
    append.SetInputData(grid)
    append.Update()
    cells = append.GetOutput()
    cells.GetFieldData().ShallowCopy(grid.GetFieldData())
    return cells


def _write_piece(piece: Any, path: Path, writers: Any) -> None:
    """Write a data set in VTK's XML format, uncompressed, to *path* with its suffix."""
    sort = piece.GetClassName()
    if sort not in _WRITERS:
        raise ValueError(f"it contains a {sort}, not a surface")
    for attributes in (piece.GetPointData(), piece.GetCellData(), piece.GetFieldData()):
        for k in range(attributes.GetNumberOfArrays()):
            array = attributes.GetAbstractArray(k)
            array.SetName(_escaped(array.GetName() or ""))
            for j in range(array.GetNumberOfComponents() * array.HasAComponentName()):
                array.SetComponentName(j, _escaped(array.GetComponentName(j) or ""))
    suffix, name = _WRITERS[sort]
    writer = getattr(writers, name)()
    writer.SetFileName(f"{path}{suffix}")
    writer.SetInputData(piece)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64()
    if not writer.Write():
        raise ValueError("the data cannot be returned by the child process")


def _escaped(name: str) -> str:
    return _REFUSED.sub(lambda found: quote(found[0]), name)


def _pieces(data: Any) -> Iterator[Any]:
    """Yield *data*, or the data sets with cells of which it is composed."""
    if data is None:
        return
    if not data.IsA("vtkCompositeDataSet"):
        yield data
        return
    item = data.NewIterator()
    item.InitTraversal()
    while not item.IsDoneWithTraversal():
        if item.GetCurrentDataObject().GetNumberOfCells():
            yield item.GetCurrentDataObject()
        item.GoToNextItem()


def _with_meshlab(path: Path, folder: Path, limit: int) -> None:
    pymeshlab = importlib.import_module("pymeshlab")
    meshset = pymeshlab.MeshSet(verbose=False)
    _limit_memory(limit)
    try:
        meshset.load_new_mesh(str(path))
        if meshset.mesh_number() > 1:
            meshset.generate_by_merging_visible_meshes(mergevertices=False)
    except pymeshlab.PyMeshLabException as error:
        raise ValueError(str(error)) from None
    mesh = meshset.current_mesh()
    numpy: Any = importlib.import_module("numpy")
    numpy.savez(folder / "mesh.npz", vertices=mesh.vertex_matrix(), faces=mesh.face_matrix())


def _limit_memory(most: int) -> None:
    """Limit the memory of this process to *most* more bytes, where the system supports that."""
    if not most:
        return
    try:
        resource: Any = importlib.import_module("resource")
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most += pages * resource.getpagesize()
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard != resource.RLIM_INFINITY:
            most = min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # no core dumps
    except (ImportError, OSError, ValueError):
        return


if __name__ == "__main__":
    main(*sys.argv[1:])
