"""Sorting and finding equals in time that grows with the number of things only.

Vertices and faces are numbered from 0 without gaps, so what is asked of them can be looked up
instead of compared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import IntArray

_MIX = np.uint64(0x9E3779B97F4A7C15)  # odd, its bits without order: spreads keys as a hash


def counting_order(keys: IntArray, n: int) -> IntArray:
    """Return the order that sorts *keys* of 0..n-1, equal ones as they come; in linear time.

    A matrix with one entry to a row is told column by column.

    >>> counting_order(np.array([2, 0, 2, 1]), 3)
    array([1, 3, 0, 2])
    """
    short = np.int32 if max(len(keys), n) < np.iinfo(np.int32).max else np.int64
    entries = np.ones(len(keys), dtype=bool)
    rows = np.arange(len(keys) + 1, dtype=short)
    matrix = sparse.csr_array((entries, keys.astype(short), rows), shape=(len(keys), n))
    return matrix.tocsc().indices.astype(np.int64)


def first_members(labels: NDArray[np.integer]) -> IntArray:
    """Return the first thing with each label, (k,) int; *labels* (n,) are 0..k-1, none left out.

    >>> first_members(np.array([1, 0, 0, 1]))
    array([1, 0])
    """
    first = np.empty(int(labels.max(initial=-1)) + 1, np.int64)
    first[labels[::-1]] = np.arange(len(labels))[::-1]  # of all written, the last one stays
    return first


def perhaps_equal(rows: NDArray[np.generic]) -> IntArray:
    """Return rows among which are all that equal another: those whose hash another has, too."""
    if rows.dtype not in (np.float64, np.int64):
        return np.arange(len(rows))
    mixed = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.T:
        mixed ^= (column + 0).view(np.uint64)  # 0 and -0 are equal
        mixed *= _MIX
        mixed ^= mixed >> np.uint64(29)
    ordered = np.sort(mixed)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    return np.flatnonzero(np.isin(mixed, twice)) if len(twice) else np.empty(0, np.int64)
