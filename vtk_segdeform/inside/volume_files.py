"""Grids from and to files: .vtu and .vtk by VTK, .msh and .mesh by meshio."""

from __future__ import annotations

import copy
import logging
from pathlib import Path
from typing import Any

import pyvista as pv

from ..checks import as_path
from ..errors import MeshError, MissingDependencyError
from ..files import replacing, require_place
from ..importing import imported
from ..io import read_data_sets, require_writable, write_with_vtk

_log = logging.getLogger(__name__)
_VTK = (".vtu", ".vtk")
_MESHIO = {".msh": "gmsh", ".mesh": "medit"}


def read_volume_file(path: str | Path) -> Any:
    """Return what a file has: a ``meshio.Mesh``, or a grid; None if it is of another format.

    Of .vtk and .vtu, None also if the file has no single unstructured grid.

    Raises
    ------
    MeshError
        If the file does not exist or cannot be read.
    MissingDependencyError
        If meshio is needed and not installed.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix in _VTK and path.is_file():
        found = list(read_data_sets(path))
        return found[0] if len(found) == 1 and isinstance(found[0], pv.UnstructuredGrid) else None
    if suffix not in _MESHIO:
        return None
    if not path.is_file():
        raise MeshError(f"{path}: there is no such file")
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
                _meshio(suffix).write(draft, _for_medit(mesh) if suffix == ".mesh" else mesh)
    except Exception as fault:  # and its writers
        reason = getattr(fault, "strerror", None) or fault
        raise MeshError(f"{path}: cannot be written ({reason})") from fault


def _for_medit(mesh: Any) -> Any:
    """Return *mesh* with the first array of one integer for each cell only, or for each point.

    The format stores no others, and of several ones meshio may write none.
    """
    plain = copy.copy(mesh)

    def is_tag(values: Any) -> bool:
        return values.ndim == 1 and values.dtype.kind in "iu"

    cells = [name for name, rows in mesh.cell_data.items() if all(map(is_tag, rows))]
    points = [name for name, values in mesh.point_data.items() if is_tag(values)]
    kept = cells[:1], points[:1]
    plain.cell_data = {name: mesh.cell_data[name] for name in kept[0]}
    plain.point_data = {name: mesh.point_data[name] for name in kept[1]}
    lost = [*(mesh.cell_data.keys() - kept[0]), *(mesh.point_data.keys() - kept[1])]
    if lost:
        _log.warning(".mesh stores one integer a cell only; left out: %s", ", ".join(sorted(lost)))
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
