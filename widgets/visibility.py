"""Which vertices of a mesh are seen, and which are behind it or turn away.

The triangles are drawn into a depth image of our own: the window's holds wires, gizmos and
whatever else is in the scene, and front layers clear it.  A vertex is seen if a triangle at it
faces the camera, and nothing that was drawn around its pixel is nearer than it.  At the outline
of a body that is a pixel's worth of mercy.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray

_MOST = 512  # pixels of the image's longer side
_CHUNK = 2_000_000  # pixels drawn at a time
_SAME = 1e-7  # depths that count as equal


def visible_vertices(display: FloatArray, faces: IntArray) -> BoolArray:
    """Return (n,) bool: whether each vertex is seen.

    Parameters
    ----------
    display : (n, 3) float
        Where they are seen: x and y in pixels, and a depth that is larger further away; NaN for
        what is behind the camera.
    faces : (m, 3) int
        Anticlockwise as seen from outside.
    """
    seen = np.zeros(len(display), dtype=bool)
    faces = faces[np.isfinite(display[faces]).all(axis=(1, 2))]
    if not len(faces):
        return seen
    low, high = display[faces].min(axis=(0, 1)), display[faces].max(axis=(0, 1))
    scale = min(1.0, _MOST / max(float((high - low)[:2].max()), 1e-9))
    points = np.column_stack([(display[:, :2] - low[:2]) * scale, display[:, 2]])
    shape = tuple(np.ceil((high - low)[:2] * scale).astype(int) + 1)
    farthest = ndimage.maximum_filter(_depth_image(points, faces, shape), size=3)
    a, b, c = points[faces.T, :2]
    facing = _cross(b - a, c - a) > 0.0
    candidates = np.unique(faces[facing])
    x, y = points[candidates, :2].astype(int).T
    seen[candidates] = points[candidates, 2] <= farthest[x, y] + _SAME
    return seen


def _depth_image(points: FloatArray, faces: IntArray, shape: tuple[int, ...]) -> FloatArray:
    """Return the least depth at each pixel's middle, infinite where nothing is."""
    image = np.full(shape, np.inf)
    corners = points[faces]
    low = np.floor(corners[:, :, :2].min(axis=1)).astype(int)
    size = np.floor(corners[:, :, :2].max(axis=1)).astype(int) + 1 - low
    ends = np.cumsum(size.prod(axis=1))
    cuts = np.searchsorted(ends, np.arange(_CHUNK, ends[-1], _CHUNK))
    for some in np.split(np.arange(len(faces)), np.unique(cuts)):
        _draw(image, corners[some], low[some], size[some])
    return image


def _draw(image: FloatArray, corners: FloatArray, low: IntArray, size: IntArray) -> None:
    count = size.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), count)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
    i, j = np.divmod(number, size[triangle, 1])
    x, y = low[triangle, 0] + i, low[triangle, 1] + j
    middle = np.stack([x + 0.5, y + 0.5], axis=1)
    a, b, c = (corners[triangle, k, :2] - middle for k in range(3))
    u, v, w = _cross(b, c), _cross(c, a), _cross(a, b)
    whole = u + v + w
    inside = (u * whole >= 0.0) & (v * whole >= 0.0) & (w * whole >= 0.0) & (whole != 0.0)
    u, v, w, whole, triangle, x, y = (part[inside] for part in (u, v, w, whole, triangle, x, y))
    z = corners[triangle, :, 2]
    depth = (u * z[:, 0] + v * z[:, 1] + w * z[:, 2]) / whole
    np.minimum.at(image, (x, y), depth)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
