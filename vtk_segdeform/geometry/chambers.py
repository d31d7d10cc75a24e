"""Chambers: the parts of space that a surface with inner walls encloses.

The surfaces of a label map share the walls between neighbouring labels, and along the border of a
wall three or more faces meet.  Such a surface is not closed in the sense of `Mesh.boundary`: a wall
belongs to both of its sides, with opposite orientation.

Faces that are connected across edges of two faces form a *patch*, with a front and a back.  Around
an edge of three or more faces, ordered by angle, the side of each that looks at the next one lies
in the same part of space as the side of that which looks back; so are both sides of a patch with a
free border.  Sides that are connected in this way bound a chamber.  One of them, whose volume is
negative with its faces turned outward, is the outside of the surface.

Source
------
Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson, "Mesh arrangements for solid geometry", ACM Trans.
Graph. 35(4), 39, 2016, section 3.2 (cells of patches, ordered around edges).
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray
from ..mesh import HalfEdges, connected
from .volume import corner_and_edges, signed_volume

NO_VOLUME = 1e-11
"""Of the area to the power 3/2: a volume that is 0 to rounding."""
_FRONT, _BACK = 0, 1
_PASSES = 5  # until all edges have an order; two are enough for most
_FEW_FACES = 5  # at an edge, of which all orders are tried


class Chambers(NamedTuple):
    """The chambers of a surface, or none if at most two faces meet at every edge."""

    inside: tuple[IntArray, ...]
    """(k, 3) each: the faces around each chamber, turned outward, in the order of first faces."""
    hulls: tuple[IntArray, ...]
    """(k, 3) each: the faces around all chambers of a connected part of the surface together: those
    that are around one only.  So their volume is the sum of that of the chambers."""
    flat: tuple[IntArray, ...] = ()
    """(k, 3) each: faces around nothing, as a flap and its lid are."""


NO_CHAMBERS = Chambers((), ())


def chambers_of(vertices: FloatArray, faces: IntArray) -> Chambers:
    """Return the chambers of the parts of a surface that have inner walls.

    Parameters
    ----------
    vertices : (n, 3) float
        In any length unit.
    faces : (m, 3) int
        Neighbours across an edge of two faces have the same orientation.

    Examples
    --------
    Two tetrahedra with a common wall.

    >>> vertices = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, 0, 0.0]])
    >>> upper, lower = [[0, 2, 3], [0, 3, 4], [0, 4, 2]], [[1, 3, 2], [1, 4, 3], [1, 2, 4]]
    >>> found = chambers_of(vertices, np.array([*upper, *lower, [2, 3, 4]]))
    >>> [len(each) for each in found.inside], [len(each) for each in found.hulls]
    ([4, 4], [6])
    """
    half_edges = HalfEdges(faces, len(vertices))
    if not len(half_edges.crowded):
        return NO_CHAMBERS
    patch = connected(len(faces), *(half_edges.pairs // 3).T)
    sides = 2 * (int(patch.max()) + 1)
    free = np.unique(patch[half_edges.boundary // 3])
    borders = np.stack([2 * free + _FRONT, 2 * free + _BACK])
    around = _around_edges(vertices, half_edges, patch)
    crowded = np.zeros(int(half_edges.shells.max()) + 1, dtype=bool)
    crowded[half_edges.shells[half_edges.crowded // 3]] = True
    own = np.flatnonzero(crowded[half_edges.shells])
    part = _closed(_apart(around, borders, sides), half_edges, patch)
    every = _around_parts(faces, own, part[2 * patch[own, None] + [_FRONT, _BACK]])
    inside, shells, flat = [], [], []
    for first, each in every:
        points = vertices - vertices[each[0, 0]]
        _, e, f = corner_and_edges(points, each)
        area = 0.5 * float(np.linalg.norm(np.cross(e, f), axis=1).sum())
        volume, tiny = signed_volume(points, each), NO_VOLUME * area**1.5
        if abs(volume) <= tiny:
            flat.append(each)
        elif volume > 0.0:
            inside.append(each)
            shells.append(half_edges.shells[first])
    together = [
        np.concatenate([each for each, of in zip(inside, shells, strict=True) if of == shell])
        for shell in dict.fromkeys(shells)
    ]
    hulls = tuple(_without_walls(each) for each in together)
    return Chambers(tuple(inside), hulls, tuple(flat))


def _without_walls(faces: IntArray) -> IntArray:
    """Return *faces* (k, 3) without pairs of opposite orientation."""
    a, b, c = faces.T
    sign = np.sign(b - a) * np.sign(c - b) * np.sign(c - a)
    _, first, same = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True
    )
    total = np.bincount(same.ravel(), sign)
    return np.asarray(faces[np.sort(first[total != 0.0])])


def _apart(around: list[IntArray], borders: IntArray, sides: int) -> IntArray:
    """Return the part of space of each side, (sides,), with different ones on both sides of a wall.

    Where faces fold over each other, as along slivers of a smoothed label map, they are not in the
    order of their sides.  So edges are joined in the order of *around*, which is that of their
    reliability, and if the sides of a wall would be joined, in another order of their faces.  Edges
    for which there is none come first in another pass.
    """
    for _ in range(_PASSES):
        part, failed = _joined(around, borders, sides)
        if not failed:
            break
        others = np.setdiff1d(np.arange(len(around)), failed)
        around = [around[k] for k in (*failed, *others)]
    return part


def _joined(around: list[IntArray], borders: IntArray, sides: int) -> tuple[IntArray, list[int]]:
    """Return the part of space of each side, (sides,), and the edges whose sides are not joined."""
    parent, members = list(range(sides)), [[side] for side in range(sides)]

    def joins(pairs: IntArray) -> bool:
        """Join *pairs* (2, k), unless this would join the sides of a wall: return whether."""
        done: list[tuple[int, int]] = []
        for one, other in pairs.T.tolist():
            a, b = parent[one], parent[other]
            if a == b:
                continue
            if len(members[a]) < len(members[b]):
                a, b = b, a
            is_wall = one // 2 != other // 2  # not the sides of a sheet
            if is_wall and any(parent[side ^ 1] == a for side in members[b]):
                for kept, moved in reversed(done):
                    del members[kept][-len(members[moved]) :]
                    for side in members[moved]:
                        parent[side] = moved
                return False
            done.append((a, b))
            members[a] += members[b]
            for side in members[b]:
                parent[side] = a
        return True

    joins(borders)
    failed = []
    for k, (before, behind) in enumerate(around):
        rest = range(1, len(before))
        orders = permutations(rest) if len(before) <= _FEW_FACES else [rest]
        if not any(joins(np.stack([behind[[0, *o]], before[[*o, 0]]])) for o in orders):
            failed.append(k)
    return np.array(parent), failed


def _around_parts(faces: IntArray, own: IntArray, part: IntArray) -> list[tuple[int, IntArray]]:
    """Return the faces around each part of space, turned outward, and the number of the first one.

    In the order of these.  *part* (k, 2) is that of the front and the back of the faces *own* (k,).
    """
    is_wall = part[:, 0] != part[:, 1]
    own, (front, back) = own[is_wall], part[is_wall].T
    turned = np.concatenate([faces[own], faces[own][:, [0, 2, 1]]])
    number, face = np.concatenate([back, front]), np.concatenate([own, own])
    order = np.lexsort((face, number))
    pieces = np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else []
    return sorted(((int(face[p[0]]), turned[p]) for p in pieces), key=lambda each: each[0])


def _closed(part: IntArray, half_edges: HalfEdges, patch: IntArray) -> IntArray:
    """Return the *part* of each side, with parts joined that are closed together only.

    Those that have the same edge in their boundaries are.
    """
    half = half_edges.crowded
    sides = 2 * patch[half // 3] + np.array([[_BACK], [_FRONT]])
    sign = np.where(half_edges.tail[half] < half_edges.head[half], 1, -1) * [[1], [-1]]
    count = int(part.max()) + 1
    edge = np.cumsum(np.diff(half_edges.keys[half], prepend=-1) != 0)
    found, own = np.unique(edge * count + part[sides], return_inverse=True)
    found = found[np.bincount(own.ravel(), sign.ravel()) != 0.0]
    edge, number = np.divmod(found, count)
    same = edge[1:] == edge[:-1]
    return np.asarray(connected(count, number[1:][same], number[:-1][same])[part])


def _around_edges(vertices: FloatArray, half_edges: HalfEdges, patch: IntArray) -> list[IntArray]:
    """Return the sides (2, k) before and behind each of k faces around edges of three or more.

    The faces are in the order of their angles.  A side is twice the number of its patch, plus 1 on
    the back.  Of edges between the same patches only the one whose faces are farthest apart is
    used; these are in the order of that.
    """
    half = half_edges.crowded
    tail, head = half_edges.tail[half], half_edges.head[half]
    last = half_edges.faces[half // 3, (half + 2) % 3]
    is_forward = tail < head
    start = np.flatnonzero(np.diff(half_edges.keys[half], prepend=-1))
    sizes = np.diff(start, append=len(half))
    edge = np.repeat(np.arange(len(start)), sizes)
    origin = vertices[np.minimum(tail, head)]
    axis = vertices[np.maximum(tail, head)] - origin
    length = np.linalg.norm(axis, axis=1)
    axis /= np.maximum(length, np.finfo(float).tiny)[:, None]
    away = vertices[last] - origin
    away -= np.einsum("ij,ij->i", away, axis)[:, None] * axis
    x = away[start][edge]
    y = np.cross(axis, x)
    angle = np.arctan2(np.einsum("ij,ij->i", away, y), np.einsum("ij,ij->i", away, x))
    angle %= 2.0 * np.pi

    order = np.lexsort((angle, edge))
    after = np.arange(1, len(order) + 1)
    after[start + sizes - 1] = start  # the last face at an edge is followed by the first one
    gap = (angle[order][after] - angle[order]) % (2.0 * np.pi)
    apart = np.minimum.reduceat(gap, start) * length[start]
    _, e, f = corner_and_edges(vertices, half_edges.faces)
    areas = np.bincount(patch, np.linalg.norm(np.cross(e, f), axis=1))
    apart *= np.minimum.reduceat(areas[patch[half // 3]], start) ** 0.5  # tiny patches last
    # The sides of each face: before it and after it, with the angle.  The normal of a face whose
    # half-edge is forward points on, to larger angles.
    before = 2 * patch[half // 3] + np.where(is_forward, _BACK, _FRONT)
    behind = 2 * patch[half // 3] + np.where(is_forward, _FRONT, _BACK)
    rows = np.sort(_padded(before, edge, sizes), axis=1)
    both = np.stack([before, behind])[:, order]
    return [both[:, start[e] : start[e] + sizes[e]] for e in _best_of_equal(rows, apart)]


def _padded(values: IntArray, row: IntArray, sizes: IntArray) -> IntArray:
    """Return *values* in rows of *sizes*, padded with -1."""
    table = np.full((len(sizes), int(sizes.max())), -1)
    table[row, np.arange(len(row)) - np.repeat(np.cumsum(sizes) - sizes, sizes)] = values
    return table


def _best_of_equal(rows: IntArray, value: FloatArray) -> IntArray:
    """Return the row of largest *value* (k,) among each set of equal *rows* (k, w), by value."""
    _, same = np.unique(rows, axis=0, return_inverse=True)
    order = np.lexsort((-value, same.ravel()))
    best = order[np.diff(same.ravel()[order], prepend=-1) != 0]
    return np.asarray(best[np.argsort(-value[best], kind="stable")])
