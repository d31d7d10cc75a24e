"""The moving picture at the top of the README: one pull.

    make drag-film      writes docs/pictures/drag.gif

Mouse events drive the widget.  The pointer follows a closed curve, so the film loops almost without
a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

import vtk_segdeform as sd
from making.made import DOCS
from vtk_segdeform.widgets import View, film
from vtk_segdeform.widgets.puller import Puller

FILE = DOCS / "pictures" / "drag.gif"
SIZE = (460, 380)  # pixels
CAMERA = [(0.35, -3.0, 0.75), (0.02, 0.0, 0.5), (0.0, 0.0, 1.0)]
N_FRAMES = 57
WIDE, HIGH = 0.1, 0.06  # of the curve
ARROW = [[0, 0], [0, -17], [4, -13.5], [6.5, -19], [9, -18], [6.5, -12.5], [11.5, -12]]  # pixels


def main() -> None:
    """Draw the film."""
    session = sd.Session(sd.models.cactus())
    session.accept(session.preparation())
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    view = View.of(plotter)
    puller = Puller(view, session)
    puller.On()
    plotter.camera_position = CAMERA
    plotter.camera.view_angle = 22.0
    plotter.show(interactive=False, auto_close=False)
    film(FILE, view, frames(plotter, view, end_of_arm(session.mesh)), fps=25)
    puller.Off()  # finishes the drag
    plotter.close()


def end_of_arm(mesh: sd.Mesh) -> Any:
    """Return a point of the surface near the end of an arm, in front of the camera."""
    x = mesh.vertices
    arm = np.flatnonzero(x[:, 0] > x[:, 0].max() - 0.08)
    end = arm[x[arm, 2] > x[arm, 2].max() - 0.04]
    return x[end[np.argmin(x[end, 1])]]


def frames(plotter: pv.Plotter, view: View, start: Any) -> Iterator[Callable[[], None]]:
    """Yield for each frame the function that plays its events."""
    arrow = add_arrow(plotter)
    angles = np.linspace(0.0, 2.0 * np.pi, N_FRAMES, endpoint=False)
    shift = [WIDE * (1.0 - np.cos(angles)), 0.0 * angles, HIGH * np.sin(angles)]
    path = start + np.stack(shift, axis=1)
    for k, place in enumerate(view.to_display(path)[:, :2].round()):

        def play(place: Any = place, first: bool = k == 0) -> None:
            press = ["LeftButtonPressEvent"] if first else []
            arrow.SetPosition(*place)
            view.interactor.SetEventPosition(*map(int, place))
            for name in ("MouseMoveEvent", *press, *["TimerEvent"] * 8):
                view.interactor.InvokeEvent(name)

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
