"""The outline of a lasso or a rectangle: dark with a light rim, visible on any background."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import INK, PAPER, rgb

from ..scene import View, cells_of, points_of

_WIDTHS = ((PAPER, 4.0), (INK, 1.5))  # pixels


class Outline:
    """A closed line in the display; invisible until `draw`."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._line = vtkPolyData()
        self._actors = []
        for colour, _ in _WIDTHS:
            mapper = vtkPolyDataMapper2D()
            mapper.SetInputData(self._line)
            actor = vtkActor2D()
            actor.SetMapper(mapper)
            actor.GetProperty().SetColor(*(rgb(colour) / 255.0))
            actor.VisibilityOff()
            view.renderer.AddViewProp(actor)
            self._actors.append(actor)

    def draw(self, corners: FloatArray) -> None:
        """Draw the closed line through *corners* (k, 2), pixels of the window."""
        origin = np.array(self._view.renderer.GetOrigin(), dtype=float)
        positions = np.column_stack([corners - origin, np.zeros(len(corners))])
        for actor, (_, width) in zip(self._actors, _WIDTHS, strict=True):
            actor.GetProperty().SetLineWidth(self._view.scale * width)
        self._line.SetPoints(points_of(positions))
        self._line.SetLines(cells_of(np.append(np.arange(len(corners)), 0)[None]))
        self._show(True)

    def hide(self) -> None:
        """Hide the line."""
        self._show(False)

    def remove(self) -> None:
        """Remove the line from the view permanently."""
        for actor in self._actors:
            self._view.renderer.RemoveViewProp(actor)

    def _show(self, visible: bool) -> None:
        for actor in self._actors:
            actor.SetVisibility(visible)
        self._view.request_render()
