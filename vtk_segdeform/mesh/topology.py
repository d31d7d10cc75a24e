"""Connectivity of a triangle mesh: half-edges, edges, fans, shells and boundaries.

A triangle (v_0, v_1, v_2) has three *half-edges*, directed from each corner to the next.
Half-edge ``h = 3 f + c`` belongs to face f and runs from its corner c to its corner c + 1, so h
also identifies that corner.  Sorting the 3m half-edges by edge gives everything else, but most
surfaces need no sorting: if every vertex has one fan, the boundary and the shells suffice, and
otherwise the other half-edge of each pair.  Compiled kernels find them in one pass over the faces:

    edge      the half-edges between the same two vertices, in either direction
    twin      the other half-edge of an edge that has two of opposite direction
    boundary  an edge with one half-edge
    pair      an edge with two half-edges; on a two-manifold every edge is a pair
    shell     the faces that are connected across edges
    fan       the corners at one vertex that are connected across pairs; each vertex of a
              two-manifold has exactly one

Positions are not used.

Long because each compiled pass has its equivalent in numpy beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import BoolArray, IntArray
from ..freezing import read_only
from ..kernels import compiled_checks, inputs
from .edges import components, edge_keys, flipped_faces, next_half_edge
from .grouping import (
    begins,
    connected,
    first_equal_row,
    first_members,
    renumbered_by_first,
    two_sides,
)

_MOST = 2**31 // 6  # faces, for numbers of 32 bits in the kernels
_LARGEST = 2**63  # of 64-bit integers
_ROUNDS = 10_000  # steps around a vertex; with more faces at a vertex, `fans` are counted
_NONE: IntArray = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """Half-edges of triangles (m, 3), sorted by edge; no face may repeat a vertex."""

    faces: IntArray
    n_vertices: int

    @cached_property
    def tail(self) -> IntArray:
        """(3m,) int: the vertex at which each half-edge starts."""
        return self.faces.ravel()

    @cached_property
    def head(self) -> IntArray:
        """(3m,) int: the vertex at which each half-edge ends."""
        return np.roll(self.faces, -1, axis=1).ravel()

    @cached_property
    def keys(self) -> IntArray:
        """(3m,) int: the edge of each half-edge as one number; see `edge_keys`."""
        return edge_keys(self.tail, self.head, self.n_vertices)

    @cached_property
    def order(self) -> IntArray:
        """(3m,) int: the half-edges sorted by edge, and by number within an edge."""
        return self._by_edge(np.arange(len(self.tail)), self.keys)

    @cached_property
    def _alone(self) -> IntArray | None:
        """`boundary` if every vertex has one fan, and no face is repeated; else maybe None."""
        m, n = len(self.faces), self.n_vertices
        kernels = compiled_checks(m) if m < _MOST else None
        if kernels is None:
            return self._walked()
        (faces,) = inputs(self.faces)
        links, narrow = np.empty(3 * m, dtype=np.int64), np.empty(4 * n + 2, dtype=np.int32)
        border, starts, *after = np.split(narrow, np.cumsum([n, n + 2, n]))
        count = kernels.one_fan_each(border, starts, *after, links, faces)
        if count < 0:
            return None
        alone = np.empty(count, dtype=np.int64)
        if count:
            kernels.border_half_edges(alone, border, faces)
        return self._by_edge(alone)

    def _walked(self) -> IntArray | None:
        """Return `_alone`, in numpy.

        Crossing the half-edge that ends at a corner leads to the next corner of its fan.  The
        walk goes around all vertices at once, each from one of its corners, at a border from the
        first, until it returns or ends; if every vertex has one fan, it visits every corner.
        """
        opposite, (n_alone, *others) = self._paired
        if any(others):
            return None
        alone = np.flatnonzero(opposite == -1) if n_alone else _NONE
        step = opposite.reshape(-1, 3)[:, [2, 0, 1]].ravel()
        start = np.full(self.n_vertices, -1)
        start[self.tail] = np.arange(len(step))
        start[self.tail[alone]] = alone
        start = at = start[start >= 0]
        visited = 0
        for k in range(_ROUNDS):
            if not len(at):
                break
            visited += len(at)
            at = step[at]
            going = (at != start) & (at >= 0)
            if k == 1 and (at[~going] >= 0).any():  # two faces with the same vertices
                return None
            start, at = start[going], at[going]
        return self._by_edge(alone) if visited == len(step) else None

    @cached_property
    def _paired(self) -> tuple[IntArray, tuple[int, int, int]]:
        """`opposite`, and the counts of `pair_half_edges`."""
        m, n = len(self.faces), self.n_vertices
        if m < _MOST and (kernels := compiled_checks(m)):
            opposite, *others = (
                np.empty(size, dtype=np.int64) for size in (3 * m, n + 2, n, 3 * m)
            )
            return opposite, kernels.pair_half_edges(opposite, *others, *inputs(self.faces))
        opposite = np.full(3 * m, -2)
        alone, (one, other) = self.order[self.first[self.counts == 1]], self.pairs.T
        opposite[alone], opposite[one], opposite[other] = -1, other, one
        n_crowded = 3 * m - len(alone) - 2 * len(one)
        return opposite, (len(alone), n_crowded, 2 * int(self.inconsistent.sum()))

    @property
    def all_twins(self) -> bool:
        """Whether every half-edge has a twin, so that all shells are closed and oriented."""
        return not (any(self._paired[1]) if self._alone is None else len(self._alone))

    @property
    def opposite(self) -> IntArray:
        """(3m,) int: the other half-edge of a pair; -1 if there is none, -2 if several."""
        return self._paired[0]

    @cached_property
    def across(self) -> IntArray:
        """(m, 3) int: the face across each half-edge; -1 if there is none, -2 if several."""
        across = np.where(self.opposite < 0, self.opposite, self.opposite // 3)
        return across.reshape(-1, 3)

    @cached_property
    def first(self) -> IntArray:
        """(e,) int: the position in `order` at which each edge begins."""
        return np.flatnonzero(np.diff(self.keys[self.order], prepend=-1))

    @cached_property
    def counts(self) -> IntArray:
        """(e,) int: the number of half-edges on each edge."""
        counts: IntArray = np.diff(self.first, append=len(self.order))
        return counts

    @cached_property
    def boundary(self) -> IntArray:
        """(b,) int: the half-edges that are alone on their edge, in the order of edges."""
        if self._alone is not None:
            return self._alone
        return self._by_edge(np.flatnonzero(self.opposite == -1)) if self._paired[1][0] else _NONE

    @cached_property
    def crowded(self) -> IntArray:
        """(c,) int: the half-edges on edges of three or more, in the order of edges."""
        if self._alone is not None or not self._paired[1][1]:
            return _NONE
        return self._by_edge(np.flatnonzero(self.opposite == -2))

    @property
    def branching(self) -> IntArray:
        """(k,) int: the first half-edge of every edge of three or more, in the order of edges."""
        return self.crowded[begins(self.keys_of(self.crowded))]

    @property
    def is_oriented(self) -> bool:
        """Whether the half-edges of all pairs have opposite directions."""
        return self._alone is not None or not self._paired[1][2]

    @cached_property
    def turned(self) -> IntArray:
        """(t,) int: the first half-edges of inconsistent pairs, in the order of edges."""
        if self.is_oriented:
            return _NONE
        return self._by_edge(self.neighbours[self._parallel, 0])

    def _by_edge(self, half_edges: IntArray, keys: IntArray | None = None) -> IntArray:
        """Return *half_edges* in the order of `order`; *keys* are theirs, if known."""
        keys = self.keys_of(half_edges) if keys is None else keys
        bits = len(self.tail).bit_length()
        if self.n_vertices**2 << bits < _LARGEST:  # both numbers in one: far quicker to sort
            numbered = (keys << bits) | half_edges
            numbered.sort()
            return numbered & ((1 << bits) - 1)
        ordered: IntArray = half_edges[np.lexsort((half_edges, keys))]
        return ordered

    @property
    def unpaired(self) -> IntArray:
        """(k,) int: the half-edges that are not in pairs, in the order of edges."""
        if not len(self.crowded):
            return self.boundary
        return self._by_edge(np.append(self.boundary, self.crowded))

    def head_of(self, half_edges: IntArray) -> IntArray:
        """Return the vertices at which *half_edges* (k,) end: `head`, if only some are needed."""
        return self.tail[next_half_edge(half_edges)]

    def keys_of(self, half_edges: IntArray) -> IntArray:
        """Return the `keys` of *half_edges* (k,)."""
        return edge_keys(self.tail[half_edges], self.head_of(half_edges), self.n_vertices)

    @cached_property
    def pairs(self) -> IntArray:
        """(p, 2) int: the two half-edges of every edge that has exactly two."""
        start = self.first[self.counts == 2]
        pairs: IntArray = self.order[start[:, None] + [0, 1]]
        return pairs

    @cached_property
    def neighbours(self) -> IntArray:
        """(p, 2) int: `pairs`, in any order."""
        one = np.flatnonzero(self.opposite > np.arange(len(self.opposite)))
        return np.stack([one, self.opposite[one]]).T

    @cached_property
    def _parallel(self) -> BoolArray:
        """(p,) bool: which `neighbours` have the same direction."""
        one, other = self.neighbours.T
        parallel: BoolArray = self.tail[one] == self.tail[other]
        return parallel

    @cached_property
    def inconsistent(self) -> BoolArray:
        """(p,) bool: pairs of the same direction, whose two faces have opposite orientation."""
        one, other = self.pairs.T
        inconsistent: BoolArray = self.tail[one] == self.tail[other]
        return inconsistent

    @cached_property
    def net_boundary(self) -> IntArray:
        """(b, 2) int: the sum of the directed edges of the faces: those without opposites, sorted.

        An edge that k more faces have in one direction than in the other occurs k times.
        """
        half = self.boundary
        if len(self.crowded) or len(self.turned):
            turned = self.opposite[self.turned]
            half = self._by_edge(np.concatenate([half, self.crowded, self.turned, turned]))
        if not len(half):
            return np.empty((0, 2), dtype=np.int64)
        forth = np.where(self.tail[half] < self.head_of(half), 1, -1)
        keys = self.keys_of(half)
        first = np.flatnonzero(begins(keys))
        net = np.add.reduceat(forth, first)
        edges = np.stack(np.divmod(keys[first], self.n_vertices), axis=1)
        edges[net < 0] = edges[net < 0, ::-1]
        return np.repeat(edges, np.abs(net), axis=0)

    @cached_property
    def repeated(self) -> BoolArray:
        """(m,) bool: which faces have the same three vertices as an earlier face.

        Such faces share three edges.  So a face can only be one of them if it has no edge alone,
        and across two of its edges the same face, or several faces each.
        """
        if self._alone is not None:
            return np.zeros(len(self.faces), dtype=bool)
        repeated = np.zeros(len(self.faces), dtype=bool)
        a, b, c = self.across.T
        same = (a == b) | (b == c) | (c == a)
        some = np.flatnonzero(same & (a != -1) & (b != -1) & (c != -1))
        if len(some):
            first = first_equal_row(np.sort(self.faces[some], axis=1))
            repeated[some] = first != np.arange(len(some))
        return repeated

    def flipped(self, flip: BoolArray) -> HalfEdges:
        """Return the half-edges with the faces *flip* (m,) in the other direction."""
        if not flip.any():
            return self
        return HalfEdges(flipped_faces(self.faces, flip), self.n_vertices)

    @cached_property
    def shells(self) -> IntArray:
        """(m,) int: the shell of each face, numbered from 0 in the order of their first faces."""
        if self._alone is not None:  # each vertex is in one shell
            return renumbered_by_first(components(self.n_vertices, self.faces)[self.faces[:, 0]])
        patch, half = self.sides[0], self.crowded
        at = np.flatnonzero(~begins(self.keys_of(half)))  # on the edge of the one before
        links = (patch[half[each] // 3] for each in (at - 1, at))
        return connected(int(patch.max(initial=-1)) + 1, *links)[patch]

    @cached_property
    def sides(self) -> tuple[IntArray, BoolArray, BoolArray]:
        """The patch of each face, (m,) int, whether to flip it, and which patches have one side.

        A patch is connected across pairs, and its faces agree after the flips; see `two_sides`.
        """
        one, other = self.neighbours.T
        return read_only(two_sides(len(self.faces), one // 3, other // 3, self._parallel))

    @cached_property
    def one_sided(self) -> BoolArray:
        """(k,) bool: for each shell, whether it contains a surface that has one side only."""
        patch, _, one_sided = self.sides
        found = np.zeros(int(self.shells.max(initial=-1)) + 1, dtype=bool)
        found[self.shells[one_sided[patch]]] = True
        return found

    def fans(self, pairs: IntArray) -> IntArray:
        """Return the fan of each corner, (3m,) int, connected across *pairs* (p, 2) only."""
        return connected(3 * len(self.faces), *self.fan_links(pairs))

    def fan_links(self, pairs: IntArray) -> tuple[IntArray, IntArray]:
        """Return the corners (2p,) at both ends of *pairs* (p, 2), and those across from them."""
        one, other = pairs.T
        start, end = one, next_half_edge(one)  # the corners at both ends of the first half-edge
        parallel = self.tail[one] == self.tail[other]
        across_start = np.where(parallel, other, next_half_edge(other))
        across_end = np.where(parallel, next_half_edge(other), other)
        return np.concatenate([start, end]), np.concatenate([across_start, across_end])

    @cached_property
    def pinched(self) -> IntArray:
        """Vertices with several fans, except the ends of non-manifold edges."""
        if self._alone is not None:
            return _NONE
        corner = first_members(self.fans(self.neighbours))
        several = np.bincount(self.tail[corner], minlength=self.n_vertices) > 1
        several[self.tail[self.crowded]] = several[self.head[self.crowded]] = False
        return np.flatnonzero(several)
