"""Queries on the displayed pose: hits of the pointer, distances from it, visible vertices.

The visible vertices are computed on first use, and again after the pose or the camera has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray
from vtk_segdeform.mesh import SurfacePoint

from ..scene import Pointer, Projection, SurfaceDisplay
from .line_of_sight import intersections
from .surface_distance import SurfaceDistance
from .surface_ring import SurfaceRing
from .visibility import visible_vertices

# A ray through an edge must not pass between its two faces.
_INTERSECTION_TOLERANCE = 1e-7  # of the diagonal


@dataclass(frozen=True, eq=False)
class Hit:
    """An intersection of the line of sight with the surface."""

    point: FloatArray
    """(3,) float: the position in the displayed pose."""
    face: int
    vertex: int
    """The corner of the face that is nearest to the point."""
    place: SurfacePoint
    """The point, wherever the surface moves."""


@dataclass(frozen=True, eq=False)
class _Visibility:
    """The visible vertices of one pose and one camera, computed on demand."""

    modified: int  # VTK's modification time of the points
    box: FloatArray  # (8, 2) display positions of the corners of the mesh's bounding box
    display: FloatArray  # (n, 3) display coordinates of the vertices
    is_tested: BoolArray  # (n,) the vertices tested so far
    is_visible: BoolArray  # (n,) the visible vertices among them
    only: BoolArray | None  # (n,) the vertices that are shown at all


class Picker:
    """Queries on the mesh of a surface."""

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._view = surface.view
        self._mesh = surface.session.mesh
        self._distance: SurfaceDistance | None = None
        self._ring: SurfaceRing | None = None
        self._visibility: _Visibility | None = None
        # Their display positions identify the camera.  The clipping range would not: it changes
        # whenever other actors are drawn.
        self._box_corners = self._mesh.bounds[np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)]

    def hits(self, pointer: Pointer) -> list[Hit]:
        """Return all intersections of the line of sight at *pointer*, the nearest first."""
        near, far = self._view.ray(pointer)
        if not (np.isfinite(near).all() and np.isfinite(far).all()):
            return []
        tolerance = _INTERSECTION_TOLERANCE * self._mesh.diagonal
        ids = self._surface.shown_faces
        places, met = intersections(
            self._surface.points, self._faces, near, far, tolerance=tolerance
        )
        met = met if ids is None else ids[met]
        return [self._hit(place, int(face)) for place, face in zip(places, met, strict=True)]

    def hit(self, pointer: Pointer, *, beside: float = 0.0) -> Hit | None:
        """Return the visible point of the surface at *pointer*, or None beside the mesh.

        Or the vertex at the silhouette that is nearest to it, if it is *beside* the mesh by at most
        so many pixels.
        """
        found = next(iter(self.hits(pointer)), None)
        if found is not None or not beside:
            return found
        display, faces, ids = self.display_points(), self._faces, self._surface.shown_faces
        away = np.hypot(*(display[:, :2] - pointer.position).T)[faces]
        away[np.isnan(away)] = np.inf  # behind the camera
        face, corner = divmod(int(away.argmin()), 3)
        if not away[face, corner] <= beside:
            return None
        point = self._surface.points[faces[face, corner]]
        return self._hit(point, face if ids is None else int(ids[face]))

    def sees(self, point: FloatArray, *, within: float) -> bool:
        """Return whether the surface does not hide *point* (3,); see `is_seen`."""
        return is_seen(self._view, point, self._surface.points, self._faces, within=within)

    def distances(self, hits: Sequence[Hit], radius: float) -> FloatArray:
        """Return the distance along the surface of each vertex to the nearest of *hits*.

        Returns
        -------
        distances : (n,) float
            Infinite except for the vertices within *radius*, in the mesh's unit, and their
            neighbours.
        """
        if self._distance is None:
            self._distance = SurfaceDistance(self._mesh.n_vertices, self._mesh.faces)
        points = np.array([hit.point for hit in hits]).reshape(-1, 3)
        faces = np.array([hit.face for hit in hits], dtype=np.int64)
        return self._distance.within(self._surface.points, points, faces, radius)

    def ring(self, hit: Hit, radius: float) -> FloatArray:
        """Return the segments (k, 2, 3) of the line at *radius* from *hit* along the surface."""
        if self._ring is None:
            self._ring = SurfaceRing(self._mesh)
        return self._ring.around(
            self._surface.points,
            centre=hit.point,
            face=hit.face,
            radius=radius,
            sight=self._view.view_direction,
        )

    def component(self, vertex: int) -> BoolArray:
        """Return the connected part of the mesh that contains *vertex*, (n,) bool."""
        return np.asarray(self._mesh.components == self._mesh.components[vertex])

    def pixel_at(self, hit: Hit) -> float:
        """Return the length of one pixel at a *hit*, in the mesh's unit."""
        return self._view.pixel_at(hit.point)

    def display_points(self) -> FloatArray:
        """Return the display coordinates of the vertices, (n, 3); see `Projection.to_display`."""
        return self._view.to_display(self._surface.points)

    def visible(self, among: BoolArray | None = None) -> BoolArray:
        """Return the vertices that the mesh does not hide from the camera, (n,) bool.

        With *among*, (n,) bool, only these vertices are tested, and none of the others is True.
        Results are cached until the pose or the camera changes.
        """
        cache = self._current_visibility()
        untested = ~cache.is_tested if among is None else among & ~cache.is_tested
        if untested.any():
            cache.is_visible[visible_vertices(cache.display, self._faces, untested)] = True
            cache.is_tested[untested] = True
            if cache.only is not None:
                cache.is_visible[~cache.only] = False
        return cache.is_visible if among is None else cache.is_visible & among

    @property
    def _faces(self) -> IntArray:
        """The faces that are shown, (f, 3)."""
        ids = self._surface.shown_faces
        return self._mesh.faces if ids is None else self._mesh.faces[ids]

    def _current_visibility(self) -> _Visibility:
        modified = self._surface.polydata.GetPoints().GetMTime()
        box = self._view.to_display(self._box_corners)[:, :2]
        cache = self._visibility
        if (
            cache is None
            or cache.modified != modified
            or cache.only is not self._surface.only
            or not np.array_equal(cache.box, box, equal_nan=True)
        ):
            none = np.zeros(self._mesh.n_vertices, dtype=bool)
            only, display = self._surface.only, self.display_points()
            cache = _Visibility(modified, box, display, none, none.copy(), only)
            self._visibility = cache
        return cache

    def _hit(self, point: FloatArray, face: int) -> Hit:
        corners = self._mesh.faces[face]
        distances = np.linalg.norm(self._surface.points[corners] - point, axis=1)
        place = SurfacePoint.in_face(self._surface.points, corners, point)
        return Hit(point, face, int(corners[distances.argmin()]), place)


def is_seen(
    projection: Projection,
    point: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
    *,
    within: float = 0.0,
) -> bool:
    """Return whether a surface does not hide a point from the camera.

    Parameters
    ----------
    projection : Projection
        The projection of the view.
    point : (3,) float
        In world coordinates.
    vertices, faces : (n, 3) float, (m, 3) int
        The surface.
    within : float
        Depth of the point behind the surface at which it still counts as seen, in the mesh's unit.
    """
    display = projection.to_display(point[None])
    eye = projection.to_world(display * [1.0, 1.0, 0.0])[0]
    if not (np.isfinite(eye).all() and np.isfinite(point).all()):
        return False
    nearest = intersections(vertices, faces, eye, point, tolerance=0.0)[0][:1]
    return not ((point - nearest) @ projection.view_direction > within).any()
