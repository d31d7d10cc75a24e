"""Where a file stores a mesh in a pose, found by reading the file again, and what is lost in it.

Formats round coordinates, and some of them to single precision.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import FloatArray
from ..geometry import lids_of
from ..mesh import Mesh
from ..solver import total_volume
from .array_names import rounding_text
from .convert import read_polydata
from .polygons import triangles_of
from .surface import Surface


def stored_vertices(surface: Surface, vertices: FloatArray, path: Path) -> FloatArray:
    """Return where a file of *surface*, with its mesh at *vertices* (n, 3), stores them.

    A file with other points, such as the corners of triangles in STL, has for each vertex one that
    is nearest: where coordinates are rounded, no other one is nearer.

    Raises
    ------
    MeshError
        If the file cannot be read again.
    """
    again = read_polydata(path)
    points = np.asarray(again.points, dtype=np.float64)
    same = again.n_points == surface.given.n_points
    if same and np.array_equal(triangles_of(again), triangles_of(surface.given)):
        return np.asarray(surface.at_vertices(points))
    points = points[np.isfinite(points).all(axis=1)]
    return np.asarray(points[cKDTree(points).query(vertices)[1]])


def volume_change(mesh: Mesh, vertices: FloatArray, lids: bool | None) -> float:
    """Return (V - V0) / V0 of *mesh* at *vertices* (n, 3), with its lids; 0 without a volume."""
    middle = mesh.vertices.mean(axis=0)  # digits are few far from the origin
    rest = mesh.with_vertices(mesh.vertices - middle)
    return total_volume(rest, lids_of(mesh, lids)).relative(vertices - middle)


def loss_of(surface: Surface, vertices: FloatArray, path: Path, lids: bool | None) -> str:
    """Return how a file of *surface* at *vertices* (n, 3) visibly differs from them, in words.

    "" if it does not.  The volume is that of the mesh with its *lids*.

    Raises
    ------
    MeshError
        If the file cannot be read again.
    """
    stored, mesh = stored_vertices(surface, vertices, path), surface.mesh
    if np.array_equal(stored, vertices):
        return ""
    moved = float(np.linalg.norm(stored - vertices, axis=1).max())
    change = volume_change(mesh, stored, lids) - volume_change(mesh, vertices, lids)
    return rounding_text(moved, mesh.diagonal, change)
