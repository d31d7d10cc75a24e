"""The points under the pointer, within a few pixels.

The nearest to the pointer comes first, with a penalty for points farther from the camera.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray

from ..scene import Pointer, Projection

_PICK_RADIUS = 8.0  # pixels
_DEPTH_PENALTY = 0.1  # pixels of distance for each pixel of additional depth


def points_at_pointer(projection: Projection, pointer: Pointer, points: FloatArray) -> IntArray:
    """Return the indices of those of *points* (k, 3) that are under *pointer*, the best first."""
    distance = np.linalg.norm(projection.to_display(points)[:, :2] - pointer.position, axis=1)
    near = np.flatnonzero(distance <= _PICK_RADIUS)  # excludes NaN: points behind the camera
    if not len(near):
        return near
    depth = (points[near] - projection.camera.GetPosition()) @ projection.view_direction
    behind = (depth - depth.min()) / projection.pixel_at(points[near[depth.argmin()]])
    return np.asarray(near[np.argsort(distance[near] + _DEPTH_PENALTY * behind)])
