"""Conversion of meshes from and to files and pyvista, with their polygons and arrays.

    file  --read_polydata-->  PolyData  --from_polydata-->  Mesh
    file  <---write_mesh----  PolyData  <--with_vertices--  new positions (n, 3)

`surface.Surface` does both for any surface; `from_polydata` takes only what a `Mesh` may be.
All of them take other objects of VTK, too (`as_polydata`).

The order and number of vertices and faces and all digits of coordinates are preserved.  OBJ, OFF
and PLY are read and written by this package, because VTK's readers round to seven digits (PLY),
split vertices at texture seams (OBJ) or do not exist (OFF); glTF is read by this package, because
VTK's reader does not validate the file.  STL is the exception: it is a triangle soup in single
precision, and equal corners are merged.

Arrays that a format cannot store are left out, names that it cannot store are changed, and a
warning is logged (`array_names`).
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from ..arrays import as_faces, as_points
from ..cages import Cage
from ..checks import as_flag, as_path, as_text, require, shown
from ..errors import ArgumentError, MeshError
from ..files import excess_of, fault_of, replacing, require_place
from ..mesh import Mesh, conversion_of
from . import meshlab
from .array_names import set_names, warn_left_out, warn_of_rounding, with_storable_texts
from .confined import read_confined
from .gltf import read_gltf, write_gltf
from .grids import surface_of_grid
from .groups import GROUP, names_key
from .moving import MovingSurface
from .off import read_off, write_off
from .ply import ply_points, read_ply, write_ply
from .polygons import polydata_of, triangles_of
from .stl import read_stl, write_stl
from .vtk_arrays import data_set
from .vtk_formats import read_with_vtk, write_with_vtk
from .wavefront import read_obj, write_obj

_log = logging.getLogger(__name__)

_VTK = dict.fromkeys((".vtk", ".vtp", ".vtu"), (read_with_vtk, write_with_vtk))
_Format: TypeAlias = tuple[Callable[[Path], pv.PolyData], Callable[[Path, pv.PolyData], None]]
# The reader and the writer of each format; PyMeshLab has others.
_FORMATS: dict[str, _Format] = {
    ".glb": (read_gltf, write_gltf),
    ".gltf": (read_gltf, write_gltf),
    ".obj": (read_obj, write_obj),
    ".off": (read_off, write_off),
    ".ply": (read_ply, write_ply),
    ".stl": (read_stl, write_stl),
    **_VTK,
}
_SHORT = 200  # characters of a name in messages
_STORE_ARRAYS = frozenset({".ply", *_VTK})  # formats of point arrays of any name and colours


def is_mesh_file(path: str | Path) -> bool:
    """Return whether *path* has the suffix of a format that can be read."""
    return as_path(path).suffix.lower() in {*_FORMATS, *meshlab.READS}


def writable_suffixes() -> tuple[str, ...]:
    """Return the suffixes that `write_mesh` can write without PyMeshLab, in order."""
    return tuple(sorted(_FORMATS))


def read_polydata(path: str | Path) -> pv.PolyData:
    """Read a surface with its polygons and arrays from a file; it may be open or faulty.

    Polygons are not cut into triangles, so that `write_mesh` can write them again.  Point, cell and
    field arrays and texture coordinates are kept.

    Parameters
    ----------
    path : str or Path
        .obj, .off, .ply, .stl, .vtk, .vtp, .vtu, .glb, .gltf; with PyMeshLab also .3ds,
        .dae, .x3d, .wrl and others.

    Raises
    ------
    MeshError
        If the file does not exist, its format is not supported, or it has no readable surface.
    MissingDependencyError
        If only PyMeshLab reads this format and it is not installed.
    """
    path = as_path(path)
    try:
        status = path.stat()
    except (OSError, ValueError):
        raise MeshError(f"{path}: there is no such file") from None
    if what := fault_of(status):
        raise MeshError(f"{path}: {what}")
    if what := excess_of(status):
        raise MeshError(f"{path}: {what}")
    if not status.st_size:
        raise MeshError(f"{path}: the file is empty (0 bytes); copy or export it again")
    suffix = path.suffix.lower()
    if not is_mesh_file(path):
        known = {*_FORMATS, *meshlab.READS}
        raise MeshError(f"{path}: {_files(suffix)} cannot be read; use one of {_listed(known)}")
    try:
        if suffix in _FORMATS:
            read, _ = _FORMATS[suffix]
            surface = read(path)
        else:
            vertices, faces = meshlab.read_faces(path)
            surface = polydata_of(vertices, np.full(len(faces), 3), faces.ravel())
    except MeshError as error:
        raise MeshError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    except (ValueError, IndexError, KeyError, OverflowError, OSError) as error:
        raise MeshError(f"{path}: is not a readable {suffix} file ({error})") from None
    except MemoryError:
        size = f"{status.st_size / 1e9:.2g} GB"
        raise MeshError(f"{path}: not enough memory to read this file ({size})") from None
    if not surface.n_points or not surface.n_cells:
        raise MeshError(
            f"{path}: contains no surface: {surface.n_points} points, {surface.n_cells} polygons; "
            "export the mesh itself"
        )
    return surface


def read_points(path: str | Path) -> pv.PolyData | pv.UnstructuredGrid:
    """Read what `read_polydata` reads, or points alone (.ply), or cells of any kind (.vtu).

    Raises
    ------
    MeshError
        If it cannot be read.
    """
    path = as_path(path)
    try:
        return read_polydata(path)
    except MeshError as fault:
        others: list[pv.PolyData | pv.UnstructuredGrid] = []
        with suppress(MeshError, ValueError, KeyError, OSError):
            if path.suffix.lower() == ".ply":
                others = [pv.PolyData(ply_points(path))]
            elif path.suffix.lower() in (".vtp", ".vtu"):
                others = [data_set(read_confined("vtk", path))]
        if len(others) == 1 and others[0].n_points:
            return others[0]
        raise fault


def write_points(path: str | Path, data: pv.PolyData | pv.UnstructuredGrid) -> None:
    """Write what `read_points` returns; a MeshError as of `write_mesh` if that is impossible."""
    path = as_path(path)
    require(data, (pv.PolyData, pv.UnstructuredGrid), "data")
    if isinstance(data, pv.PolyData) and data.GetNumberOfPolys() + data.GetNumberOfStrips():
        write_mesh(path, data)
        return
    suffixes = (".ply", ".vtp") if isinstance(data, pv.PolyData) else (".vtu",)
    if path.suffix.lower() not in suffixes:
        raise MeshError(f"{path}: points without faces are written to {' or '.join(suffixes)} only")
    require_writable(path)
    try:
        with replacing(path) as draft:
            data.save(draft)
    except OSError as fault:
        raise MeshError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


def write_mesh(
    path: str | Path, mesh: Mesh | pv.PolyData | pv.UnstructuredGrid | pv.MultiBlock
) -> None:
    """Write a mesh to a file, atomically: after an error an existing file is unchanged.

    The new file has the mode of the old one; symbolic links are followed.

    Parameters
    ----------
    path : str or Path
        .obj, .off, .ply, .stl, .vtk, .vtp, .vtu, .glb, .gltf; with PyMeshLab .3ds, .dae,
        .x3d, .wrl, .ctm.  All formats except .stl, .glb, .gltf and those of PyMeshLab store every
        digit; .vtk, .vtp and .vtu store every array.  An .stl is text, with named solids,
        if its cells have groups, and binary otherwise.  A warning is logged for each array that is
        left out or renamed.
    mesh : Mesh or pyvista.PolyData
        The mesh to write.  A surface that was read from glTF is written to glTF with the nodes,
        materials and textures of that file.

    Raises
    ------
    MeshError
        If the format is not supported, the folder does not exist, *path* is not a regular file, or
        the disk is full.
    """
    path = as_path(path)
    is_mesh = isinstance(mesh, Mesh)
    surface = as_polydata(mesh, "mesh", "a Mesh or a PolyData")
    require_writable(path)
    if not is_mesh:
        surface = with_storable_texts(surface)
    suffix = path.suffix.lower()
    try:
        with replacing(path) as draft:
            if suffix in _FORMATS:
                _, write = _FORMATS[suffix]
                write(draft, surface)
            else:
                warn_left_out(f"{suffix} written by PyMeshLab", surface, {})
                _write_with_meshlab(draft, mesh if is_mesh else from_polydata(surface))
    except MeshError as fault:
        raise MeshError(f"{path}: {str(fault).removeprefix(f'{path}: ')}") from None
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise MeshError(
            f"{path}: cannot be written ({reason}); free disk space or choose another folder"
        ) from fault


def _write_with_meshlab(draft: Path, mesh: Mesh) -> None:
    """Write by PyMeshLab; OSError if the file is incomplete, which PyMeshLab does not report."""
    try:
        meshlab.write(draft, mesh)
        vertices, faces = meshlab.read_faces(draft)
        complete = len(faces) == mesh.n_faces
    except MeshError as fault:
        raise OSError(str(fault).removeprefix(f"{draft}: ")) from None
    if not complete:
        raise OSError("the written file is incomplete")
    place = np.zeros(mesh.n_vertices, dtype=np.int64)  # some formats renumber or merge vertices
    place[mesh.faces] = faces
    if np.array_equal(place[mesh.faces], faces):
        what = f"{draft.suffix} rounds coordinates"
        warn_of_rounding(what, mesh.faces, mesh.vertices, vertices[place])


def require_writable(path: str | Path, *, arrays: bool = False) -> None:
    """Raise the MeshError that `write_mesh` would raise, so that it is known before the work.

    With *arrays* the format must store point arrays and colours.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    as_flag(arrays, "arrays")
    known = {*_STORE_ARRAYS} if arrays else {*_FORMATS, *meshlab.WRITES}
    if suffix not in known:
        verb = "cannot store arrays and colours" if arrays else "cannot be written"
        raise MeshError(f"{path}: {_files(suffix)} {verb}; use one of {_listed(known)}")
    try:
        require_place(path)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault


def to_polydata(mesh: Mesh | Cage) -> pv.PolyData:
    """Return a mesh or a cage as PolyData with float64 points and the same triangles."""
    require(mesh, (Mesh, Cage), "mesh")
    return polydata_of(mesh.vertices.copy(), np.full(mesh.n_faces, 3), mesh.faces.ravel())


def from_polydata(polydata: pv.PolyData) -> Mesh:
    """Return the mesh of a PolyData; polygons and strips are cut into triangles.

    Vertices keep their number and order, so `with_vertices` accepts positions of the mesh.  For a
    surface with seams or other faults there is `Surface`.

    Raises
    ------
    MeshError
        If the surface cannot be a `Mesh` as it is.
    """
    polydata = as_polydata(polydata, "polydata")
    faces = triangles_of(polydata)
    if len(faces) != polydata.n_cells:
        _log.info("%d cells were cut into %d triangles", polydata.n_cells, len(faces))
    return Mesh(np.asarray(polydata.points, dtype=np.float64), faces)


def with_vertices(polydata: pv.PolyData, vertices: ArrayLike) -> pv.PolyData:
    """Return a copy of *polydata* with other positions.

    Cells, point, cell and field arrays and texture coordinates are kept; points become float64.
    Normals and tangents follow the surface (`moving`).

    Parameters
    ----------
    polydata : pyvista.PolyData
        Not changed.
    vertices : (n, 3) float
        One position per point, in the order of ``polydata.points``.
    """
    polydata = as_polydata(polydata, "polydata")
    points = as_points(vertices, "vertices", polydata.n_points)
    return MovingSurface(polydata).at(points)


def as_polydata(mesh: object, name: str = "mesh", expected: str = "a PolyData") -> pv.PolyData:
    """Return the surface that *mesh* is; a PolyData is returned itself.

    It may be a `Mesh`, a pair of vertices (n, 3) and faces (m, 3), a ``trimesh.Trimesh``, a
    ``meshio.Mesh`` of surface cells, or another object of VTK: an UnstructuredGrid of triangles,
    polygons, strips, lines and vertices, and a MultiBlock, whose blocks become one surface, and
    their names groups of its cells.

    Parameters
    ----------
    mesh : object
        What a caller has passed.
    name, expected : str
        For the message of an error: the name of the argument, and what it must be.

    Raises
    ------
    ArgumentError
        If it is no surface; the message has the line that converts it, if there is one.
    MeshError
        If a grid has cells that are not of a surface.
    """
    if isinstance(mesh, pv.PolyData):
        return mesh
    name, expected = as_text(name, "name", _SHORT), as_text(expected, "expected", _SHORT)
    if isinstance(mesh, Mesh):
        return to_polydata(mesh)
    if isinstance(mesh, tuple) and len(mesh) == 2:
        points = as_points(mesh[0], f"vertices of {name}")
        faces = as_faces(mesh[1], len(points), f"faces of {name}")
        return polydata_of(points, np.full(len(faces), 3), faces.ravel())
    line = conversion_of(mesh)
    data = None
    if line == "Surface(mesh)" and is_trimesh(mesh):
        data = pv.from_trimesh(mesh, pass_data=("point", "cell"))
    elif line == "Surface(mesh)":
        if is_meshio(mesh):
            plain: Any = copy.copy(mesh)
            plain.cell_sets = {}  # pyvista would turn those of *mesh* itself into cell arrays
            mesh = plain
        data = pv.wrap(mesh)
    if isinstance(data, pv.PolyData):
        return data
    if isinstance(data, pv.UnstructuredGrid):
        try:
            return surface_of_grid(data)
        except MeshError:
            line = "Surface(mesh.extract_surface(algorithm=None))"
            raise MeshError(f"{name} has cells that are not of a surface: {line}") from None
    blocks = []
    if isinstance(data, pv.MultiBlock):
        items = data.recursive_iterator("items")
        blocks = [(key, block) for key, block in items if block is not None]
    if not blocks:
        how = f". Convert it: {line}" if data is None and line else ""
        raise ArgumentError(f"{name} must be {expected}; got {shown(mesh)}{how}")
    of_block = f"{expected}; of a MultiBlock all blocks must be surfaces"
    return _joined([(key, as_polydata(block, name, of_block)) for key, block in blocks])


def is_trimesh(mesh: object) -> bool:
    """Return whether *mesh* is a ``trimesh.Trimesh``, by the name of its class."""
    return "Trimesh" in {each.__name__ for each in type(mesh).__mro__}


def is_meshio(mesh: object) -> bool:
    """Return whether *mesh* is of a class of meshio."""
    return type(mesh).__module__.partition(".")[0] == "meshio"


def _joined(blocks: list[tuple[str | None, pv.PolyData]]) -> pv.PolyData:
    """Return blocks as one surface, in which each is a group, unless they have groups already."""
    surfaces = [surface.copy(deep=False) for _, surface in blocks]
    if len(surfaces) == 1:
        return surfaces[0]
    names = [key or f"block {k}" for k, (key, _) in enumerate(blocks)]
    is_named = not any(GROUP in surface.cell_data for surface in surfaces)
    if is_named:
        for k, surface in enumerate(surfaces):
            surface.cell_data[GROUP] = np.full(surface.n_cells, k)
    joined = surfaces[0].append_polydata(*surfaces[1:])
    for sort in ("point", "cell"):
        given = {key for each in surfaces for key in getattr(each, f"{sort}_data")}
        if lost := sorted(given - set(getattr(joined, f"{sort}_data"))):
            _log.warning("only some blocks have the %s arrays %s: left out", sort, ", ".join(lost))
    if is_named:
        set_names(joined, names_key(GROUP), names)
    return joined


def _files(suffix: str) -> str:
    return f"{suffix} files" if suffix else "files without a suffix"


def _listed(suffixes: set[str]) -> str:
    return ", ".join(sorted(suffixes))
