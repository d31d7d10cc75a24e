"""The confined process that reads files with VTK or PyMeshLab; `confined` starts it.

Both libraries trust the files that they read: a wrong count crashes them, and a file can name other
files that they then read as well.  So this process reads one request after another from its
standard input, a line of JSON each, and forks for every one of them.  The fork gives up everything
it does not need, reads the file, and writes plain arrays to standard output:

    limits of memory, processor time and open files; no files written, no core dumps
    Landlock (Linux 5.13): no file can be opened but the given one, no TCP connection made

Where there is no fork, the process reads the file itself, with the limits that exist there.

A reply is a sequence of pairs of arrays in numpy's .npy format: a name, as bytes in UTF-8, and its
values; it ends with an empty name.  The only name of a failed reply is "error".  A data set has

    points  verts/offsets  verts/corners ... (lines, polys, strips)  cells/...  types
    point/j/name  /values  /lengths (of texts)  /uses  /ids  /components        (cell, field)

Long because it imports nothing of the package but `landlock`, from its folder, and numpy only where
it must: so it starts in a fraction of a second.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

# Readers of the VTK formats: module and class.
_READERS = {
    ".vtk": ("vtkIOLegacy", "vtkDataSetReader"),
    ".vtp": ("vtkIOXML", "vtkXMLPolyDataReader"),
    ".vtu": ("vtkIOXML", "vtkXMLUnstructuredGridReader"),
}
_STRUCTURED = (
    "vtkStructuredGrid", "vtkRectilinearGrid", "vtkStructuredPoints", "vtkImageData",
)  # fmt: skip
# In VTK's messages.  The second is only a warning, but missing numbers are returned as zeros.
_FAILURE = re.compile(r"ERROR:|Error reading")
_TEXT = re.compile(rb"[^\n]*\n[^\n]*\n\s*ASCII\b", re.IGNORECASE)
_END = b"end_of_the_file"
_LEGACY = (
    "ColorScalars", "Fields", "Normals", "Scalars", "TCoords", "Tensors", "Vectors",
)  # fmt: skip
_NORM_RANGE = re.compile(  # of bounded length, so that no file takes quadratic time
    rb'<InformationKey\s[^<>]{0,200}name="L2_NORM_(?:FINITE_)?RANGE"[^<>]{0,200}>'
    rb".{0,1000}?</InformationKey>",
    re.DOTALL,
)
_KINDS = {
    "f": "f",
    "d": "f",
    "c": "i",
    **dict.fromkeys("bhilq", "i"),
    **dict.fromkeys("BHILQ", "u"),
}
_MOST_FILES = 16  # open at a time; a reader opens one or two


def main() -> None:
    """Serve requests until standard input ends, or one of them crashes this process."""
    replies = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # the libraries print
    _set_limits({"RLIMIT_CORE": 0})
    _module("landlock")
    for line in sys.stdin.buffer:
        request = json.loads(line)
        _import_reader(request["tool"], request["path"])
        if sys.platform != "linux":
            answer(replies, **request)
            continue
        child = os.fork()
        if not child:
            os.close(0)
            answer(replies, **request, confined=True)
            os._exit(0)
        if code := os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
            os._exit(128 - code if code < 0 else code)


def answer(
    replies: BinaryIO, *, tool: str, path: str, memory: int, seconds: int, confined: bool = False
) -> None:
    """Read the file at *path*, and write its arrays, or the reason of the failure.

    Parameters
    ----------
    replies : binary file
        Where to write.
    tool : str
        "vtk" or "meshlab".
    path : str
        The file, by its absolute path.
    memory, seconds : int
        Bytes and processor time that reading may take.
    confined : bool
        Give up, for good, what this process does not need for that.
    """
    try:
        if confined:
            most = memory + _memory_in_use()
            _set_limits(
                {
                    "RLIMIT_AS": most,
                    "RLIMIT_CPU": seconds,
                    "RLIMIT_FSIZE": 0,
                    "RLIMIT_NOFILE": _MOST_FILES,
                }
            )
            _module("landlock").allow_only(path)
        for name, values in {"vtk": _with_vtk, "meshlab": _with_meshlab}[tool](Path(path)):
            _write(replies, name.encode())
            _write(replies, values)
    except (RuntimeError, ValueError, MemoryError, OSError, ImportError) as error:
        reason = str(error) or type(error).__name__
        _write(replies, b"error")
        _write(replies, reason.encode(errors="replace"))
    _write(replies, b"")
    replies.flush()


def _memory_in_use() -> int:
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    except FileNotFoundError:  # no /proc, as in some containers: less, but not by gigabytes
        resource: Any = _module("resource")
        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * 1024
    return int(pages) * int(os.sysconf("SC_PAGE_SIZE"))


def _set_limits(limits: dict[str, int]) -> None:
    """Lower those of the given resource limits of this process that the system supports."""
    try:
        resource: Any = importlib.import_module("resource")
    except ImportError:
        return
    for name, most in limits.items():
        kind = getattr(resource, name, None)
        if kind is not None:
            hard = resource.getrlimit(kind)[1]
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(kind, (most, most))


def _write(replies: BinaryIO, values: Any) -> None:
    """Write values that support the buffer protocol in numpy's format."""
    view = memoryview(values)
    letter = view.format.lstrip("@=<|")
    kind = {"?": "u"}.get(letter) or _KINDS[letter]
    order = "|" if view.itemsize == 1 else {"little": "<", "big": ">"}[sys.byteorder]
    head = (
        f"{{'descr': '{order}{kind}{view.itemsize}', 'fortran_order': False, "
        f"'shape': {tuple(view.shape or ())}, }}"
    )
    head += " " * (-(len(head) + 11) % 64) + "\n"
    replies.write(b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode())
    if view.nbytes:
        replies.write(view.cast("B"))


def _import_reader(tool: str, path: str) -> None:
    """Import what reading will need: a confined process cannot."""
    with contextlib.suppress(ImportError):  # which reading then reports
        if tool == "meshlab":
            _module("pymeshlab")
            return
        suffix = Path(path).suffix.lower()
        _module("vtkmodules.vtkCommonCore")
        _module(f"vtkmodules.{_READERS[suffix][0]}")
        if suffix == ".vtk":
            _module("vtkmodules.vtkFiltersCore")


_module = importlib.import_module


def _with_vtk(path: Path) -> Iterator[tuple[str, Any]]:
    core = _module("vtkmodules.vtkCommonCore")
    suffix = path.suffix.lower()
    module, name = _READERS[suffix]
    reader = getattr(_module(f"vtkmodules.{module}"), name)()
    window, before = core.vtkStringOutputWindow(), core.vtkOutputWindow.GetInstance()
    core.vtkOutputWindow.SetInstance(window)
    try:
        _update(reader, path)
        if _FAILURE.search(window.GetOutput()):
            raise ValueError(window.GetOutput())
        if suffix == ".vtk" and _TEXT.match(data := path.read_bytes()):
            own = core.vtkStringOutputWindow()
            core.vtkOutputWindow.SetInstance(own)
            _require_whole(type(reader)(), data, own)
            core.vtkOutputWindow.SetInstance(window)
        data = reader.GetOutputDataObject(0)
        if data is not None and data.GetClassName() in _STRUCTURED:
            data = _unstructured(data)
        if data is not None:
            yield from _arrays_of(data, core)
    finally:
        core.vtkOutputWindow.SetInstance(before)


def _update(reader: Any, path: Path) -> None:
    suffix = path.suffix.lower()
    reader.SetFileName(os.fsencode(path) if os.name == "posix" else str(path))
    if suffix == ".vtk":
        _read_all(reader)
    else:
        plain = without_ranges(data := path.read_bytes())
        if len(plain) < len(data):
            reader.ReadFromInputStringOn()
            reader.SetInputString(plain)
    reader.Update()


def without_ranges(data: bytes) -> bytes:
    """Return a file in XML without the ranges of norms, which VTK computes again when needed.

    VTK computes norms of integers with integers, writes "-nan" where these overflow, and cannot
    read that.
    """
    head, mark, rest = data.partition(b"<AppendedData")
    return _NORM_RANGE.sub(b"", head) + mark + rest


def _read_all(reader: Any) -> None:
    for sort in _LEGACY:
        getattr(reader, f"ReadAll{sort}On")()


def _require_whole(reader: Any, data: bytes, window: Any) -> None:
    """Raise ValueError unless *reader* reaches the end of *data*, a legacy file in text.

    VTK returns zeros for missing numbers, and silently omits everything after a word that it does
    not expect.  So an unknown keyword is appended, which VTK reports once it gets there.
    """
    whole = data + b"\n\n" + _END + b" 1\n"
    reader.ReadFromInputStringOn()
    reader.SetBinaryInputString(whole, len(whole))
    _read_all(reader)
    reader.Update()
    if _END.decode() not in window.GetOutput():
        raise ValueError("its numbers do not fit their counts: it is damaged, or was cut off")


def _unstructured(grid: Any) -> Any:
    """Return the cells of a structured *grid*: of two dimensions, quads and pixels."""
    append = _module("vtkmodules.vtkFiltersCore").vtkAppendFilter()
    append.SetInputData(grid)
    append.Update()
    cells = append.GetOutput()
    cells.GetFieldData().ShallowCopy(grid.GetFieldData())
    return cells


def _arrays_of(piece: Any, core: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of a surface or a grid by name."""
    sort = piece.GetClassName()
    if sort == "vtkPolyData":
        lists = {
            name: getattr(piece, f"Get{name.title()}")()
            for name in ("verts", "lines", "polys", "strips")
        }
    elif sort == "vtkUnstructuredGrid":
        lists = {"cells": piece.GetCells()}
        if piece.GetNumberOfCells():
            yield "types", _plain(piece.GetCellTypesArray(), core)
    else:
        raise ValueError(f"it contains a {sort}, not a surface")
    if piece.GetPoints() is not None:
        yield "points", _plain(piece.GetPoints().GetData(), core)
    for name, cells in lists.items():
        if cells is not None and cells.GetNumberOfCells():
            yield f"{name}/offsets", _plain(cells.GetOffsetsArray(), core)
            yield f"{name}/corners", _plain(cells.GetConnectivityArray(), core)
    for name in ("point", "cell", "field"):
        attributes = getattr(piece, f"Get{name.title()}Data")()
        for k in range(attributes.GetNumberOfArrays()):
            array = attributes.GetAbstractArray(k)
            for key, values in _array(array, core):
                yield f"{name}/{k}/{key}", values
            kinds = range(attributes.NUM_ATTRIBUTES if name != "field" else 0)
            uses = bytes(kind for kind in kinds if attributes.GetAbstractAttribute(kind) is array)
            yield f"{name}/{k}/uses", uses


def _array(array: Any, core: Any) -> Iterator[tuple[str, Any]]:
    yield "name", _bytes(array.GetName() or "")
    if array.IsA("vtkStringArray"):
        texts = [_bytes(array.GetValue(k)) for k in range(array.GetNumberOfValues())]
        yield "values", b"".join(texts)
        yield "lengths", _integers(map(len, texts))
    elif array.IsA("vtkDataArray"):
        yield "values", _plain(array, core)
    else:
        raise ValueError(f"it contains a {array.GetClassName()}, which is not supported")
    yield "width", bytes([min(array.GetNumberOfComponents(), 255)])
    if array.IsA("vtkIdTypeArray"):
        yield "ids", b""
    if array.HasAComponentName():
        names = [
            _bytes(array.GetComponentName(k) or "") for k in range(array.GetNumberOfComponents())
        ]
        yield "components", b"\0".join(names)


def _plain(array: Any, core: Any) -> Any:
    """Return an array whose values lie in memory one after another."""
    if array.IsA("vtkBitArray"):
        plain = core.vtkUnsignedCharArray()
    else:
        plain = core.vtkDataArray.CreateDataArray(array.GetDataType())
        if array.GetClassName() == plain.GetClassName():
            return array
        with contextlib.suppress(TypeError, BufferError):
            return memoryview(array)
    plain.DeepCopy(array)
    return plain


def _integers(values: Iterable[int]) -> memoryview:
    return memoryview(b"".join(value.to_bytes(8, sys.byteorder) for value in values)).cast("q")


def _bytes(text: str | bytes) -> bytes:
    return text if isinstance(text, bytes) else text.encode(errors="surrogateescape")


def _with_meshlab(path: Path) -> Iterator[tuple[str, Any]]:
    pymeshlab = _module("pymeshlab")
    meshset = pymeshlab.MeshSet(verbose=False)
    try:
        meshset.load_new_mesh(str(path))
        if meshset.mesh_number() > 1:
            meshset.generate_by_merging_visible_meshes(mergevertices=False)
    except pymeshlab.PyMeshLabException as error:
        raise ValueError(str(error)) from None
    mesh = meshset.current_mesh()
    yield "vertices", mesh.vertex_matrix().copy(order="C")
    yield "faces", mesh.face_matrix().copy(order="C")


if __name__ == "__main__":
    main()
