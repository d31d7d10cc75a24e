"""Which faces to flip so that any triangles become consistently oriented, outward if possible.

    patch    faces that are connected across pairs; they get the orientation of their majority
    unit     patches that are connected across non-manifold edges.  Around such an edge, bodies are
             entered and left in turn, so neighbouring faces have opposite directions.  If two or
             more patches without border meet there, they are a body and the others its fins
    outward  a unit that encloses a volume, by itself or under lids, gets a positive volume; within
             another one a negative volume

A lid is a cone over a part of the boundary of a unit, from the mean of its vertices.  A unit has an
outside if the area of its lids is at most 0.6 of its own (`_MOST_LIDS`; half a ball has 0.5), else
it is a sheet.  That decides about orientation only: which components keep a volume under lids is
decided in `geometry.lids`, for oriented faces.  One-sided patches are not changed.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from .edges import flipped_faces
from .grouping import begins, connected, first_members, two_sides
from .shells import NO_VOLUME, ShellSums, outward_signs, shell_depths, shell_volumes
from .topology import HalfEdges

_MOST_LIDS = 0.6  # area of the lids of a unit that has an outside, relative to its own


def faces_to_flip(points: FloatArray, half_edges: HalfEdges) -> tuple[BoolArray, IntArray]:
    """Return which faces (m,) to flip; those of a second call are none.

    Afterwards all pairs agree, except on one-sided patches, and no closed shell is inside-out.
    The number of shells around each closed shell is returned, too.
    """
    patch, flip, two_sided = _patches(half_edges)
    unit = patch
    if len(half_edges.crowded):
        group, turned = _linked(points, half_edges, patch, flip, two_sided)
        flip, unit = flip ^ turned[patch], group[patch]
    one_sided = np.zeros(int(unit.max(initial=-1)) + 1, dtype=bool)
    if flip.any():
        n_flipped = np.bincount(unit, flip)
        minority = n_flipped > np.bincount(unit) - n_flipped
        flip = flip ^ (minority[unit] & two_sided[patch])
    if not two_sided.all():
        one_sided[unit[~two_sided[patch]]] = True
    faces = flipped_faces(half_edges.faces, flip) if flip.any() else half_edges.faces
    sums = shell_volumes(points, faces, unit)
    wrong, depth = _inside_out(points, half_edges, flip, unit, one_sided, sums)
    if wrong.any():
        flip = flip ^ wrong[unit]
    return flip, depth


def _patches(half_edges: HalfEdges) -> tuple[IntArray, BoolArray, BoolArray]:
    """Return the patch of each face, (m,), the faces to flip, and which patches have two sides."""
    if half_edges.is_oriented and not len(half_edges.crowded):
        patch = half_edges.shells
        flip = np.zeros(len(patch), dtype=bool)
        return patch, flip, np.ones(int(patch.max(initial=-1)) + 1, dtype=bool)
    patch, flip, one_sided = half_edges.sides
    return patch, flip, ~one_sided


def _linked(
    points: FloatArray,
    half_edges: HalfEdges,
    patch: IntArray,
    flip: BoolArray,
    two_sided: BoolArray,
) -> tuple[IntArray, BoolArray]:
    """Return the unit of each patch, (q,) int from 0, and which patches to flip.

    Each pair of faces that are neighbours around an edge votes for the relative orientation of
    their patches, by the angle between them; the strongest votes connect all patches of a unit.
    """
    q = len(two_sided)
    bordered = np.zeros(q, dtype=bool)
    bordered[patch[half_edges.boundary // 3]] = True
    half = half_edges.crowded
    edge = np.cumsum(begins(half_edges.keys_of(half))) - 1
    of_body = ~bordered[patch[half // 3]]
    n_of_bodies = np.bincount(edge, of_body)
    used = of_body | (n_of_bodies[edge] < 2)
    edge, half = edge[used], half[used]
    angle = _angles(points, half_edges, half, edge)
    order = np.lexsort((angle, edge))
    begin = np.flatnonzero(np.diff(edge, prepend=-1))  # of each edge
    following = np.arange(1, len(order) + 1)
    following[np.append(begin[1:], len(order)) - 1] = begin
    one, other = order, order[following]
    wedge = (angle[other] - angle[one]) % (2.0 * np.pi)
    forth = (half_edges.tail[half] < half_edges.head_of(half)) ^ flip[half // 3]
    vote = np.where(forth[one] != forth[other], 1.0, -1.0) * (wedge + 1e-3)
    p, r = patch[half[one] // 3], patch[half[other] // 3]
    counts = (p != r) & two_sided[p] & two_sided[r]
    keys, which = np.unique(
        np.minimum(p, r)[counts] * q + np.maximum(p, r)[counts], return_inverse=True
    )
    total = np.bincount(which, vote[counts], len(keys))
    tree = keys
    if len(keys) > 1:
        cost = 2.0 - np.abs(total) / np.abs(total).max(initial=1.0)
        ends = np.stack(np.divmod(keys, q)).astype(np.int32)  # as SciPy before 1.16 requires
        graph = sparse.coo_array((cost, (ends[0], ends[1])), (q, q)).tocsr()
        links = csgraph.minimum_spanning_tree(graph).tocoo()
        tree = links.row.astype(np.int64) * q + links.col
    agree = total[np.searchsorted(keys, tree)] >= 0.0
    return two_sides(q, *np.divmod(tree, q), ~agree)[:2]


def _angles(
    points: FloatArray, half_edges: HalfEdges, half: IntArray, edge: IntArray
) -> FloatArray:
    """Return the angle of the faces of half-edges (h,) around their *edge*, from the first one."""
    tail, head = half_edges.tail[half], half_edges.head_of(half)
    start = points[np.minimum(tail, head)]
    axis = points[np.maximum(tail, head)] - start
    arm = points[half_edges.faces[half // 3].sum(axis=1) - tail - head] - start
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    arm -= np.einsum("hx,hx->h", arm, axis)[:, None] * axis
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    reference = np.repeat(arm[first], np.diff(first, append=len(edge)), axis=0)
    x = np.einsum("hx,hx->h", arm, reference)
    y = np.einsum("hx,hx->h", arm, np.cross(axis, reference))
    return np.asarray(np.arctan2(y, x))


def _inside_out(
    points: FloatArray,
    half_edges: HalfEdges,
    flip: BoolArray,
    unit: IntArray,
    one_sided: BoolArray,
    sums: ShellSums,
) -> tuple[BoolArray, IntArray]:
    """Return which units enclose a volume of the wrong sign, (u,) bool, with faces flipped.

    Also the number of shells around each shell that has an outside, (k,) int.
    """
    shells = half_edges.shells
    of_shell = unit[first_members(shells)]
    alone = np.ones(len(of_shell), dtype=bool)  # whether the shell is a unit
    alone[shells[half_edges.crowded // 3]] = False
    closed = alone & ~one_sided[of_shell]
    closed[shells[half_edges.boundary // 3]] = False
    volume, area, size = sums
    under_lids, lids = _lids(points, half_edges, flip, unit)
    volume = volume + under_lids
    encloses = (lids <= _MOST_LIDS * area) & ~one_sided
    tiny = NO_VOLUME * (area * size)
    wrong = encloses & (volume < -tiny)
    wrong[of_shell[alone]] = False  # first those on which the winding numbers of shells depend
    flip = flip ^ wrong[unit] if wrong.any() else flip
    depth = shell_depths(points, half_edges, alone & encloses[of_shell], flip)
    outward = outward_signs(volume[of_shell], depth, closed)[alone]
    of_shell = of_shell[alone]
    wrong[of_shell] = encloses[of_shell] & (outward * volume[of_shell] < -tiny[of_shell])
    return wrong, depth


def _lids(
    points: FloatArray, half_edges: HalfEdges, flip: BoolArray, unit: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the volume and the area of the lids of each unit, (u,) float each."""
    n_units, half = int(unit.max(initial=-1)) + 1, half_edges.unpaired
    if not len(half):
        return np.zeros(n_units), np.zeros(n_units)
    edge = np.cumsum(begins(half_edges.keys_of(half))) - 1
    n_edges = int(edge[-1]) + 1
    forth = (half_edges.tail[half] < half_edges.head_of(half)) ^ flip[half // 3]
    keys, first, which = np.unique(
        unit[half // 3] * n_edges + edge, return_index=True, return_inverse=True
    )
    times = np.bincount(which, np.where(forth, 1.0, -1.0), len(keys))
    keys, half, times = (each[times != 0.0] for each in (keys, half[first], times))
    if not len(keys):
        return np.zeros(n_units), np.zeros(n_units)
    owner = keys // n_edges
    ends = np.sort(np.stack([half_edges.tail[half], half_edges.head_of(half)]), axis=0)
    tail, head = np.where(times > 0.0, ends, ends[::-1])
    nodes, ends = np.unique(owner * len(points) + [tail, head], return_inverse=True)
    ends = ends.reshape(2, -1)
    lid = connected(len(nodes), *ends)[ends[0]]
    weight = np.abs(times)
    origin = points[half_edges.faces[first_members(unit), 0]][owner]
    a, b = points[head] - origin, points[tail] - origin
    centre = np.stack([np.bincount(lid, weight * x) for x in b.T], axis=1)
    c = (centre / np.bincount(lid, weight)[:, None])[lid]
    volume = np.einsum("bx,bx->b", a, np.cross(b, c)) / 6.0
    area = np.linalg.norm(np.cross(a - c, b - c), axis=1) / 2.0
    volumes = np.bincount(owner, weight * volume, n_units)
    areas = np.bincount(owner, weight * area, n_units)
    return np.asarray(volumes, np.float64), np.asarray(areas, np.float64)
