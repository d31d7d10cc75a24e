"""Camera, light, material and marks of a VTK renderer, as numbers for a page.

A mark is everything else that is drawn over the body: rings, pins, gizmos, cages.  Each actor
becomes up to three marks, its points, its lines and its triangles, in one colour and without light.
Text and other two-dimensional actors are not among them.
"""

from __future__ import annotations

import enum
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform.arrays import FloatArray, IntArray

from ...scene import TURN
from .encoding import EncodedSurface
from .messages import Kind, message


@dataclass(frozen=True)
class Look:
    """How a body is seen.

    Parameters
    ----------
    view, projection : (4, 4) float
        From the scene to the camera, and from there to the clip space of OpenGL.
    axis, pivot : (3,) float
        The axis about which the camera orbits, of length 1, and a point of it, in the scene.
    colour : (3,) float
        Of the body, 0 to 1.
    ambient, diffuse : float
        Shares of ambient and of diffuse light.
    lights : (k, 6) float
        For each light its direction from the body, in the camera's coordinates and of length 1,
        and the strengths of its red, green and blue.
    """

    view: FloatArray
    projection: FloatArray
    axis: FloatArray
    pivot: FloatArray
    colour: FloatArray
    ambient: float
    diffuse: float
    lights: FloatArray

    def message(self, serial: int, surface: EncodedSurface) -> bytes:
        """Return the message of this look at *surface*."""
        to_scene = np.diag([surface.scale] * 3 + [1.0])
        to_scene[:3, 3] = surface.centre
        projection = self.projection.copy()
        projection[2] = 0.0  # the page chooses its own range of depths
        numbers: list[ArrayLike] = [
            (self.view @ to_scene).T.ravel(),
            projection.T.ravel(),
            self.axis,
            (self.pivot - surface.centre) / surface.scale,
            self.colour,
            [self.ambient, self.diffuse, TURN],
            self.lights.ravel(),
        ]
        return message(
            Kind.LOOK,
            serial,
            np.concatenate([np.asarray(each) for each in numbers]).astype(np.float32),
        )


def look_of(renderer: Any, material: Any, axis: FloatArray, pivot: FloatArray) -> Look:
    """Return how *renderer* shows a body.

    Parameters
    ----------
    renderer : vtkRenderer
        In a window.
    material : vtkProperty
        Of the body.
    axis, pivot : (3,) float
        As in `Look`.
    """
    camera = renderer.GetActiveCamera()
    view = _array(camera.GetViewTransformMatrix())
    aspect = renderer.GetTiledAspectRatio()
    projection = _array(camera.GetProjectionTransformMatrix(aspect, -1, 1))
    lights = [_light(light, view) for light in renderer.GetLights() if light.GetSwitch()]
    return Look(
        view,
        projection,
        np.asarray(axis, dtype=float),
        np.asarray(pivot, dtype=float),
        np.array(material.GetDiffuseColor()),
        material.GetAmbient(),
        material.GetDiffuse(),
        np.array(lights).reshape(-1, 6),
    )


def _light(light: Any, view: FloatArray) -> FloatArray:
    if light.LightTypeIsHeadlight():
        away = np.array([0.0, 0.0, 1.0])
    else:
        away = np.subtract(light.GetPosition(), light.GetFocalPoint())
        if not light.LightTypeIsCameraLight():
            away = view[:3, :3] @ away
    strength = light.GetIntensity() * np.array(light.GetDiffuseColor())
    return np.concatenate([away / np.linalg.norm(away), strength])


def _array(matrix: Any) -> FloatArray:
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


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
        In the scene; one, two or three for each piece.
    colour : (4,) float
        Red, green, blue and opacity, 0 to 1.
    size : float
        Of points and lines, in pixels.
    is_above : bool
        Whether the body does not hide it.
    """

    shape: Shape
    points: FloatArray
    colour: FloatArray
    size: float
    is_above: bool

    def numbers(self, surface: EncodedSurface) -> NDArray[np.float32]:
        """Return the mark in the message of *surface*: eight numbers, and its points."""
        head = [self.shape, self.is_above, *self.colour, self.size, len(self.points)]
        points = (self.points - surface.centre) / surface.scale
        return np.concatenate([head, points.ravel()]).astype(np.float32)


def marks_message(serial: int, surface: EncodedSurface, marks: Collection[Mark]) -> bytes:
    """Return the message that replaces all marks over *surface* by *marks*."""
    return message(Kind.MARKS, serial, *(mark.numbers(surface) for mark in marks))


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
                marks += _marks(actor, view.camera, is_above=renderer is view.foreground)
    return marks


def _marks(actor: Any, camera: Any, *, is_above: bool) -> Iterator[Mark]:
    mapper, style = actor.GetMapper(), actor.GetProperty()
    mapper.Update()
    data = mapper.GetInput()
    if data is None or not data.GetNumberOfPoints():
        return
    matrix = _array(actor.GetMatrix())
    points = vtk_to_numpy(data.GetPoints().GetData()) @ matrix[:3, :3].T + matrix[:3, 3]
    colour = np.array([*style.GetDiffuseColor(), style.GetOpacity()])
    eye = None
    if style.GetFrontfaceCulling():  # the outline of a solid, which must not hide that
        eye = np.array([*camera.GetDirectionOfProjection(), 0.0])
        if not camera.GetParallelProjection():
            eye = np.array([*camera.GetPosition(), 1.0])
    pieces = (
        (Shape.POINTS, _corners(Shape.POINTS, data.GetVerts()), style.GetPointSize()),
        (Shape.LINES, _corners(Shape.LINES, data.GetLines()), style.GetLineWidth()),
        (
            Shape.TRIANGLES,
            np.concatenate(
                [_corners(Shape.TRIANGLES, data.GetPolys()), _strip_corners(data.GetStrips())]
            ),
            1.0,
        ),
    )
    for shape, corners, size in pieces:
        if shape is Shape.TRIANGLES and eye is not None:
            corners = corners[np.repeat(_face_away(points[corners], eye), shape)]
        for plane in mapper.GetClippingPlanes() or ():
            normal, origin = np.array(plane.GetNormal()), np.array(plane.GetOrigin())
            middles = points[corners].reshape(-1, shape, 3).mean(axis=1)
            corners = corners[np.repeat((middles - origin) @ normal >= 0.0, shape)]
        if len(corners):
            yield Mark(shape, points[corners], colour, size, is_above)


def _face_away(corners: FloatArray, eye: FloatArray) -> NDArray[np.bool_]:
    """Return which triangles, three *corners* (3 k, 3) each, show their backs to *eye* (4,).

    It is homogeneous: a place, or a direction of sight with a last number of 0.
    """
    a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
    sight = a - eye[:3] if eye[3] else eye[:3]
    return np.asarray((np.cross(b - a, c - a) * sight).sum(axis=1) > 0.0)


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
