"""Which triangles touch where: edges, fans, shells and borders, without any positions.

A triangle (v_0, v_1, v_2) has three *sides*, directed from each corner to the next.  Side
``h = 3 f + c`` belongs to face f and runs from its corner c to its corner c + 1, so h also names
that corner.  Everything here follows from sorting the 3m sides by the edge they lie on:

    edge     the sides between the same two vertices, in either direction
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
        return self.faces[:, [1, 2, 0]].ravel()

    @cached_property
    def keys(self) -> IntArray:
        """(3m,) int: one number per pair of vertices, whatever the direction; see `edge_keys`."""
        return edge_keys(self.tail, self.head, self.n_vertices)

    @cached_property
    def order(self) -> IntArray:
        """(3m,) int: the sides, those of one edge next to each other, smaller number first."""
        return np.argsort(self.keys, kind="stable")

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
        same_edge = np.diff(self.keys[self.order]) == 0
        one, other = self.order[:-1][same_edge] // 3, self.order[1:][same_edge] // 3
        return connected(len(self.faces), one, other)

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
        _, corner = np.unique(self.fans(self.pairs), return_index=True)
        several = np.bincount(self.tail[corner], minlength=self.n_vertices) > 1
        crowded = self.order[self.first[self.n_sides > 2]]
        several[self.tail[crowded]] = several[self.head[crowded]] = False
        return np.flatnonzero(several)


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
    first = np.empty(count, np.int64)
    first[found[::-1]] = np.arange(n)[::-1]  # of all that are written, the last one stays
    rank = np.empty(count, np.int64)
    rank[np.argsort(first)] = np.arange(count)
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
    order = (
        np.lexsort(rows.T) if len(rows) else np.empty(0, np.int64)
    )  # stable: equal rows stay in their order
    ordered = rows[order]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.empty(len(rows), dtype=np.int64)
    first[order] = order[np.flatnonzero(new)][np.cumsum(new) - 1]
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
