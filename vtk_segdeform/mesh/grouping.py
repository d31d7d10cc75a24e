"""Grouping, sorting and ragged ranges of integers in linear time.

Vertices and faces are numbered from 0 without gaps, so tables replace comparisons.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, IntArray
from ..kernels import compiled_checks, inputs

_PIECE = 1 << 20  # rows of `ragged_arange` at once
_MIX = np.uint64(0x9E3779B97F4A7C15)  # odd, with irregular bits: a multiplicative hash


def connected(n: int, one: IntArray, other: IntArray) -> IntArray:
    """Return the connected component of each of *n* items, (n,) int, over links one[i]-other[i].

    Components are numbered from 0 in the order of their first members.

    >>> connected(5, np.array([3]), np.array([1]))
    array([0, 1, 2, 1, 3])
    """
    if n == 0:
        return np.empty(0, dtype=np.int64)
    if kernels := compiled_checks(len(one)):
        tree: IntArray = np.arange(n)
        kernels.link(tree, *inputs(np.asarray(one, np.int64), np.asarray(other, np.int64)))
        kernels.number_trees(tree)
        return tree
    ends = np.asarray(one, np.int32), np.asarray(other, np.int32)  # as SciPy before 1.16 requires
    graph = sparse.coo_array((np.ones(len(one), np.int8), ends), (n, n))
    return renumbered_by_first(csgraph.connected_components(graph, directed=False)[1])


def renumbered_by_first(labels: NDArray[np.integer]) -> IntArray:
    """Return *labels* (n,) of 0..k-1, maybe with gaps, numbered in the order of first members.

    >>> renumbered_by_first(np.array([3, 1, 3, 0]))
    array([0, 1, 0, 2])
    """
    first = np.full(int(labels.max(initial=-1)) + 1, len(labels))
    first[labels[::-1]] = np.arange(len(labels))[::-1]  # the last write wins
    rank = np.empty_like(first)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    renumbered: IntArray = rank[labels]
    return renumbered


def two_sides(
    n: int, one: IntArray, other: IntArray, opposite: BoolArray
) -> tuple[IntArray, BoolArray, BoolArray]:
    """Return the group of each of *n* items, whether to flip it, and which groups have one side.

    Items one[i] and other[i] are neighbours, of different orientation if opposite[i].  After the
    flips all neighbours agree, except in a one-sided group, in which none is flipped.  Groups are
    numbered from 0 in the order of their first members.

    >>> two_sides(3, np.array([0]), np.array([2]), np.array([True]))
    (array([0, 1, 0]), array([False, False,  True]), array([False, False]))
    """
    # Items that agree are one node of a graph, and one more if they are flipped; links are between
    # nodes that agree.  If both nodes of items are connected, their group is one-sided.
    alike = connected(n, one[~opposite], other[~opposite])
    k = int(alike.max(initial=-1)) + 1
    one, other = alike[one[opposite]], alike[other[opposite]]
    node = connected(2 * k, np.append(one, one + k), np.append(other + k, other))
    unchanged, flipped = node[:k], node[k:]
    first, group = np.unique(np.minimum(unchanged, flipped), return_inverse=True)
    one_sided = np.zeros(len(first), dtype=bool)
    one_sided[group[unchanged == flipped]] = True
    return group[alike], (flipped < unchanged)[alike], one_sided


def first_of_group(group: IntArray) -> IntArray:
    """Return for each item the index of the first item of the same group, (n,) int.

    >>> first_of_group(np.array([7, 4, 7, 4]))
    array([0, 1, 0, 1])
    """
    _, first, which = np.unique(group, return_index=True, return_inverse=True)
    return first[which]


def first_equal_row(rows: NDArray[np.generic]) -> IntArray:
    """Return for each row the index of the first row equal to it, (n,) int; NaN equals nothing.

    >>> first_equal_row(np.array([[0, 1], [2, 3], [0, 1]]))
    array([0, 1, 0])
    """
    points = rows.shape[1:] == (3,) and rows.dtype == np.float64
    if points and (kernels := compiled_checks(len(rows))):
        found = np.empty(len(rows), dtype=np.int64)
        table = np.full(1 << (2 * len(rows)).bit_length(), -1, dtype=np.int32)
        kernels.first_equal_points(found, *inputs(rows), table)
        return found
    hashes = row_hashes(rows)
    ordered = np.sort(hashes)  # faster than to find the order, and usually all that is needed
    if not (ordered[1:] == ordered[:-1]).any():
        return np.arange(len(rows))
    order = np.argsort(hashes, kind="stable")  # equal rows keep their order
    new = begins(hashes[order])
    if (begins(rows[order]) & ~new).any():  # different rows of equal hash
        order = np.lexsort(rows.T)
        new = begins(rows[order])
    first = np.empty(len(rows), dtype=np.int64)
    first[order] = order[np.flatnonzero(new)][np.cumsum(new) - 1]
    return first


def first_members(labels: NDArray[np.integer]) -> IntArray:
    """Return the first item with each label, (k,) int; *labels* (n,) are 0..k-1 without gaps.

    >>> first_members(np.array([1, 0, 0, 1]))
    array([1, 0])
    """
    first = np.zeros(int(labels.max(initial=-1)) + 1, np.int64)
    if len(first) > 1:
        first[labels[::-1]] = np.arange(len(labels))[::-1]  # the last write wins
    return first


def begins(ordered: NDArray[np.generic]) -> BoolArray:
    """Return which items (k, ...) differ from the one before, (k,) bool.

    >>> begins(np.array([4, 4, 7]))
    array([ True, False,  True])
    """
    begins = np.ones(len(ordered), dtype=bool)
    differ = ordered[1:] != ordered[:-1]
    begins[1:] = differ if differ.ndim == 1 else differ.any(axis=1)
    return begins


def ragged_arange(counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return i and k: each i repeated counts[i] times, with k = 0, 1, ... counts[i] - 1.

    >>> ragged_arange(np.array([2, 0, 3]))
    (array([0, 0, 2, 2, 2]), array([0, 1, 0, 1, 2]))
    """
    i = np.repeat(np.arange(len(counts)), counts)
    return i, np.arange(len(i)) - np.repeat(counts.cumsum() - counts, counts)


def ragged_pieces(counts: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield the result of `ragged_arange` in pieces of bounded size."""
    some = np.flatnonzero(counts)
    run = counts[some].cumsum() // _PIECE
    for piece in np.split(some, np.flatnonzero(np.diff(run)) + 1):
        i, k = ragged_arange(counts[piece])
        yield piece[i], k


def row_hashes(rows: NDArray[np.generic]) -> NDArray[np.uint64]:
    """Return a hash of each row, (n,), the same for equal rows."""
    mixed = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.T:
        wide = np.ascontiguousarray(column, np.float64 if rows.dtype.kind == "f" else np.int64)
        mixed ^= (wide + 0).view(np.uint64)  # 0 and -0 are equal
        mixed *= _MIX
        mixed ^= mixed >> np.uint64(29)
    return mixed
