"""The ring around a point of the surface: all points at one distance from it along the surface.

So the ring does not appear on a finger beside the one under the pointer.  The distances of a large
mesh are those of its decimated mesh, whose vertices lie on the surface; another thread makes that,
and until it is finished there is no ring.  A ring of a few of its triangles is a plane
circle in one of them; one beyond the whole component, such as a button, is a circle that faces the
camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtk_segdeform import sizes
from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.mesh import Mesh

from ..scene import decimated_soon
from .line_of_sight import perpendicular
from .surface_distance import SurfaceDistance

_SMALLEST_RADIUS = 1.5  # of a ring that follows the triangles, in their sides
_CORNERS = 48  # of a circle


class SurfaceRing:
    """Rings on the surface of one mesh, in any pose."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._sample: _Sample | None = None
        if mesh.n_vertices <= sizes.DECIMATED_POINTS:
            every = np.arange(mesh.n_vertices)
            self._sample = _Sample.of(mesh.faces, every, every)

    def around(
        self, points: FloatArray, *, centre: FloatArray, face: int, radius: float, sight: FloatArray
    ) -> FloatArray:
        """Return the segments (k, 2, 3) of the ring about *centre*.

        Parameters
        ----------
        points : (n, 3) float
            The pose.
        centre : (3,) float
            On the surface.
        face : int
            The triangle that contains it.
        radius : float
            Above 0.
        sight : (3,) float
            The viewing direction, of length 1.
        """
        corner = self._mesh.faces[face]
        if self._sample is None and (found := decimated_soon(self._mesh)) is not None:
            coarse, kept, cluster = found
            self._sample = _Sample.of(coarse.faces, kept, cluster)
        sample = self._sample
        if sample is None:
            return np.empty((0, 2, 3))
        x = points[sample.kept]
        start = sample.face_of[sample.cluster[corner]]
        start = np.unique(start[start >= 0])
        sides = x[sample.faces[start]]
        length = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2)
        if len(start) and radius >= _SMALLEST_RADIUS * length.mean():
            centres = np.broadcast_to(centre, (len(start), 3))
            away = sample.distance.within(x, centres, start, radius)
            near = (away[sample.faces] <= radius).any(axis=1)
            faces = sample.faces[near]
            segments = contour(x[faces], away[faces], radius)
            return segments if len(segments) else _circle(perpendicular(sight), centre, radius)
        side, other = points[corner[1:]] - points[corner[0]]
        normal = np.cross(side, other)
        if not (length := np.linalg.norm(normal)) > 0.0:
            return np.empty((0, 2, 3))
        return _circle(perpendicular(normal / length), centre, radius)


@dataclass(frozen=True, eq=False)
class _Sample:
    """Some vertices of a mesh, and triangles between them."""

    faces: IntArray
    """(m, 3) int, of the sample."""
    kept: IntArray
    """(k,) int: its vertices in the mesh."""
    cluster: IntArray
    """(n,) int: the vertex of the sample that stands for each vertex of the mesh."""
    face_of: IntArray
    """(k,) int: a triangle of the sample at each of its vertices, -1 for none."""
    distance: SurfaceDistance

    @classmethod
    def of(cls, faces: IntArray, kept: IntArray, cluster: IntArray) -> _Sample:
        face_of = np.full(len(kept), -1)
        face_of[faces] = np.arange(len(faces))[:, None]
        return cls(faces, kept, cluster, face_of, SurfaceDistance(len(kept), faces))


def contour(corners: FloatArray, values: FloatArray, level: float) -> FloatArray:
    """Return the segments (k, 2, 3) of the contour line at *level* over triangles.

    *corners* are (m, 3, 3) and their *values* (m, 3), which are interpolated linearly.  Each
    triangle with corners on both sides has one segment.
    """
    below = values <= level
    mixed = below.any(axis=1) & ~below.all(axis=1)
    start, first = corners[mixed], values[mixed]
    end, last = start[:, [1, 2, 0]], first[:, [1, 2, 0]]
    crossed = (first <= level) != (last <= level)  # two sides of each triangle
    start, end, first, last = start[crossed], end[crossed], first[crossed], last[crossed]
    fraction = (level - first) / (last - first)
    return np.asarray((start + fraction[:, None] * (end - start)).reshape(-1, 2, 3))


def _circle(axes: FloatArray, centre: FloatArray, radius: float) -> FloatArray:
    """Return a circle in the plane of two *axes* (2, 3), unit vectors, as segments (k, 2, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS + 1)
    line = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes
    return np.stack([line[:-1], line[1:]], axis=1)
