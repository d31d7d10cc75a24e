"""Self-intersections: pairs of triangles of a mesh that cross or touch.

Two faces of an embedded surface are disjoint or share exactly a corner or an edge.  All other
pairs are found in two stages:

    boxes       pairs whose bounding boxes touch are found by a tree (`near_faces`)
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

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, as_faces, as_points
from .near_faces import near_faces

_TOUCH = 1e-12  # of a pair's extent: at smaller distances triangles touch and planes coincide
_FOLD = 1e-9  # radians between two faces folded over their common edge
_BATCH = 200_000  # pairs tested at once
_KNOWN = 4  # poses that are kept besides the last and the rest pose

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
    hits = np.sort(_meeting(points, triangles, np.ones(len(triangles), dtype=bool)), axis=1)
    return hits[np.lexsort((hits[:, 1], hits[:, 0]))]


def new_crossings(vertices: FloatArray, rest: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces (k,) that cross or touch others at *vertices* (n, 3) but not at *rest*.

    A face counts if it is in a pair of `self_intersections` at *vertices* that is none at *rest*.
    Pairs of which neither face has moved are not tested.
    """
    return Crossings(rest, faces).at(vertices)


class Crossings:
    """The faces that cross or touch others in poses of a mesh, but not at rest.

    A pose is tested only where it differs from one of the last few poses.

    Parameters
    ----------
    rest : (n, 3) float
        All vertices at rest.
    faces : (m, 3) int
        The triangles.
    """

    def __init__(self, rest: FloatArray, faces: IntArray) -> None:
        self._rest, self._faces = rest, faces
        self._known = [(rest, np.empty((0, 2), dtype=np.int64))]  # poses, and pairs that cross

    def at(self, x: FloatArray) -> IntArray:
        """Return the faces (k,) of `new_crossings` in the pose *x* (n, 3), not changed later."""
        return np.unique(self.pairs(x))

    def pairs(self, x: FloatArray) -> IntArray:
        """Return the pairs (k, 2) of faces that cross in the pose *x* (n, 3), not changed later."""
        differences = [(x != pose).any(axis=1) for pose, _ in self._known]
        least = int(np.argmin([np.count_nonzero(each) for each in differences]))
        moved = differences[least][self._faces].any(axis=1)
        known = self._known[least][1]
        found = _meeting(x, self._faces, moved)
        found = found[~_meet(self._rest, self._faces[found[:, 0]], self._faces[found[:, 1]])]
        pairs = np.concatenate([known[~moved[known].any(axis=1)], found])
        self._known = [self._known[0], *self._known[1:][-_KNOWN:], (x, pairs)]
        return pairs


def intersections_of(vertices: FloatArray, faces: IntArray, some: IntArray) -> IntArray:
    """Return the pairs of `self_intersections` that involve the faces *some* (s,).

    Returns
    -------
    pairs : (k, 2) int
        One of *some* comes first; a pair of two of them is listed in both orders.
    """
    asked = np.zeros(len(faces), dtype=bool)
    asked[some] = True
    pairs = _meeting(vertices, faces, asked)
    return np.concatenate([pairs, pairs[asked[pairs[:, 1]], ::-1]])


def _meeting(points: FloatArray, faces: IntArray, asked: BoolArray) -> IntArray:
    """Return the pairs (k, 2) of faces that meet, of which one is *asked* (m,), that one first."""
    found = [np.empty((0, 2), dtype=np.int64)]
    for near in near_faces(points, faces, asked):
        for start in range(0, len(near), _BATCH):
            pairs = near[start : start + _BATCH]
            found.append(pairs[_meet(points, faces[pairs[:, 0]], faces[pairs[:, 1]])])
    return np.concatenate(found)


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
