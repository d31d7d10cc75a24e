"""Which triangles touch where: edges, fans, shells and borders, without any positions.

A triangle (v_0, v_1, v_2) has three *sides*, directed from each corner to the next.  Side
``h = 3 f + c`` belongs to face f and runs from its corner c to its corner c + 1, so h also names
that corner.  Everything here follows from sorting the 3m sides by the edge they lie on, and
where each lies against just one other, as on any sound mesh, from these partners alone:

    edge     the sides between the same two vertices, in either direction
    partner  the one other side on an edge, which runs the other way
    open     an edge with one side; the surface ends there
    pair     an edge with two; on a two-manifold every edge is one
    shell    the faces that can be reached from each other across edges
    fan      the corners at one vertex that can be reached from each other across pairs; at each
             vertex of a two-manifold there is exactly one
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, IntArray
from .counting import counting_order, first_members, perhaps_equal

_ROUNDS = 10_000  # steps around a vertex; where more faces meet, `fans` are counted instead


@dataclass(frozen=True, eq=False)
class Sides:
    """The directed sides of triangles, sorted by edge; faces (m, 3) must not repeat a vertex."""

    faces: IntArray
    n_vertices: int

    @cached_property
    def tail(self) -> IntArray:
        """(3m,) int: the vertex where each side starts."""
        return self.faces.ravel()

    @cached_property
    def head(self) -> IntArray:
        """(3m,) int: the vertex where each side ends."""
        return np.roll(self.faces, -1, axis=1).ravel()

    @cached_property
    def keys(self) -> IntArray:
        """(3m,) int: one number per pair of vertices, whatever the direction; see `edge_keys`."""
        return edge_keys(self.tail, self.head, self.n_vertices)

    @cached_property
    def order(self) -> IntArray:
        """(3m,) int: the sides, those of one edge next to each other, smaller number first."""
        by_larger = counting_order(np.maximum(self.tail, self.head), self.n_vertices)
        smaller = np.minimum(self.tail, self.head)[by_larger]
        order: IntArray = by_larger[counting_order(smaller, self.n_vertices)]
        return order

    @cached_property
    def partner(self) -> IntArray | None:
        """(3m,) int: the partner of each side; None unless every edge is a pair, and not turned."""
        one, other = self.order[: len(self.order) // 2 * 2].reshape(-1, 2).T
        tail, head = self.tail[one], self.head[one]
        if not (
            len(self.order) % 2 == 0
            and (tail == self.head[other]).all()
            and (head == self.tail[other]).all()
            and np.diff(edge_keys(tail, head, self.n_vertices)).all()
        ):
            return None
        partner = np.empty_like(self.order)
        partner[one], partner[other] = other, one
        return partner

    @cached_property
    def neighbours(self) -> IntArray | None:
        """(m, 3) int: the face across each side; None where `partner` is."""
        return None if self.partner is None else (self.partner // 3).reshape(-1, 3)

    @cached_property
    def first(self) -> IntArray:
        """(e,) int: where in `order` each edge begins."""
        return np.flatnonzero(np.diff(self.keys[self.order], prepend=-1))

    @cached_property
    def n_sides(self) -> IntArray:
        """(e,) int: the number of sides on each edge."""
        n_sides: IntArray = np.diff(self.first, append=len(self.order))
        return n_sides

    @cached_property
    def open(self) -> IntArray:
        """(b,) int: the sides without a partner."""
        alone: IntArray = self.order[self.first[self.n_sides == 1]]
        return alone

    @cached_property
    def pairs(self) -> IntArray:
        """(p, 2) int: the two sides of every edge that has exactly two."""
        start = self.first[self.n_sides == 2]
        pairs: IntArray = self.order[start[:, None] + [0, 1]]
        return pairs

    @cached_property
    def crowded(self) -> list[IntArray]:
        """The sides of every edge that has three or more, one array per edge."""
        where = np.flatnonzero(self.n_sides > 2)
        return [self.order[self.first[e] : self.first[e] + self.n_sides[e]] for e in where]

    @cached_property
    def turned(self) -> BoolArray:
        """(p,) bool: pairs that run the same way, so that their faces face opposite sides."""
        one, other = self.pairs.T
        turned: BoolArray = self.tail[one] == self.tail[other]
        return turned

    @cached_property
    def shells(self) -> IntArray:
        """(m,) int: the shell of each face, numbered from 0 in the order of first faces."""
        m = len(self.faces)
        # One shell, as nearly always?  To walk over it takes a fifth of the time to find all.
        if self.neighbours is not None and m:
            starts, across = np.arange(0, 3 * m + 1, 3), self.neighbours.ravel()
            links = sparse.csr_array((np.ones(3 * m, bool), across, starts), shape=(m, m))
            if len(csgraph.breadth_first_order(links, 0)[0]) == m:
                return np.zeros(m, dtype=np.int64)
        same_edge = np.diff(self.keys[self.order]) == 0
        one, other = self.order[:-1][same_edge] // 3, self.order[1:][same_edge] // 3
        return connected(m, one, other)

    def fans(self, pairs: IntArray) -> IntArray:
        """Return the fan of each corner, (3m,) int, where only *pairs* (p, 2) hold together."""
        one, other = pairs.T
        start, end = one, following(one)  # the corners at both ends of the first side
        turned = self.tail[one] == self.tail[other]
        partner_of_start = np.where(turned, other, following(other))
        partner_of_end = np.where(turned, following(other), other)
        return connected(
            3 * len(self.faces),
            np.concatenate([start, end]),
            np.concatenate([partner_of_start, partner_of_end]),
        )

    @cached_property
    def pinched(self) -> IntArray:
        """Vertices with several fans, for no other reason than that; crowded edges apart."""
        if self._has_one_fan_each():
            return np.empty(0, dtype=np.int64)
        _, corner = np.unique(self.fans(self.pairs), return_index=True)
        several = np.bincount(self.tail[corner], minlength=self.n_vertices) > 1
        crowded = self.order[self.first[self.n_sides > 2]]
        several[self.tail[crowded]] = several[self.head[crowded]] = False
        return np.flatnonzero(several)

    def _has_one_fan_each(self) -> bool:
        """Tell whether partners show it for each vertex at once; False may be too careful.

        A step across the side that ends at a corner leads to the next corner of its fan.  All
        vertices are gone round together, each from one of its corners back to it; with one fan
        to each, this passes all corners.
        """
        if self.partner is None:
            return False
        step = np.roll(self.partner.reshape(-1, 3), 1, axis=1).ravel()
        start = np.full(self.n_vertices, -1)
        start[self.tail] = np.arange(len(step))
        start = at = start[start >= 0]
        passed = 0
        for _ in range(_ROUNDS):
            if not len(at):
                break
            passed += len(at)
            at = step[at]
            on = at != start
            start, at = start[on], at[on]
        return passed == len(step)


def edge_keys(one: IntArray, other: IntArray, n_vertices: int) -> IntArray:
    """Return a number for each pair of vertices that is the same for (a, b) and (b, a)."""
    return np.minimum(one, other) * n_vertices + np.maximum(one, other)


def following(sides: IntArray) -> IntArray:
    """Return the next side of the same face, or the next corner."""
    return np.where(sides % 3 == 2, sides - 2, sides + 1)


def connected(n: int, one: IntArray, other: IntArray) -> IntArray:
    """Return the group of each of *n* things, (n,) int, when one[i] and other[i] belong together.

    Groups are numbered from 0 in the order of their first members.

    >>> connected(5, np.array([3]), np.array([1]))
    array([0, 1, 2, 1, 3])
    """
    if n == 0:
        return np.empty(0, dtype=np.int64)
    links = sparse.coo_array((np.ones(len(one), bool), (one, other)), shape=(n, n))
    count, found = csgraph.connected_components(links, directed=False)
    rank = np.empty(count, np.int64)
    rank[np.argsort(first_members(found))] = np.arange(count)
    return rank[found]


def first_of_group(group: IntArray) -> IntArray:
    """Return for each thing the number of the first in the same group, (n,) int.

    >>> first_of_group(np.array([7, 4, 7, 4]))
    array([0, 1, 0, 1])
    """
    _, first, which = np.unique(group, return_index=True, return_inverse=True)
    return first[which]


def first_equal_row(rows: NDArray[np.generic]) -> IntArray:
    """Return for each row the number of the first row equal to it, (n,) int; NaN equals nothing.

    >>> first_equal_row(np.array([[0, 1], [2, 3], [0, 1]]))
    array([0, 1, 0])
    """
    suspects = perhaps_equal(rows)  # mostly none, and there is nothing to sort
    some = rows[suspects]
    order = (
        np.lexsort(some.T) if len(some) else np.empty(0, np.int64)
    )  # stable: equal rows stay in their order
    ordered = some[order]
    new = np.ones(len(some), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.arange(len(rows))
    first[suspects[order]] = suspects[order[np.flatnonzero(new)][np.cumsum(new) - 1]]
    return first


def repeats_vertex(faces: IntArray) -> BoolArray:
    """Return which faces name a vertex twice, (m,) bool."""
    a, b, c = faces.T
    repeats: BoolArray = (a == b) | (b == c) | (c == a)
    return repeats


def repeats_face(faces: IntArray) -> BoolArray:
    """Return which faces stand on the same three vertices as an earlier one, (m,) bool."""
    repeats: BoolArray = first_equal_row(np.sort(faces, axis=1)) != np.arange(len(faces))
    return repeats
