"""Orientation of closed shells: outward around bodies, inward around cavities.

A shell inside an even number of other shells bounds a body, so its volume must be positive; inside
an odd number it bounds a cavity, so its volume must be negative.  A point is inside a shell if the
shell's generalized winding number there is 1 or -1.

Source
------
A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized
winding numbers", ACM Trans. Graph. 32(4), 33, 2013.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import in_parallel
from .grouping import first_members
from .inside import winding_number
from .triangles import corner_columns, cross, norm

_PIECE = 10_000  # faces per task; their data fit into the cache
_NO_VOLUME = 1e-14  # relative to area times size: about the rounding error for a flat shell


def misoriented_shells(vertices: FloatArray, faces: IntArray, shells: IntArray) -> BoolArray:
    """Return which shells are inside-out or enclose no volume, (k,) bool; see `shell_faults`."""
    return shell_faults(vertices, faces, shells)[0]


def shell_faults(
    vertices: FloatArray, faces: IntArray, shells: IntArray
) -> tuple[BoolArray, BoolArray, IntArray]:
    """Return which shells are inside-out or enclose no volume.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    faces : (m, 3) int
        Every shell closed and consistently oriented.
    shells : (m,) int
        The shell of each face, 0..k-1.

    Returns
    -------
    wrong : (k,) bool
        Whether the shell is inside-out or encloses no volume.
    flat : (k,) bool
        Whether it encloses no volume, up to rounding.
    first : (k,) int
        Its first face.
    """
    first = first_members(shells)
    volume, scale = _volumes(vertices, faces, shells, vertices[faces[first, 0]])
    depth = _depths(vertices, faces, shells)
    wrong = np.where(depth % 2 == 0, volume, -volume) <= _NO_VOLUME * scale
    if len(volume) and not wrong.any() and volume.sum() <= 0.0:
        wrong[:] = True  # only overlapping shells get here
    return wrong, np.asarray(np.abs(volume) <= _NO_VOLUME * scale), first


def _volumes(
    vertices: FloatArray, faces: IntArray, shells: IntArray, origins: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the volume of each shell, relative to its *origin* (k, 3), and its area times size."""
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


def _depths(vertices: FloatArray, faces: IntArray, shells: IntArray) -> IntArray:
    """Return the number of other shells around each shell, (k,) int.

    All extreme vertices of a shell must be inside the other one, so that a shell which only
    reaches into another, such as a limb pushed into a body, does not count as a cavity.
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
