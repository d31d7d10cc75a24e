"""From the window to the mesh: what is under the pointer, near it along the surface, or seen.

Always in the pose that is drawn.  What a look-up needs is made when it is first asked for, and
again only after the pose has changed, or for what is seen the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkStaticCellLocator

from vtk_segdeform.arrays import BoolArray, FloatArray

from ..scene import Pointer, SurfaceDisplay
from .surface_distance import SurfaceDistance
from .visibility import seen_vertices

_SLACK = 1e-7  # of the diagonal: a line through an edge must not slip between its two faces


@dataclass(frozen=True, eq=False)
class Hit:
    """Where a line of sight meets the surface."""

    point: FloatArray
    """(3,) float: in the pose."""
    face: int
    vertex: int
    """The corner of the face that is nearest to the point."""


@dataclass(frozen=True, eq=False)
class _Look:
    """What is known of one pose, seen in one way."""

    posed: int
    marks: FloatArray  # where the corners of the mesh's box are seen
    places: FloatArray  # (n, 3) of each vertex in the display
    known: BoolArray  # (n,) the vertices that were looked at, filled in bit by bit
    seen: BoolArray  # (n,) those of them that are seen


class Picker:
    """Look-ups in the mesh of a surface.

    Parameters
    ----------
    surface : SurfaceDisplay
        The mesh, as it is drawn in its view.
    """

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._view = surface.view
        self._mesh = surface.session.mesh
        # Not the data that is drawn: those are modified by every change of colour.
        self._data = vtkPolyData()
        self._data.SetPoints(surface.polydata.GetPoints())
        self._data.SetPolys(surface.polydata.GetPolys())
        self._locator = vtkStaticCellLocator()
        self._locator.SetDataSet(self._data)
        self._distance: SurfaceDistance | None = None
        self._look: _Look | None = None
        # Where these are seen tells where the camera is; not how far it sees, which changes
        # whenever something else is drawn.
        ends = np.stack([self._mesh.vertices.min(axis=0), self._mesh.vertices.max(axis=0)])
        self._landmarks = ends[np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)]

    def hits(self, pointer: Pointer) -> list[Hit]:
        """Return all that *pointer* is over, front and back, the nearest first."""
        near, far = self._view.ray(pointer)
        if not (np.isfinite(near).all() and np.isfinite(far).all()):
            return []
        self._locator.BuildLocator()  # does nothing unless the pose has changed
        points, faces = vtkPoints(), vtkIdList()
        slack = _SLACK * self._mesh.diagonal
        self._locator.IntersectWithLine(near, far, slack, points, faces)
        return [
            self._hit(np.array(points.GetPoint(k)), faces.GetId(k))
            for k in range(faces.GetNumberOfIds())
        ]

    def hit(self, pointer: Pointer) -> Hit | None:
        """Return what is seen at *pointer*, or None beside the mesh."""
        return next(iter(self.hits(pointer)), None)

    def distances(self, hits: Sequence[Hit], radius: float) -> FloatArray:
        """Return how far each vertex is along the surface from the nearest of *hits*, (n,) float.

        Infinitely far, but for the vertices within *radius*, in the mesh's unit, and their
        neighbours.
        """
        if self._distance is None:
            self._distance = SurfaceDistance(self._mesh.n_vertices, self._mesh.faces)
        points = np.array([hit.point for hit in hits]).reshape(-1, 3)
        faces = np.array([hit.face for hit in hits], dtype=np.int64)
        return self._distance.within(self._surface.points, points, faces, radius)

    def component(self, vertex: int) -> BoolArray:
        """Return the vertices that are connected with *vertex*, (n,) bool."""
        return np.asarray(self._mesh.components == self._mesh.components[vertex])

    def pixel_at(self, hit: Hit) -> float:
        """Return how long one pixel is at a *hit*, in the mesh's unit."""
        return self._view.pixel_at(hit.point)

    def places(self) -> FloatArray:
        """Return where each vertex is in the display, (n, 3) float, as `Sight.to_display`."""
        return self._view.to_display(self._surface.points)

    def seen(self, among: BoolArray | None = None) -> BoolArray:
        """Return the vertices that the mesh does not hide from the camera, (n,) bool.

        Asked for those *among* some, (n,) bool, it looks at no others, and at each only once.
        """
        look = self._look_now()
        asked = ~look.known if among is None else among & ~look.known
        if asked.any():
            look.seen[seen_vertices(look.places, self._mesh.faces, asked)] = True
            look.known[asked] = True
        return look.seen if among is None else look.seen & among

    def _look_now(self) -> _Look:
        posed = self._data.GetPoints().GetMTime()
        marks = self._view.to_display(self._landmarks)[:, :2]
        look = self._look
        if (
            look is None
            or look.posed != posed
            or not np.array_equal(look.marks, marks, equal_nan=True)
        ):
            nothing = np.zeros(self._mesh.n_vertices, dtype=bool)
            look = _Look(posed, marks, self.places(), nothing, nothing.copy())
            self._look = look
        return look

    def _hit(self, point: FloatArray, face: int) -> Hit:
        corners = self._mesh.faces[face]
        away = np.linalg.norm(self._surface.points[corners] - point, axis=1)
        return Hit(point, face, int(corners[away.argmin()]))
