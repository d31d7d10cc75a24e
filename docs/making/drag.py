"""The moving picture at the top of the README: a handle dragged to both sides.

    make drag-film      writes docs/pictures/drag.gif

Mouse events drive the widgets, as in `vtk_segdeform.widgets.replay`.  The pointer follows a closed
curve and a pose depends only on its targets, so the film loops without a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

import vtk_segdeform as sd
from making.made import DOCS
from vtk_segdeform.widgets import CageDisplay, HandleDragger, View, film, replay

FILE = DOCS / "pictures" / "drag.gif"
SIZE = (460, 380)  # pixels
CAMERA = [(0.35, -3.0, 0.75), (0.02, 0.0, 0.5), (0.0, 0.0, 1.0)]
N_FRAMES = 57  # odd: no frame returns to the start exactly, to be labelled 1e-16
SWING = 40.0  # degrees to each side
PIVOT = [0.0, 0.0, 0.3]
ARROW = [[0, 0], [0, -17], [4, -13.5], [6.5, -19], [9, -18], [6.5, -12.5], [11.5, -12]]  # pixels


def main() -> None:
    """Draw the film."""
    session = sd.Session(sd.models.cactus())
    height = session.mesh.vertices[:, 2]
    session.segment(3)
    session.fit_cages()
    session.set_fixed(height < 0.08)
    session.add_handle(height > 0.99, "tip")
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    view = View.of(plotter)
    dragger, cages = HandleDragger(view, session), CageDisplay(view, session)
    cages.opacity = 0.8
    dragger.On()
    plotter.camera_position = CAMERA
    plotter.camera.view_angle = 22.0
    plotter.show(interactive=False, auto_close=False)
    film(FILE, view, frames(plotter, view, dragger.gizmo.centre), fps=25)
    dragger.Off()  # finishes the drag
    plotter.close()


def frames(plotter: pv.Plotter, view: View, start: Any) -> Iterator[Callable[[], None]]:
    """Yield for each frame the function that plays its events."""
    arrow = add_arrow(plotter)
    angles = np.radians(SWING) * np.sin(np.linspace(0.0, 2.0 * np.pi, N_FRAMES, endpoint=False))
    arm = start[2] - PIVOT[2]
    path = PIVOT + arm * np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=1)
    for k, place in enumerate(view.to_display(path)[:, :2].round()):

        def play(place: Any = place, first: bool = k == 0) -> None:
            at = f"{place[0]:.0f} {place[1]:.0f}"
            press = [f"0.0 LeftButtonPress {at}"] if first else []
            lines = [f"0.0 MouseMove {at}", *press, "0.0 Timer 8"]
            arrow.SetPosition(*place)
            replay(plotter, ["vtk_segdeform recording 1", *lines])

        yield play


def add_arrow(plotter: pv.Plotter) -> vtkActor2D:
    """Add a mouse pointer, which an off-screen window does not have."""
    corners = np.column_stack([ARROW, np.zeros(len(ARROW))])
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(pv.PolyData(corners, faces=[len(ARROW), *range(len(ARROW))]).triangulate())
    arrow = vtkActor2D()
    arrow.SetMapper(mapper)
    arrow.GetProperty().SetColor(0.1, 0.1, 0.1)
    plotter.renderer.AddActor(arrow)
    return arrow


if __name__ == "__main__":
    main()
