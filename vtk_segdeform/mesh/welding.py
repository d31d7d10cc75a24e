"""Welding: points at the same position on borders become one vertex.

The two sides of a seam may be computed in different ways, as at 0 and 2 pi of a cylinder, so
positions are compared up to a few rounding errors.  Points that differ by more, such as those that
a file with few digits rounded differently, are not welded: no tolerance distinguishes them safely
from a narrow gap.  `soup` reports that they almost coincide.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from .faults import Search, distinct_faces
from .grouping import connected, first_equal_row, first_members
from .topology import HalfEdges

_ROUNDINGS = 4.0  # of the largest coordinate, in the precision of all: the same position
_NEARLY = 1e-2  # of the shortest edge at both points
_NEAREST = 3  # other points of borders that are looked at


def welded(points: FloatArray, found: Search) -> tuple[IntArray, BoolArray, HalfEdges, IntArray]:
    """Weld points of borders and of open sheets.

    Return the point that each point (p,) is welded to, the faces (m,) kept, half-edges, and the
    points (k,) of borders that almost coincide.
    """
    target, half_edges, first_at = np.arange(len(points)), found.half_edges, found.first_at
    kept, near = ~(found.degenerate | found.duplicate), np.empty((0, 2), dtype=np.int64)
    same = rounding(points)
    while len(half_edges.boundary):  # a face that is dropped may leave a border
        weld = _coinciding_sheets(half_edges, first_at)
        weld[half_edges.tail[half_edges.boundary]] = True
        weld[half_edges.head_of(half_edges.boundary)] = True
        some = np.flatnonzero(weld)
        place, first_there = first_at[some], np.empty(len(points), dtype=np.int64)
        first_there[place[::-1]] = some[::-1]  # the last write wins
        first = first_there[place]
        number = np.arange(len(points))
        if (first == some).all():
            near = _near_on_borders(points, half_edges, same)
            apart = np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
            is_same = apart <= same
            if not is_same.any():
                break
            one, two = near[is_same].T
            part = connected(len(points), np.append(number, one), np.append(first_at, two))
            first_at, near = first_members(part)[part], near[:0]
            continue
        number[some] = first
        target = number[target]
        degenerate, duplicate, half_edges = distinct_faces(number[half_edges.faces], len(points))
        kept[kept] = ~(degenerate | duplicate)
    return target, kept, half_edges, np.unique(near)


def rounding(points: FloatArray) -> float:
    """Return the distance up to which points are at the same position, up to rounding errors."""
    with np.errstate(over="ignore"):
        is_single = bool((points.astype(np.float32) == points).all())
    precision = np.finfo(np.float32 if is_single else np.float64).eps
    return _ROUNDINGS * float(precision) * float(np.abs(points).max(initial=0.0))


def _near_on_borders(points: FloatArray, half_edges: HalfEdges, same: float) -> IntArray:
    """Return pairs (k, 2) of vertices of borders that almost coincide, relative to their edges.

    Edges no longer than *same* are ignored: at a pole, one point is given many times.  Both ends of
    such an edge may be a pair, those of a longer one may not.
    """
    ends = np.append(half_edges.tail[half_edges.boundary], half_edges.head_of(half_edges.boundary))
    is_border = np.zeros(len(points), dtype=bool)
    is_border[ends] = True
    border = np.flatnonzero(is_border)
    first, second, third = is_border[half_edges.faces.T]
    faces = half_edges.faces[np.flatnonzero(first | second | third)]
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    edges = points.take(tail, axis=0) - points.take(head, axis=0)
    length = np.sqrt(np.einsum("ij,ij->i", edges, edges))
    shortest = np.full(len(points), np.inf)
    for end in (tail, head):
        np.minimum.at(shortest, end, np.where(length > same, length, np.inf))
    shortest[np.isinf(shortest)] = 0.0
    shortest = shortest[border]
    most = np.nextafter(_NEARLY * shortest.max(initial=0.0), np.inf)  # farther ones are not sought
    tree = cKDTree(points[border], compact_nodes=False, balanced_tree=False)  # sooner built
    found = tree.query(points[border], min(_NEAREST + 1, len(border)), distance_upper_bound=most)
    away, other = (np.reshape(each, (len(border), -1)) for each in found)
    one, k = np.nonzero(np.isfinite(away))
    away, other = away[one, k], other[one, k]
    is_near = (one != other) & (away <= _NEARLY * np.minimum(shortest[one], shortest[other]))
    pairs: IntArray = border[np.stack([one, other], axis=1)[is_near]]
    if not len(pairs):
        return pairs
    is_end, n = np.zeros(len(points), dtype=bool), len(points)
    is_end[pairs] = True
    some = np.flatnonzero(is_end[tail] & is_end[head])
    low, high = np.minimum(tail[some], head[some]), np.maximum(tail[some], head[some])
    is_edge = np.isin(np.sort(pairs, axis=1) @ [n, 1], low * n + high)
    kept: IntArray = pairs[~is_edge | (away[is_near] <= same)]
    return kept


def _coinciding_sheets(half_edges: HalfEdges, first_at: IntArray) -> BoolArray:
    """Return the vertices (p,) of faces of open shells with all positions of another such face."""
    found = np.zeros(len(first_at), dtype=bool)
    if (first_at == np.arange(len(first_at))).all():
        return found
    used = np.zeros_like(found)
    used[half_edges.faces] = True
    shared = used & (np.bincount(first_at[used], minlength=len(first_at)) > 1)[first_at]
    border = np.zeros_like(found)
    border[half_edges.tail[half_edges.boundary]] = True
    border[half_edges.head_of(half_edges.boundary)] = True
    if border[used].all():
        return found
    some = np.flatnonzero(shared[half_edges.faces[:, 0]])
    some = some[shared[half_edges.faces[some, 1:]].all(axis=1)]
    if border[half_edges.faces[some]].all():  # as along seams: no need to find the shells
        return found
    shells = half_edges.shells
    is_open = np.zeros(int(shells.max()) + 1, dtype=bool)
    is_open[shells[half_edges.boundary // 3]] = True
    faces = half_edges.faces[some[is_open[shells[some]]]]
    if border[faces].all():
        return found
    first = first_equal_row(np.sort(first_at[faces], axis=1))
    again = first != np.arange(len(first))
    found[faces[again]] = found[faces[first[again]]] = True
    return found
