"""An off-screen window with the mesh of a session, for films.

Fixed vertices are grey and handles red.  As in the package's pictures, the projection is parallel,
and the camera looks along the shortest extent of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import BODY, FIXED, HANDLE, PAPER, require_offscreen, rgb, view_of
from vtk_segdeform.session import Session

from ..scene import SurfaceDisplay, View

_MARGIN = 1.15  # of the view, as a bent mesh may reach beyond its handles
_SAMPLES = 8  # per pixel, for smooth edges


class OffScreen:
    """An off-screen view of a session, as a context manager.

    Parameters
    ----------
    session : Session
        The session whose current pose is shown.
    size : (width, height)
        In pixels.
    in_view : sequence of (k, 3) float
        Points besides the mesh that must be in view.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering is unavailable.
    """

    def __init__(
        self, session: Session, size: tuple[int, int], *, in_view: Sequence[FloatArray] = ()
    ) -> None:
        require_offscreen()
        self._window = vtkRenderWindow()
        self._window.SetOffScreenRendering(True)
        self._window.SetMultiSamples(_SAMPLES)
        self._window.SetSize(*size)
        renderer = vtkRenderer()
        renderer.SetBackground(*(rgb(PAPER) / 255.0))
        self._window.AddRenderer(renderer)
        interactor = vtkGenericRenderWindowInteractor()
        interactor.SetRenderWindow(self._window)
        interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        self.view = View(renderer, interactor)
        self.surface = SurfaceDisplay(self.view, session)
        self.surface.set_colours("film", _colours(session))
        rest = session.mesh.vertices
        points = np.concatenate([rest, session.vertices, *in_view])
        self._place_camera(view_of(rest, session.vertices), points)

    def __enter__(self) -> OffScreen:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.surface.remove()
        self._window.Finalize()

    def _place_camera(self, axes: FloatArray, points: FloatArray) -> None:
        """Fit all *points* into the view; the rows of *axes* point right, up and to the camera."""
        aligned = points @ axes.T
        low, high = aligned.min(axis=0), aligned.max(axis=0)
        width, height, _ = np.maximum(high - low, 1e-9 * np.ptp(aligned))
        columns, rows = self._window.GetSize()
        centre = 0.5 * (low + high) @ axes
        camera = self.view.camera
        camera.SetFocalPoint(*centre)
        camera.SetPosition(*(centre + 3.0 * np.linalg.norm(high - low) * axes[2]))
        camera.SetViewUp(*axes[1])
        camera.ParallelProjectionOn()
        camera.SetParallelScale(0.5 * _MARGIN * max(height, width * rows / columns))
        self.view.before_render(self.view.renderer.ResetCameraClippingRange)


def _colours(session: Session) -> NDArray[np.uint8]:
    """Return the (n, 3) colours of the vertices."""
    colours = np.tile(rgb(BODY), (session.mesh.n_vertices, 1))
    colours[session.fixed] = rgb(FIXED)
    for vertices in session.handles.values():
        colours[vertices] = rgb(HANDLE)
    return colours
