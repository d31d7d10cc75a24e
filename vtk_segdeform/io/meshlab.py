"""PyMeshLab, if it is installed: conversion, simplification and its file formats.

    Mesh, Surface, PolyData, Session  --to_meshset-->  MeshSet
    PolyData               <--from_meshset-----------  MeshSet     the current layer
    fixed, handle, region  <--selected_vertices------  MeshSet     its selected vertices

Selection, quality, colours and texture coordinates are converted both ways, as arrays of the
PolyData (`meshlab_layers`); so are other arrays of numbers, as custom attributes, whose names must
be passed to `from_meshset`.  `convert.from_polydata` converts a PolyData to a `Mesh`.

Texture images are not converted: PyMeshLab (2025.7) reads them from files only, by its filter
``set_texture_per_mesh``, and writes them to files only, ``layer.textures()[name].save(path)``.

PyMeshLab has the GPL (version 3), unlike this package: it is only imported inside the functions
below, and everything else works without it.

PyMeshLab returns arrays in column-major order and faces of 32 bits; `Mesh` converts both.  Lengths
that are not percentages must be wrapped in its ``PureValue``.
"""

from __future__ import annotations

import contextlib
import importlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import FloatArray, IntArray, is_whole
from ..checks import all_of, as_path, require, shown
from ..errors import ArgumentError, MeshError, MissingDependencyError
from ..mesh import Mesh, require_mesh
from .confined import read_confined
from .meshlab_layers import (
    HasLayers,
    Layer,
    add_attributes,
    as_layers,
    free_name,
    layer_data,
    surface_of,
)

if TYPE_CHECKING:
    import pyvista as pv

READS = frozenset({".3ds", ".bre", ".ctm", ".dae", ".ptx", ".qobj", ".x3d", ".x3dv", ".wrl"})
WRITES = frozenset({".3ds", ".ctm", ".dae", ".wrl", ".x3d"})
_MARK = "selected_here"


def available() -> bool:
    """Return whether PyMeshLab can be imported; it may be installed but lack a GL library."""
    try:
        _pymeshlab()
    except MissingDependencyError:
        return False
    return True


def to_meshset(what: Layer | HasLayers | Mapping[str, Layer]) -> Any:
    """Convert surfaces to a ``pymeshlab.MeshSet``; its first layer is the current one.

    Parameters
    ----------
    what : Mesh, Surface, pyvista.PolyData, Session, or dict of str to one of the first three
        A surface, for one layer; a session, for layers of its mesh and cages in their pose; or
        layers by name.  Polygons are cut into triangles; vertices and faces keep their order.

    Raises
    ------
    MissingDependencyError
        If PyMeshLab is not installed.
    MeshError
        If *what* is of another type.

    Notes
    -----
    PyMeshLab has no function to select given vertices.  They are marked by a custom attribute of
    the layer, "selected_here", which remains there.
    """
    pymeshlab = _pymeshlab()
    meshset = pymeshlab.MeshSet(verbose=False)
    for name, surface in as_layers(what).items():
        arrays, vertices, faces, of_vertices, of_faces = layer_data(surface)
        meshset.add_mesh(pymeshlab.Mesh(**arrays), name)
        layer, condition = meshset.current_mesh(), f"({_MARK} > 0)"
        add_attributes(layer, "vertex", of_vertices)
        add_attributes(layer, "face", of_faces)
        # Added to the layer, because PyMeshLab crashes if the mesh already has the attribute.
        if vertices is not None:
            layer.add_vertex_custom_scalar_attribute(vertices, _MARK)
            meshset.compute_selection_by_condition_per_vertex(condselect=condition)
        if faces is not None:
            layer.add_face_custom_scalar_attribute(faces, _MARK)
            meshset.compute_selection_by_condition_per_face(condselect=condition)
    if meshset.mesh_number():
        meshset.set_current_mesh(0)
    return meshset


def from_meshset(meshset: Any, arrays: Sequence[str] = ()) -> pv.PolyData:
    """Convert the current layer of a ``pymeshlab.MeshSet``, with all its arrays.

    Parameters
    ----------
    meshset : pymeshlab.MeshSet
        Not changed.
    arrays : sequence of str
        Names of custom attributes, of vertices or faces, to convert to float64 arrays.

    Raises
    ------
    MeshError
        If there is no layer, or an attribute does not exist.
    """
    arrays = all_of(arrays, str, "arrays")
    return surface_of(_current(meshset), arrays, _pymeshlab().PyMeshLabException)


def layers_from_meshset(meshset: Any) -> dict[str, pv.PolyData]:
    """Return all layers of a ``pymeshlab.MeshSet`` by name; equal names get a number."""
    _require_meshset(meshset)
    layers: dict[str, pv.PolyData] = {}
    for layer in meshset:
        layers[free_name(layer.label(), layers)] = surface_of(layer)
    return layers


def selected_vertices(meshset: Any) -> IntArray:
    """Return the selected vertices of the current layer and those of selected faces, (k,) int.

    For use as fixed vertices, ``session.set_fixed(selected_vertices(meshset))``, as a handle,
    ``session.handles.add(...)``, or as a region, ``session.painting.paint(0, ...)``.

    Raises
    ------
    MeshError
        If there is no layer.
    """
    layer = _current(meshset)
    chosen = np.array(layer.vertex_selection_array(), dtype=bool)
    if layer.face_number():
        chosen[layer.face_matrix()[layer.face_selection_array()].ravel()] = True
    return np.flatnonzero(chosen)


def read_faces(path: str | Path) -> tuple[FloatArray, IntArray]:
    """Read (vertices, faces) of a file in any format of PyMeshLab, unchecked."""
    path = as_path(path)
    _pymeshlab()
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        raise MeshError(f"{path}: PyMeshLab cannot open it: its name is not valid UTF-8") from None
    try:
        arrays = read_confined("meshlab", path)
        return _plain(arrays["vertices"].reshape(-1, 3), arrays["faces"])
    except (MeshError, OSError, KeyError, ValueError) as error:
        raise MeshError(f"{path}: PyMeshLab cannot read it: {error}") from None


def write(path: str | Path, mesh: Mesh) -> None:
    """Write *mesh* in the PyMeshLab format of the suffix of *path*."""
    path = as_path(path)
    require_mesh(mesh)
    pymeshlab, meshset = _pymeshlab(), to_meshset(mesh)
    try:
        with _same_folder():
            meshset.save_current_mesh(str(path.absolute()))
    except pymeshlab.PyMeshLabException as error:
        raise MeshError(f"{path}: PyMeshLab cannot write it: {error}") from None


def simplify(mesh: Mesh, n_vertices: int) -> Mesh:
    """Simplify *mesh* to about *n_vertices* by quadric edge collapses that preserve topology.

    Parameters
    ----------
    mesh : Mesh
        Not changed.
    n_vertices : int
        At least 4; the topology may require more.

    Raises
    ------
    MissingDependencyError
        If PyMeshLab is not installed.
    """
    require_mesh(mesh)
    if not is_whole(n_vertices, 4):
        raise ArgumentError(f"n_vertices must be 4 or more; got {shown(n_vertices)}")
    n_vertices = min(int(n_vertices), mesh.n_vertices)
    meshset = to_meshset(mesh)
    euler = mesh.n_vertices - len(mesh.edges) + mesh.n_faces  # preserved: V - E + F with E = 3/2 F
    meshset.meshing_decimation_quadric_edge_collapse(
        targetfacenum=max(2 * (n_vertices - euler), 4),
        preservenormal=True,
        preservetopology=True,
        preserveboundary=True,
        autoclean=True,
    )
    return Mesh(*_arrays(meshset))


def _require_meshset(meshset: object) -> None:
    require(meshset, _pymeshlab().MeshSet, "meshset")


def _current(meshset: Any) -> Any:
    _require_meshset(meshset)
    if not meshset.mesh_number():
        raise MeshError("the MeshSet has no layer; add a mesh to it first")
    return meshset.current_mesh()


def _arrays(meshset: Any) -> tuple[FloatArray, IntArray]:
    current = _current(meshset)
    return _plain(current.vertex_matrix(), current.face_matrix())


def _plain(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    rows = np.ascontiguousarray(faces, dtype=np.int64).reshape(-1, 3)
    return np.ascontiguousarray(vertices, dtype=np.float64), rows


@contextlib.contextmanager
def _same_folder() -> Iterator[None]:
    """Restore the working directory, which PyMeshLab changes if it fails."""
    folder = os.getcwd()
    try:
        yield
    finally:
        os.chdir(folder)


def _pymeshlab() -> Any:
    try:
        # In this thread: imported in another one, its Qt frees memory twice when Python ends.
        return importlib.import_module("pymeshlab")
    except ImportError as error:
        raise MissingDependencyError(
            "this needs PyMeshLab: pip install 'vtk-segdeform[meshlab]', and on Debian "
            f"apt-get install libgl1 libopengl0 libglib2.0-0 ({error})"
        ) from None
