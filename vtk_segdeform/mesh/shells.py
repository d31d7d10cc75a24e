"""Which way each closed shell of a mesh ought to face, and whether it does.

A shell inside an even number of others bounds a body and must enclose a positive volume; inside an
odd number it is the wall of a cavity, and its own volume must be negative.  Inside is where the
generalized winding number of the other shell is 1 in absolute value, whichever way that faces.

Source
------
A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized
winding numbers", ACM Trans. Graph. 32(4), 33, 2013.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import in_parallel
from .counting import first_members
from .inside import winding_number

_PIECE = 10_000  # faces to a thread; what they need stays in the cache
_NO_VOLUME = 1e-14  # share of area times size; rounding leaves about this much of a flat shell


def wrong_way_round(vertices: FloatArray, faces: IntArray, shells: IntArray) -> BoolArray:
    """Return which shells face the wrong side or enclose no volume, (k,) bool; see `judged`."""
    return judged(vertices, faces, shells)[0]


def judged(
    vertices: FloatArray, faces: IntArray, shells: IntArray
) -> tuple[BoolArray, BoolArray, IntArray]:
    """Tell of each shell what is wrong with the volume it encloses.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    faces : (m, 3) int
        Every shell closed and oriented consistently.
    shells : (m,) int
        The shell of each face, 0..k-1.

    Returns
    -------
    wrong : (k,) bool
        Faces the wrong side, or encloses no volume.
    flat : (k,) bool
        Encloses no volume but what rounding leaves.
    first : (k,) int
        Its first face.
    """
    first = first_members(shells)
    volume, scale = _volumes(vertices, faces, shells, vertices[faces[first, 0]])
    depth = _depths(vertices, faces, shells)
    wrong = np.where(depth % 2 == 0, volume, -volume) <= _NO_VOLUME * scale
    if len(volume) and not wrong.any() and volume.sum() <= 0.0:
        wrong[:] = True  # only shells that overlap get here
    return wrong, np.asarray(np.abs(volume) <= _NO_VOLUME * scale), first


def _volumes(
    vertices: FloatArray, faces: IntArray, shells: IntArray, origins: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return each shell's volume, about a point of its own (k, 3), and its area times its size."""
    volumes, areas, radii = np.empty((3, len(faces)))

    def work(start: int, stop: int) -> None:
        origin = origins.T[:, shells[start:stop]]
        a, b, c = (corner - origin for corner in corner_columns(vertices, faces[start:stop]))
        volumes[start:stop] = (a * cross(b, c)).sum(axis=0)
        areas[start:stop] = norm(cross(b - a, c - a))
        radii[start:stop] = norm(a)

    in_parallel(work, len(faces), _PIECE)
    size = np.zeros(len(origins))
    np.maximum.at(size, shells, radii)
    return np.bincount(shells, volumes) / 6.0, np.bincount(shells, areas) / 2.0 * size


def corner_columns(vertices: FloatArray, faces: IntArray) -> list[FloatArray]:
    """Return the places of the three corners of *faces* (k, 3), each (3, k) float: x, y and z.

    Long rows: `cross` and `norm` take half the time that numpy's own take of short ones.
    """
    return [np.take(vertices, corner, axis=0).T.copy() for corner in faces.T]


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """Return the cross products of the columns of *u* and *v*, (3, k) float."""
    product = np.empty_like(u)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[i] = u[j] * v[k] - u[k] * v[j]
    return product


def norm(u: FloatArray) -> FloatArray:
    """Return the lengths of the columns of *u*, (k,) float."""
    return np.asarray(np.sqrt((u * u).sum(axis=0)))


def _depths(vertices: FloatArray, faces: IntArray, shells: IntArray) -> IntArray:
    """Return the number of other shells around each shell, (k,) int.

    A shell is asked at its outermost vertices in each direction, so that one which merely
    reaches into another, a limb pushed into a body, is not taken for a cavity.
    """
    n_shells = int(shells.max(initial=-1)) + 1
    depth = np.zeros(n_shells, dtype=np.int64)
    if n_shells < 2:
        return depth
    by_shell = np.split(np.argsort(shells, kind="stable"), np.cumsum(np.bincount(shells))[:-1])
    owned = [np.unique(faces[mine]) for mine in by_shell]
    low = np.array([vertices[ids].min(axis=0) for ids in owned])
    high = np.array([vertices[ids].max(axis=0) for ids in owned])
    order, starts, stops = _beginning_within(low, high)
    for outer, its_faces in enumerate(by_shell):
        near = order[starts[outer] : stops[outer]]
        within = ((low[near] > low[outer]) & (high[near] < high[outer])).all(axis=1)
        for inner in near[within]:
            points = vertices[owned[inner]]
            extremes = np.unique([points.argmin(axis=0), points.argmax(axis=0)])
            corners = np.searchsorted(owned[outer], faces[its_faces])
            w = winding_number(points[extremes], vertices[owned[outer]], corners)
            depth[inner] += bool((np.abs(w) > 0.5).all())
    return depth


def _beginning_within(low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the boxes ``order[starts[k]:stops[k]]`` whose lower end lies within that of box k.

    That is tested along one axis, the one that leaves the fewest pairs: all pairs of 200,000 boxes
    would take a quarter of an hour.
    """
    found = []
    for axis in range(3):
        order = np.argsort(low[:, axis])
        begins = low[order, axis]
        starts = np.searchsorted(begins, low[:, axis], side="right")
        stops = np.searchsorted(begins, high[:, axis], side="left")
        found.append((int(np.maximum(stops - starts, 0).sum()), axis, order, starts, stops))
    return min(found)[2:]
