"""W~ of a large mesh in two narrow factors, patch by patch: the map of every frame.

Mean value coordinates are smooth.  Over a patch of a thousand neighbours, in a mesh of a million,
the rows of W~ are combinations of some thirty rows to 3e-7, however many cage vertices there are:

    W~_patch = U V        U (k, r) in single precision,  V (r, c) with orthonormal rows

so a map reads less than half as many numbers as in W~ itself, and multiplies a third.  The first
rows of V span the affine motions of all cages: these are mapped without error, and for the others
W~ V^T V is W~ to that tolerance.  Every product is computed in double precision, and the exact
volume is that of the mapped vertices, as with W~ itself.

Source
------
Low rank of smooth kernels between clusters, as in W. Hackbusch, "A sparse matrix arithmetic based
on H-matrices", Computing 62 (1999); here only one side is clustered, and cages are few.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, IntArray
from ..kernels import compiled_kernels, in_parallel, inputs
from ..progress import Progress
from .subspace import Subspace

_PATCH = 1024  # vertices in a patch, at most
_TOLERANCE = 3e-7  # Euclidean error of a row of W~
_FACTORED = 8  # patches that a thread factors at a time
_PIECES = 16  # in which threads map the patches
_WORTHWHILE = 0.7  # share of the numbers in W~; with more, W~ itself is as fast


@dataclass(frozen=True, eq=False)
class LowRankSubspace:
    """W~ in low-rank factors; made by `LowRankSubspace.of`.

    Parameters
    ----------
    vertices : (n,) int
        All vertices of the mesh, patch by patch.
    columns : (sum c,) int
        For each patch, the cage vertices that move it.
    left, right : (sum r k,), (sum r c,) float32
        U^T and V of each patch, in C order.
    starts : (patches + 1, 4) int
        Where each patch begins in *vertices*, *columns*, *left* and *right*.
    """

    vertices: IntArray
    columns: IntArray
    left: FloatArray
    right: FloatArray
    starts: IntArray

    @classmethod
    def of(
        cls,
        subspace: Subspace,
        rest: FloatArray,
        rest_cages: FloatArray,
        *,
        progress: Progress | None = None,
    ) -> LowRankSubspace | None:
        """Return W~ in low-rank factors; None where these would not have far fewer numbers.

        *rest* (n, 3) and *rest_cages* (m, 3) are the mesh and the stacked cages at rest, size
        about 1.
        """
        patches = [ids for some in subspace.sets_by_cages() for ids in _split(some, rest)]
        parts: dict[int, tuple[IntArray, IntArray, FloatArray, FloatArray]] = {}

        def work(first: int, last: int) -> None:
            for k, ids in enumerate(patches[first:last], first):
                own, w = subspace.nonzeros(ids)
                affine = np.column_stack([np.ones(len(own)), rest_cages[own]])
                parts[k] = ids, own, *_factors(w, affine)

        message = "factoring the subspace"
        in_parallel(work, len(patches), _FACTORED, progress=progress, message=message)
        in_order = [parts[k] for k in range(len(patches))]
        lengths = [[array.size for array in arrays] for arrays in in_order]
        starts = np.concatenate([np.zeros((1, 4), dtype=np.int64), np.cumsum(lengths, axis=0)])
        if starts[-1, 2:].sum() > _WORTHWHILE * sum(block.size for block in subspace.blocks):
            return None
        vertices, columns, left, right = (
            np.concatenate([array.ravel() for array in arrays])
            for arrays in zip(*in_order, strict=True)
        )
        return cls(vertices, columns, left, right, starts)

    def base(self, points: FloatArray) -> FloatArray:
        """Return *points* (n, 3) in the order in which `map` adds them: patch by patch."""
        return points[self.vertices]

    def map(self, p: FloatArray, base: FloatArray | None = None) -> FloatArray:
        """Return x = W~ p, (n, k), for stacked cage vertices *p* (m, k), k a multiple of 3.

        A *base*, `base` of some points, is added to the first three columns.
        """
        x = np.empty((len(self.vertices), p.shape[1]))
        added = np.empty((0, 3)) if base is None else base
        n_patches = len(self.starts) - 1
        kernels = compiled_kernels()
        numbers = self.vertices, self.columns, self.left, self.right, self.starts
        arguments = inputs(added, p.T, *numbers)

        def put(first: int, last: int) -> None:
            if kernels:
                kernels.map_low_rank(x, *arguments, first, last)
                return
            place = self.starts[first, 0]
            for ids, own, left, right in self._parts(first, last):
                x[ids] = left.T.astype(np.float64) @ (right.astype(np.float64) @ p[own])
                if base is not None:
                    x[ids, :3] += base[place : place + len(ids)]
                place += len(ids)

        in_parallel(put, n_patches, -(-n_patches // _PIECES))
        return x

    def _parts(
        self, first: int, last: int
    ) -> Iterator[tuple[IntArray, IntArray, FloatArray, FloatArray]]:
        """Yield (vertices (k,), columns (c,), U^T (r, k), V (r, c)) of some patches."""
        for here, after in zip(
            self.starts[first:last], self.starts[first + 1 : last + 1], strict=True
        ):
            a, b, c, d = (slice(i, j) for i, j in zip(here, after, strict=True))
            ids, own = self.vertices[a], self.columns[b]
            yield ids, own, self.left[c].reshape(-1, len(ids)), self.right[d].reshape(-1, len(own))


def _split(ids: IntArray, positions: FloatArray) -> list[IntArray]:
    """Return *ids* in patches: halved across their longest side until each is small enough."""
    if len(ids) <= _PATCH:
        return [np.sort(ids)]
    x = positions[ids]
    across = x[:, np.ptp(x, axis=0).argmax()]
    parts = -(-len(ids) // _PATCH)
    half = len(ids) * (parts // 2) // parts
    order = np.argpartition(across, half)
    return _split(ids[order[:half]], positions) + _split(ids[order[half:]], positions)


def _factors(w: FloatArray, affine: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (U^T, V) of rows *w* (k, c); the rows of V span the columns of *affine* (c, 4)."""
    basis = np.linalg.qr(affine, mode="complete")[0]
    first, others = np.split(basis, [affine.shape[1]], axis=1)
    left = w @ others
    turn = np.linalg.eigh(left.T @ left)[1][:, ::-1]
    left = left @ turn
    missed = np.cumsum((left * left)[:, ::-1], axis=1)[:, ::-1].max(axis=0)
    rank = np.count_nonzero(missed > _TOLERANCE**2)
    u, v = np.hstack([w @ first, left[:, :rank]]), np.hstack([first, (others @ turn)[:, :rank]])
    return u.T.astype(np.float32), v.T.astype(np.float32)
