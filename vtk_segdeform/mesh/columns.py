"""What is inside a closed surface, by counting crossings along columns parallel to z.

The winding number of a point is the number of faces below it, one that looks down counted +1
and one that looks up -1.  A face is below if the column meets its projection, which means to
pass its three edges on the same side.  The two faces at an edge compute that side from the same
numbers in the same order, so no column slips between them, whatever the rounding.  A column
through an edge or a corner counts as one next to it, on the same side for all of them.

For n points or nodes this costs n times the few faces whose box a column meets, not n times all
faces as the sum of solid angles does.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import in_parallel

_BLOCK = 1 << 20  # pairs of face and column held at once
_BAND = 1 << 14  # points to a thread

Column = FloatArray | IntArray  # coordinates of columns, (k,)


def inside_nodes(vertices: FloatArray, faces: IntArray, shape: tuple[int, int, int]) -> BoolArray:
    """Return a bool array of *shape*: which nodes of the unit grid (0, 1, ...)^3 are inside.

    The surface is closed and outward oriented, *vertices* in steps of the grid; where it covers
    itself twice is inside too.
    """
    nx, ny, nz = shape
    faces = faces[_between(vertices[:, :2], faces, nx, ny)]
    low, high = _boxes(vertices[:, :2], faces)
    first = np.ceil(low).clip(0).astype(np.int64)
    last = np.floor(high).clip(max=[nx - 1, ny - 1]).astype(np.int64)
    extent = (last - first + 1).clip(0)
    change = np.zeros(nx * ny * (nz + 1))
    for f, k in _pairs(extent.prod(axis=1)):
        column = first[f] + np.stack([k // extent[f, 1], k % extent[f, 1]], axis=1)
        met, height, turn = _crossings(vertices, faces[f], *column.T)
        above = np.ceil(height).clip(0, nz).astype(np.int64)
        place = (column[met] @ [ny, 1]) * (nz + 1) + above
        change += np.bincount(place, turn, minlength=len(change))
    winding = change.reshape(nx, ny, nz + 1).cumsum(axis=2)[:, :, :nz]
    return np.asarray(winding > 0.5)


def inside_points(points: FloatArray, vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Return which of (n, 3) *points* are inside a closed, outward oriented surface."""
    low, high = _boxes(vertices[:, :2], faces)
    order = np.argsort(points[:, 0], kind="stable")
    inside = np.empty(len(points), dtype=bool)

    def work(start: int, stop: int) -> None:  # a band of x; in it, those in a face's reach of y
        band = order[start:stop]
        x_low, x_high = points[band[[0, -1]], 0]
        band = band[np.argsort(points[band, 1], kind="stable")]
        x, y, z = points[band].T.copy()
        near = np.flatnonzero((low[:, 0] <= x_high) & (high[:, 0] >= x_low))
        first = np.searchsorted(y, low[near, 1], side="left")
        last = np.searchsorted(y, high[near, 1], side="right")
        winding = np.zeros(len(band))
        for f, i, j in zip(near, first, last, strict=True):
            met, height, turn = _crossings(vertices, faces[f], x[i:j], y[i:j])
            below = height < z[i:j][met]
            winding[i + met[below]] += turn[below]
        inside[band] = winding > 0.5

    in_parallel(work, len(points), _BAND)
    return inside


def count_up(counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return i and k: each i repeated counts[i] times, with k = 0, 1, ... counts[i] - 1.

    Examples
    --------
    >>> count_up(np.array([2, 0, 3]))
    (array([0, 0, 2, 2, 2]), array([0, 1, 0, 1, 2]))
    """
    i = np.repeat(np.arange(len(counts)), counts)
    return i, np.arange(len(i)) - np.repeat(counts.cumsum() - counts, counts)


def _between(xy: FloatArray, faces: IntArray, nx: int, ny: int) -> BoolArray:
    """Return which faces may meet a column: those whose corners are not all between the same two.

    A corner's place is even on a column and odd between two; beyond the grid it is next to it.
    """
    near = xy.clip(-0.5, [nx - 0.5, ny - 0.5])
    place = (np.floor(near) + np.ceil(near)).astype(np.int32)
    between = (place % 2 == 1).any(axis=1)
    code = place @ np.array([2 * ny + 1, 1], dtype=np.int32)
    a, b, c = code[faces.T]
    return np.asarray((a != b) | (b != c) | ~between[faces[:, 0]])


def _boxes(xy: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    a, b, c = xy[faces[:, 0]], xy[faces[:, 1]], xy[faces[:, 2]]
    low = np.minimum(np.minimum(a, b), c)
    return low, np.maximum(np.maximum(a, b), c)


def _pairs(counts: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield `count_up` in pieces of bounded size."""
    some = np.flatnonzero(counts)
    run = counts[some].cumsum() // _BLOCK
    for piece in np.split(some, np.flatnonzero(np.diff(run)) + 1):
        i, k = count_up(counts[piece])
        yield piece[i], k


def _crossings(
    vertices: FloatArray, faces: IntArray, x: Column, y: Column
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return which of k columns meet their face, where, and which way; *faces* (k, 3) or one (3,).

    Where: the height z.  Which way: +1 if the face looks down, so that going up leads inside.
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
    """Return twice the signed area of tail, head, column; for head, tail its exact opposite."""
    a, b = vertices[np.minimum(tail, head), :2].T, vertices[np.maximum(tail, head), :2].T
    along, across = b[0] - a[0], b[1] - a[1]
    area = along * (y - a[1]) - across * (x - a[0])
    if len(on := np.flatnonzero(area == 0.0)):  # moved on in x by next to nothing; in y, by less
        along, across = (np.broadcast_to(way, area.shape)[on] for way in (along, across))
        shift = np.where(across == 0.0, along, -across)
        area[on] = np.copysign(np.finfo(float).tiny, shift)
    return np.asarray(np.where(tail < head, area, -area))
