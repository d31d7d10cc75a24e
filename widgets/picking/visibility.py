"""Visible vertices of a mesh, computed without rendering.

A vertex is hidden if a triangle covers it and is nearer to the camera; the triangles around the
vertex itself do not hide it.  The test is exact at silhouettes and independent of other actors and
of the number of pixels, unlike a test with the depth buffer.  Display coordinates are projective,
so a triangle is flat in them, and its depth linear.

To keep the number of pairs small, the display is divided into square cells of about the size of a
triangle, and a vertex is compared with the triangles whose bounding box touches its cell.
Triangles that face the camera are tested first: they hide most of the hidden vertices, which then
need no further tests.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray

_DEPTH_TOLERANCE = 1e-9  # of the camera's depth range; smaller differences are rounding errors
_MOST_CELLS_TOUCHED = 16  # by a triangle, on average
_MOST_CELLS_ACROSS = 4096
_CELLS_PER_ELEMENT = 4  # at most, for each triangle and vertex
_BATCH = 300_000  # pairs tested at once, to bound the memory


def visible_vertices(
    display: FloatArray, faces: IntArray, among: BoolArray | None = None
) -> BoolArray:
    """Return (n,) bool: the vertices that no triangle hides.

    Parameters
    ----------
    display : (n, 3) float
        Display coordinates as of `Projection.to_display`.  Vertices behind the camera, NaN, are
        not visible and hide nothing; vertices outside the window count as visible.
    faces : (m, 3) int
        Triangles; both sides hide.
    among : (n,) bool, optional
        The vertices to test; the others are False in the result.
    """
    finite = np.asarray(np.isfinite(display).all(axis=1))
    visible = finite if among is None else finite & among
    if not visible.any():
        return visible
    low, high = display[visible, :2].min(axis=0), display[visible, :2].max(axis=0)
    triangles = faces[may_overlap(display[:, :2], faces, low, high)]
    if not finite.all():
        triangles = triangles[finite[triangles].all(axis=1)]
    (ax, ay), (bx, by), (cx, cy) = (display[k, :2].T for k in triangles.T)
    faces_camera = (bx - ax) * (cy - ay) > (by - ay) * (cx - ax)
    for some in (triangles[faces_camera], triangles[~faces_camera]):
        if len(some) and visible.any():
            _remove_hidden(display, some, visible)
    return visible


def may_overlap(
    points: FloatArray, faces: IntArray, low: FloatArray, high: FloatArray
) -> BoolArray:
    """Return (m,) bool: the triangles that may overlap a box, as no side of it separates them.

    Parameters
    ----------
    points : (n, 2) float
        The vertices.
    faces : (m, 3) int
        Triangles.
    low, high : (2,) float
        The box, which may be a point.
    """
    outside = np.zeros(len(points), dtype=np.uint8)  # one bit for each side of the box
    for k, coordinate in enumerate(points.T):
        outside |= (coordinate < low[k]).view(np.uint8) << (2 * k)
        outside |= (coordinate > high[k]).view(np.uint8) << (2 * k + 1)
    a, b, c = (outside[corner] for corner in faces.T)
    return np.asarray((a & b & c) == 0)


def _remove_hidden(display: FloatArray, triangles: IntArray, visible: BoolArray) -> None:
    """Remove from *visible*, in place, the vertices that the triangles hide."""
    vertices = np.flatnonzero(visible)
    points = display[vertices, :2]
    origin = points.min(axis=0)
    low, high = _boxes(display, triangles)
    size = _cell_size(low, high, points)
    row, column = ((points - origin) // size).astype(np.int64).T
    n_rows, n_columns = row.max() + 1, column.max() + 1
    home = row * n_columns + column
    order = np.argsort(home, kind="stable")
    vertices, home = vertices[order], home[order]
    count_at = np.bincount(home, minlength=n_rows * n_columns)
    first_at = np.cumsum(count_at) - count_at
    farthest_at = np.full(len(count_at), -np.inf)
    used = np.flatnonzero(count_at)
    farthest_at[used] = np.maximum.reduceat(display[vertices, 2], first_at[used])

    # One entry for each cell that a triangle may touch, unless all vertices there are nearer.
    last = [n_rows - 1, n_columns - 1]
    first = np.clip((low[:, :2] - origin) // size, 0, last).astype(np.int64)
    wide = np.clip((high[:, :2] - origin) // size, 0, last).astype(np.int64) - first + 1
    triangle, step = _spread(wide[:, 0] * wide[:, 1])
    down, along = np.divmod(step, wide[triangle, 1])
    cell = (first[triangle, 0] + down) * n_columns + first[triangle, 1] + along
    some = np.flatnonzero(farthest_at[cell] > low[triangle, 2])
    triangle, begin, count = triangle[some], first_at[cell[some]], count_at[cell[some]]

    batches = np.flatnonzero(np.diff(np.cumsum(count) // _BATCH)) + 1
    for batch in np.split(np.arange(len(count)), batches):
        entry, step = _spread(count[batch])
        vertex, over = vertices[begin[batch][entry] + step], triangle[batch][entry]
        behind = np.flatnonzero(visible[vertex] & (display[vertex, 2] > low[over, 2]))
        vertex, corners = vertex[behind], triangles[over[behind]]
        visible[vertex[_hides(display, corners, vertex)]] = False


def _cell_size(low: FloatArray, high: FloatArray, points: FloatArray) -> float:
    """Return a cell side for which triangles touch few cells, and the grid is not too large."""
    wide = (high - low)[:, :2]
    across = np.ptp(points, axis=0)
    least = float(np.sqrt(across.prod() / (_CELLS_PER_ELEMENT * (len(low) + len(points)))))
    finest = float(across.max()) / _MOST_CELLS_ACROSS
    size = max(float(np.median(wide.max(axis=1))), finest, least, 1e-9)
    while (wide // size + 1.0).prod(axis=1).sum() > _MOST_CELLS_TOUCHED * len(low):
        size *= 2.0
    return size


def _boxes(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest coordinates of each triangle, (m, 3)."""
    a, b, c = (points[k] for k in triangles.T)
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _spread(count: IntArray) -> tuple[IntArray, IntArray]:
    """Return 0, 0, 0, 1, 2, 2 and 0, 1, 2, 0, 0, 1 for a *count* of 3, 1, 2."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def _hides(display: FloatArray, corners: IntArray, vertex: IntArray) -> BoolArray:
    """Return (p,) bool: whether each triangle with *corners* (p, 3) hides its *vertex* (p,)."""
    x, y, depth = display.T
    px, py = x[vertex], y[vertex]
    (ax, ay), (bx, by), (cx, cy) = ((x[k] - px, y[k] - py) for k in corners.T)
    # Twice the signed areas of the triangles formed by the vertex and each side.
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    around = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    hides = np.flatnonzero(around)
    u, v, w = u[hides], v[hides], w[hides]
    za, zb, zc = (depth[k] - depth[vertex[hides]] for k in corners[hides].T)
    total = u + v + w
    around[hides] = (u * za + v * zb + w * zc) * total < -_DEPTH_TOLERANCE * total**2
    return np.asarray(around)
