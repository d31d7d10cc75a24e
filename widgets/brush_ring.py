"""The size of a brush, as a ring that lies on the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.palette import INK, rgb

from .view import View

_CORNERS = 64
_ANGLE = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
_RIM, _LINE = 5.0, 2.5  # pixels


class BrushRing:
    """A circle in front of everything; nothing until `draw`.

    Parameters
    ----------
    view : View
        Where the brush is used.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._ring = vtkPolyData()
        cells = vtkCellArray()
        cells.InsertNextCell(_CORNERS + 1)
        for k in [*range(_CORNERS), 0]:
            cells.InsertCellPoint(k)
        self._ring.SetLines(cells)
        self._actors = [self._actor(width) for width in (_RIM, _LINE)]

    def draw(
        self, middle: FloatArray, normal: FloatArray, radius: float, colour: NDArray[np.uint8]
    ) -> None:
        """Draw the circle about *middle* (3,) across *normal* (3,), in a *colour* of 0 to 255."""
        across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        across /= np.linalg.norm(across)
        along = np.cross(normal, across)
        circle = np.outer(np.cos(_ANGLE), across) + np.outer(np.sin(_ANGLE), along)
        points = vtkPoints()
        points.SetData(numpy_to_vtk(middle + radius * circle, deep=True))
        self._ring.SetPoints(points)
        for actor, shade in zip(self._actors, (rgb(INK), colour), strict=True):
            actor.GetProperty().SetColor(*(shade / 255.0))
            actor.VisibilityOn()
        self._view.touch()

    def hide(self) -> None:
        """Show nothing."""
        if self._actors[0].GetVisibility():
            for actor in self._actors:
                actor.VisibilityOff()
            self._view.touch()

    def remove(self) -> None:
        """Take the ring out of the view, for good."""
        for actor in self._actors:
            self._view.front.RemoveActor(actor)

    def _actor(self, width: float) -> vtkActor:
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._ring)
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        actor.GetProperty().SetLineWidth(width)
        actor.PickableOff()
        actor.VisibilityOff()
        self._view.front.AddActor(actor)
        return actor
