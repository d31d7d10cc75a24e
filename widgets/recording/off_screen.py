"""A window that nobody sees, with a session's mesh in it: what a film of a session is taken of.

Fixed vertices are grey and handles red.  The camera is that of the package's pictures: it looks
along the direction in which the model extends least, and projects in parallel.
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

_MARGIN = 1.15  # more than what has to be seen: a body bends out of the way of its handles
_SAMPLES = 8  # for smooth edges


class OffScreen:
    """An off-screen view of a session, to be used in a ``with``.

    Parameters
    ----------
    session : Session
        Its mesh is shown in its pose.
    size : (width, height)
        Pixels.
    room : sequence of (k, 3) float
        Places besides the mesh that the camera has to see.

    Raises
    ------
    MissingDependencyError
        If nothing can be rendered here.
    """

    def __init__(
        self, session: Session, size: tuple[int, int], *, room: Sequence[FloatArray] = ()
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
        self._look(view_of(rest, session.vertices), np.concatenate([rest, session.vertices, *room]))

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

    def _look(self, axes: FloatArray, points: FloatArray) -> None:
        """Let the camera see all *points*; *axes* are rows to the right, up and towards it."""
        seen = points @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        width, height, _ = np.maximum(high - low, 1e-9 * np.ptp(seen))
        across, along = self._window.GetSize()
        centre = 0.5 * (low + high) @ axes
        camera = self.view.camera
        camera.SetFocalPoint(*centre)
        camera.SetPosition(*(centre + 3.0 * np.linalg.norm(high - low) * axes[2]))
        camera.SetViewUp(*axes[1])
        camera.ParallelProjectionOn()
        camera.SetParallelScale(0.5 * _MARGIN * max(height, width * along / across))
        self.view.before_render(self.view.renderer.ResetCameraClippingRange)


def _colours(session: Session) -> NDArray[np.uint8]:
    """Return the (n, 3) colours of the vertices."""
    colours = np.tile(rgb(BODY), (session.mesh.n_vertices, 1))
    colours[session.fixed] = rgb(FIXED)
    for vertices in session.handles.values():
        colours[vertices] = rgb(HANDLE)
    return colours
