"""An off-screen window with the mesh of a session, for films.

Fixed vertices are grey and handles red.  As in the package's pictures, the projection is parallel,
and the camera looks along the shortest extent of the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

from vtk_segdeform.arrays import FloatArray, bounds_of
from vtk_segdeform.pictures import BODY, FIXED, HANDLE, PAPER, require_offscreen, rgb, view_of
from vtk_segdeform.session import Session

from ..scene import SurfaceDisplay, View

_MARGIN = 1.15  # of the view, as a bent mesh may reach beyond its handles
_SAMPLES = 8  # per pixel, for smooth edges


@contextmanager
def off_screen(
    session: Session, size: tuple[int, int], *, in_view: Sequence[FloatArray] = ()
) -> Iterator[View]:
    """Show the current pose of *session* in a view of *size* (width, height) pixels, until left.

    Besides the mesh, the points *in_view*, each (k, 3), are inside the view.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering is unavailable.
    """
    require_offscreen()
    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(_SAMPLES)
    window.SetSize(*size)
    renderer.SetBackground(*(rgb(PAPER) / 255.0))
    window.AddRenderer(renderer)
    interactor = vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
    view = View(renderer, interactor)
    surface = SurfaceDisplay(view, session)
    surface.set_colours("film", _colours(session))
    rest = session.mesh.vertices
    points = np.concatenate([rest, session.vertices, *in_view])
    _place_camera(view, view_of(rest, session.vertices), points)
    try:
        yield view
    finally:
        surface.remove()
        window.Finalize()


def _place_camera(view: View, axes: FloatArray, points: FloatArray) -> None:
    """Fit all *points* into the view; the rows of *axes* point right, up and to the camera."""
    low, high = bounds_of(points @ axes.T)
    width, height, _ = np.maximum(high - low, 1e-9 * (high - low).max())
    columns, rows = view.window.GetSize()
    centre = 0.5 * (low + high) @ axes
    camera = view.camera
    camera.SetFocalPoint(*centre)
    camera.SetPosition(*(centre + 3.0 * np.linalg.norm(high - low) * axes[2]))
    camera.SetViewUp(*axes[1])
    camera.ParallelProjectionOn()
    camera.SetParallelScale(0.5 * _MARGIN * max(height, width * rows / columns))
    view.before_render(view.renderer.ResetCameraClippingRange)


def _colours(session: Session) -> NDArray[np.uint8]:
    """Return the (n, 3) colours of the vertices."""
    colours = np.tile(rgb(BODY), (session.mesh.n_vertices, 1))
    colours[session.fixed] = rgb(FIXED)
    for vertices in session.handles.values():
        colours[vertices] = rgb(HANDLE)
    return colours
