"""Which vertices of a mesh are seen, and which it hides itself, found without drawing.

A vertex is hidden where a triangle covers it and is nearer; one that ends at it is not.  That is
exact at silhouettes, whatever else is drawn in front and however many pixels there are; a depth
buffer would be neither.  Display coordinates are projective, so a triangle is flat in them, and
its depth linear.

To compare few pairs, the display is cut into square cells about as large as a triangle; a vertex
is compared with the triangles whose bounding box touches its cell.  Those that face the camera
come first: they hide nearly all there is to hide, and what is hidden is compared no more.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray

_NEARER = 1e-9  # of the depth that the camera sees; less is rounding
_CELLS = 16  # for each triangle, at most, on average
_FINEST = 4096  # cells across
_MOST = 4  # cells in all, for each triangle and vertex
_AT_ONCE = 300_000  # pairs, to bound the memory


def seen_vertices(
    display: FloatArray, faces: IntArray, among: BoolArray | None = None
) -> BoolArray:
    """Return (n,) bool: the vertices that no triangle hides.

    Parameters
    ----------
    display : (n, 3) float
        Display coordinates as of `Sight.to_display`.  What is behind the camera, NaN, is not seen
        and hides nothing; what is beside the window counts as seen.
    faces : (m, 3) int
        Triangles; both sides hide.
    among : (n,) bool, optional
        The vertices that are asked for; none of the others is called seen.
    """
    there = np.asarray(np.isfinite(display).all(axis=1))
    seen = there if among is None else there & among
    if not seen.any():
        return seen
    low, high = display[seen, :2].min(axis=0), display[seen, :2].max(axis=0)
    triangles = faces[touching(display[:, :2], faces, low, high)]
    if not there.all():
        triangles = triangles[there[triangles].all(axis=1)]
    (ax, ay), (bx, by), (cx, cy) = (display[k, :2].T for k in triangles.T)
    to_camera = (bx - ax) * (cy - ay) > (by - ay) * (cx - ax)
    for some in (triangles[to_camera], triangles[~to_camera]):
        if len(some) and seen.any():
            _hide(display, some, seen)
    return seen


def touching(places: FloatArray, faces: IntArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Tell which triangles are not plainly beside a box: all on one side of it.

    Parameters
    ----------
    places : (n, 2) float
        Of the vertices.
    faces : (m, 3) int
        Triangles.
    low, high : (2,) float
        The box, which may be a point.
    """
    beside = np.zeros(len(places), dtype=np.uint8)  # a bit for each side that a vertex is on
    for k, coordinate in enumerate(places.T):
        beside |= (coordinate < low[k]).view(np.uint8) << (2 * k)
        beside |= (coordinate > high[k]).view(np.uint8) << (2 * k + 1)
    a, b, c = (beside[corner] for corner in faces.T)
    return np.asarray((a & b & c) == 0)


def _hide(display: FloatArray, triangles: IntArray, seen: BoolArray) -> None:
    """Take out of *seen* what the triangles hide."""
    vertices = np.flatnonzero(seen)
    places = display[vertices, :2]
    origin = places.min(axis=0)
    low, high = _boxes(display, triangles)
    size = _cell_size(low, high, places)
    row, column = ((places - origin) // size).astype(np.int64).T
    n_rows, n_columns = row.max() + 1, column.max() + 1
    home = row * n_columns + column
    order = np.argsort(home, kind="stable")
    vertices, home = vertices[order], home[order]
    count_at = np.bincount(home, minlength=n_rows * n_columns)
    first_at = np.cumsum(count_at) - count_at
    farthest_at = np.full(len(count_at), -np.inf)
    used = np.flatnonzero(count_at)
    farthest_at[used] = np.maximum.reduceat(display[vertices, 2], first_at[used])

    # One entry for each cell that a triangle may touch, unless all there is nearer than it.
    last = [n_rows - 1, n_columns - 1]
    first = np.clip((low[:, :2] - origin) // size, 0, last).astype(np.int64)
    wide = np.clip((high[:, :2] - origin) // size, 0, last).astype(np.int64) - first + 1
    triangle, step = _spread(wide[:, 0] * wide[:, 1])
    down, along = np.divmod(step, wide[triangle, 1])
    cell = (first[triangle, 0] + down) * n_columns + first[triangle, 1] + along
    some = np.flatnonzero(farthest_at[cell] > low[triangle, 2])
    triangle, begin, count = triangle[some], first_at[cell[some]], count_at[cell[some]]

    batches = np.flatnonzero(np.diff(np.cumsum(count) // _AT_ONCE)) + 1
    for batch in np.split(np.arange(len(count)), batches):
        entry, step = _spread(count[batch])
        vertex, over = vertices[begin[batch][entry] + step], triangle[batch][entry]
        behind = np.flatnonzero(seen[vertex] & (display[vertex, 2] > low[over, 2]))
        vertex, corners = vertex[behind], triangles[over[behind]]
        seen[vertex[_hides(display, corners, vertex)]] = False


def _cell_size(low: FloatArray, high: FloatArray, places: FloatArray) -> float:
    """Return a side such that triangles touch a few cells each, and not too many in all."""
    wide = (high - low)[:, :2]
    across = np.ptp(places, axis=0)
    least = float(np.sqrt(across.prod() / (_MOST * (len(low) + len(places)))))
    size = max(float(np.median(wide.max(axis=1))), float(across.max()) / _FINEST, least, 1e-9)
    while (wide // size + 1.0).prod(axis=1).sum() > _CELLS * len(low):
        size *= 2.0
    return size


def _boxes(places: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest coordinates of each triangle, (m, 3)."""
    a, b, c = (places[k] for k in triangles.T)
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
