"""A `Mesh` from any triangles, and the map between both: what is given and what is deformed.

    weld       border points at the same position become one vertex
    drop       faces without three different vertices, repeated faces, points in no face
    orient     neighbouring faces alike, closed surfaces and nearly closed ones outward

Nothing is lost: every given point follows a vertex of the mesh, so a pose of the mesh is one of
what was given, with the same points in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_ids, as_points
from .faults import as_soup
from .grouping import first_equal_row, first_of_group
from .mesh import Mesh
from .topology import HalfEdges, repeats_face, repeats_vertex


@dataclass(frozen=True)
class Workaround:
    """Something in the given triangles that the mesh does not have: a sentence, and where it is."""

    text: str
    points: IntArray  # (k,) int: given points there

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, eq=False)
class Soup:
    """Given points and triangles, and their mesh.

    Attributes
    ----------
    points : (p, 3) float
        As given.
    mesh : Mesh
        What is deformed.
    vertex_of : (p,) int
        The vertex that each given point follows: its own, or the nearest one if it is in no face.
    workarounds : tuple of Workaround
        What differs between the two.
    """

    points: FloatArray
    mesh: Mesh
    vertex_of: IntArray
    workarounds: tuple[Workaround, ...] = ()

    def vertices_at(self, points: ArrayLike) -> IntArray:
        """Return the vertices (k,) of the mesh, sorted, that given *points* (mask or ids) follow."""
        return np.unique(self.vertex_of[as_ids(points, len(self.points), "points")])

    def at_vertices(self, values: Any) -> Any:
        """Return *values* (p, ...) of the given points at the vertices (n, ...).

        Of several points that follow a vertex, the first one counts.
        """
        _, first = np.unique(self.vertex_of, return_index=True)
        return values[first]

    def targets_at(self, points: ArrayLike, targets: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Return the vertices (k,) that given *points* follow, and where they must be, (k, 3).

        A vertex that several points with *targets* (q, 3) follow goes to the mean.
        """
        ids = as_ids(points, len(self.points), "points")
        ends = as_points(targets, "targets", len(ids))
        ends = ends - (self.points[ids] - self.mesh.vertices[self.vertex_of[ids]])
        vertices, number = np.unique(self.vertex_of[ids], return_inverse=True)
        sums = np.zeros((len(vertices), 3))
        np.add.at(sums, number, ends)
        return vertices, sums / np.bincount(number, minlength=len(vertices))[:, None]

    def moved(self, vertices: FloatArray) -> FloatArray:
        """Return the given points (p, 3) for the mesh at *vertices* (n, 3)."""
        offsets = self.points - self.mesh.vertices[self.vertex_of]  # 0 for all points of faces
        return np.asarray(vertices[self.vertex_of] + offsets)


def mesh_of(vertices: ArrayLike, faces: ArrayLike) -> Soup:
    """Return the mesh of any triangles *faces* (m, 3) over *vertices* (p, 3)."""
    points, triangles = as_soup(vertices, faces)
    half_edges = HalfEdges(triangles[~repeats_vertex(triangles)], len(points))
    border = np.union1d(half_edges.tail[half_edges.boundary], half_edges.head[half_edges.boundary])
    vertex_of = np.arange(len(points))
    vertex_of[border] = border[first_equal_row(points[border])]
    welded = vertex_of[triangles]
    kept = welded[~repeats_vertex(welded)]
    kept = kept[~repeats_face(kept)]
    _, flip = HalfEdges(kept, len(points)).sides
    kept[flip] = kept[flip][:, [0, 2, 1]]
    used, faces = np.unique(kept, return_inverse=True)
    number = np.zeros(len(points), dtype=np.int64)
    number[used] = np.arange(len(used))
    mesh = Mesh(points[used], faces.reshape(-1, 3))
    return Soup(points, mesh, number[first_of_group(vertex_of)])
