"""Which vertices of a mesh are seen, and which it hides itself, found without drawing.

A vertex is hidden where a triangle covers it and is nearer; one that ends at it is not.  That is
exact at silhouettes, whatever else is drawn in front and however many pixels there are; a depth
buffer would be neither.  Display coordinates are projective, so a triangle is flat in them, and
its depth linear.

To compare few pairs, the display is cut into square cells about as large as a triangle; a vertex
is compared with the triangles whose bounding box touches its cell.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray

_NEARER = 1e-9  # of the depth that the camera sees; less is rounding
_CELLS = 16  # for each triangle, at most, on average
_FINEST = 4096  # cells across
_AT_ONCE = 300_000  # pairs, to bound the memory


def seen_vertices(display: FloatArray, faces: IntArray) -> BoolArray:
    """Return (n,) bool: the vertices that no triangle hides.

    Parameters
    ----------
    display : (n, 3) float
        Display coordinates as of `Sight.to_display`.  What is behind the camera, NaN, is not seen
        and hides nothing; what is beside the window counts as seen.
    faces : (m, 3) int
        Triangles; both sides hide.
    """
    seen = np.asarray(np.isfinite(display).all(axis=1))
    triangles = faces[seen[faces].all(axis=1)]
    vertices = np.flatnonzero(seen)
    if not len(triangles):
        return seen
    size = _cell_size(display[:, :2], triangles)
    origin = display[vertices, :2].min(axis=0)
    row, column = (((display[vertices, :2] - origin) // size).astype(np.int64)).T
    n_columns = column.max() + 1
    home = row * n_columns + column
    order = np.argsort(home, kind="stable")
    vertices, home = vertices[order], home[order]

    # One entry for each cell that a triangle may touch, and how many vertices are in it.
    first, last = _boxes((display[:, :2] - origin) // size, triangles)
    first, wide = first.astype(np.int64), (last - first).astype(np.int64) + 1
    triangle, step = _spread(wide.prod(axis=1))
    down, along = np.divmod(step, wide[triangle, 1])
    cell = (first[triangle, 0] + down) * n_columns + first[triangle, 1] + along
    begin = np.searchsorted(home, cell, side="left")
    count = np.searchsorted(home, cell, side="right") - begin

    some = np.flatnonzero(count)
    batches = np.flatnonzero(np.diff(np.cumsum(count[some]) // _AT_ONCE)) + 1
    for batch in np.split(some, batches):
        entry, step = _spread(count[batch])
        vertex = vertices[begin[batch][entry] + step]
        corners = triangles[triangle[batch][entry]]
        seen[vertex[_hides(display, corners, vertex)]] = False
    return seen


def _cell_size(places: FloatArray, triangles: IntArray) -> float:
    """Return a side such that triangles touch a few cells each, and not too many in all."""
    low, high = _boxes(places, triangles)
    across = float((high.max(axis=0) - low.min(axis=0)).max())
    size = max(float(np.median((high - low).max(axis=1))), across / _FINEST, 1e-9)
    while ((high - low) // size + 1.0).prod(axis=1).sum() > _CELLS * len(triangles):
        size *= 2.0
    return size


def _boxes(places: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the lower left and upper right corners of what is around each triangle, (m, 2)."""
    a, b, c = places[triangles.T]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _spread(count: IntArray) -> tuple[IntArray, IntArray]:
    """Return 0, 0, 0, 1, 2, 2 and 0, 1, 2, 0, 0, 1 for a *count* of 3, 1, 2."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def _hides(display: FloatArray, corners: IntArray, vertex: IntArray) -> BoolArray:
    """Tell for each pair whether the triangle with *corners* (p, 3) hides *vertex* (p,)."""
    x, y, depth = display.T
    px, py = x[vertex], y[vertex]
    (ax, ay), (bx, by), (cx, cy) = ((x[k] - px, y[k] - py) for k in corners.T)
    # Twice the areas of the triangles that the vertex makes with each side.
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    around = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    hides = np.flatnonzero(around)
    u, v, w = u[hides], v[hides], w[hides]
    za, zb, zc = (depth[k] - depth[vertex[hides]] for k in corners[hides].T)
    total = u + v + w
    around[hides] = (u * za + v * zb + w * zc) * total < -_NEARER * total**2
    return np.asarray(around)
