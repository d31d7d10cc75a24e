"""Meshes from and to files and pyvista, so that nothing is lost that a deformation leaves valid.

    file  --read_polydata-->  PolyData  --from_polydata-->  Mesh
    file  <---write_mesh----  PolyData  <--with_vertices--  new positions (n, 3)

Vertices and faces keep their order and number all the way, coordinates their digits: OBJ, OFF
and PLY are read and written by this package, because VTK's readers round to seven digits (PLY),
split vertices at texture seams (OBJ) or do not exist (OFF); glTF because VTK's reader does not
validate the file.  STL is the exception: a triangle soup in single precision, whose equal corners
are merged on reading.

Arrays that a format cannot store are left out, names that it cannot store are changed, and a
warning is logged (`array_names`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from ..arrays import as_points
from ..cages import Cage
from ..checks import as_flag, as_path, require
from ..errors import MeshError
from ..files import fault_of, replacing, require_place
from ..mesh import Mesh
from . import meshlab
from .gltf import read_gltf
from .off import read_off, write_off
from .ply import read_ply, write_ply
from .polygons import polydata_of, triangles_of
from .stl import read_stl
from .vtk_readers import read_with_vtk
from .vtk_writers import write_with_vtk
from .wavefront import read_obj, write_obj

_log = logging.getLogger(__name__)

_READERS: dict[str, Callable[[Path], pv.PolyData]] = {
    ".glb": read_gltf, ".gltf": read_gltf, ".obj": read_obj, ".off": read_off, ".ply": read_ply,
    ".stl": read_stl,
}  # fmt: skip
_WRITERS: dict[str, Callable[[Path, pv.PolyData], None]] = {
    ".obj": write_obj, ".off": write_off, ".ply": write_ply,
}  # fmt: skip
_VTK_READS = frozenset({".vtk", ".vtp", ".vtu", ".vtkhdf"})
_VTK_WRITES = frozenset({".stl", ".vtk", ".vtp", ".vtkhdf"})
_HOLD_ARRAYS = frozenset({".ply", ".vtk", ".vtp", ".vtkhdf"})


def is_mesh_file(path: str | Path) -> bool:
    """Tell whether *path* has a suffix of a format that `read_mesh` knows."""
    return as_path(path).suffix.lower() in {*_READERS, *_VTK_READS, *meshlab.READS}


def read_mesh(path: str | Path) -> Mesh:
    """Return the closed mesh in a file.

    Parameters
    ----------
    path : str or Path
        .obj, .off, .ply, .stl, .vtk, .vtp, .vtu, .vtkhdf, .glb, .gltf; with PyMeshLab also .3ds,
        .dae, .x3d, .wrl and others.

    Returns
    -------
    mesh : Mesh
        Vertices and faces in the file's order; polygons cut into triangles.

    Raises
    ------
    MeshError
        If there is no such file, it cannot be read, or holds no closed outward two-manifold.
    MissingDependencyError
        If only PyMeshLab reads such files, and it is not installed.
    """
    surface = read_polydata(path)
    try:
        return from_polydata(surface)
    except ValueError as error:
        raise MeshError(f"{path}: {error}") from None


def read_polydata(path: str | Path) -> pv.PolyData:
    """Return the surface in a file with all that comes with it; open or faulty ones too.

    Quadrangles and polygons stay what they are (`from_polydata` cuts them), so that `write_mesh`
    can write them back.  Point, cell and field arrays and texture coordinates are kept.

    Raises
    ------
    MeshError
        If there is no such file, its suffix is not known, or it holds no readable surface.
    MissingDependencyError
        If only PyMeshLab reads such files, and it is not installed.
    """
    path = as_path(path)
    try:
        status = path.stat()
    except (OSError, ValueError):
        raise MeshError(f"{path}: there is no such file") from None
    if what := fault_of(status):
        raise MeshError(f"{path}: {what}")
    if not status.st_size:
        raise MeshError(f"{path}: the file is empty (0 bytes); copy or export it again")
    suffix = path.suffix.lower()
    if not is_mesh_file(path):
        known = {*_READERS, *_VTK_READS, *meshlab.READS}
        raise MeshError(f"{path}: cannot read {suffix or 'no suffix'}; can {_listed(known)}")
    try:
        if suffix in _READERS:
            surface = _READERS[suffix](path)
        elif suffix in _VTK_READS:
            surface = read_with_vtk(path)
        else:
            vertices, faces = meshlab.read_faces(path)
            surface = polydata_of(vertices, np.full(len(faces), 3), faces.ravel())
    except MeshError as error:
        raise MeshError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    except (ValueError, IndexError, KeyError, OverflowError, OSError) as error:
        raise MeshError(f"{path}: is no readable {suffix} file ({error})") from None
    except MemoryError:
        size = f"{status.st_size / 1e9:.2g} GB"
        raise MeshError(f"{path}: too large for the memory of this machine ({size})") from None
    if not surface.n_points or not surface.n_cells:
        raise MeshError(
            f"{path}: holds no surface: {surface.n_points} points, {surface.n_cells} polygons; "
            "export the mesh itself"
        )
    return surface


def write_mesh(path: str | Path, mesh: Mesh | pv.PolyData) -> None:
    """Write a mesh atomically: if anything fails, an existing file stays unchanged.

    The new file keeps the mode of the old one; a symbolic link is followed.

    Parameters
    ----------
    path : str or Path
        .obj, .off, .ply, .stl, .vtk, .vtp, .vtkhdf; with PyMeshLab .3ds, .dae, .x3d, .wrl, .ctm.
        All formats except .stl and PyMeshLab's keep every digit; .vtk, .vtp and .vtkhdf keep every
        array.  A warning is logged for each array that is left out or renamed.
    mesh : Mesh or pyvista.PolyData
        What to write.

    Raises
    ------
    MeshError
        If the suffix is not known, the folder does not exist, *path* is not a regular file, or the
        disk is full.
    """
    path = as_path(path)
    require(mesh, (Mesh, pv.PolyData), "mesh")
    require_writable(path)
    surface = to_polydata(mesh) if isinstance(mesh, Mesh) else mesh
    suffix = path.suffix.lower()
    try:
        with replacing(path) as draft:
            if suffix in _WRITERS:
                _WRITERS[suffix](draft, surface)
            elif suffix in _VTK_WRITES:
                write_with_vtk(draft, surface)
            else:
                _write_with_meshlab(draft, mesh if isinstance(mesh, Mesh) else from_polydata(mesh))
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise MeshError(
            f"{path}: cannot be written ({reason}); make room, or choose another place"
        ) from fault


def _write_with_meshlab(draft: Path, mesh: Mesh) -> None:
    """Write through PyMeshLab; OSError unless all of it is there, which it does not say itself."""
    try:
        meshlab.write(draft, mesh)
        whole = len(meshlab.read_faces(draft)[1]) == mesh.n_faces
    except MeshError as fault:
        raise OSError(str(fault).removeprefix(f"{draft}: ")) from None
    if not whole:
        raise OSError("what was written is not all of it")


def require_writable(path: str | Path, *, arrays: bool = False) -> None:
    """Raise the MeshError that `write_mesh` would, before the work that is to be written.

    With *arrays* the file has to hold point arrays and colours, which some formats cannot.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    as_flag(arrays, "arrays")
    known = {*_HOLD_ARRAYS} if arrays else {*_WRITERS, *_VTK_WRITES, *meshlab.WRITES}
    if suffix not in known:
        what = "arrays and colours to " if arrays else ""
        raise MeshError(f"{path}: cannot write {what}{suffix or 'no suffix'}; can {_listed(known)}")
    try:
        require_place(path)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault


def to_polydata(mesh: Mesh | Cage) -> pv.PolyData:
    """Return *mesh*, or a cage, as PolyData: float64 points, same vertices, same triangles."""
    require(mesh, (Mesh, Cage), "mesh")
    return polydata_of(mesh.vertices.copy(), np.full(mesh.n_faces, 3), mesh.faces.ravel())


def from_polydata(polydata: pv.PolyData) -> Mesh:
    """Return the closed mesh of a PolyData; quads, polygons and strips are cut into triangles.

    No vertex is added, dropped or renumbered, so `with_vertices` fits new positions back.

    Raises
    ------
    MeshError
        If the surface is not a closed, outward oriented two-manifold.
    """
    require(polydata, pv.PolyData, "polydata")
    faces = triangles_of(polydata)
    if len(faces) != polydata.n_cells:
        _log.info("%d cells were cut into %d triangles", polydata.n_cells, len(faces))
    return Mesh(np.asarray(polydata.points, dtype=np.float64), faces)


def with_vertices(polydata: pv.PolyData, vertices: ArrayLike) -> pv.PolyData:
    """Return a copy of *polydata* with other positions and everything else as it was.

    Cells, point, cell and field arrays and texture coordinates stay; points become float64.
    Arrays of normals are computed anew, since the old ones would shade the old shape.

    Parameters
    ----------
    polydata : pyvista.PolyData
        Left as it is.
    vertices : (n, 3) float
        One position per point, in the order of ``polydata.points``.
    """
    require(polydata, pv.PolyData, "polydata")
    points = as_points(vertices, "vertices", polydata.n_points)
    moved = polydata.copy(deep=True)
    moved.points = points.copy()
    for attributes, of_points in ((moved.point_data, True), (moved.cell_data, False)):
        stale = {"Normals", attributes.active_normals_name} & set(attributes.keys())
        if not stale:
            continue
        # VTK hands back normals that are already there, so it gets the bare shape.
        bare = pv.PolyData()
        bare.copy_structure(moved)
        bare = bare.compute_normals(
            point_normals=of_points,
            cell_normals=not of_points,
            split_vertices=False,
            consistent_normals=False,
        )
        fresh = (bare.point_data if of_points else bare.cell_data)["Normals"]
        for name in stale:
            attributes[name] = np.asarray(fresh, dtype=attributes[name].dtype)
    return moved


def _listed(suffixes: set[str]) -> str:
    return ", ".join(sorted(suffixes))
