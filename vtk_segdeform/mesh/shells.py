"""Orientation of closed shells: outward around bodies, inward around cavities.

A shell inside an even number of other shells bounds a body, so its volume must be positive; inside
an odd number it bounds a cavity, so its volume must be negative.  A point is inside a shell if the
shell's generalized winding number there is 1 or -1, so shells with small holes count too.

Source
------
A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized
winding numbers", ACM Trans. Graph. 32(4), 33, 2013.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import compiled_checks, in_parallel, inputs
from .grouping import first_members
from .inside import winding_by_columns, winding_number
from .topology import HalfEdges
from .triangles import corner_columns, cross, norm

_PIECE = 10_000  # faces per task; their data fit into the cache
NO_VOLUME = 1e-14  # relative to area times size: about the rounding error for a flat shell
_MANY = 100  # points for which columns are quicker
_INSIDE = 0.5 + 1e-6  # at a flat part of a shell it is 0.5: not inside

# Volume, area and size of each shell, (k,) float each.
ShellSums: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


def closed_shells(half_edges: HalfEdges) -> BoolArray:
    """Return which shells are closed and consistently oriented, every edge a pair, (k,) bool."""
    closed = np.ones(int(half_edges.shells.max(initial=-1)) + 1, dtype=bool)
    for some in (half_edges.boundary, half_edges.crowded, half_edges.turned):
        closed[half_edges.shells[some // 3]] = False
    return closed


def misoriented_shells(vertices: FloatArray, half_edges: HalfEdges) -> BoolArray:
    """Return which closed shells are inside-out or enclose no volume, (k,) bool."""
    faces, shells, closed = half_edges.faces, half_edges.shells, closed_shells(half_edges)
    return shell_faults(vertices, faces, shells, closed)[0]


def shell_faults(
    vertices: FloatArray,
    faces: IntArray,
    shells: IntArray,
    closed: BoolArray,
    *,
    sums: ShellSums | None = None,
) -> tuple[BoolArray, BoolArray, IntArray]:
    """Return which shells are inside-out or enclose no volume.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    faces : (m, 3) int
        Of all shells.
    shells : (m,) int
        The shell of each face, 0..k-1.
    closed : (k,) bool
        The shells to test, closed and consistently oriented.  Others may be around them.
    sums : ShellSums, optional
        Those of `shell_volumes`, if they are known.

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
    volume, area, size = sums or shell_volumes(vertices, faces, shells)
    tiny = NO_VOLUME * (area * size)
    outward = outward_signs(volume, shell_depths(vertices, faces, shells, closed), closed)
    wrong = outward * volume <= tiny
    flat = np.abs(volume) <= tiny
    return np.asarray(wrong & closed), np.asarray(flat & closed), first


def outward_signs(volume: FloatArray, depth: IntArray, closed: BoolArray) -> IntArray:
    """Return the sign that the *volume* (k,) of each shell must have: 1 of bodies, -1 of cavities.

    *depth* (k,) is the number of shells around each.  Cavities that are together as large as the
    bodies overlap each other; if all shells are *closed* (k,), they count as bodies then.
    """
    outward = np.where(depth % 2 == 0, 1, -1)
    if closed.all() and (outward * np.abs(volume)).sum() <= 0.0:
        outward[:] = 1
    return outward


def shell_volumes(vertices: FloatArray, faces: IntArray, shells: IntArray) -> ShellSums:
    """Return the volume, area and size of each shell, (k,) each, from its first vertex."""
    origins = vertices[faces[first_members(shells), 0]]
    if kernels := compiled_checks(len(faces)):
        volume, area, size = np.zeros((3, len(origins)))
        several = shells if len(origins) > 1 else shells[:1]  # not read if there is only one
        kernels.shell_sums(volume, area, size, *inputs(origins, vertices, faces, several))
        return volume / 6.0, area / 2.0, size
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
    return np.bincount(shells, volumes) / 6.0, np.bincount(shells, areas) / 2.0, size


def shell_depths(
    vertices: FloatArray, faces: IntArray, shells: IntArray, inner: BoolArray
) -> IntArray:
    """Return the number of other shells around each of the shells *inner* (k,), (k,) int.

    All extreme vertices of a shell must be inside the other one, so that a shell which only
    reaches into another, such as a limb pushed into a body, does not count as a cavity.
    """
    depth = np.zeros(len(inner), dtype=np.int64)
    if len(inner) < 2 or not inner.any():
        return depth
    low, high = _boxes(vertices, faces, shells)
    order, begin, end = _beginning_within(low, high)
    within = []
    for outer in np.flatnonzero(end > begin):
        near = order[begin[outer] : end[outer]]
        near = near[inner[near]]
        near = near[((low[near] > low[outer]) & (high[near] < high[outer])).all(axis=1)]
        if len(near):
            within.append((outer, near))
    if not within:  # as for most surfaces
        return depth
    by_shell = np.argsort(shells, kind="stable")
    ends = np.cumsum(np.bincount(shells))
    starts = ends - np.bincount(shells)
    for outer, inside in within:
        owned, its_faces = _owned(faces[by_shell[starts[outer] : ends[outer]]])
        if its_faces[0, 1] > its_faces[0, 2]:  # the same rounding for both orientations
            its_faces = its_faces[:, [0, 2, 1]]
        extremes = []
        for one in inside:
            points = vertices[_owned(faces[by_shell[starts[one] : ends[one]]])[0]]
            extremes.append(points[np.unique([points.argmin(axis=0), points.argmax(axis=0)])])
        firsts = np.array([points[0] for points in extremes])
        left = np.flatnonzero(_surrounded(firsts, vertices[owned], its_faces))  # few, if any
        if len(left):
            begins = np.cumsum([0, *(len(extremes[k]) for k in left[:-1])])
            others = np.concatenate([extremes[k] for k in left])
            is_inside = _surrounded(others, vertices[owned], its_faces)
            depth[inside[left]] += np.logical_and.reduceat(is_inside, begins)
    return depth


def _boxes(
    vertices: FloatArray, faces: IntArray, shells: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest coordinates of each shell, (k, 3) each."""
    n_shells = int(shells.max()) + 1
    low, high = np.full((n_shells, 3), np.inf), np.full((n_shells, 3), -np.inf)
    if kernels := compiled_checks(len(faces)):
        last = np.full(len(vertices), -1, dtype=np.int32)
        kernels.shell_boxes(low, high, last, *inputs(vertices, faces, shells))
        return low, high
    by_shell = np.argsort(shells, kind="stable")
    corners, starts = faces[by_shell].ravel(), 3 * first_members(shells[by_shell])
    for axis in range(3):  # numpy takes ten times as long for rows of three numbers
        x = vertices[:, axis][corners]
        low[:, axis] = np.minimum.reduceat(x, starts)
        high[:, axis] = np.maximum.reduceat(x, starts)
    return low, high


def _surrounded(points: FloatArray, vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Return around which of *points* (n, 3) the winding number of a shell is 1 or -1 or more.

    Columns are far quicker for many points, but they need a closed shell, and do not say whether a
    point is on it; a point is not if the nearest vertex is farther than any edge is long.
    """
    by_columns = np.zeros(len(points), dtype=bool)
    if len(points) >= _MANY and _is_closed(faces):
        corners = vertices[faces]
        longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max()
        by_columns = cKDTree(vertices).query(points)[0] > longest
    found = np.zeros(len(points), dtype=bool)
    found[by_columns] = np.abs(winding_by_columns(points[by_columns], vertices, faces)) > _INSIDE
    found[~by_columns] = np.abs(winding_number(points[~by_columns], vertices, faces)) > _INSIDE
    return found


def _is_closed(faces: IntArray) -> bool:
    """Return whether each edge has as many faces in one direction as in the other."""
    tail, head = faces.T, faces[:, [1, 2, 0]].T
    n = int(faces.max(initial=0)) + 1
    return np.array_equal(np.sort((tail * n + head).ravel()), np.sort((head * n + tail).ravel()))


def _owned(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices of *faces* (k, 3), sorted, and the faces over these."""
    owned, numbers = np.unique(faces, return_inverse=True)
    return owned, numbers.reshape(-1, 3)


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
