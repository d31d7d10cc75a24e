"""PyMeshLab, if it is installed: meshes to and from it, its simplification, its file formats.

PyMeshLab is under the GPL (version 3), this package is not: it is imported inside the calls
below, nowhere else, and everything but these calls works without it.

PyMeshLab gives arrays column by column and with 32-bit faces; `Mesh` puts both right.  Lengths
that are meant as such, not as per cent, have to be wrapped in its ``PureValue``.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import FloatArray, IntArray
from .errors import MeshError, MissingDependencyError
from .mesh import Mesh

READS = frozenset({".3ds", ".bre", ".ctm", ".dae", ".ptx", ".qobj", ".x3d", ".x3dv", ".wrl"})
WRITES = frozenset({".3ds", ".ctm", ".dae", ".wrl", ".x3d"})


def available() -> bool:
    """Return whether PyMeshLab can be imported; it may be there and lack a GL library."""
    try:
        _pymeshlab()
    except MissingDependencyError:
        return False
    return True


def to_meshset(mesh: Mesh) -> Any:
    """Return a ``pymeshlab.MeshSet`` with *mesh* as its current mesh, vertices in order."""
    meshset = _pymeshlab().MeshSet(verbose=False)
    meshset.add_mesh(_pymeshlab().Mesh(mesh.vertices, mesh.faces))
    return meshset


def from_meshset(meshset: Any) -> Mesh:
    """Return the current mesh of a ``pymeshlab.MeshSet``.

    Raises
    ------
    MeshError
        If it is not a closed, outward oriented two-manifold.
    """
    return Mesh(*_arrays(meshset))


def read_faces(path: str | Path) -> tuple[FloatArray, IntArray]:
    """Return (vertices, faces) of a file in any format PyMeshLab reads; nothing is checked."""
    pymeshlab = _pymeshlab()
    meshset = pymeshlab.MeshSet(verbose=False)
    try:
        meshset.load_new_mesh(str(path))
    except pymeshlab.PyMeshLabException as error:
        raise MeshError(f"{path}: PyMeshLab cannot read it: {error}") from None
    if meshset.mesh_number() > 1:
        meshset.generate_by_merging_visible_meshes(mergevertices=False)
    return _arrays(meshset)


def read(path: str | Path) -> Mesh:
    """Return the mesh of a file in any format PyMeshLab reads."""
    vertices, faces = read_faces(path)
    try:
        return Mesh(vertices, faces)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def write(path: str | Path, mesh: Mesh) -> None:
    """Write *mesh* in the format PyMeshLab knows by the suffix of *path*."""
    pymeshlab, meshset = _pymeshlab(), to_meshset(mesh)
    try:
        meshset.save_current_mesh(str(path))
    except pymeshlab.PyMeshLabException as error:
        raise MeshError(f"{path}: PyMeshLab cannot write it: {error}") from None


def simplify(mesh: Mesh, n_vertices: int) -> Mesh:
    """Return *mesh* with about *n_vertices*, by quadric edge collapse with topology kept.

    Parameters
    ----------
    mesh : Mesh
        Left as it is.
    n_vertices : int
        At least 4.  Fewer cannot be reached than the topology allows.

    Raises
    ------
    MissingDependencyError
        If PyMeshLab is not installed.
    """
    if n_vertices < 4:
        raise ValueError(f"n_vertices must be 4 or more; got {n_vertices}")
    meshset = to_meshset(mesh)
    euler = mesh.n_vertices - len(mesh.edges) + mesh.n_faces  # stays; V - E + F with E = 3/2 F
    meshset.meshing_decimation_quadric_edge_collapse(
        targetfacenum=max(2 * (n_vertices - euler), 4),
        preservenormal=True,
        preservetopology=True,
        preserveboundary=True,
        autoclean=True,
    )
    return from_meshset(meshset)


def _arrays(meshset: Any) -> tuple[FloatArray, IntArray]:
    current = meshset.current_mesh()
    vertices = np.ascontiguousarray(current.vertex_matrix(), dtype=np.float64)
    faces = np.ascontiguousarray(current.face_matrix(), dtype=np.int64)
    return vertices, faces.reshape(-1, 3)


def _pymeshlab() -> Any:
    try:
        return importlib.import_module("pymeshlab")
    except ImportError as error:
        raise MissingDependencyError(
            "this needs PyMeshLab: pip install 'vtk-segdeform[meshlab]', and on Debian "
            f"apt-get install libgl1 libopengl0 libglib2.0-0 ({error})"
        ) from None
