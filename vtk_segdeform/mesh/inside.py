"""Points inside or outside a closed surface, and their distance to it.

The winding number is the signed fraction of the unit sphere that the surface covers as seen from
x, with a, b, c the corners of a face relative to x:

    w(x) = 1 / (4 pi) sum over faces omega
    tan(omega / 2) = det(a, b, c) / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|)

It is 1 inside and 0 outside.

For many points, `inside_points` and `inside_nodes` count crossings along columns parallel to z
instead.  The winding number of a point is the number of faces below it, a face that looks down
counted +1 and one that looks up -1.  A face is below if the column through the point meets its
projection, that is, passes its three edges on the same side.  The two faces at an edge compute
that side from the same numbers in the same order, so no column passes between them, whatever the
rounding.  A column through an edge or a corner is treated as one next to it, consistently for all
faces.  The cost is n times the few faces whose box a column meets, not n times all faces.

Source
------
A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomedical
Engineering 30(2), 125-126, 1983.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, as_faces, as_points
from ..kernels import in_parallel
from .grouping import ragged_pieces
from .triangles import corner_columns, cross, norm

_BLOCK = 1 << 17  # numbers per temporary array: a megabyte, which fits into the cache
_BAND = 1 << 14  # points per task

Column = FloatArray | IntArray  # coordinates of columns, (k,)


def winding_number(
    points: ArrayLike, vertices: ArrayLike, faces: ArrayLike, near: float = 0.0
) -> FloatArray:
    """Return the winding number of a surface at each point, (n,): 1 inside, 0 outside.

    The surface, *vertices* (m, 3) and *faces* (k, 3), may be open: the winding number then
    decreases smoothly from inside to outside.  At a distance of at most *near* from the plane of a
    face, that face counts as 0; so the winding number is 0.5 on a flat part of a closed surface,
    whatever the rounding.  Memory is bounded for any n and k.
    """
    x = as_points(points, "points")
    p = as_points(vertices, "vertices")
    faces = as_faces(faces, len(p), "faces")
    if not len(faces):
        return np.zeros(len(x))
    centre = p.mean(axis=0)
    x, p = x - centre, p - centre
    corners = corner_columns(p, faces)
    a, b, c = corners
    flat = near * norm(cross(b - a, c - a))[:, None]
    number = np.empty(len(x))

    def work(start: int, stop: int) -> None:
        y = x[start:stop].T[:, None]
        a, b, c = (corner[:, :, None] - y for corner in corners)
        d_a, d_b, d_c = norm(a), norm(b), norm(c)
        below = d_a * d_b * d_c + (a * b).sum(axis=0) * d_c
        below += (b * c).sum(axis=0) * d_a + (c * a).sum(axis=0) * d_b
        volume = (a * cross(b, c)).sum(axis=0)
        half_omega = np.where(np.abs(volume) <= flat, 0.0, np.arctan2(volume, below))
        number[start:stop] = half_omega.sum(axis=0) / (2.0 * np.pi)

    in_parallel(work, len(x), max(1, _BLOCK // (9 * len(faces))), blas=False)
    return number


def distance_to_surface(x: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return the distance from each point *x* (n, 3) to the nearest face, (n,)."""
    a = vertices[faces]  # (k, 3 corners, 3)
    along = a[:, [1, 2, 0]] - a
    normal = np.cross(along[:, 0], along[:, 1])
    size, squares = np.linalg.norm(normal, axis=1), np.einsum("kcj,kcj->kc", along, along)
    has_area = size > 0.0
    normal /= np.where(has_area, size, 1.0)[:, None]
    squares = np.where(squares > 0.0, squares, 1.0)  # of coinciding corners
    nearest = np.empty(len(x))
    rows = max(1, _BLOCK // (3 * len(faces)))
    for start in range(0, len(x), rows):
        to_x = x[start : start + rows, None, None] - a  # (rows, k, 3 corners, 3)
        t = np.einsum("nkcj,kcj->nkc", to_x, along) / squares
        off_edge = np.linalg.norm(to_x - t.clip(0, 1)[..., None] * along, axis=-1).min(axis=2)
        over = (np.einsum("nkcj,kcj->nkc", to_x, np.cross(normal[:, None], along)) >= 0).all(axis=2)
        over &= has_area
        off_plane = np.abs(np.einsum("nkj,kj->nk", to_x[:, :, 0], normal))
        nearest[start : start + rows] = np.where(over, off_plane, off_edge).min(axis=1)
    return nearest


def inside_nodes(vertices: FloatArray, faces: IntArray, shape: tuple[int, int, int]) -> BoolArray:
    """Return which nodes of the unit grid (0, 1, ...)^3 are inside, a bool array of *shape*.

    The surface is closed and outward oriented, with *vertices* in units of the grid spacing;
    regions it encloses twice are inside too.
    """
    nx, ny, nz = shape
    faces = faces[_between(vertices[:, :2], faces, nx, ny)]
    low, high = _boxes(vertices[:, :2], faces)
    first = np.ceil(low).clip(0).astype(np.int64)
    last = np.floor(high).clip(max=[nx - 1, ny - 1]).astype(np.int64)
    extent = (last - first + 1).clip(0)
    change = np.zeros(nx * ny * (nz + 1))
    for f, k in ragged_pieces(extent.prod(axis=1)):
        column = first[f] + np.stack([k // extent[f, 1], k % extent[f, 1]], axis=1)
        met, height, sign = _crossings(vertices, faces[f], *column.T)
        above = np.ceil(height).clip(0, nz).astype(np.int64)
        node = (column[met] @ [ny, 1]) * (nz + 1) + above
        change += np.bincount(node, sign, minlength=len(change))
    winding = change.reshape(nx, ny, nz + 1).cumsum(axis=2)[:, :, :nz]
    return np.asarray(winding > 0.5)


def inside_points(points: FloatArray, vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Return which of (n, 3) *points* are inside a closed, outward oriented surface."""
    low, high = _boxes(vertices[:, :2], faces)
    order = np.argsort(points[:, 0], kind="stable")
    inside = np.zeros(len(points), dtype=bool)

    def work(start: int, stop: int) -> None:  # a band in x; each face meets a range in y of it
        band = order[start:stop]
        x_low, x_high = points[band[[0, -1]], 0]
        band = band[np.argsort(points[band, 1], kind="stable")]
        x, y, z = points[band].T.copy()
        near = np.flatnonzero((low[:, 0] <= x_high) & (high[:, 0] >= x_low))
        first = np.searchsorted(y, low[near, 1], side="left")
        last = np.searchsorted(y, high[near, 1], side="right")
        winding = np.zeros(len(band))
        for f, k in ragged_pieces(last - first):
            at, its_faces = first[f] + k, near[f]
            beside = (x[at] >= low[its_faces, 0]) & (x[at] <= high[its_faces, 0])
            at, its_faces = at[beside], its_faces[beside]
            met, height, sign = _crossings(vertices, faces[its_faces], x[at], y[at])
            below = height < z[at[met]]
            winding += np.bincount(at[met[below]], sign[below], minlength=len(band))
        inside[band] = winding > 0.5

    in_parallel(work, len(points), _BAND, blas=False)
    return inside


def _between(xy: FloatArray, faces: IntArray, nx: int, ny: int) -> BoolArray:
    """Return which faces may meet a column: not all corners lie between the same two columns.

    Cells have even numbers on columns and odd ones between; corners beyond the grid are clamped.
    """
    near = xy.clip(-0.5, [nx - 0.5, ny - 0.5])
    cell = (np.floor(near) + np.ceil(near)).astype(np.int32)
    between = (cell % 2 == 1).any(axis=1)
    code = cell @ np.array([2 * ny + 1, 1], dtype=np.int32)
    a, b, c = code[faces.T]
    return np.asarray((a != b) | (b != c) | ~between[faces[:, 0]])


def _boxes(xy: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    a, b, c = xy[faces[:, 0]], xy[faces[:, 1]], xy[faces[:, 2]]
    low = np.minimum(np.minimum(a, b), c)
    return low, np.maximum(np.maximum(a, b), c)


def _crossings(
    vertices: FloatArray, faces: IntArray, x: Column, y: Column
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return which of k columns meet their face, at which heights z, and with which signs.

    *faces* is (k, 3), or (3,) for all columns.  The sign is +1 where the face looks down, so that
    the column enters the body upwards.
    """
    corners = faces.T
    side = np.stack([_side(vertices, corners[c], corners[c - 2], x, y) for c in range(3)])
    up = side > 0
    met = np.flatnonzero((up[0] == up[1]) & (up[0] == up[2]))
    side = side[:, met]
    z = vertices[corners, 2]
    z = z[:, met] if z.ndim == 2 else z[:, None]
    height = (side * z[[2, 0, 1]]).sum(axis=0) / side.sum(axis=0)
    return met, height, np.where(side[0] > 0, -1.0, 1.0)


def _side(vertices: FloatArray, tail: IntArray, head: IntArray, x: Column, y: Column) -> FloatArray:
    """Return twice the signed area of tail, head, column; exactly negated if tail and head swap."""
    a, b = vertices[np.minimum(tail, head), :2].T, vertices[np.maximum(tail, head), :2].T
    along, across = b[0] - a[0], b[1] - a[1]
    area = along * (y - a[1]) - across * (x - a[0])
    if len(on := np.flatnonzero(area == 0.0)):  # shifted by an infinitesimal in x, and by less in y
        along, across = (np.broadcast_to(d, area.shape)[on] for d in (along, across))
        shift = np.where(across == 0.0, along, -across)
        area[on] = np.copysign(np.finfo(float).tiny, shift)
    return np.asarray(np.where(tail < head, area, -area))
