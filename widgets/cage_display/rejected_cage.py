"""A surface that was rejected as a cage: a grey wireframe, marked faults and a message.

Only the first kind of fault that occurs is marked:

    connectivity   boundary edges, edges with three faces or more, edges between faces of opposite
                   orientation; unused vertices, and vertices where several fans of faces meet
    geometry       the edges of faces without area, or else of intersecting faces, or else of all
                   faces if a part is inside-out
    enclosure      vertices of the region outside the cage
"""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401 - required to draw text
from numpy.typing import ArrayLike
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform.arrays import FloatArray, IntArray, as_faces, as_points
from vtk_segdeform.cages import Cage, cage_faults
from vtk_segdeform.errors import CageError
from vtk_segdeform.mesh import HalfEdges, face_edges, flat_faces, repeats_vertex, self_intersections
from vtk_segdeform.pictures import PAPER, rgb

from ..scene import View, Wireframe

WARNING = rgb("#C2006B")  # differs from the region colours and from the red of handles
_PLAIN = rgb("#8C8C8C")
_NO_IDS = np.empty(0, dtype=np.int64)
_NO_EDGES = np.empty((0, 2), dtype=np.int64)
_LINE_LENGTH = 44  # characters
_MARGIN = 16  # pixels around the message


class RejectedCage:
    """A wireframe with marked faults, in a view until `remove`.

    Parameters
    ----------
    view : View
        The view to draw in.
    vertices : (m, 3) float
        Of the rejected surface.
    faces : (k, 3) int
        Triangles.
    enclosed : (n, 3) float
        The points that should be inside; may be empty.
    message : str, optional
        The text beside the marks; by default a description of the faults found.

    Attributes
    ----------
    message : str
        The text beside the marks; "" if there is no fault.
    """

    def __init__(
        self,
        view: View,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        enclosed: FloatArray,
        message: str | None = None,
    ) -> None:
        points = as_points(vertices, "vertices")
        triangles = as_faces(faces, len(points), "faces")
        found = "; ".join(cage_faults(points, triangles))
        edges, corners, outside = _NO_EDGES, _NO_IDS, enclosed[:0]
        if found:
            edges, corners = _failing(points, triangles)
        else:
            cage = Cage(points, triangles)
            outside = enclosed[~cage.contains(enclosed)]
            try:
                cage.require_encloses(enclosed, "vertices")
            except CageError as fault:
                found = str(fault)
        self.message = found if message is None else message
        marked = np.union1d(edges, corners)
        self._view = view
        self._plain = Wireframe(points, face_edges(triangles)[0], _NO_IDS)
        self._marks = Wireframe(points, edges, marked)
        self._outside = Wireframe(outside, _NO_EDGES, np.arange(len(outside)))
        self._marked = np.concatenate([points[marked], outside])
        self._caption = _caption()
        self._foreground = view.foreground  # kept: the view's own may be another one by then
        self._warnings = self._marks.actor, self._outside.actor, self._caption
        view.renderer.AddActor(self._plain.actor)
        for actor in self._warnings:
            self._foreground.AddActor(actor)

    def lay_out(self, scale: float) -> None:
        """Scale all sizes by *scale* and place the message where there is room."""
        self._plain.set_style(_PLAIN, line_width=1.5 * scale, sphere_size=1.0)
        self._marks.set_style(WARNING, line_width=4.0 * scale, sphere_size=11.0 * scale)
        self._outside.set_style(WARNING, line_width=1.0, sphere_size=6.0 * scale)
        self._caption.SetInput("\n".join(textwrap.wrap(self.message, _LINE_LENGTH)))
        self._caption.GetTextProperty().SetFontSize(round(14 * scale))
        self._caption.SetVisibility(bool(self.message) and len(self._marked) > 0)
        if self._caption.GetVisibility():
            self._caption.SetPosition(*self._caption_position())

    def remove(self) -> None:
        """Remove it from the view."""
        self._view.renderer.RemoveActor(self._plain.actor)
        for actor in self._warnings:
            self._foreground.RemoveActor(actor)

    def _caption_position(self) -> FloatArray:
        """Return a position of the message, in pixels, beside the marks and inside the window."""
        size = np.zeros(2)
        self._caption.GetSize(self._foreground, size)
        largest = np.array(self._view.renderer.GetSize()) - size - _MARGIN
        marked = self._view.to_display(self._marked)[:, :2] - self._view.renderer.GetOrigin()
        low, high = marked.min(axis=0), marked.max(axis=0)
        above = high[1] + _MARGIN
        position = [
            0.5 * (low[0] + high[0] - size[0]),
            above if above < largest[1] else low[1] - size[1] - _MARGIN,
        ]
        return np.asarray(np.clip(position, _MARGIN, np.maximum(largest, _MARGIN)))


def _failing(points: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2) and the vertices (v,) at which a surface fails to be a cage."""
    broken = repeats_vertex(faces)
    sides = HalfEdges(faces[~broken], len(points))
    bad = np.concatenate([sides.boundary, sides.crowded, sides.pairs[sides.inconsistent, 0]])
    edges = np.stack([sides.tail[bad], sides.head[bad]], axis=1)
    unused = np.setdiff1d(np.arange(len(points)), faces)
    corners = np.concatenate([unused, sides.pinched, faces[broken].ravel()])
    if len(edges) or len(corners):
        return edges, corners
    flat = flat_faces(points, faces)
    crossing = np.unique(self_intersections(points, faces)) if not len(flat) else flat
    return face_edges(faces[crossing] if len(crossing) else faces)[0], corners


def _caption() -> Any:
    caption = vtkTextActor()
    style = caption.GetTextProperty()
    style.SetColor(*(rgb(PAPER) / 255.0))
    style.SetBackgroundColor(*(WARNING / 255.0))
    style.SetBackgroundOpacity(1.0)
    style.FrameOn()
    style.SetFrameColor(*(WARNING / 255.0))
    style.SetFrameWidth(4)
    return caption
