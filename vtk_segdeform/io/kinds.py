"""Whatever holds a surface, as a `Surface`; and a deformed PolyData as the same type of object."""

from __future__ import annotations

import copy
import os
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..mesh import Mesh
from .convert import as_polydata, from_polydata, is_meshio, is_trimesh
from .polygons import triangles_of
from .surface import Surface

_EXPECTED = "a PolyData, a Mesh, a pair (vertices, faces), a path, or another surface"


def surface_of(mesh: Any) -> Surface:
    """Return the surface of a path, or of anything that `Surface` takes; a Surface itself."""
    if isinstance(mesh, Surface):
        return mesh
    if isinstance(mesh, str | os.PathLike):
        return Surface.read(Path(mesh))
    return Surface(as_polydata(mesh, "mesh", _EXPECTED))


def of_its_kind(given: Any, polydata: pv.PolyData) -> Any:
    """Return *polydata* as an object of the type of *given*.

    If it has as many points, it is a copy of *given* with other coordinates, and so with all that
    PolyData cannot hold, such as the materials of a ``trimesh.Trimesh``.  Without such a type, as
    of a path, it is returned itself.
    """
    if isinstance(given, Mesh):
        return from_polydata(polydata)
    points = np.array(polydata.points, dtype=np.float64)
    if isinstance(given, tuple):
        is_same = len(given[0]) == len(points)
        return points, np.array(given[1] if is_same else triangles_of(polydata), dtype=np.int64)
    if is_trimesh(given):
        mesh = given.to_mesh() if hasattr(given, "primitive") else given.copy()
        if len(mesh.vertices) != len(points):
            return type(mesh)(points, triangles_of(polydata), process=False)
        mesh.vertices = points
        return mesh
    if not is_meshio(given):
        return polydata
    if len(given.points) != len(points):
        return type(given)(points, [("triangle", triangles_of(polydata))])
    mesh = copy.deepcopy(given)
    mesh.points = points
    for name in mesh.point_data.keys() & set(polydata.point_data.keys()):
        mesh.point_data[name] = np.array(polydata.point_data[name])
    return mesh
