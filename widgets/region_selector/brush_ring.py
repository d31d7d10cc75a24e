"""The radius of the brush as a ring on the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import INK, rgb

from ..scene import Draft, SurfaceDisplay, cells_of, points_of

_RIM_WIDTH, _LINE_WIDTH = 5.5, 2.5  # pixels
# Polygon offsets towards the camera.  By slope: half the width of the line must stay in front of a
# steep surface.  In units of depth: the rim is drawn over the surface, the line over the rim.
_SLOPE_OFFSET = 4.0
_UNIT_OFFSETS = (10.0, 40.0)
_LIFT = 6.0  # pixels towards the camera, so that the line is whole at the silhouette


class BrushRing:
    """The line of constant distance along the surface; invisible until `draw`."""

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._ring = vtkPolyData()
        self._draft = Draft.of(surface.view)
        self._actors = [self._actor(offset) for offset in _UNIT_OFFSETS]

    def draw(
        self, segments: FloatArray, colour: NDArray[np.uint8], *, thickness: float = 1.0
    ) -> None:
        """Draw the ring with a dark rim, visible on any background.

        Parameters
        ----------
        segments : (k, 2, 3) float
            From `Picker.ring`.
        colour : (3,) uint8
            Red, green and blue, 0 to 255.
        thickness : float
            Of the line, relative to that of a brush.
        """
        view = self._surface.view
        ends = view.lifted(segments.reshape(-1, 3), view.scale * _LIFT)
        self._ring.SetPoints(points_of(ends))
        self._ring.SetLines(cells_of(np.arange(len(ends)).reshape(-1, 2)))
        shades, widths = (rgb(INK), colour), (_RIM_WIDTH, _LINE_WIDTH)
        for actor, shade, width in zip(self._actors, shades, widths, strict=True):
            actor.GetProperty().SetColor(*(shade / 255.0))
            actor.GetProperty().SetLineWidth(view.scale * thickness * width)
        self._show(True)

    def hide(self) -> None:
        """Hide the ring."""
        if self._actors[0].GetVisibility():
            self._show(False)

    def remove(self) -> None:
        """Remove the ring from the view permanently."""
        self._draft.end()
        for actor in self._actors:
            self._surface.view.renderer.RemoveActor(actor)

    def _show(self, visible: bool) -> None:
        for actor in self._actors:
            actor.SetVisibility(visible)
        self._draft.begin(if_slow=True)
        self._surface.view.request_render()

    def _actor(self, offset: float) -> Any:
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._ring)
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-_SLOPE_OFFSET, -offset)
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        actor.PickableOff()
        actor.UseBoundsOff()  # the mesh has the same bounds
        actor.VisibilityOff()
        self._surface.view.renderer.AddActor(actor)
        return actor
