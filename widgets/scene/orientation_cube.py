"""A cube in the upper right corner of a view that shows the directions of the model.

Drag it to orbit.  Click a face for the view from there, an edge or a corner for the view between.
Faces are named after the up axis: Front, Right, Top and so on.

The cube has a renderer of its own above that of the view, which copies the camera's direction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersSources import vtkCubeSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer
from vtkmodules.vtkRenderingFreeType import vtkVectorText

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import INK, rgb

from .foreground import layer_above
from .gestures import Phase, Pointer
from .navigation import Navigation
from .projection import Projection
from .view import Stop, View
from .viewpoint import Viewpoint

Rectangle: TypeAlias = tuple[float, float, float, float]
_ABOVE_WIDGETS = 1.5  # priority: our widgets have 1
_SIZE, _SMALLEST_VIEW = 84.0, 240  # pixels
_SHARE = 0.22  # of a small view, at most
_MARGIN = 10.0  # pixels, to the corner of the view
_REACH = 0.9  # half the height of its view; a corner of the cube is at 0.87
_EDGE = 0.32  # from the centre of a face to where an edge begins; the edge itself is at 0.5
_CLICK = 4.0  # pixels; a press that moves more is a drag
_FACE, _LINE = "#E9E7E2", INK
_NAMES = "front", "back", "right", "left", "top", "bottom"
_LETTERS, _ABOVE_FACE = 0.13, 0.502  # size, and distance from the middle of the cube


class OrientationCube:
    """The cube of a view; hidden until `show`.

    Parameters
    ----------
    view : View
        The view to show it in.
    navigation : Navigation
        Moves the camera of the view.
    is_covered : callable, optional
        Returns whether something else is in a rectangle at present: left, bottom, right, top.
    """

    def __init__(
        self,
        view: View,
        navigation: Navigation,
        is_covered: Callable[[Rectangle], bool] = lambda _: False,
    ) -> None:
        self.view, self._navigation, self._is_covered = view, navigation, is_covered
        self._renderer: vtkRenderer | None = None
        self._cube, self._labels = _cube(), [_Label(name) for name in _NAMES]
        self._labelled: tuple[float, ...] = ()  # the up axis
        self._press: Pointer | None = None
        self._stops: list[Stop] = []

    @property
    def is_shown(self) -> bool:
        """Whether it is shown."""
        return self._renderer is not None

    def show(self) -> None:
        """Show it."""
        if self._renderer is not None:
            return
        self._renderer = vtkRenderer()
        self._renderer.InteractiveOff()
        camera = self._renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetParallelScale(_REACH)
        for actor in (self._cube, *(label.actor for label in self._labels)):
            self._renderer.AddActor(actor)
        layer_above(self.view.renderer, self._renderer)
        observe = self.view.observe
        self._stops = [
            self.view.before_render(self._follow),
            observe("LeftButtonPressEvent", self._pressed, _ABOVE_WIDGETS),
            observe("LeftButtonReleaseEvent", self._released, _ABOVE_WIDGETS),
        ]
        self.view.request_render()

    def hide(self) -> None:
        """Hide it and remove its renderer from the window."""
        if self._renderer is None:
            return
        for stop in self._stops:
            stop()
        self._stops, self._press = [], None
        self._renderer.RemoveAllViewProps()
        window = self._renderer.GetRenderWindow()
        if window is not None:
            window.RemoveRenderer(self._renderer)
        self._renderer = None
        self.view.request_render()

    @property
    def rectangle(self) -> Rectangle:
        """Left, bottom, right and top in pixels of the window.

        All 0 in a view too small for it, and while it is covered.
        """
        x, y = self.view.renderer.GetOrigin()
        width, height = self.view.renderer.GetSize()
        size = float(np.clip(_SIZE * height / 600.0, _SIZE, 2.0 * _SIZE))
        size = min(size, _SHARE * min(width, height))
        right, top = x + width - _MARGIN, y + height - _MARGIN
        place = right - size, top - size, right, top
        if min(width, height) < _SMALLEST_VIEW or self._is_covered(place):
            return 0.0, 0.0, 0.0, 0.0
        return place

    def direction_at(self, pointer: Pointer) -> FloatArray | None:
        """Return the direction (3,) of the face, edge or corner at *pointer*, or None beside it."""
        left, bottom, right, top = self.rectangle
        if self._renderer is None or not (
            left < right and left <= pointer.x <= right and bottom <= pointer.y <= top
        ):
            return None
        near, far = Projection(self._renderer).ray(pointer)
        step = far - near
        with np.errstate(divide="ignore", invalid="ignore"):
            slabs = np.sort([(-0.5 - near) / step, (0.5 - near) / step], axis=0)
        enter, leave = np.nanmax(slabs[0]), np.nanmin(slabs[1])
        if not enter <= leave:
            return None
        point = near + enter * step
        direction = np.where(np.abs(point) > _EDGE, np.sign(point), 0.0)
        return np.asarray(direction)

    # Events.

    def _pressed(self) -> bool:
        pointer = self.view.pointer(Phase.PRESS)
        self._press = None
        if pointer.alt or self.direction_at(pointer) is None:
            return False
        self._press = pointer
        self._navigation.orbit(pointer)
        return True

    def _released(self) -> bool:
        press, self._press = self._press, None
        if press is None:
            return False
        pointer = self.view.pointer(Phase.RELEASE)
        moved = float(np.linalg.norm(pointer.position - press.position))
        direction = self.direction_at(press)
        self._navigation.end_drag()
        if moved <= _CLICK and direction is not None:
            self._navigation.viewpoint.look_along(direction)
        return True

    # Drawing.

    def _follow(self) -> None:
        """Copy the direction of the view's camera, and lay out."""
        renderer = self._renderer
        if renderer is None:
            return
        left, bottom, right, top = self.rectangle
        renderer.SetDraw(left < right)
        if left >= right:
            return
        width, height = self.view.window.GetSize()
        renderer.SetViewport(left / width, bottom / height, right / width, top / height)
        camera, of_view = renderer.GetActiveCamera(), self.view.camera
        camera.SetFocalPoint(0.0, 0.0, 0.0)
        camera.SetPosition(*(-5.0 * self.view.view_direction))
        camera.SetViewUp(*of_view.GetViewUp())
        camera.SetClippingRange(1.0, 10.0)
        up = tuple(self._navigation.viewpoint.up)
        if up != self._labelled:
            self._labelled = up
            for label in self._labels:
                label.place(self._navigation.viewpoint)


class _Label:
    """The name of a view on a face of the cube, upright in that view."""

    def __init__(self, name: str) -> None:
        self.name, self.actor = name, vtkActor()
        text, mapper = vtkVectorText(), vtkPolyDataMapper()
        text.SetText(name.upper())
        text.Update()
        left, right, low, high, _, _ = text.GetOutput().GetBounds()
        self._middle = np.array([left + right, low + high, 0.0]) / 2.0
        mapper.SetInputConnection(text.GetOutputPort())
        self.actor.SetMapper(mapper)
        self._matrix = vtkMatrix4x4()
        self.actor.SetUserMatrix(self._matrix)
        self.actor.PickableOff()
        self.actor.GetProperty().SetColor(*(rgb(_LINE) / 255.0))
        self.actor.GetProperty().LightingOff()

    def place(self, viewpoint: Viewpoint) -> None:
        """Put it on its face; the cube's axes are those of the world nearest to the model's."""
        away, up = viewpoint.directions(self.name)
        away = _nearest_axis(away)
        up = _nearest_axis(np.where(away == 0.0, up, 0.0))
        axes = _LETTERS * np.stack([np.cross(up, away), up, away], axis=1)
        affine = np.column_stack([axes, _ABOVE_FACE * away - axes @ self._middle])
        self._matrix.DeepCopy([*affine.ravel(), 0.0, 0.0, 0.0, 1.0])


def _nearest_axis(direction: FloatArray) -> FloatArray:
    """Return the axis of the world, with its sign, that is nearest to *direction* (3,)."""
    axis, k = np.zeros(3), int(np.abs(direction).argmax())
    axis[k] = np.sign(direction[k])
    return axis


def _cube() -> vtkActor:
    source, mapper, cube = vtkCubeSource(), vtkPolyDataMapper(), vtkActor()
    mapper.SetInputConnection(source.GetOutputPort())
    cube.SetMapper(mapper)
    cube.PickableOff()
    style = cube.GetProperty()
    style.SetColor(*(rgb(_FACE) / 255.0))
    style.SetAmbient(0.7)
    style.SetDiffuse(0.3)
    style.SetEdgeVisibility(True)
    style.SetEdgeColor(*(rgb(_LINE) / 255.0))
    return cube
