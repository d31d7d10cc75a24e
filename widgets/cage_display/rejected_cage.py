"""A surface that was refused as a cage, and where it fails: grey wires, marks and a sentence.

Marked are, and each kind only where there is nothing of the ones before:

    connectivity   edges that are open, have three faces or more, or faces that face opposite
                   sides; vertices in no face, and those where several fans touch
    geometry       the edges of faces without area, or else of faces that cross; of all faces
                   where a part is inside-out
    enclosure      what should be inside and is not
"""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401 - without it text is not drawn
from numpy.typing import ArrayLike
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform.arrays import FloatArray, IntArray, as_faces, as_points
from vtk_segdeform.cages import Cage, cage_faults
from vtk_segdeform.errors import CageError
from vtk_segdeform.mesh import HalfEdges, face_edges, flat_faces, repeats_vertex, self_intersections
from vtk_segdeform.pictures import PAPER, rgb

from ..scene import View, Wires

WARNING = rgb("#C2006B")  # neither a region's colour nor the red of what is dragged
_PLAIN = rgb("#8C8C8C")
_NO_IDS = np.empty(0, dtype=np.int64)
_NO_EDGES = np.empty((0, 2), dtype=np.int64)
_LINE = 44  # letters
_MARGIN = 16  # pixels around the words


class RejectedCage:
    """Wires with warnings on them, in a view until `remove`.

    Parameters
    ----------
    view : View
        Where to draw.
    vertices : (m, 3) float
        Of what should have been a cage.
    faces : (k, 3) int
        Its triangles.
    enclosed : (n, 3) float
        What it should have inside; may be empty.
    message : str, optional
        What stands beside the marks; None for what is found to be wrong.

    Attributes
    ----------
    message : str
        What stands beside the marks; empty if nothing is wrong.
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
        self._plain = Wires(points, face_edges(triangles)[0], _NO_IDS)
        self._marks = Wires(points, edges, marked)
        self._outside = Wires(outside, _NO_EDGES, np.arange(len(outside)))
        self._marked = np.concatenate([points[marked], outside])
        self._caption = _caption()
        self._front = view.front  # to be taken out of this very one
        self._marked_by = self._marks.actor, self._outside.actor, self._caption
        view.renderer.AddActor(self._plain.actor)
        for actor in self._marked_by:
            self._front.AddActor(actor)

    def draw(self, scale: float) -> None:
        """Draw with sizes times *scale*, and the words where there is room for them now."""
        self._plain.draw(_PLAIN, line_width=1.5 * scale, ball_size=1.0)
        self._marks.draw(WARNING, line_width=4.0 * scale, ball_size=11.0 * scale)
        self._outside.draw(WARNING, line_width=1.0, ball_size=6.0 * scale)
        self._caption.SetInput("\n".join(textwrap.wrap(self.message, _LINE)))
        self._caption.GetTextProperty().SetFontSize(round(14 * scale))
        self._caption.SetVisibility(bool(self.message) and len(self._marked) > 0)
        if self._caption.GetVisibility():
            self._caption.SetPosition(*self._place())

    def remove(self) -> None:
        """Take it out of the view."""
        self._view.renderer.RemoveActor(self._plain.actor)
        for actor in self._marked_by:
            self._front.RemoveActor(actor)

    def _place(self) -> FloatArray:
        """Return where the words are beside what is marked, and inside the window, in pixels."""
        size = np.zeros(2)
        self._caption.GetSize(self._front, size)
        room = np.array(self._view.renderer.GetSize()) - size - _MARGIN
        seen = self._view.to_display(self._marked)[:, :2] - self._view.renderer.GetOrigin()
        low, high = seen.min(axis=0), seen.max(axis=0)
        above = high[1] + _MARGIN
        place = [
            0.5 * (low[0] + high[0] - size[0]),
            above if above < room[1] else low[1] - size[1] - _MARGIN,
        ]
        return np.asarray(np.clip(place, _MARGIN, np.maximum(room, _MARGIN)))


def _failing(points: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2) and the vertices (v,) at which a surface fails to be a cage."""
    broken = repeats_vertex(faces)
    sides = HalfEdges(faces[~broken], len(points))
    bad = np.concatenate([sides.boundary, *sides.non_manifold, sides.pairs[sides.inconsistent, 0]])
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
    words = caption.GetTextProperty()
    words.SetColor(*(rgb(PAPER) / 255.0))
    words.SetBackgroundColor(*(WARNING / 255.0))
    words.SetBackgroundOpacity(1.0)
    words.FrameOn()
    words.SetFrameColor(*(WARNING / 255.0))
    words.SetFrameWidth(4)
    return caption
