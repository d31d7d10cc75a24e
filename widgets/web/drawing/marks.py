"""Everything that is drawn over the body, as marks: rings, pins, gizmos, cages.

Each actor becomes up to three marks, its points, its lines and its triangles, in one colour and
without light.  Text and other two-dimensional actors are not among them.

A mark is placed by a matrix, and the page culls and clips it, so that its points rarely change: a
gizmo that follows the pointer is sent once, and then 120 bytes for each of its marks.
"""

from __future__ import annotations

import enum
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform.arrays import FloatArray, IntArray

from .encoding import EncodedSurface
from .look import matrix_of
from .messages import Kind, message

_EVERYWHERE = np.array([0.0, 0.0, 0.0, 1.0])


class Shape(enum.IntEnum):
    """What a mark consists of; the value is the number of points of each piece."""

    POINTS = 1
    LINES = 2
    TRIANGLES = 3


@dataclass(frozen=True, eq=False)
class Mark:
    """Points, lines or triangles in one colour.

    Parameters
    ----------
    shape : Shape
        What it consists of.
    points : (k, 3) float
        One, two or three for each piece.
    colour : (4,) float
        Red, green, blue and opacity, 0 to 1.
    size : float
        Of points and lines, in pixels.
    is_above : bool
        Whether the body does not hide it.
    matrix : (4, 4) float, optional
        From *points* to the scene; by default they are in the scene.
    shows_backs : bool
        Whether only those triangles are drawn that show their backs: the outline of a solid.
    plane : (4,) float
        Only what is in the scene at x with ``plane[:3] @ x + plane[3] >= 0`` is drawn.
    """

    shape: Shape
    points: FloatArray
    colour: FloatArray
    size: float
    is_above: bool
    matrix: FloatArray | None = None
    shows_backs: bool = False
    plane: FloatArray = field(default_factory=_EVERYWHERE.copy)

    def sent_points(self, surface: EncodedSurface) -> NDArray[np.float32]:
        """Return the points as the message of *surface* has them."""
        points = self.points
        if self.matrix is None:
            points = (points - surface.centre) / surface.scale
        return points.astype(np.float32)

    def head(self, surface: EncodedSurface, number: int) -> NDArray[np.float32]:
        """Return the numbers (30,) in the message of *surface*; *number* names the points."""
        to_message, to_scene = np.eye(4), np.eye(4)
        if self.matrix is not None:
            to_message[:3] = self.matrix[:3] / surface.scale
            to_message[:3, 3] -= surface.centre / surface.scale
        to_scene[:3] *= surface.scale
        to_scene[:3, 3] = surface.centre
        numbers: list[ArrayLike] = [
            [self.shape, self.is_above, *self.colour, self.size, len(self.points), number],
            [self.shows_backs],
            to_message.T.ravel(),
            self.plane @ to_scene,
        ]
        return np.concatenate([np.asarray(each) for each in numbers]).astype(np.float32)


class MarkStream:
    """The messages of marks for one page.

    The page keeps the points of the last message, each array under a number.
    """

    def __init__(self) -> None:
        self._last = 0
        self._points: dict[int, NDArray[np.float32]] = {}
        self._heads = b""

    def reset(self) -> None:
        """Send everything again."""
        self._points, self._heads = {}, b""

    def due(self, serial: int, surface: EncodedSurface, marks: Collection[Mark]) -> list[bytes]:
        """Return the message that replaces all marks over *surface* by *marks*, if it does."""
        arrays: list[NDArray[np.float32]] = []
        heads: list[NDArray[np.float32]] = []
        kept: dict[int, NDArray[np.float32]] = {}
        for mark in marks:
            points = mark.sent_points(surface)
            known = {**self._points, **kept}
            number = next((n for n, old in known.items() if np.array_equal(old, points)), None)
            is_new = number is None
            if number is None:
                self._last = number = self._last + 1
            kept[number] = points
            heads.append(mark.head(surface, number))
            arrays += [heads[-1], points.ravel()] if is_new else [heads[-1]]
        self._points = kept
        before, self._heads = self._heads, b"".join(head.tobytes() for head in heads)
        return [message(Kind.MARKS, serial, *arrays)] if self._heads != before else []


def marks_of(view: Any, body: Collection[Any]) -> list[Mark]:
    """Return the visible actors of *view* other than those of the *body*, as marks.

    Parameters
    ----------
    view : View
        Its renderer and its foreground are searched.
    body : collection of vtkActor
        Left out.
    """
    marks: list[Mark] = []
    for renderer in (view.renderer, view.foreground):
        for actor in renderer.GetActors():
            if actor.GetVisibility() and all(actor is not other for other in body):
                marks += _marks(actor, is_above=renderer is view.foreground)
    return marks


def _marks(actor: Any, *, is_above: bool) -> Iterator[Mark]:
    mapper, style = actor.GetMapper(), actor.GetProperty()
    mapper.Update()
    data = mapper.GetInput()
    if data is None or not data.GetNumberOfPoints():
        return
    points = vtk_to_numpy(data.GetPoints().GetData())
    placed = matrix_of(actor.GetMatrix())
    matrix = None if np.array_equal(placed, np.eye(4)) else placed
    colour = np.array([*style.GetDiffuseColor(), style.GetOpacity()])
    plane, shows_backs = _EVERYWHERE, bool(style.GetFrontfaceCulling())
    for clipping in mapper.GetClippingPlanes() or ():  # one at most
        normal = np.array(clipping.GetNormal())
        plane = np.append(normal, -normal @ clipping.GetOrigin())
    triangles = _corners(Shape.TRIANGLES, data.GetPolys()), _strip_corners(data.GetStrips())
    pieces = (
        (Shape.POINTS, _corners(Shape.POINTS, data.GetVerts()), style.GetPointSize()),
        (Shape.LINES, _corners(Shape.LINES, data.GetLines()), style.GetLineWidth()),
        (Shape.TRIANGLES, np.concatenate(triangles), 1.0),
    )
    for shape, corners, size in pieces:
        if len(corners):
            backs = shows_backs and shape is Shape.TRIANGLES
            yield Mark(shape, points[corners], colour, size, is_above, matrix, backs, plane)


def _strip_corners(cells: Any) -> IntArray:
    """Return the points of the triangles of strips, every other one turned."""
    offsets = vtk_to_numpy(cells.GetOffsetsArray()) if cells.GetNumberOfCells() else ()
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    pieces = [np.empty(0, dtype=np.int64)]
    for start, end in pairwise(offsets):
        strip = corners[start:end]
        triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        triangles[1::2] = triangles[1::2, ::-1]
        pieces.append(triangles.ravel())
    return np.concatenate(pieces)


def _corners(shape: Shape, cells: Any) -> IntArray:
    """Return the points of the pieces of *cells*, polylines and polygons taken apart."""
    if not cells.GetNumberOfCells():
        return np.empty(0, dtype=np.int64)
    offsets = vtk_to_numpy(cells.GetOffsetsArray())
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    if shape is Shape.POINTS:
        return np.asarray(corners)
    last = np.zeros(len(corners), dtype=bool)
    last[offsets[1:] - 1] = True
    first = np.repeat(corners[offsets[:-1]], np.diff(offsets))
    here, after = corners[:-1][~last[:-1]], corners[1:][~last[:-1]]
    if shape is Shape.LINES:
        return np.asarray(np.stack([here, after], axis=1).ravel())
    apex = first[:-1][~last[:-1]]
    fan = np.stack([apex, here, after], axis=1)
    return np.asarray(fan[apex != here].ravel())
