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
from .inside import winding_number

_NO_VOLUME = 1e-14  # share of area times size; rounding leaves about this much of a flat shell


def wrong_way_round(vertices: FloatArray, faces: IntArray, shells: IntArray) -> BoolArray:
    """Return which shells face the wrong side or enclose no volume, (k,) bool.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    faces : (m, 3) int
        Every shell closed and oriented consistently.
    shells : (m,) int
        The shell of each face, 0..k-1.
    """
    volume, scale = _volumes(vertices, faces, shells)
    depth = _depths(vertices, faces, shells)
    wrong = np.where(depth % 2 == 0, volume, -volume) <= _NO_VOLUME * scale
    if len(volume) and not wrong.any() and volume.sum() <= 0.0:
        wrong[:] = True  # only shells that overlap get here
    return wrong


def without_volume(vertices: FloatArray, faces: IntArray, shells: IntArray) -> BoolArray:
    """Return which shells enclose no volume but what rounding leaves, (k,) bool; see above."""
    volume, scale = _volumes(vertices, faces, shells)
    return np.asarray(np.abs(volume) <= _NO_VOLUME * scale)


def _volumes(
    vertices: FloatArray, faces: IntArray, shells: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return each shell's volume, about a point of its own, and its area times its size."""
    _, anchor = np.unique(shells, return_index=True)
    corners = vertices[faces] - vertices[faces[anchor[shells], 0]][:, None]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = np.bincount(shells, np.einsum("ij,ij->i", a, np.cross(b, c))) / 6.0
    area = np.bincount(shells, np.linalg.norm(np.cross(b - a, c - a), axis=1)) / 2.0
    size = np.zeros(len(anchor))
    np.maximum.at(size, shells, np.linalg.norm(a, axis=1))
    return volume, area * size


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
    for outer, its_faces in enumerate(by_shell):
        within = ((low > low[outer]) & (high < high[outer])).all(axis=1)
        for inner in np.flatnonzero(within):
            points = vertices[owned[inner]]
            extremes = np.unique([points.argmin(axis=0), points.argmax(axis=0)])
            corners = np.searchsorted(owned[outer], faces[its_faces])
            w = winding_number(points[extremes], vertices[owned[outer]], corners)
            depth[inner] += bool((np.abs(w) > 0.5).all())
    return depth
