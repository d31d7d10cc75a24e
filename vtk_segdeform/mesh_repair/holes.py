"""Close holes with lids that have no flat triangle and, where possible, no intersections.

A lid over the corners of its loop needs no interior vertices if its triangles are about as well
shaped as the faces along the border; otherwise it is refined.  A lid that intersects itself or the
surrounding surface is built again from other triangulations of its loop, and the best is kept:

    least area       by dynamic programming; cuts off bays and follows a curved border
    clipped ears     of the projected loop; for planar borders of any shape, and others with a
                     simple projection

All holes are processed together, so that a mesh with thousands of them takes seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, counted, edge_keys, intersections_of, least_angle
from ..progress import Progress, part, tell
from .hole_borders import border_loops
from .lid_refining import Lids, among, harmonic, joined_twice, refine, split_edges
from .lids import clip_ears, triangulate_long_loop, triangulate_loops

_CUBIC = 64  # most corners of a loop for dynamic programming
_ROUND = np.deg2rad(20.0)  # least angle that is sufficient for any lid
_GAIN = 1.1  # factor by which another lid must increase the least angle
_FLAT = 1e-9  # radians
_NEAREST = 8  # border vertices that a new one interpolates


@dataclass(frozen=True)
class Closing:
    """Lids for the holes of a surface of n vertices.

    Attributes
    ----------
    sizes : list of int
        The number of edges of each hole.
    vertices : (c, 3) float
        New vertices n, n + 1, ...
    faces : (k, 3) int
        The lids, hole by hole.
    sources, weights : (c, 8) int, (c, 8) float
        Border vertices near each new vertex, and their weights; rows sum to 1.
    n_crossing : int
        Number of lids that intersect themselves or the surface, except degenerate ones.
    """

    sizes: list[int]
    vertices: FloatArray
    faces: IntArray
    sources: IntArray
    weights: FloatArray
    n_crossing: int


@dataclass(frozen=True)
class _Scores:
    """Quality of lids, (h,) each; fewer crossings matter most, then flat faces, then angles."""

    crossings: IntArray
    flat: IntArray
    angle: FloatArray

    def worse_than(self, other: _Scores) -> BoolArray:
        """Return for which loops the *other* lid is better, (h,)."""
        fewer_crossings = other.crossings < self.crossings
        equal = other.crossings == self.crossings
        fewer_flat = equal & (other.flat < self.flat)
        equal &= other.flat == self.flat
        rounder = equal & (other.angle > _GAIN * self.angle)
        return np.asarray(fewer_crossings | fewer_flat | rounder)


def close_holes(
    vertices: FloatArray, half_edges: HalfEdges, largest: int, progress: Progress | None = None
) -> Closing:
    """Return lids for the holes of up to *largest* edges.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    half_edges : HalfEdges
        Consistently oriented, at most two on each edge.
    largest : int
        Largest number of edges of a hole that is closed.
    progress : callable, optional
        Called with the fraction done and a text; may raise to cancel.
    """
    borders = border_loops(half_edges, largest)
    if not borders:
        none = np.empty((0, 3))
        return Closing([], none, none.astype(int), np.empty((0, _NEAREST), int), none, 0)
    holes = _Holes(vertices, half_edges, borders)
    return _closing(holes, *_best_lids(holes, progress))


class _Holes:
    """The h loops to close, and the surrounding surface.

    All `Lids` in this file begin with the corners of all loops, in their order.
    """

    def __init__(
        self, vertices: FloatArray, half_edges: HalfEdges, borders: list[IntArray]
    ) -> None:
        self.vertices, self.faces = vertices, half_edges.faces
        self.border = np.concatenate(borders)  # half-edges
        self.corners = half_edges.head[self.border]
        self.length = np.array([len(loop) for loop in borders])
        self.start = np.cumsum(self.length) - self.length
        self.known = np.sort(half_edges.keys)
        self.points = vertices[self.corners]
        edge = np.linalg.norm(vertices[half_edges.tail[self.border]] - self.points, axis=1)
        before = np.arange(len(edge)) - 1
        before[self.start] = self.start + self.length - 1
        self.size = 0.5 * (edge + edge[before])
        triangles = vertices[half_edges.faces[self.border // 3]]
        angles = np.split(least_angle(triangles), self.start[1:])
        self.sufficient = np.minimum(_ROUND, [float(np.median(some)) for some in angles])

    def of(self, loop: int) -> slice:
        """Return the slice of the corners of a loop."""
        return slice(self.start[loop], self.start[loop] + self.length[loop])

    def lids(self, faces: IntArray, centred: IntArray) -> Lids:
        """Return lids of *faces* over the corners and a new vertex in each loop of *centred*."""
        owner = np.repeat(np.arange(len(self.length)), self.length)
        middle = [self.points[self.of(loop)].mean(axis=0) for loop in centred]
        size = [self.size[self.of(loop)].mean() for loop in centred]
        return Lids(
            np.concatenate([self.points, np.reshape(middle, (-1, 3))]),
            np.append(self.size, size),
            np.append(self.corners, np.full(len(centred), -1)),
            np.append(owner, centred),
            faces,
        )


def _best_lids(holes: _Holes, progress: Progress | None) -> tuple[Lids, _Scores]:
    """Return the best lids found, and their scores."""
    lids = plain = _least_area(holes, part(progress, 0.0, 0.5))
    narrow = _least(holes, lids) < holes.sufficient
    scores = _scores(holes, lids, lids, ~narrow)  # others count as worse than any refined lid
    again = narrow | (scores.crossings > 0)
    for k, attempt in enumerate((_refined, _clipped, _unrefined)):
        tell(progress, 0.5 + k / 6, "Refining the lids of holes")
        retried = again & (holes.length > 3)
        if not retried.any():
            break
        tried = attempt(holes, plain, np.flatnonzero(retried))
        retried &= _mask(holes, tried.owner[tried.faces[:, 0]])
        found = _scores(holes, lids, tried, retried)
        better = retried & scores.worse_than(found)
        lids = _together(holes, _only(holes, lids, ~better), _only(holes, tried, better))
        scores = _Scores(
            np.where(better, found.crossings, scores.crossings),
            np.where(better, found.flat, scores.flat),
            np.where(better, found.angle, scores.angle),
        )
        again = scores.crossings > 0
    while (double := joined_twice(lids, holes.known, len(holes.vertices))).any():
        lids = split_edges(lids, double.astype(float))
    return lids, scores


def _least_area(holes: _Holes, progress: Progress | None) -> Lids:
    """Return lids of least area over the corners; a fan with a new vertex if none is allowed."""
    faces: list[IntArray] = [np.empty((0, 3), int)] * len(holes.length)
    centred: list[int] = []
    for n in np.unique(holes.length):
        some = np.flatnonzero(holes.length == n)
        message = f"Filling {counted(len(some), 'hole', 'holes')} of {n} edges"
        tell(progress, np.count_nonzero(holes.length < n) / len(holes.length), message)
        triangles, allowed = _over_corners(holes, some)
        for loop, lid, good in zip(some.tolist(), triangles, allowed.tolist(), strict=True):
            faces[loop] = lid + holes.start[loop]
            if not good:
                at = np.arange(n)
                rim = holes.start[loop] + np.stack([at, np.roll(at, -1)], axis=1)
                middle = len(holes.corners) + len(centred)
                faces[loop] = np.insert(rim, 2, middle, axis=1)
                centred.append(loop)
    return holes.lids(np.concatenate(faces), np.array(centred, dtype=np.int64))


def _over_corners(holes: _Holes, some: IntArray) -> tuple[IntArray, BoolArray]:
    """Return triangles (l, n - 2, 3) for loops of one length, and whether they are allowed."""
    n = int(holes.length[some[0]])
    at = holes.start[some][:, None] + np.arange(n)
    if n == 3:
        return np.tile(np.arange(3), (len(some), 1, 1)), np.ones(len(some), dtype=bool)
    if n > _CUBIC:
        lids = []
        for loop in at:
            clipped = clip_ears(holes.points[loop])
            lids.append(clipped[0] if clipped else triangulate_long_loop(holes.points[loop]))
        return np.stack(lids), np.ones(len(some), dtype=bool)
    ids = holes.corners[at]
    keys = edge_keys(ids[:, :, None], ids[:, None, :], len(holes.vertices))
    return triangulate_loops(holes.points[at], among(keys, holes.known))


def _refined(holes: _Holes, lids: Lids, some: IntArray) -> Lids:
    return refine(_unrefined(holes, lids, some), holes.known, len(holes.vertices))


def _unrefined(holes: _Holes, lids: Lids, some: IntArray) -> Lids:
    return _only(holes, lids, _mask(holes, some))


def _clipped(holes: _Holes, lids: Lids, some: IntArray) -> Lids:
    """Clip ears and refine in the projection, then lift the lid by harmonic heights."""
    del lids
    faces, views = [], np.tile(np.eye(3), (len(holes.length), 1, 1))
    for loop in some:
        if (clipped := clip_ears(holes.points[holes.of(loop)])) is not None:
            faces.append(clipped[0] + holes.start[loop])
            views[loop] = clipped[1]
    lid = _of_corners(holes, faces)
    local = np.einsum("kxy,ky->kx", views[lid.owner], lid.points)
    flat = replace(lid, points=local * [1.0, 1.0, 0.0])
    flat = refine(flat, holes.known, len(holes.vertices))
    points, k = flat.points.copy(), len(local)
    points[:k, 2] = local[:, 2]
    points[:, 2:] = harmonic(flat, points[:, 2:])
    points[:k] = lid.points
    points[k:] = np.einsum("kyx,ky->kx", views[flat.owner[k:]], points[k:])
    return replace(flat, points=points)


def _of_corners(holes: _Holes, faces: list[IntArray]) -> Lids:
    none = np.empty((0, 3), dtype=np.int64)
    return holes.lids(np.concatenate([none, *faces]), np.empty(0, dtype=np.int64))


def _mask(holes: _Holes, some: IntArray) -> BoolArray:
    mask = np.zeros(len(holes.length), dtype=bool)
    mask[some] = True
    return mask


def _only(holes: _Holes, lids: Lids, mask: BoolArray) -> Lids:
    """Return the lids over the loops of *mask* (h,)."""
    keep = mask[lids.owner]
    keep[: len(holes.corners)] = True
    number = np.cumsum(keep) - 1
    return Lids(
        lids.points[keep],
        lids.size[keep],
        lids.origin[keep],
        lids.owner[keep],
        number[lids.faces[mask[lids.owner[lids.faces[:, 0]]]]],
    )


def _together(holes: _Holes, one: Lids, other: Lids) -> Lids:
    """Return the union of two sets of lids over different loops."""
    k, more = len(holes.corners), len(one.points) - len(holes.corners)
    return Lids(
        np.concatenate([one.points, other.points[k:]]),
        np.append(one.size, other.size[k:]),
        np.append(one.origin, other.origin[k:]),
        np.append(one.owner, other.owner[k:]),
        np.concatenate([one.faces, np.where(other.faces < k, other.faces, other.faces + more)]),
    )


def _over_surface(holes: _Holes, lids: Lids) -> IntArray:
    """Return the faces of the lids, over the vertices of the surface followed by new ones."""
    k = len(holes.corners)
    new = len(holes.vertices) + np.arange(len(lids.points) - k)
    return np.append(lids.origin[:k], new)[lids.faces]


def _least(holes: _Holes, lids: Lids) -> FloatArray:
    """Return the least angle of the lid over each loop, (h,)."""
    least = np.full(len(holes.length), np.pi)
    np.minimum.at(least, lids.owner[lids.faces[:, 0]], least_angle(lids.points[lids.faces]))
    return least


def _scores(holes: _Holes, rest: Lids, lids: Lids, scored: BoolArray) -> _Scores:
    """Return scores of *lids* over the loops *scored* (h,), while *rest* closes the others.

    A lid of one triangle has no alternative, so it is not tested for intersections.
    """
    h, k = len(holes.length), len(holes.corners)
    both = _together(holes, _only(holes, rest, ~scored), _only(holes, lids, scored))
    points = np.concatenate([holes.vertices, both.points[k:]])
    faces = _over_surface(holes, both)
    owner = both.owner[both.faces[:, 0]]
    some = np.flatnonzero((scored & (holes.length > 3))[owner])
    hits, _ = intersections_of(
        points, np.concatenate([holes.faces, faces]), len(holes.faces) + some
    ).T
    crossings = np.bincount(owner[hits - len(holes.faces)], minlength=h)
    flat = np.bincount(owner, least_angle(points[faces]) <= _FLAT, minlength=h)
    return _Scores(
        np.where(scored | (holes.length == 3), crossings, np.iinfo(np.int64).max),
        flat.astype(np.int64),
        _least(holes, both),
    )


def _closing(holes: _Holes, lids: Lids, scores: _Scores) -> Closing:
    """Return the `Closing` of the final *lids*."""
    k = len(holes.corners)
    owner, points = lids.owner[k:], lids.points[k:]
    sources = np.zeros((len(points), _NEAREST), dtype=np.int64)
    weights = np.zeros((len(points), _NEAREST))
    for loop in np.unique(owner):
        mine = np.flatnonzero(owner == loop)
        corners = holes.of(loop)
        count = min(_NEAREST, int(holes.length[loop]))
        tree = cKDTree(holes.points[corners])
        distance, near = map(np.asarray, tree.query(points[mine], k=np.arange(1, count + 1)))
        share = 1.0 / np.maximum(distance, 1e-12 * distance[:, -1:] + np.finfo(float).tiny) ** 2
        sources[mine, :count] = holes.corners[corners][near]
        weights[mine, :count] = share / share.sum(axis=1, keepdims=True)
    order = np.argsort(lids.owner[lids.faces[:, 0]], kind="stable")
    return Closing(
        holes.length.tolist(),
        points,
        _over_surface(holes, lids)[order],
        sources,
        weights,
        int(np.count_nonzero((scores.crossings > 0) & (scores.flat == 0))),
    )
