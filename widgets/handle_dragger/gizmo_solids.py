"""The parts of a gizmo as solids, each with an outline that sets it off from what is behind it.

The outline is the same solid, a little swollen, of which only the inside is drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkTubeFilter
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import rgb

from .gizmo_shapes import BALL, Part, Way, line_of

_OUTLINE = 0.018  # its thickness
_SHAFT, _BORDER, _RING, _OUTER_RING = 0.020, 0.014, 0.017, 0.013  # radii of tubes
_HEAD_LENGTH, _HEAD_RADIUS = 0.16, 0.065


class Solid:
    """One part, drawn.

    Parameters
    ----------
    renderer : vtkRenderer
        Where.
    part : Part
        Which.
    """

    def __init__(self, renderer: Any, part: Part) -> None:
        self._renderer = renderer
        self._matrix = vtkMatrix4x4()
        self._actors = []
        for swollen in (0.0, _OUTLINE):
            mapper, actor = vtkPolyDataMapper(), vtkActor()
            mapper.SetInputData(solid_of(part, swollen=swollen))
            actor.SetMapper(mapper)
            actor.SetUserMatrix(self._matrix)
            actor.PickableOff()
            actor.GetProperty().LightingOff()
            actor.GetProperty().SetFrontfaceCulling(swollen > 0.0)
            renderer.AddActor(actor)
            self._actors.append(actor)

    def place(self, centre: FloatArray, axes: FloatArray) -> None:
        """Be at *centre* (3,), with *axes* (3, 3) for x, y and z, as rows; their length counts."""
        affine = np.column_stack([axes.T, centre])
        self._matrix.DeepCopy([*affine.ravel(), 0.0, 0.0, 0.0, 1.0])

    def draw(self, colour: str, outline: str) -> None:
        """Have these colours, "#RRGGBB"."""
        for actor, its in zip(self._actors, (colour, outline), strict=True):
            actor.GetProperty().SetColor(*(rgb(its) / 255.0))

    def show(self, shown: bool) -> None:
        """Be seen or not."""
        for actor in self._actors:
            actor.SetVisibility(shown)

    def cut(self, plane: Any | None) -> None:
        """Lose what is behind a vtkPlane; or, with None, be whole."""
        for actor in self._actors:
            actor.GetMapper().RemoveAllClippingPlanes()
            if plane is not None:
                actor.GetMapper().AddClippingPlane(plane)

    def remove(self) -> None:
        """Go out of the renderer, for good."""
        for actor in self._actors:
            self._renderer.RemoveActor(actor)


def solid_of(part: Part, *, swollen: float = 0.0) -> Any:
    """Return a part as vtkPolyData; *swollen* is how much thicker than it is."""
    line = line_of(part)
    if part.way is Way.FREE:
        ball = vtkSphereSource()
        ball.SetRadius(BALL + swollen)
        ball.SetThetaResolution(20)
        ball.SetPhiResolution(14)
        return _output(ball)
    if part.way is Way.ALONG:
        tip, axis = line[-1], np.eye(3)[part.axis]
        head = vtkConeSource()
        head.SetHeight(_HEAD_LENGTH + 3.0 * swollen)
        head.SetRadius(_HEAD_RADIUS + 1.3 * swollen)
        head.SetCenter(*(tip - 0.5 * (_HEAD_LENGTH - swollen) * axis))
        head.SetDirection(*axis)
        head.SetResolution(24)
        shaft = np.stack([line[0], tip - 0.5 * _HEAD_LENGTH * axis])
        return _joined(_tube(shaft, _SHAFT + swollen), _output(head))
    if part.way is Way.WITHIN:
        border = _tube(line, _BORDER + swollen)
        return border if swollen else _joined(border, _cell(line[:-1], closed_area=True))
    return _tube(line, (_OUTER_RING if part.axis is None else _RING) + swollen)


def _tube(line: FloatArray, radius: float) -> Any:
    tube = vtkTubeFilter()
    tube.SetInputData(_cell(line, closed_area=False))
    tube.SetRadius(radius)
    tube.SetNumberOfSides(10)
    tube.CappingOn()
    return _output(tube)


def _cell(points: FloatArray, *, closed_area: bool) -> Any:
    places, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    cells.InsertNextCell(len(points), list(range(len(points))))
    data.SetPoints(places)
    (data.SetPolys if closed_area else data.SetLines)(cells)
    return data


def _joined(*pieces: Any) -> Any:
    join = vtkAppendPolyData()
    for piece in pieces:
        join.AddInputData(piece)
    return _output(join)


def _output(source: Any) -> Any:
    source.Update()
    return source.GetOutput()
