"""The point under the pointer: within a few pixels and not hidden by the mesh.

Of several points the nearest to the pointer is picked, with a penalty for points farther from the
camera.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray

from ..picking import may_overlap
from ..scene import Pointer, Projection

_PICK_RADIUS = 8.0  # pixels
_DEPTH_PENALTY = 0.1  # pixels of distance for each pixel of additional depth


def vertex_at_pointer(
    projection: Projection,
    pointer: Pointer,
    points: FloatArray,
    *,
    occluder: tuple[FloatArray, IntArray] | None = None,
) -> int | None:
    """Return the index of the point under *pointer*, or None.

    Parameters
    ----------
    projection : Projection
        The projection of the view.
    pointer : Pointer
        The position in the display.
    points : (k, 3) float
        In world coordinates.
    occluder : ((n, 3) float, (m, 3) int), optional
        Vertices and triangles that hide the points behind them.
    """
    distance = np.linalg.norm(projection.to_display(points)[:, :2] - pointer.position, axis=1)
    near = np.flatnonzero(distance <= _PICK_RADIUS)  # excludes NaN: points behind the camera
    if not len(near):
        return None
    depth = (points[near] - projection.camera.GetPosition()) @ projection.view_direction
    behind = (depth - depth.min()) / projection.pixel_at(points[near[depth.argmin()]])
    order = near[np.argsort(distance[near] + _DEPTH_PENALTY * behind)]
    if occluder is None:
        return int(order[0])
    vertices = projection.to_display(occluder[0])
    for k in order:
        if not _is_hidden(projection.to_display(points[k : k + 1])[0], vertices, occluder[1]):
            return int(k)
    return None


def _is_hidden(point: FloatArray, vertices: FloatArray, faces: IntArray) -> bool:
    """Return whether a triangle is in front of *point*, all in display coordinates."""
    near = faces[may_overlap(vertices[:, :2], faces, point[:2], point[:2])]
    a, b, c = (vertices[corner] - point for corner in near.T)
    # Twice the signed areas of the triangles formed by the point and each side.
    u, v, w = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b)))
    around = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    u, v, w, a, b, c = (part[around] for part in (u, v, w, a, b, c))
    # Depth is linear over a triangle in display coordinates; negative means nearer than the point.
    return bool(((u * a[:, 2] + v * b[:, 2] + w * c[:, 2]) * (u + v + w) < 0.0).any())
