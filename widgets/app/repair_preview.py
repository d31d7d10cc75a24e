"""The view of a surface before and after its repair, with its holes outlined."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
import pyvistaqt

from vtk_segdeform.mesh import Mesh
from vtk_segdeform.mesh_repair import Repair
from vtk_segdeform.pictures import BODY, COLOURS, PAPER, rgb

from ..qt import close_view
from ..scene import Highlights, View

_NEW = COLOURS[0]  # of faces that fill holes


class Preview:
    """The view; call `close` before Qt deletes it.

    Parameters
    ----------
    given : pyvista.PolyData
        The surface before.
    mesh : Mesh
        The mesh of it, whose borders are outlined.
    camera : vtkCamera or None
        Where to look from at first.
    parent : QWidget
        The parent of the view.

    Attributes
    ----------
    plotter : pyvistaqt.QtInteractor
        The view.
    """

    def __init__(self, given: pv.PolyData, mesh: Mesh, camera: Any, parent: Any) -> None:
        self.plotter = pyvistaqt.QtInteractor(parent, auto_update=False, off_screen=False)
        self.plotter.setAcceptDrops(False)
        self.plotter.set_background(PAPER)
        self._mesh = mesh
        self._before = self._add(given, None)
        self._after: Any = None
        self._is_after = False
        self._marks = Highlights(View.of(self.plotter))
        self._outline()
        if camera is not None:
            mine = self.plotter.camera
            mine.SetPosition(*camera.GetPosition())
            mine.SetFocalPoint(*camera.GetFocalPoint())
            mine.SetViewUp(*camera.GetViewUp())
        self.plotter.reset_camera()

    def set_result(self, done: Repair) -> None:
        """Set the surface after the repair; the faces that fill holes have another colour."""
        if self._after is not None:
            self.plotter.remove_actor(self._after, reset_camera=False)
        colours = np.tile(rgb(BODY), (len(done.faces), 1))
        colours[done.face_map < 0] = rgb(_NEW)
        self._after = self._add(pv.PolyData.from_regular_faces(done.vertices, done.faces), colours)
        self.show_after(self._is_after)

    def show_after(self, is_after: bool) -> None:
        """Show the surface after or before the repair."""
        self._is_after = is_after
        self._before.visibility = not is_after
        if self._after is not None:
            self._after.visibility = is_after
        self._outline()
        self.plotter.render()

    def close(self) -> None:
        """Release the view."""
        self._marks.hide()
        self._marks.view.remove_foreground()
        close_view(self.plotter)

    def _outline(self) -> None:
        if self._is_after:
            self._marks.hide()
        else:
            none = np.empty(0, dtype=np.int64)
            self._marks.show(self._mesh.vertices, self._mesh.borders, none)

    def _add(self, surface: pv.PolyData, colours: Any) -> Any:
        return self.plotter.add_mesh(
            surface, color=BODY, scalars=colours, rgb=colours is not None, ambient=0.25,
            smooth_shading=False, reset_camera=False, show_scalar_bar=False,
        )  # fmt: skip
