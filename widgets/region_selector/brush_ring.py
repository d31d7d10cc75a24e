"""How far a brush reaches, as a ring that lies on the surface, hidden where the surface is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.pictures import INK, rgb

from ..scene import SurfaceDisplay

_DESIGNED_FOR = 600  # pixels of height; lines are wider in a higher window
_RIM, _LINE = 5.5, 2.5  # pixels
_STEEP = 4.0  # pixels: half a line must not sink into a surface that rises beside it
_IN_FRONT = (10.0, 40.0)  # units of depth: the rim of the surface, and the line of its rim


class BrushRing:
    """The line on which some distance along the surface is reached; nothing until `draw`.

    Parameters
    ----------
    surface : SurfaceDisplay
        The mesh, n vertices.
    """

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._ring = vtkPolyData()
        self._actors = [self._actor(nearer) for nearer in _IN_FRONT]

    def draw(self, distance: FloatArray, radius: float, colour: NDArray[np.uint8]) -> None:
        """Draw the ring with a dark rim, seen on any ground.

        Parameters
        ----------
        distance : (n,) float
            Of each vertex, known for those within *radius* and their neighbours.
        radius : float
            In the mesh's unit.
        colour : (3,) uint8
            Red, green and blue, 0 to 255.
        """
        faces = self._surface.session.mesh.faces
        ends = contour(self._surface.points, faces, distance, radius).reshape(-1, 3)
        points, lines = vtkPoints(), vtkCellArray()
        points.SetData(numpy_to_vtk(ends, deep=True))
        lines.SetData(
            numpy_to_vtkIdTypeArray(np.arange(0, len(ends) + 1, 2, dtype=np.int64), deep=True),
            numpy_to_vtkIdTypeArray(np.arange(len(ends), dtype=np.int64), deep=True),
        )
        self._ring.SetPoints(points)
        self._ring.SetLines(lines)
        scale = np.clip(self._surface.view.renderer.GetSize()[1] / _DESIGNED_FOR, 0.7, 3.0)
        shades, widths = (rgb(INK), colour), (_RIM, _LINE)
        for actor, shade, width in zip(self._actors, shades, widths, strict=True):
            actor.GetProperty().SetColor(*(shade / 255.0))
            actor.GetProperty().SetLineWidth(float(scale * width))
        self._show(True)

    def hide(self) -> None:
        """Show nothing."""
        if self._actors[0].GetVisibility():
            self._show(False)

    def remove(self) -> None:
        """Take the ring out of the view, for good."""
        for actor in self._actors:
            self._surface.view.renderer.RemoveActor(actor)

    def _show(self, visible: bool) -> None:
        for actor in self._actors:
            actor.SetVisibility(visible)
        self._surface.view.touch()

    def _actor(self, nearer: float) -> Any:
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._ring)
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-_STEEP, -nearer)
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        actor.PickableOff()
        actor.UseBoundsOff()  # the mesh has them already
        actor.VisibilityOff()
        self._surface.view.renderer.AddActor(actor)
        return actor


def contour(vertices: FloatArray, faces: IntArray, values: FloatArray, level: float) -> FloatArray:
    """Return the pieces (k, 2, 3) of the line on which *values* (n,), linear between, are *level*.

    Each triangle with corners both up to *level* and above it has one of them.
    """
    below = values <= level
    a, b, c = (below[corner] for corner in faces.T)
    faces = faces[(a != b) | (b != c)]
    i, j = faces, faces[:, [1, 2, 0]]
    crossed = (values[i] <= level) != (values[j] <= level)  # two sides of each triangle
    i, j = i[crossed], j[crossed]
    share = (level - values[i]) / (values[j] - values[i])
    places = vertices[i] + share[:, None] * (vertices[j] - vertices[i])
    return np.asarray(places.reshape(-1, 2, 3))
