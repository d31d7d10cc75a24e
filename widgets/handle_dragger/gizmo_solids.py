"""The parts of a gizmo as solids, each with an outline that separates it from the background.

The outline is a slightly thicker copy of the solid, of which only the back faces are drawn.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkTubeFilter
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import rgb

from ..scene import cells_of, points_of
from .gizmo_shapes import BALL, Kind, Part, line_of

_OUTLINE = 0.018  # thickness
_SHAFT, _BORDER, _RING, _OUTER_RING = 0.020, 0.014, 0.017, 0.013  # radii of tubes
_HEAD_LENGTH, _HEAD_RADIUS = 0.16, 0.065


class Solid:
    """The actors of one part."""

    def __init__(self, renderer: Any, part: Part) -> None:
        self._renderer = renderer
        self._matrix = vtkMatrix4x4()
        self._actors = []
        for thickness in (0.0, _OUTLINE):
            mapper, actor = vtkPolyDataMapper(), vtkActor()
            mapper.SetInputData(solid_of(part, outline=thickness))
            actor.SetMapper(mapper)
            actor.SetUserMatrix(self._matrix)
            actor.PickableOff()
            actor.GetProperty().LightingOff()
            actor.GetProperty().SetFrontfaceCulling(thickness > 0.0)
            renderer.AddActor(actor)
            self._actors.append(actor)

    def place(self, centre: FloatArray, axes: FloatArray) -> None:
        """Set the *centre* (3,) and the *axes* (3, 3), as rows whose length is the size."""
        affine = np.column_stack([axes.T, centre])
        self._matrix.DeepCopy([*affine.ravel(), 0.0, 0.0, 0.0, 1.0])

    def set_colours(self, colour: str, outline: str) -> None:
        """Set the colours of the solid and its outline, "#RRGGBB"."""
        for actor, each in zip(self._actors, (colour, outline), strict=True):
            actor.GetProperty().SetColor(*(rgb(each) / 255.0))

    def show(self, shown: bool) -> None:
        """Show or hide the part."""
        for actor in self._actors:
            actor.SetVisibility(shown)

    def clip(self, plane: Any | None) -> None:
        """Clip everything behind a vtkPlane; with None, show the whole solid."""
        for actor in self._actors:
            actor.GetMapper().RemoveAllClippingPlanes()
            if plane is not None:
                actor.GetMapper().AddClippingPlane(plane)

    def remove(self) -> None:
        """Remove the part from the renderer permanently."""
        for actor in self._actors:
            self._renderer.RemoveActor(actor)


@functools.cache
def solid_of(part: Part, *, outline: float = 0.0) -> Any:
    """Return a part as vtkPolyData, thicker by the thickness of an *outline*.

    It is made once and shared by all gizmos: do not modify it.
    """
    line = line_of(part)
    if part.kind is Kind.FREE:
        ball = vtkSphereSource()
        ball.SetRadius(BALL + outline)
        ball.SetThetaResolution(20)
        ball.SetPhiResolution(14)
        return _output(ball)
    if part.kind is Kind.AXIS:
        tip, axis = line[-1], np.eye(3)[part.axis]
        head = vtkConeSource()
        head.SetHeight(_HEAD_LENGTH + 3.0 * outline)
        head.SetRadius(_HEAD_RADIUS + 1.3 * outline)
        head.SetCenter(*(tip - 0.5 * (_HEAD_LENGTH - outline) * axis))
        head.SetDirection(*axis)
        head.SetResolution(24)
        shaft = np.stack([line[0], tip - 0.5 * _HEAD_LENGTH * axis])
        return _joined(_tube(shaft, _SHAFT + outline), _output(head))
    if part.kind is Kind.PLANE:
        border = _tube(line, _BORDER + outline)
        return border if outline else _joined(border, _cell(line[:-1], closed_area=True))
    return _tube(line, (_OUTER_RING if part.axis is None else _RING) + outline)


def _tube(line: FloatArray, radius: float) -> Any:
    tube = vtkTubeFilter()
    tube.SetInputData(_cell(line, closed_area=False))
    tube.SetRadius(radius)
    tube.SetNumberOfSides(10)
    tube.CappingOn()
    return _output(tube)


def _cell(points: FloatArray, *, closed_area: bool) -> Any:
    data, cell = vtkPolyData(), cells_of(np.arange(len(points))[None])
    data.SetPoints(points_of(points))
    (data.SetPolys if closed_area else data.SetLines)(cell)
    return data


def _joined(*pieces: Any) -> Any:
    join = vtkAppendPolyData()
    for piece in pieces:
        join.AddInputData(piece)
    return _output(join)


def _output(source: Any) -> Any:
    source.Update()
    return source.GetOutput()
