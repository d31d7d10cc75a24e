"""Grids from and to files: .vtu and .vtk by VTK, .msh and .mesh by meshio."""

from __future__ import annotations

import copy
import logging
import os
from pathlib import Path
from typing import Any

import pyvista as pv

from ..checks import as_path
from ..errors import MeshError, MissingDependencyError
from ..files import excess_of, replacing, require_place
from ..importing import imported
from ..io import read_data_set, require_writable, write_with_vtk

_log = logging.getLogger(__name__)
_VTK = (".vtu", ".vtk")
_MESHIO = {".msh": "gmsh", ".mesh": "medit"}


def read_volume_file(path: str | Path) -> Any:
    """Return what a file has: a ``meshio.Mesh``, or a grid; None if it is of another format.

    Of .vtk and .vtu, None also if there is no file that has a single unstructured grid.

    Raises
    ------
    MeshError
        If the file does not exist or cannot be read.
    MissingDependencyError
        If meshio is needed and not installed.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    size = os.path.getsize(path) if os.path.isfile(path) else 0
    if suffix in _VTK and size and not excess_of(path.stat()):
        found = read_data_set(path)
        return found if isinstance(found, pv.UnstructuredGrid) else None
    if suffix not in _MESHIO:
        return None
    if not size:
        raise MeshError(f"{path}: there is no such file, or it is empty")
    if what := excess_of(path.stat()):
        raise MeshError(f"{path}: {what}")
    try:
        return _meshio(suffix).read(path)
    except MissingDependencyError:
        raise
    except Exception as fault:  # the readers of meshio raise anything
        raise MeshError(f"{path}: is not a readable {suffix} file ({fault})") from fault


def write_volume_file(path: str | Path, given: Any) -> None:
    """Write a grid or a ``meshio.Mesh``, atomically; MeshError if the file cannot be written."""
    path = as_path(path)
    suffix = path.suffix.lower()
    require_volume_writable(path)
    is_grid = isinstance(given, pv.UnstructuredGrid)
    try:
        with replacing(path) as draft:
            if suffix in _VTK:
                write_with_vtk(draft, given if is_grid else pv.from_meshio(given))
            else:
                mesh = pv.to_meshio(given) if is_grid else given
                mesh, options = (_for_medit if suffix == ".mesh" else _for_gmsh)(mesh)
                _meshio(suffix).write(draft, mesh, **options)
    except Exception as fault:  # and its writers
        reason = getattr(fault, "strerror", None) or fault
        raise MeshError(f"{path}: cannot be written ({reason})") from fault


def _for_medit(mesh: Any) -> tuple[Any, dict[str, str]]:
    """Return *mesh* with one array of integers of its cells and one of its points, at most.

    The format stores no others, and of several ones meshio may write none.
    """

    def is_tag(values: Any) -> bool:
        return bool(values.ndim == 1 and values.dtype.kind in "iu")

    cells = [name for name, rows in mesh.cell_data.items() if all(map(is_tag, rows))]
    points = [name for name, values in mesh.point_data.items() if is_tag(values)]
    return _with_arrays(mesh, cells[:1], points[:1], ".mesh"), {}


def _for_gmsh(mesh: Any) -> tuple[Any, dict[str, str]]:
    """Return *mesh* as meshio can write and read it again, and the options of its writer.

    If there are several types of cells it reads no arrays of cells but those of Gmsh, and version
    4.1 needs the entities of all points, which only a mesh of Gmsh has.
    """
    if len(mesh.cells) == 1:
        return mesh, {}
    own = [name for name in mesh.cell_data if name.startswith("gmsh:")]
    options = {} if "gmsh:dim_tags" in mesh.point_data else {"fmt_version": "2.2"}
    return _with_arrays(
        mesh, own, list(mesh.point_data), ".msh with several types of cells"
    ), options


def _with_arrays(mesh: Any, cells: list[str], points: list[str], what: str) -> Any:
    """Return *mesh* with these arrays of its cells and points only; warn of the others."""
    plain = copy.copy(mesh)
    plain.cell_data = {name: mesh.cell_data[name] for name in cells}
    plain.point_data = {name: mesh.point_data[name] for name in points}
    lost = {*mesh.cell_data, *mesh.point_data, *mesh.cell_sets} - {*cells, *points}
    plain.cell_sets = {}
    if lost:
        _log.warning(
            "%s cannot store the arrays and sets %s: left out", what, ", ".join(sorted(lost))
        )
    return plain


def require_volume_writable(path: str | Path) -> None:
    """Raise the MeshError that `write_volume_file` would raise because of the name or place."""
    path = as_path(path)
    if path.suffix.lower() not in (*_VTK, *_MESHIO):
        raise MeshError(
            f"{path}: cells cannot be written there; use one of .mesh, .msh, .vtk, .vtu"
        )
    if path.suffix.lower() in _VTK:
        require_writable(path)
        return
    try:
        require_place(path)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault
    _meshio(path.suffix.lower())


def _meshio(suffix: str) -> Any:
    try:  # not meshio.read, which ends the process if a file is damaged
        return imported(f"meshio.{_MESHIO[suffix]}")
    except ImportError:
        raise MissingDependencyError(f"{suffix} files need meshio: pip install meshio") from None
