"""PyMeshLab, if it is installed: meshes to and from it, its simplification, its file formats.

    Mesh, PolyData, Session  --to_meshset-->    MeshSet
    PolyData                 <--from_meshset--  MeshSet       its current layer
    fixed, handle, region    <--selected_vertices--           what is selected there

Selection, quality, colours and texture coordinates go both ways, as arrays of the PolyData that
`meshlab_layers` lists; so do other arrays of numbers, as custom attributes, of which
`from_meshset` has to be told the names.  `convert.from_polydata` makes the `Mesh` of a PolyData.

The image of a texture stays behind: PyMeshLab (2025.7) takes one from a file only, by its filter
``set_texture_per_mesh``, and hands one out only to a file, ``layer.textures()[name].save(path)``.

PyMeshLab is under the GPL (version 3), this package is not: it is imported inside the calls
below, nowhere else, and everything but these calls works without it.

PyMeshLab gives arrays column by column and with 32-bit faces; `Mesh` puts both right.  Lengths
that are meant as such, not as per cent, have to be wrapped in its ``PureValue``.
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
from ..session import Session
from .isolated import read_apart
from .meshlab_layers import Surface, add_attributes, as_layers, free_name, ingredients, surface_of

if TYPE_CHECKING:
    import pyvista as pv

READS = frozenset({".3ds", ".bre", ".ctm", ".dae", ".ptx", ".qobj", ".x3d", ".x3dv", ".wrl"})
WRITES = frozenset({".3ds", ".ctm", ".dae", ".wrl", ".x3d"})
_MARK = "selected_here"


def available() -> bool:
    """Return whether PyMeshLab can be imported; it may be there and lack a GL library."""
    try:
        _pymeshlab()
    except MissingDependencyError:
        return False
    return True


def to_meshset(what: Surface | Session | Mapping[str, Surface]) -> Any:
    """Return a ``pymeshlab.MeshSet``, vertices and faces in order, its first layer the current one.

    Parameters
    ----------
    what : Mesh, pyvista.PolyData, Session, or dict of str to Mesh or PolyData
        One layer; the mesh and the cages of a session, in its pose; or layers by name.  Polygons
        are cut into triangles.

    Raises
    ------
    MissingDependencyError
        If PyMeshLab is not installed.
    MeshError
        If *what* is none of these.

    Notes
    -----
    PyMeshLab has no call to select given vertices.  They are marked by an attribute of the
    layer's own, "selected_here", which stays there.
    """
    pymeshlab = _pymeshlab()
    meshset = pymeshlab.MeshSet(verbose=False)
    for name, surface in as_layers(what).items():
        arrays, vertices, faces, of_vertices, of_faces = ingredients(surface)
        meshset.add_mesh(pymeshlab.Mesh(**arrays), name)
        layer, condition = meshset.current_mesh(), f"({_MARK} > 0)"
        add_attributes(layer, "vertex", of_vertices)
        add_attributes(layer, "face", of_faces)
        # The attribute goes to the layer: from the mesh it is copied from, PyMeshLab crashes.
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
    """Return the current layer of a ``pymeshlab.MeshSet``, with all that MeshLab knows of it.

    Parameters
    ----------
    meshset : pymeshlab.MeshSet
        Left as it is.
    arrays : sequence of str
        Names of custom attributes, of vertices or faces, to bring along as float64 arrays.

    Raises
    ------
    MeshError
        If there is no layer, or no attribute of a name.
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
    """Return (k,) int, the vertices selected in the current layer and the corners of its faces'.

    To hold still, to drag, or as a region: ``session.set_fixed(selected_vertices(meshset))``,
    ``session.add_handle(...)``, ``session.paint_region(0, ...)``, as the layer's vertices are
    those of the mesh.

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
    """Return (vertices, faces) of a file in any format PyMeshLab reads; nothing is checked."""
    path = as_path(path)
    _pymeshlab()
    try:
        with read_apart("meshlab", path) as folder, np.load(folder / "mesh.npz") as arrays:
            return _plain(arrays["vertices"], arrays["faces"])
    except (MeshError, OSError) as error:
        raise MeshError(f"{path}: PyMeshLab cannot read it: {error}") from None


def read(path: str | Path) -> Mesh:
    """Return the mesh of a file in any format PyMeshLab reads."""
    vertices, faces = read_faces(path)
    try:
        return Mesh(vertices, faces)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def write(path: str | Path, mesh: Mesh) -> None:
    """Write *mesh* in the format PyMeshLab knows by the suffix of *path*."""
    path = as_path(path)
    require_mesh(mesh)
    pymeshlab, meshset = _pymeshlab(), to_meshset(mesh)
    try:
        with _standing_still():
            meshset.save_current_mesh(str(path.absolute()))
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
    require_mesh(mesh)
    if not is_whole(n_vertices, 4):
        raise ArgumentError(f"n_vertices must be 4 or more; got {shown(n_vertices)}")
    n_vertices = min(int(n_vertices), mesh.n_vertices)
    meshset = to_meshset(mesh)
    euler = mesh.n_vertices - len(mesh.edges) + mesh.n_faces  # stays; V - E + F with E = 3/2 F
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
        raise MeshError("this MeshSet has no layer; add a mesh to it first")
    return meshset.current_mesh()


def _arrays(meshset: Any) -> tuple[FloatArray, IntArray]:
    current = _current(meshset)
    return _plain(current.vertex_matrix(), current.face_matrix())


def _plain(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    rows = np.ascontiguousarray(faces, dtype=np.int64).reshape(-1, 3)
    return np.ascontiguousarray(vertices, dtype=np.float64), rows


@contextlib.contextmanager
def _standing_still() -> Iterator[None]:
    """Stay in the current folder, which PyMeshLab leaves when it fails."""
    folder = os.getcwd()
    try:
        yield
    finally:
        os.chdir(folder)


def _pymeshlab() -> Any:
    try:
        return importlib.import_module("pymeshlab")
    except ImportError as error:
        raise MissingDependencyError(
            "this needs PyMeshLab: pip install 'vtk-segdeform[meshlab]', and on Debian "
            f"apt-get install libgl1 libopengl0 libglib2.0-0 ({error})"
        ) from None
