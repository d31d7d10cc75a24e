"""Orientation of closed shells: outward around bodies, inward around cavities.

A shell inside an even number of other shells bounds a body, so its volume must be positive; inside
an odd number it bounds a cavity, so its volume must be negative.  A point is inside a shell if the
shell's generalized winding number there is 1 or -1, so shells with small holes count too.

A compiled kernel finds that number by a cone over the border of the shell, which closes it: what
shell and cone have together is counted along a column, see `inside`, and that of the cone, a few
faces, is subtracted.  A point on the shell, up to rounding, is not inside.

Source
------
A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized
winding numbers", ACM Trans. Graph. 32(4), 33, 2013.
"""

from __future__ import annotations

from functools import partial
from typing import TypeAlias

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import compiled_checks, in_parallel, inputs
from .edges import flipped_faces
from .grouping import first_members, ragged_pieces
from .inside import winding_number
from .topology import HalfEdges
from .triangles import corner_columns, cross, norm

_PIECE = 10_000  # faces per task; their data fit into the cache
NO_VOLUME = 1e-14  # relative to area times size: about the rounding error for a flat shell
_NEAR = 1e-9  # of the size of a shell: on its surface, up to rounding
_FEW_PAIRS = 16  # of shells per task
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
    return shell_faults(vertices, half_edges, closed_shells(half_edges))[0]


def shell_faults(
    vertices: FloatArray, half_edges: HalfEdges, closed: BoolArray, depth: IntArray | None = None
) -> tuple[BoolArray, BoolArray]:
    """Return which shells are inside-out or enclose no volume.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    half_edges : HalfEdges
        Of all shells.
    closed : (k,) bool
        The shells to test, those of `closed_shells`.  Others may be around them.
    depth : (k,) int, optional
        `shell_depths`, if it is known.

    Returns
    -------
    wrong : (k,) bool
        Whether the shell is inside-out or encloses no volume.
    flat : (k,) bool
        Whether it encloses no volume, up to rounding.
    """
    volume, area, size = shell_volumes(vertices, half_edges.faces, half_edges.shells)
    tiny = NO_VOLUME * (area * size)
    depth = shell_depths(vertices, half_edges, closed) if depth is None else depth
    outward = outward_signs(volume, depth, closed)
    wrong = outward * volume <= tiny
    flat = np.abs(volume) <= tiny
    return np.asarray(wrong & closed), np.asarray(flat & closed)


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

    in_parallel(work, len(faces), _PIECE, blas=False)
    size = np.zeros(len(origins))
    np.maximum.at(size, shells, radii)
    return np.bincount(shells, volumes) / 6.0, np.bincount(shells, areas) / 2.0, size


def shell_depths(
    vertices: FloatArray, half_edges: HalfEdges, inner: BoolArray, flip: BoolArray | None = None
) -> IntArray:
    """Return the number of other shells around each of the shells *inner* (k,), (k,) int.

    All extreme vertices of a shell must be inside the other one, so that a shell which only
    reaches into another, such as a limb pushed into a body, does not count as a cavity.  The faces
    *flip* (m,) have the other direction.
    """
    depth = np.zeros(len(inner), dtype=np.int64)
    if len(inner) < 2 or not inner.any():
        return depth
    low, high = _boxes(vertices, half_edges.faces, half_edges.shells)
    order, begin, end = _beginning_within(low, high)
    pieces = [np.empty((0, 2), dtype=np.int64)]
    for outer, k in ragged_pieces((end - begin).clip(0)):
        inside = order[begin[outer] + k]
        is_in = inner[inside]
        for axis in range(3):
            is_in &= low[inside, axis] > low[outer, axis]
            is_in &= high[inside, axis] < high[outer, axis]
        pieces.append(np.stack([outer[is_in], inside[is_in]], axis=1))
    pairs = np.concatenate(pieces)
    if len(pairs):  # not for most surfaces
        near_to = _NEAR * (high - low).max(axis=1)
        found = _are_around(vertices, half_edges, flip, pairs, near_to)
        np.add.at(depth, pairs[found, 1], 1)
    return depth


def _are_around(
    vertices: FloatArray,
    half_edges: HalfEdges,
    flip: BoolArray | None,
    pairs: IntArray,
    near: FloatArray,
) -> BoolArray:
    """Return for which *pairs* (p, 2) of shells the first one is around the second one, (p,).

    *pairs* are in the order of the first ones.  Points at most *near* (k,) from a shell are on it.
    """
    flip = np.zeros(len(half_edges.faces), dtype=bool) if flip is None else flip
    faces = flipped_faces(half_edges.faces, flip)
    faces, (starts, stops) = _by_shell(faces, half_edges.shells, len(near))
    found = np.zeros(len(pairs), dtype=bool)
    if kernels := compiled_checks(int((stops - starts)[pairs[:, 0]].sum())):
        extremes = np.full((len(stops), 6), -1)
        some = np.unique(pairs[:, 1])
        kernels.shell_extremes(extremes, *inputs(some, vertices, faces, starts, stops))
        cones, ends = _cones(half_edges, flip)
        given = inputs(near, vertices, faces, starts, stops, cones, *ends)
        work = partial(kernels.shells_around, found, *inputs(pairs, extremes), _INSIDE, *given)
        in_parallel(work, len(pairs), _FEW_PAIRS, blas=False)
        return found
    for at in np.split(np.arange(len(pairs)), np.flatnonzero(np.diff(pairs[:, 0])) + 1):
        one = pairs[at[0], 0]
        its_vertices, its_faces = _owned(vertices, faces[starts[one] : stops[one]])
        tested = []
        for other in pairs[at, 1]:
            points = _owned(vertices, faces[starts[other] : stops[other]])[0]
            tested.append(points[np.unique([points.argmin(axis=0), points.argmax(axis=0)])])
        firsts = np.array([points[0] for points in tested])
        found[at] = np.abs(winding_number(firsts, its_vertices, its_faces, near[one])) > _INSIDE
        some = np.flatnonzero(found[at])  # few, if any
        if len(some):
            begins = np.cumsum([0, *(len(tested[k]) for k in some[:-1])])
            others = np.concatenate([tested[k] for k in some])
            number = np.abs(winding_number(others, its_vertices, its_faces, near[one]))
            found[at[some]] = np.logical_and.reduceat(number > _INSIDE, begins)
    return found


def _cones(half_edges: HalfEdges, flip: BoolArray) -> tuple[IntArray, tuple[IntArray, IntArray]]:
    """Return faces (c, 3) that close the shells, by shell, and the first and the last of each.

    A cone over the half-edges without opposites, after the flips, to the first vertex of these.
    """
    half = half_edges.unpaired
    if not half_edges.is_oriented:
        one, other = half_edges.neighbours.T
        turned = half_edges.tail[one] == half_edges.tail[other]
        turned = turned ^ flip[one // 3] ^ flip[other // 3]
        half = np.concatenate([half, one[turned], other[turned]])
    ends = np.stack([half_edges.tail[half], half_edges.head_of(half)], axis=1)
    turned = flip[half // 3]
    ends[turned] = ends[turned, ::-1]
    n_shells = int(half_edges.shells.max(initial=-1)) + 1
    ends, (starts, stops) = _by_shell(ends, half_edges.shells[half // 3], n_shells)
    apex = np.repeat(ends[starts[starts < stops], 0], (stops - starts)[starts < stops])
    return np.column_stack([ends[:, ::-1], apex]), (starts, stops)


def _by_shell(
    rows: IntArray, shells: IntArray, n_shells: int
) -> tuple[IntArray, tuple[IntArray, IntArray]]:
    """Return *rows* (r, ...) ordered by shell, and where those of each begin and end, (k,) each."""
    counts = np.bincount(shells, minlength=n_shells)
    stops = np.cumsum(counts)
    return rows[np.argsort(shells, kind="stable")], (stops - counts, stops)


def _boxes(
    vertices: FloatArray, faces: IntArray, shells: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest coordinates of each shell, (k, 3) each."""
    n_shells = int(shells.max()) + 1
    low, high = np.full((n_shells, 3), np.inf), np.full((n_shells, 3), -np.inf)
    by_shell = np.argsort(shells, kind="stable")
    corners, starts = faces[by_shell].ravel(), 3 * first_members(shells[by_shell])
    for axis in range(3):  # numpy takes ten times as long for rows of three numbers
        x = vertices[:, axis][corners]
        low[:, axis] = np.minimum.reduceat(x, starts)
        high[:, axis] = np.maximum.reduceat(x, starts)
    return low, high


def _owned(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the vertices (v, 3) of *faces* (k, 3), and the faces over these."""
    owned, numbers = np.unique(faces, return_inverse=True)
    return vertices[owned], numbers.reshape(-1, 3)


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
