"""Which of some points is under the pointer.

It has to be within a few pixels, and seen: not behind the body, and not behind another point
unless it is much nearer to the pointer.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray

from ..picking import touching
from ..scene import Pointer, Sight

_REACH = 8.0  # pixels
_BEHIND = 0.1  # pixels that each pixel further from the camera counts as


def under_pointer(
    sight: Sight,
    pointer: Pointer,
    points: FloatArray,
    *,
    body: tuple[FloatArray, IntArray] | None = None,
) -> int | None:
    """Return the number of the point that is under *pointer*, or None.

    Parameters
    ----------
    sight : Sight
        How the points are seen.
    pointer : Pointer
        Where it is.
    points : (k, 3) float
        In the world.
    body : ((n, 3) float, (m, 3) int), optional
        Vertices and triangles that hide what is behind them.  Looked at only where a point is
        near enough.
    """
    away = np.linalg.norm(sight.to_display(points)[:, :2] - pointer.position, axis=1)
    near = np.flatnonzero(away <= _REACH)  # NaN, behind the camera, is not
    if not len(near):
        return None
    depth = (points[near] - sight.camera.GetPosition()) @ sight.towards_scene
    behind = (depth - depth.min()) / sight.pixel_at(points[near[depth.argmin()]])
    order = near[np.argsort(away[near] + _BEHIND * behind)]
    if body is None:
        return int(order[0])
    seen = sight.to_display(body[0])
    for k in order:
        if not _is_hidden(sight.to_display(points[k : k + 1])[0], seen, body[1]):
            return int(k)
    return None


def _is_hidden(point: FloatArray, vertices: FloatArray, faces: IntArray) -> bool:
    """Tell whether a triangle is in front of *point*, all in display coordinates."""
    near = faces[touching(vertices[:, :2], faces, point[:2], point[:2])]
    a, b, c = (vertices[corner] - point for corner in near.T)
    # Twice the areas of the triangles that the point makes with each side.
    u, v, w = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b)))
    around = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    u, v, w, a, b, c = (part[around] for part in (u, v, w, a, b, c))
    # The depth of a triangle is linear as it is seen; below 0 it is nearer than the point.
    return bool(((u * a[:, 2] + v * b[:, 2] + w * c[:, 2]) * (u + v + w) < 0.0).any())
