"""Projection between world and display coordinates.

world       the coordinates of the mesh
display     (x, y) pixels from the window's lower left corner, and a depth in 0..1
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from vtk_segdeform.arrays import FloatArray

from .gestures import Pointer


class Projection:
    """The projection of a renderer's current camera.

    Parameters
    ----------
    renderer : vtkRenderer
        Must be in a window; its camera may change at any time.
    """

    def __init__(self, renderer: Any) -> None:
        self.renderer = renderer

    @property
    def camera(self) -> Any:
        """The vtkCamera in use."""
        return self.renderer.GetActiveCamera()

    def to_display(self, points: FloatArray) -> FloatArray:
        """Return (k, 3) display coordinates of (k, 3) world *points*; NaN behind the camera."""
        projection = self._projection(self.camera)
        homogeneous = points @ projection[:, :3].T
        homogeneous += projection[:, 3]
        w = homogeneous[:, 3:]
        if len(w) and w.min() > 0.0:
            display = homogeneous[:, :3] / w
        else:
            undefined = np.full((len(w), 3), np.nan)
            display = np.divide(homogeneous[:, :3], w, out=undefined, where=w > 0.0)
        display *= 0.5 * self._extent()
        display += self._origin() + 0.5 * self._extent()
        return np.asarray(display)

    def to_world(self, display: FloatArray) -> FloatArray:
        """Return (k, 3) world points of (k, 3) *display* coordinates.

        NaN where the camera's matrix cannot be inverted.
        """
        return self._unprojected(display, self.camera)

    def _unprojected(self, display: FloatArray, camera: Any) -> FloatArray:
        """Return (k, 3) world points of (k, 3) *display* coordinates in the picture of *camera*."""
        clip = 2.0 * (np.asarray(display) - self._origin()) / self._extent() - 1.0
        try:
            inverse = np.linalg.inv(self._projection(camera))
        except np.linalg.LinAlgError:  # zoomed in or out beyond floating point
            return np.full(clip.shape, np.nan)
        homogeneous = np.column_stack([clip, np.ones(len(clip))]) @ inverse.T
        return np.asarray(homogeneous[:, :3] / homogeneous[:, 3:])

    def ray(self, pointer: Pointer) -> tuple[FloatArray, FloatArray]:
        """Return the points (3,) where the line of sight enters and leaves the view frustum."""
        ends = self.to_world(np.array([[*pointer.position, 0.0], [*pointer.position, 1.0]]))
        return ends[0], ends[1]

    def line_of_sight(self, pointer: Pointer) -> tuple[FloatArray, FloatArray]:
        """Return a point (3,) of the line of sight, and its direction, of length 1.

        Unlike those of `ray` they do not depend on the clipping range, not even in the last digit.
        VTK sets that range at every frame, and other hosts draw other frames of the same input.
        """
        camera = vtkCamera()
        camera.DeepCopy(self.camera)
        distance = camera.GetDistance()
        camera.SetClippingRange(0.5 * distance, 1.5 * distance)
        ends = np.array([[*pointer.position, 0.0], [*pointer.position, 1.0]])
        near, far = self._unprojected(ends, camera)
        eye = near if camera.GetParallelProjection() else np.array(camera.GetPosition())
        return eye, np.asarray((far - near) / np.linalg.norm(far - near))

    def pixel_at(self, point: FloatArray) -> float:
        """Return the length of one pixel at a world *point* (3,), in the mesh's unit."""
        if self.camera.GetParallelProjection():
            return float(2.0 * self.camera.GetParallelScale() / self._extent()[1])
        away = (np.asarray(point) - self.camera.GetPosition()) @ self.view_direction
        half = np.tan(0.5 * np.radians(self.camera.GetViewAngle()))
        return float(2.0 * max(away, 1e-12) * half / self._extent()[1])

    def lifted(self, points: FloatArray, pixels: float) -> FloatArray:
        """Return *points* (k, 3) moved towards the camera, to where they look the same."""
        camera, direction = self.camera, self.view_direction
        if camera.GetParallelProjection():
            step = 2.0 * camera.GetParallelScale() / self._extent()[1]
            return np.asarray(points - pixels * step * direction)
        to_eye = np.asarray(camera.GetPosition() - points)
        depth = np.maximum(-(to_eye @ direction), 1e-12)
        half = np.tan(0.5 * np.radians(camera.GetViewAngle()))
        step = 2.0 * depth * half / self._extent()[1]
        away = np.maximum(np.linalg.norm(to_eye, axis=1), 1e-300)
        return np.asarray(points + (pixels * step / away)[:, None] * to_eye)

    @property
    def scale(self) -> float:
        """The size of marks, relative to a view 600 pixels high."""
        return float(np.clip(self.renderer.GetSize()[1] / 600.0, 0.8, 3.0))

    @property
    def view_direction(self) -> FloatArray:
        """(3,) float: the viewing direction of the camera, of length 1."""
        return np.array(self.camera.GetDirectionOfProjection())

    def contains(self, pointer: Pointer) -> bool:
        """Return whether *pointer* is within this renderer's viewport."""
        inside = (pointer.position - self._origin()[:2]) / self._extent()[:2]
        return bool(((inside >= 0.0) & (inside <= 1.0)).all())

    def _projection(self, camera: Any) -> FloatArray:
        matrix = camera.GetCompositeProjectionTransformMatrix(
            self.renderer.GetTiledAspectRatio(), -1, 1
        )
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])

    def _origin(self) -> FloatArray:
        return np.array([*self.renderer.GetOrigin(), 0.0])

    def _extent(self) -> FloatArray:
        return np.maximum([*self.renderer.GetSize(), 1.0], 1.0)
