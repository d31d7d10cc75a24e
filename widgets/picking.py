"""From the window to the mesh: the point under the pointer, and the vertices a stroke takes.

point       where the line of sight meets the surface first
brush       vertices near to it along the surface, so that nothing leaks to another limb
outline     vertices inside a lasso or a rectangle, those that are seen or all
component   what hangs together with a vertex
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

from vtk_segdeform.arrays import BoolArray, FloatArray

from .gestures import Pointer
from .surface_display import SurfaceDisplay
from .visibility import seen_vertices

_SLACK = 1e-7  # of the diagonal: a line through an edge must not slip between its two faces
_DETOUR = 1.4  # a path along edges is at most about as much longer than one across faces


@dataclass(frozen=True, eq=False)
class Hit:
    """Where a line of sight meets the surface."""

    point: FloatArray
    """(3,) float, in the present pose."""
    face: int
    vertex: int
    """Of the face, the nearest one."""


class Picker:
    """Asks a surface, in the pose in which it is drawn.

    Parameters
    ----------
    surface : SurfaceDisplay
        Of n vertices.
    """

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._locator = vtkStaticCellLocator()
        self._locator.SetDataSet(surface.polydata)
        self._built_at = -1

    def hit(self, pointer: Pointer) -> Hit | None:
        """Return what is under *pointer*, or None where the surface is not."""
        points = self._surface.polydata.GetPoints()
        if points.GetMTime() != self._built_at:  # the pose has changed
            self._locator.ForceBuildLocator()
            self._built_at = points.GetMTime()
        near, far = self._surface.view.ray(pointer)
        if not (np.isfinite(near).all() and np.isfinite(far).all()):
            return None
        slack = _SLACK * self._surface.session.mesh.diagonal
        place, local = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        t, part, face = reference(0.0), reference(0), reference(-1)
        if not self._locator.IntersectWithLine(near, far, slack, t, place, local, part, face):
            return None
        point, corners = np.array(place), self._surface.session.mesh.faces[int(face)]
        away = np.linalg.norm(self._surface.points[corners] - point, axis=1)
        return Hit(point, int(face), int(corners[away.argmin()]))

    def around(self, hit: Hit, radius: float) -> BoolArray:
        """Return (n,) bool: vertices no further than *radius* from *hit*, and joined to it so.

        At least the nearest vertex, however small the radius.
        """
        mesh, points = self._surface.session.mesh, self._surface.points
        near = np.linalg.norm(points - hit.point, axis=1) <= radius
        corners = mesh.faces[hit.face]
        start = np.linalg.norm(points[corners] - hit.point, axis=1)
        way = csgraph.dijkstra(
            mesh.adjacency, directed=False, indices=corners, limit=_DETOUR * radius
        )
        near &= (way + start[:, None]).min(axis=0) <= _DETOUR * radius
        near[hit.vertex] = True
        return np.asarray(near)

    def inside(self, outline: FloatArray, *, through: bool) -> BoolArray:
        """Return (n,) bool: vertices seen inside a closed *outline* (k, 2) in the window.

        Parameters
        ----------
        outline : (k, 2) float
            Corners, pixels; one that crosses itself holds what an odd number of its turns do.
        through : bool
            Also those that the body itself hides.
        """
        display = self._surface.view.to_display(self._surface.points)
        inside = _in_polygon(display[:, :2], outline)
        if through or not inside.any():
            return inside
        return inside & seen_vertices(display, self._surface.session.mesh.faces)

    def component(self, vertex: int) -> BoolArray:
        """Return (n,) bool: vertices joined to *vertex* by edges, however far."""
        components = self._surface.session.mesh.components
        return np.asarray(components == components[vertex])


def _in_polygon(points: FloatArray, polygon: FloatArray) -> BoolArray:
    """Return (n,) bool: how often a ray to the right crosses the polygon, odd or even."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = (y0 > y) != (y1 > y)
        inside ^= crosses & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside
