"""Connectivity of a triangle mesh: half-edges, edges, fans, shells and boundaries.

A triangle (v_0, v_1, v_2) has three *half-edges*, directed from each corner to the next.
Half-edge ``h = 3 f + c`` belongs to face f and runs from its corner c to its corner c + 1, so h
also identifies that corner.  Sorting the 3m half-edges by edge gives everything else; on a closed,
consistently oriented surface, where every half-edge has a twin, the twins alone suffice:

    edge      the half-edges between the same two vertices, in either direction
    twin      the other half-edge of an edge that has two of opposite direction
    boundary  an edge with one half-edge
    pair      an edge with two half-edges; on a two-manifold every edge is a pair
    shell     the faces that are connected across edges
    fan       the corners at one vertex that are connected across pairs; each vertex of a
              two-manifold has exactly one

Positions are not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, IntArray
from .grouping import connected, counting_order, first_equal_row, first_members

_NAMELESS = (
    "order", "twin", "opposite", "across", "first", "counts", "boundary", "pairs", "inconsistent",
    "repeated", "shells", "sides", "one_sided",
)  # fmt: skip
_ROUNDS = 10_000  # steps around a vertex; with more faces at a vertex, `fans` are counted


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
        by_larger = counting_order(np.maximum(self.tail, self.head), self.n_vertices)
        smaller = np.minimum(self.tail, self.head)[by_larger]
        order: IntArray = by_larger[counting_order(smaller, self.n_vertices)]
        return order

    @cached_property
    def twin(self) -> IntArray | None:
        """(3m,) int: the twin of each half-edge; None unless every half-edge has one."""
        one, other = self.order[: len(self.order) // 2 * 2].reshape(-1, 2).T
        tail, head = self.tail[one], self.head[one]
        if not (
            len(self.order) % 2 == 0
            and (tail == self.head[other]).all()
            and (head == self.tail[other]).all()
            and np.diff(edge_keys(tail, head, self.n_vertices)).all()
        ):
            return None
        twin = np.empty_like(self.order)
        twin[one], twin[other] = other, one
        return twin

    @cached_property
    def opposite(self) -> IntArray:
        """(3m,) int: the other half-edge of a pair; -1 if there is none, -2 if several."""
        if self.twin is not None:
            return self.twin
        opposite = np.full(3 * len(self.faces), -2)
        opposite[self.boundary] = -1
        one, other = self.pairs.T
        opposite[one], opposite[other] = other, one
        return opposite

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
        """(b,) int: the half-edges that are alone on their edge."""
        boundary: IntArray = self.order[self.first[self.counts == 1]]
        return boundary

    @cached_property
    def pairs(self) -> IntArray:
        """(p, 2) int: the two half-edges of every edge that has exactly two."""
        start = self.first[self.counts == 2]
        pairs: IntArray = self.order[start[:, None] + [0, 1]]
        return pairs

    @cached_property
    def non_manifold(self) -> list[IntArray]:
        """The half-edges of every edge that has three or more, one array per edge."""
        where = np.flatnonzero(self.counts > 2)
        return [self.order[self.first[e] : self.first[e] + self.counts[e]] for e in where]

    @cached_property
    def inconsistent(self) -> BoolArray:
        """(p,) bool: pairs of the same direction, whose two faces have opposite orientation."""
        one, other = self.pairs.T
        inconsistent: BoolArray = self.tail[one] == self.tail[other]
        return inconsistent

    @cached_property
    def edge_keys(self) -> IntArray:
        """(e,) int: the key of each edge, sorted."""
        keys: IntArray = self.keys[self.order[self.first]]
        return keys

    @cached_property
    def net_boundary(self) -> IntArray:
        """(b, 2) int: the sum of the directed edges of the faces: those without opposites, sorted.

        An edge that k more faces have in one direction than in the other occurs k times.
        """
        if self.twin is not None:
            return np.empty((0, 2), dtype=np.int64)
        summed = self.counts != 2
        summed[np.flatnonzero(~summed)[self.inconsistent]] = True
        half = self.order[np.repeat(summed, self.counts)]
        forth = np.where(self.tail[half] < self.head[half], 1, -1)
        counts = self.counts[summed]
        net = np.add.reduceat(forth, np.cumsum(counts) - counts) if len(half) else forth
        edges = np.stack(np.divmod(self.edge_keys[summed], self.n_vertices), axis=1)
        edges[net < 0] = edges[net < 0, ::-1]
        return np.repeat(edges, np.abs(net), axis=0)

    @cached_property
    def repeated(self) -> BoolArray:
        """(m,) bool: which faces have the same three vertices as an earlier face.

        Such faces share three edges.  So a face can only be one of them if it has no edge alone,
        and across two of its edges the same face, or several faces each.
        """
        a, b, c = self.across.T
        same = (a == b) | (b == c) | (c == a)
        some = np.flatnonzero(same & (a != -1) & (b != -1) & (c != -1))
        repeated = np.zeros(len(self.faces), dtype=bool)
        first = first_equal_row(np.sort(self.faces[some], axis=1))
        repeated[some] = first != np.arange(len(some))
        return repeated

    def renumbered(self, number: IntArray, n_vertices: int) -> HalfEdges:
        """Return the half-edges with each vertex v called number[v], which keeps their order.

        What does not depend on the names of vertices is passed on.
        """
        renamed = HalfEdges(number[self.faces], n_vertices)
        for name in _NAMELESS:
            if name in self.__dict__:
                renamed.__dict__[name] = self.__dict__[name]
        return renamed

    @cached_property
    def shells(self) -> IntArray:
        """(m,) int: the shell of each face, numbered from 0 in the order of their first faces."""
        m = len(self.faces)
        # Most meshes are one shell; testing for that takes a fifth of the time of the general case.
        if m and (self.twin is not None or self.counts.max() <= 2):
            starts, faces = np.arange(0, 3 * m + 1, 3), np.arange(m)[:, None]
            across = np.where(self.across < 0, faces, self.across).ravel()  # itself at a border
            links = sparse.csr_array((np.ones(3 * m, bool), across, starts), shape=(m, m))
            if len(csgraph.breadth_first_order(links, 0)[0]) == m:
                return np.zeros(m, dtype=np.int64)
        later = np.ones(len(self.order), dtype=bool)  # on an edge, than its first half-edge
        later[self.first] = False
        at = np.flatnonzero(later)
        return connected(m, self.order[at - 1] // 3, self.order[at] // 3)

    @cached_property
    def sides(self) -> tuple[IntArray, BoolArray]:
        """The side that each face shares with its neighbours, (m,) int, and whether to flip it.

        Neighbours are those across pairs; see `two_sides`.
        """
        one, other = self.pairs.T // 3
        return two_sides(len(self.faces), one, other, self.inconsistent)

    @cached_property
    def one_sided(self) -> BoolArray:
        """(k,) bool: for each shell, whether it contains a surface that has one side only."""
        one, other = self.pairs.T // 3
        _, flip = self.sides
        left = (flip[one] ^ flip[other]) != self.inconsistent
        found = np.zeros(int(self.shells.max(initial=-1)) + 1, dtype=bool)
        found[self.shells[one[left]]] = True
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
        if self._has_one_fan_each():
            return np.empty(0, dtype=np.int64)
        _, corner = np.unique(self.fans(self.pairs), return_index=True)
        several = np.bincount(self.tail[corner], minlength=self.n_vertices) > 1
        excluded = self.order[self.first[self.counts > 2]]
        several[self.tail[excluded]] = several[self.head[excluded]] = False
        return np.flatnonzero(several)

    def _has_one_fan_each(self) -> bool:
        """Return whether every vertex has one fan; may be False for a valid mesh.

        Crossing the half-edge that ends at a corner leads to the next corner of its fan.  The
        walk goes around all vertices at once, each from one of its corners, at a border from the
        first, until it returns or ends; if every vertex has one fan, it visits every corner.
        """
        if self.twin is None and (self.inconsistent.any() or (self.counts > 2).any()):
            return False
        step = np.roll(self.opposite.reshape(-1, 3), 1, axis=1).ravel()
        start = np.full(self.n_vertices, -1)
        start[self.tail] = np.arange(len(step))
        if self.twin is None:
            start[self.tail[self.boundary]] = self.boundary
        start = at = start[start >= 0]
        visited = 0
        for _ in range(_ROUNDS):
            if not len(at):
                break
            visited += len(at)
            at = step[at]
            going = (at != start) & (at >= 0)
            start, at = start[going], at[going]
        return visited == len(step)


def two_sides(
    n: int, one: IntArray, other: IntArray, opposite: BoolArray
) -> tuple[IntArray, BoolArray]:
    """Return the group of each of *n* items, (n,) int, and whether to flip it for all to agree.

    Items one[i] and other[i] are neighbours, of different orientation if opposite[i].  A graph has
    two nodes for each item, unchanged and flipped, and links between nodes of neighbours that
    agree.  If both nodes of an item are connected, its group is one-sided, and none is flipped.
    """
    across = np.where(opposite, other + n, other)
    group = connected(
        2 * n,
        np.concatenate([one, one + n]),
        np.concatenate([across, (across + n) % max(2 * n, 1)]),
    )
    unchanged, flipped = group[:n], group[n:]
    side = np.minimum(unchanged, flipped)
    return side, (flipped == side) & (unchanged != flipped)


def edge_keys(one: IntArray, other: IntArray, n_vertices: int) -> IntArray:
    """Return one number for each pair of vertices, the same for (a, b) and (b, a)."""
    return np.minimum(one, other) * n_vertices + np.maximum(one, other)


def loops_of(boundary: IntArray) -> list[IntArray]:
    """Return the directed edges (b, 2) of a boundary as loops, the vertices (k,) of each in order.

    Loops are in the order of their first edges, and begin there.  Where several loops pass a
    vertex, a walk closes the shortest one first, so that no loop passes a vertex twice.
    """
    vertices, ends = np.unique(boundary, return_inverse=True)
    tail, head = ends.reshape(-1, 2).T
    part = connected(len(vertices), tail, head)
    crossed = np.zeros(len(vertices), dtype=bool)  # parts in which loops share a vertex
    crossed[part[np.bincount(tail, minlength=len(vertices)) > 1]] = True
    walked = crossed[part[tail]]
    first, loops = _cycles(tail[~walked], head[~walked], len(vertices))
    first = np.flatnonzero(~walked)[first]
    loops = [vertices[loop] for loop in loops]
    if not walked.any():
        return loops
    more_first, more = _walk(boundary[walked])
    first = np.append(first, np.flatnonzero(walked)[more_first])
    loops += more
    return [loops[i] for i in np.argsort(first, kind="stable")]


def _cycles(tail: IntArray, head: IntArray, n: int) -> tuple[IntArray, list[IntArray]]:
    """Return the first edge of each cycle, and its vertices in order; no vertex is in two.

    The steps from each edge to the last one of its cycle are counted by doubling: in each round,
    an edge looks twice as far ahead.
    """
    b = len(tail)
    leaving = np.zeros(n, dtype=np.int64)
    leaving[tail] = np.arange(b)
    following = leaving[head]
    label = connected(b, np.arange(b), following)
    first = first_members(label)
    last = np.zeros(b, dtype=bool)
    last[first] = True
    last = last[following]  # whether the next edge is the first one again
    ahead = np.where(last, np.arange(b), following)
    steps = np.where(last, 0, 1)  # from each edge to the one ahead
    while (further := ahead[ahead] != ahead).any():
        steps[further] += steps[ahead[further]]
        ahead[further] = ahead[ahead[further]]
    order = np.lexsort((-steps, label))
    return first, np.split(tail[order], np.cumsum(np.bincount(label))[:-1]) if b else []


def _walk(boundary: IntArray) -> tuple[list[int], list[IntArray]]:
    """Return the edge at which each walk begins, and its loops."""
    following: dict[int, list[int]] = {}
    for tail, head in boundary[::-1].tolist():
        following.setdefault(tail, []).append(head)
    begun, loops = [], []
    for edge, start in enumerate(boundary[:, 0].tolist()):
        path, place = [start], {start: 0}
        while following.get(path[-1]):
            vertex = following[path[-1]].pop()
            if vertex in place:  # a loop is closed
                loop = path[place[vertex] :]
                begun.append(edge)
                loops.append(np.array(loop))
                del path[place[vertex] + 1 :]
                for each in loop[1:]:
                    del place[each]
            else:
                place[vertex] = len(path)
                path.append(vertex)
    return begun, loops


def next_half_edge(half_edges: IntArray) -> IntArray:
    """Return the next half-edge, or corner, of the same face."""
    return np.where(half_edges % 3 == 2, half_edges - 2, half_edges + 1)


def repeats_vertex(faces: IntArray) -> BoolArray:
    """Return which faces contain a vertex twice, (m,) bool."""
    a, b, c = faces.T
    repeats: BoolArray = (a == b) | (b == c) | (c == a)
    return repeats


def components(n_points: int, faces: IntArray) -> IntArray:
    """Return the component of each vertex, (n,) int, numbered from 0."""
    return connected(n_points, faces.ravel(), faces[:, [1, 2, 0]].ravel())


def face_edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2), and for each face (m, 3) the edges opposite its three corners."""
    opposite = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    edges, which = np.unique(opposite, axis=0, return_inverse=True)
    return edges, which.reshape(-1, 3)
