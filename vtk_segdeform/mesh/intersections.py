"""Self-intersections: pairs of triangles of a mesh that cross or touch.

Two faces of an embedded surface are disjoint or share exactly a corner or an edge.  All other
pairs are found in two stages:

    boxes       a sweep along the axis that separates the bounding boxes best leaves few pairs
    triangles   a and b meet if an edge of one pierces the other, d_p d_q <= 0 with the piercing
                point inside; in a common plane, if no edge of either separates them

d are the distances of one triangle's corners from the other's plane.  A shared corner lies in
both planes, so only the edges opposite to it can pierce; faces that share an edge can only fold
over one another.

Source
------
[Moe97] T. Moeller, "A fast triangle-triangle intersection test", J. Graphics Tools 2(2), 25-30,
        1997.  Piercing points replace its interval test, since they remain correct for
        nearly coplanar triangles.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray, as_faces, as_points

_TOUCH = 1e-12  # of a pair's extent: at smaller distances triangles touch and planes coincide
_FOLD = 1e-9  # radians between two faces folded over their common edge
_NEEDLE = 1e-10  # height over longest edge; the plane of a flatter face is undefined
_BATCH = 200_000  # pairs of boxes tested at once
_ALL_FACES = 200_000  # beyond so many `new_crossings` tests only some
_CUBE, _ELSEWHERE = 4.0, 2.0  # a cube in edges; a distance at rest in cubes
_WIDER = 1.0 + 1e-12  # for rounding
_FACES = 10_000  # faces whose neighbourhoods are searched at once

_TINY = 1e-300

_EDGES = ((0, 1), (1, 2), (2, 0))
_OPPOSITE = ((1, 2),)  # the edge opposite to a shared corner, which is rolled to the front


def self_intersections(vertices: ArrayLike, faces: ArrayLike) -> IntArray:
    """Return the pairs of faces that cross, touch or fold over one another.

    Parameters
    ----------
    vertices : (n, 3) float
        In any length unit.
    faces : (m, 3) int
        Without degenerate faces.

    Returns
    -------
    pairs : (k, 2) int
        Smaller face first, in lexicographic order; empty for an embedded surface.  Faces that
        share a corner or an edge and meet only there are not listed.

    Examples
    --------
    >>> self_intersections([[0, 0, 0], [1, 0, 0], [0, 1, 0],
    ...                     [.2, .2, -1], [.2, .2, 1], [2, 2, 0]], [[0, 1, 2], [3, 4, 5]])
    array([[0, 1]])
    """
    points = as_points(vertices, "vertices")
    triangles = as_faces(faces, len(points), "faces")
    corners = points[triangles]
    found = [np.empty((0, 2), dtype=np.int64)]
    for pairs in _overlapping_boxes(corners.min(axis=1), corners.max(axis=1)):
        found.append(pairs[_meet(points, triangles[pairs[:, 0]], triangles[pairs[:, 1]])])
    hits = np.sort(np.concatenate(found), axis=1)
    return hits[np.lexsort((hits[:, 1], hits[:, 0]))]


def new_crossings(
    vertices: FloatArray, rest: FloatArray, faces: IntArray, *, all_faces: int = _ALL_FACES
) -> IntArray:
    """Return the faces (k,) that cross or touch others at *vertices* (n, 3) but not at *rest*.

    A face counts if it is in a pair of `self_intersections` at *vertices* that is none at *rest*.
    Of more than *all_faces*, only those are tested that are near others from elsewhere at rest, or
    turned against others nearby: a fold of a few faces may not be found.
    """
    some = np.arange(len(faces))
    if len(faces) > all_faces:
        some = _suspects(vertices, rest, faces)
    low, high = (np.empty((len(faces), 3)) for _ in range(2))
    corners = vertices[faces[some]]
    low[some], high[some] = corners.min(axis=1), corners.max(axis=1)
    found = [np.empty((0, 2), dtype=np.int64)]
    for near in _boxes_among(low[some], high[some]):
        pairs = some[near]
        pairs = pairs[_meet(vertices, faces[pairs[:, 0]], faces[pairs[:, 1]])]
        found.append(pairs[~_meet(rest, faces[pairs[:, 0]], faces[pairs[:, 1]])])
    return np.unique(np.concatenate(found))


def _suspects(vertices: FloatArray, rest: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces (k,) that may cross others.

    Vertices (n, 3) are sorted into cubes, four times over, each time shifted by a quarter: two
    points less than a quarter apart share one of them.  Surface in one cube may cross itself if it
    comes from elsewhere at *rest*, some cubes away, if it has parts that are not connected, or if
    the normals of the vertices are not all on one side of a plane.
    """
    a, b, c = (np.take(vertices, corner, axis=0) for corner in faces.T)
    edges = np.maximum(np.abs(b - a).max(axis=1), np.abs(c - a).max(axis=1))
    size = _CUBE * float(np.quantile(edges, 0.99))
    across = np.cross(b - a, c - a)
    normals: FloatArray = np.stack(
        [np.bincount(faces.ravel(), np.repeat(axis, 3), len(vertices)) for axis in across.T], axis=1
    )
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
    links = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    graph = sparse.coo_array((np.ones(faces.size, dtype=bool), links), (len(vertices),) * 2)
    component = csgraph.connected_components(graph.tocsr(), directed=False)[1]
    is_near = np.zeros(len(vertices), dtype=bool)
    for shift in range(4):
        cube = np.floor((vertices - vertices.min(axis=0)) / size + 0.25 * shift).astype(np.int64)
        width = cube.max(axis=0) + 1
        key = (cube[:, 0] * width[1] + cube[:, 1]) * width[2] + cube[:, 2]
        order = np.lexsort((component, key))
        first = np.flatnonzero(np.diff(key[order], prepend=-1))
        counts = np.diff(first, append=len(order))
        there = rest[order]
        spread = np.maximum.reduceat(there, first) - np.minimum.reduceat(there, first)
        mean = np.repeat(np.add.reduceat(normals[order], first), counts, axis=0)
        turned = np.einsum("ij,ij->i", mean, normals[order]) <= 0.0
        suspect = (spread > _ELSEWHERE * size).any(axis=1) | np.logical_or.reduceat(turned, first)
        suspect |= component[order[first]] != component[order[first + counts - 1]]
        is_near[order] |= np.repeat(suspect, counts)
    return np.flatnonzero(is_near[faces].any(axis=1))


def _boxes_among(low: FloatArray, high: FloatArray) -> Iterator[IntArray]:
    """Yield, in batches, the pairs of boxes that overlap or touch.

    As in `_boxes_near` the centres are searched separately for each power of two of the size.
    """
    centre, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    size = np.frexp(radius)[1]
    grades = [np.flatnonzero(size == grade) for grade in np.unique(size)]
    trees = [(ids, cKDTree(centre[ids]), float(radius[ids].max())) for ids in grades]
    for k, (ids, tree, largest) in enumerate(trees):
        pairs = ids[tree.query_pairs(2.0 * largest * _WIDER, output_type="ndarray")]
        yield from _overlapping(low, high, pairs)
        for others, smaller, radius_there in trees[:k]:
            reach = (largest + radius_there) * _WIDER
            near = tree.sparse_distance_matrix(smaller, reach, output_type="ndarray")
            yield from _overlapping(
                low, high, np.stack([ids[near["i"]], others[near["j"]]], axis=1)
            )


def _overlapping(low: FloatArray, high: FloatArray, pairs: IntArray) -> Iterator[IntArray]:
    """Yield, in batches, those *pairs* (k, 2) of boxes that overlap or touch."""
    for start in range(0, len(pairs), _BATCH):
        i, j = pairs[start : start + _BATCH].T
        keep = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        yield np.stack([i[keep], j[keep]], axis=1)


def intersections_of(vertices: FloatArray, faces: IntArray, some: IntArray) -> IntArray:
    """Return the pairs of `self_intersections` that involve the faces *some* (s,).

    The cost depends on the number of faces nearby, not on the size of the mesh.

    Returns
    -------
    pairs : (k, 2) int
        One of *some* comes first; a pair of two of them is listed in both orders.
    """
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    found = [np.empty((0, 2), dtype=np.int64)]
    for pairs in _boxes_near(low, high, some):
        found.append(pairs[_meet(vertices, faces[pairs[:, 0]], faces[pairs[:, 1]])])
    return np.concatenate(found)


def _boxes_near(low: FloatArray, high: FloatArray, some: IntArray) -> Iterator[IntArray]:
    """Yield the pairs of *some* boxes and any others that overlap or touch.

    The centres are searched separately for each power of two of the size, so that one large box
    does not slow down the search among small ones.
    """
    centre, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    size = np.frexp(radius)[1]
    trees = {}
    for grade in np.unique(size):
        ids = np.flatnonzero(size == grade)
        trees[grade] = ids, cKDTree(centre[ids])
    for grade in np.unique(size[some]):
        mine = some[size[some] == grade]
        for ids, tree in trees.values():
            reach = float(radius[mine].max() + radius[ids].max()) * (1.0 + 1e-12)
            for start in range(0, len(mine), _FACES):
                part = mine[start : start + _FACES]
                lists = tree.query_ball_point(centre[part], reach)
                count = np.array([len(near) for near in lists])
                i = np.repeat(part, count)
                j = ids[np.fromiter(chain.from_iterable(lists), np.int64, int(count.sum()))]
                keep = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1) & (i != j)
                yield np.stack([i[keep], j[keep]], axis=1)


def flat_faces(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return the indices of faces with nearly zero area, whose plane is undefined."""
    a, b, c = vertices[faces.T]
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)], axis=0)
    return np.flatnonzero(twice_area <= _NEEDLE * longest)


def _overlapping_boxes(low: FloatArray, high: FloatArray) -> Iterator[IntArray]:
    """Yield, in batches of bounded size, the pairs of boxes that overlap or touch."""
    if len(low) < 2:
        return
    best = None
    for axis in range(3):
        order = np.argsort(low[:, axis])
        last = np.searchsorted(low[order, axis], high[order, axis], side="right")
        followers = last - np.arange(1, len(low) + 1)  # boxes that begin within this one
        if best is None or followers.sum() < best[1].sum():
            best = order, followers
    assert best is not None
    order, followers = best
    ends = np.cumsum(followers)
    rows = np.searchsorted(ends, np.arange(_BATCH, ends[-1], _BATCH)) + 1
    for first, last in zip([0, *rows], [*rows, len(low)], strict=True):
        count = followers[first:last]
        i = np.repeat(np.arange(first, last), count)
        step = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
        i, j = order[i], order[i + 1 + step]
        keep = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        yield np.stack([i[keep], j[keep]], axis=1)


def _meet(points: FloatArray, a: IntArray, b: IntArray) -> BoolArray:
    """Return which triangles *a* and *b*, (k, 3) int each, meet outside their common corners."""
    same = a[:, :, None] == b[:, None, :]
    shared = same.sum(axis=(1, 2))
    result = np.asarray(shared == 3)
    two = np.flatnonzero(shared == 2)
    alone_a, alone_b = (same[two].any(axis=axis).argmin(axis=1) for axis in (2, 1))
    begin_a, begin_b = (
        np.take_along_axis(each[two], (alone[:, None] + 1) % 3, axis=1)[:, 0]
        for each, alone in ((a, alone_a), (b, alone_b))
    )
    # The common edge has opposite directions in both faces, unless they are oppositely oriented.
    result[two] = _folded(points[a[two]], points[b[two]], begin_a != begin_b)
    one = np.flatnonzero(shared == 1)
    roll_a, roll_b = (same[one].any(axis=axis).argmax(axis=1) for axis in (2, 1))
    around = np.arange(3)
    a_one = np.take_along_axis(a[one], (roll_a[:, None] + around) % 3, axis=1)
    b_one = np.take_along_axis(b[one], (roll_b[:, None] + around) % 3, axis=1)
    result[one] = _pierce_or_overlap(points[a_one], points[b_one], corner_shared=True)
    none = np.flatnonzero(shared == 0)
    result[none] = _pierce_or_overlap(points[a[none]], points[b[none]], corner_shared=False)
    return result


def _folded(a: FloatArray, b: FloatArray, consistent: BoolArray) -> BoolArray:
    """Return which triangles (k, 3, 3) with a common edge lie on one another."""
    n, m = _unit_normals(a), _unit_normals(b)
    opposite = (np.einsum("ij,ij->i", n, m) < 0) == consistent
    return np.asarray(opposite & (np.linalg.norm(np.cross(n, m), axis=1) <= _FOLD))


def _pierce_or_overlap(a: FloatArray, b: FloatArray, *, corner_shared: bool) -> BoolArray:
    """Return which triangles (k, 3, 3) intersect; a shared corner is the first of both."""
    origin = a[:, :1]
    a, b = a - origin, b - origin
    touch = _TOUCH * np.maximum(np.abs(a).max(axis=(1, 2)), np.abs(b).max(axis=(1, 2)))
    n, m = _unit_normals(a), _unit_normals(b)
    from_b, from_a = _distances(a, b, m, touch), _distances(b, a, n, touch)
    if corner_shared:
        from_a[:, 0] = from_b[:, 0] = 0.0
    own = slice(1, None) if corner_shared else slice(None)
    apart = np.zeros(len(a), dtype=bool)
    for d in (from_a[:, own], from_b[:, own]):
        apart |= (d > 0).all(axis=1) | (d < 0).all(axis=1)

    near = np.flatnonzero(~apart)
    a, b, touch, from_a, from_b = a[near], b[near], touch[near], from_a[near], from_b[near]
    inward_a, inward_b = _inward(a, n[near]), _inward(b, m[near])
    one_plane = (from_a == 0).all(axis=1) | (from_b == 0).all(axis=1)
    hit = one_plane & _overlap(a, b, inward_a, inward_b, touch if corner_shared else -touch)
    edges = _OPPOSITE if corner_shared else _EDGES
    for triangle, d, other, inward in (a, from_b, b, inward_b), (b, from_a, a, inward_a):
        for start, end in edges:
            across = ~one_plane & (d[:, start] * d[:, end] <= 0) & (d[:, start] != d[:, end])
            k = np.flatnonzero(across)
            p, q = triangle[k, start], triangle[k, end]
            t = d[k, start] / (d[k, start] - d[k, end])
            x = p + t[:, None] * (q - p)
            inside = np.einsum("kij,kij->ki", x[:, None] - other[k], inward[k])
            hit[k] |= (inside >= -touch[k, None]).all(axis=1)
    result = np.zeros(len(apart), dtype=bool)
    result[near] = hit
    return result


def _overlap(
    a: FloatArray, b: FloatArray, inward_a: FloatArray, inward_b: FloatArray, depth: FloatArray
) -> BoolArray:
    """Return which coplanar triangles overlap by more than *depth* (k,)."""
    separated = np.zeros(len(a), dtype=bool)
    for triangle, inward, other in (a, inward_a, b), (b, inward_b, a):
        beyond = np.einsum("kijx,kix->kij", other[:, None] - triangle[:, :, None], inward)
        separated |= (beyond.max(axis=2) <= depth[:, None]).any(axis=1)
    return ~separated


def _unit_normals(triangle: FloatArray) -> FloatArray:
    n = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return np.asarray(n / np.where(length > 0, length, 1.0))


def _distances(
    corners: FloatArray, triangle: FloatArray, normal: FloatArray, touch: FloatArray
) -> FloatArray:
    """Return the signed distances of *corners* from the planes, (k, 3); 0 where they touch."""
    d = np.einsum("kij,kj->ki", corners - triangle[:, :1], normal)
    d[np.abs(d) <= touch[:, None]] = 0.0
    return np.asarray(d)


def _inward(triangle: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the in-plane unit vectors that point inward from each edge i, i + 1, (k, 3, 3)."""
    along = triangle[:, [1, 2, 0]] - triangle
    inward = np.cross(normal[:, None], along)
    length = np.linalg.norm(inward, axis=2, keepdims=True)
    return np.asarray(inward / np.where(length > 0, length, 1.0))
