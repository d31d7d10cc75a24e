"""Products with the tall dense blocks of W~, a piece at a time, so that no large copy is made.

A block is kept in single precision where a mesh is large: its rounded numbers then *are* W~, and
every product with it is taken in double precision.  So x = W~ p is as linear, and its volume as
exact, as ever, while half as much memory is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..kernels import WORTHWHILE, compiled_kernels, in_parallel, inputs, writable

_CACHED = 1 << 17  # numbers of a block that are multiplied at a time: a megabyte
_ROW = 24  # numbers that take as long as a face of a volume
_PIECES = 16  # of a block at most, for compiled kernels: to hand one over takes its time
_DENSE = 1 << 22  # numbers in a dense piece: 32 megabytes
_NOTHING = inputs(np.empty((0, 3)))


def is_heavy(blocks: Sequence[FloatArray]) -> bool:
    """Tell whether compiled kernels are worth it for products with all *blocks*."""
    return sum(block.size for block in blocks) // _ROW >= WORTHWHILE


def add_product(
    x: FloatArray,
    rows: IntArray,
    block: FloatArray,
    p: FloatArray,
    *,
    heavy: bool,
    base: FloatArray | None = None,
) -> None:
    """Add block @ p to the *rows* of x, in double precision whatever the block is in.

    With *base* (n, 3), x (n, k) is set to that first, and to 0 beyond its three columns: piece by
    piece, while it is at hand.
    """
    kernels = compiled_kernels() if heavy and p.shape[1] % 3 == 0 else None
    size = max(_CACHED // block.shape[1], 1)
    if kernels:
        arguments = inputs(x, rows, block, p.T)
        size = max(8 * size, -(-len(rows) // _PIECES))

    def add(start: int, stop: int) -> None:
        if base is not None:
            first = rows[start] if start else 0
            last = rows[stop] if stop < len(rows) else len(x)
            x[first:last, :3] = base[first:last, : x.shape[1]]
            x[first:last, 3:] = 0.0
        if kernels:
            kernels.add_product(x, *arguments, start, stop)
        else:
            x[rows[start:stop]] += double(block[start:stop]) @ p

    if base is not None and not len(rows):
        x[:, :3], x[:, 3:] = base[:, : x.shape[1]], 0.0
    in_parallel(add, len(rows), size)


def adjoint_product(rows: IntArray, block: FloatArray, y: FloatArray, *, heavy: bool) -> FloatArray:
    """Return block.T @ y[rows], in double precision."""
    kernels = compiled_kernels() if heavy and y.shape[1] == 3 else None
    if kernels:
        kernels.add_adjoint(summed := np.zeros((3, block.shape[1])), *inputs(rows, block, y))
        return summed.T
    p = np.zeros((block.shape[1], y.shape[1]))
    for piece in pieces(len(rows), block.shape[1]):
        p += double(block[piece]).T @ y[rows[piece]]
    return p


def double(block: FloatArray) -> FloatArray:
    """Return *block* in double precision."""
    return block.astype(np.float64, copy=False)


def pieces(n: int, width: int) -> list[slice]:
    """Return 0..n in slices of rows whose dense arrays of *width* columns stay small."""
    size = max(_DENSE // width, 1)
    return [slice(start, min(start + size, n)) for start in range(0, n, size)]


@dataclass(frozen=True, eq=False)
class Groups:
    """A small W~ end to end, so that one call of a kernel multiplies by all of it.

    Vertices that the same cages reach are a group, a dense block of its own: each vertex is met
    once, and nothing is handed over per region.

    Parameters
    ----------
    rows, columns, weights : (n,) int, (sum c,) int, (sum k c,) float
        For each group its vertices, the cage vertices that reach them, and W~ there.
    starts : (groups + 1, 3) int
        Where each begins in these.
    """

    rows: IntArray
    columns: IntArray
    weights: FloatArray
    starts: IntArray

    @classmethod
    def of(cls, groups: Sequence[tuple[IntArray, IntArray, FloatArray]]) -> Groups:
        """Return *groups* of (rows (k,), columns (c,), weights (k, c)) end to end."""
        sizes = [[array.size for array in arrays] for arrays in groups]
        starts = np.concatenate([np.zeros((1, 3), dtype=np.int64), np.cumsum(sizes, axis=0)])
        parts = (np.concatenate([a.ravel() for a in each]) for each in zip(*groups, strict=True))
        return cls(*inputs(*parts, starts))

    def map(self, p: FloatArray, start: FloatArray | None, kernels: Any) -> FloatArray:
        """Return `Subspace.map` of *p* (m, k), k a multiple of 3."""
        x = np.empty((len(self.rows), p.shape[1]))
        (base,) = _NOTHING if start is None else inputs(start)
        kernels.put_groups(x, base, writable(p), self.rows, self.columns, self.weights, self.starts)
        return x

    def adjoints(self, ys: Sequence[FloatArray], n_columns: int, kernels: Any) -> list[FloatArray]:
        """Return `Subspace.adjoint` of each of *ys* (n, 3), two at a time."""
        result = []
        for k in range(0, len(ys), 2):
            y, z = ys[k], (ys[k + 1] if k + 1 < len(ys) else None)
            p = np.zeros((6 if z is not None else 3, n_columns))
            beside = None if z is None else writable(z)
            kernels.add_groups_adjoint(
                p, writable(y), beside, self.rows, self.columns, self.weights, self.starts
            )
            result += [p[d : d + 3].T for d in range(0, len(p), 3)]
        return result
