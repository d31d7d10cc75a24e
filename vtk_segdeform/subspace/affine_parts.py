"""Parts of the surface that move affinely with the cages: those that are to be rigid.

Cages are coarse: what is stiff between two of their vertices, they bend nevertheless.  But the
affine map A that fits the motion W~ p of a part best is linear in p as well,

    A(v) = sum_a b_a(v) G_a p,      G_a = sum_i c_i b_a(v_i) W~_i,      a = 0 .. 3

with b the functions 1, x, y, z, made orthonormal in the part: sum_i c_i b_a(v_i) b_b(v_i) is 1 or
0.  So each part is treated as a region whose "cage" has the four degrees of freedom of a
tetrahedron.  It overlaps its surroundings in a collar, where it is blended as regions are, (2)-(4):

    x_i = alpha_i A(v_i) + (1 - alpha_i) W~_i p

This is another W~, with the same cage vertices.  In the part alpha is 1.  The weights c are areas
times alpha, so that a flat part takes its normal from the collar.

An energy of G_1 p .. G_3 p, the gradient of A, makes the part rigid; one of the misfit of A,

    sum_i c_i |W~_i p - A(v_i)|^2  =  tr p^T (sum_i c_i W~_i^T W~_i  -  sum_a G_a^T G_a) p

keeps the cages around it near it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import FloatArray, IntArray
from ..freezing import Frozen
from ..mesh import Mesh
from ..regions import blend_weights
from .interpolated import InterpolatedBlock
from .subspace import Subspace, row_pieces

_FLAT = 1e-9  # of the largest second moment of a part; an axis with less has no gradient


@dataclass(frozen=True, eq=False, repr=False)
class AffineParts(Frozen):
    """q parts of a surface of n vertices with m cage vertices; made by `AffineParts.of`."""

    shares: FloatArray  # (q, n): alpha
    centres: FloatArray  # (q, 3)
    axes: FloatArray  # (q, 3, 3): b_1 .. b_3 of v are (v - centre) @ axes
    maps: FloatArray  # (q, 4, m): G
    misfit: FloatArray  # (m, m), above, summed over the parts

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        subspace: Subspace,
        parts: Sequence[IntArray],
        *,
        collar: float,
        smoothness: float,
    ) -> AffineParts:
        """Return *parts* of *mesh*, each a set of vertices, with W~ *subspace*.

        Parameters
        ----------
        mesh : Mesh
            n vertices, at rest.
        subspace : Subspace
            W~ by the cages alone.
        parts : sequence of (k,) int
            Vertices; no vertex is in two parts.
        collar : float
            Width of the collar along the surface, in the unit of the mesh.
        smoothness : float
            Of the blend; see `Regions`.
        """
        shares = _shares(mesh, parts, collar, smoothness)
        count, x = len(parts), mesh.vertices
        centres, axes, rows = np.zeros((count, 3)), np.zeros((count, 3, 3)), []
        squares = np.zeros((subspace.n_columns, subspace.n_columns))
        for r, share in enumerate(shares):
            own = np.flatnonzero(share)
            c = mesh.vertex_areas[own] * share[own]
            c = c / c.sum() if c.any() else np.full(len(own), 1.0 / len(own))
            centres[r] = c @ x[own]
            away = x[own] - centres[r]
            moments, ways = np.linalg.eigh((away.T * c) @ away)
            is_wide = moments > _FLAT * moments[-1]
            axes[r] = ways * np.where(is_wide, 1.0 / np.sqrt(np.where(is_wide, moments, 1.0)), 0.0)
            basis = c * np.c_[np.ones(len(own)), away @ axes[r]].T
            columns = np.broadcast_to(own, basis.shape).ravel()
            entries = np.repeat(np.arange(4), len(own)), columns
            rows.append(sparse.coo_array((basis.ravel(), entries), (4, len(x))))
            for piece in row_pieces(len(own), subspace.n_columns):
                w = subspace.at(own[piece])
                squares += (w.T * c[piece]) @ w
        products = subspace.premultiplied(sparse.vstack(rows).tocsr())
        misfit = squares - products.T @ products
        return cls(shares, centres, axes, products.reshape(count, 4, -1), misfit)

    @property
    def gradients(self) -> FloatArray:
        """G_1 .. G_3 of each part, (q, 3, m): the gradient of A along its axes.

        A is rigid if G p is that of the cages at rest, rotated.
        """
        return self.maps[:, 1:]

    def blended(self, subspace: Subspace, points: FloatArray, shares: FloatArray) -> Subspace:
        """Return W~ *subspace* of some *points* (k, 3), which belong to the parts by *shares*.

        These, (q, k), are alpha at the points.
        """
        own = [np.flatnonzero(each) for each in shares]
        basis = [
            shares[r, some, None]
            * np.c_[np.ones(len(some)), (points[some] - self.centres[r]) @ self.axes[r]]
            for r, some in enumerate(own)
        ]
        left, all_rows, blocks = 1.0 - shares.sum(axis=0), [], []
        for rows, block, columns in zip(
            subspace.rows, subspace.blocks, subspace.columns, strict=True
        ):
            maps = self.maps[:, :, columns]
            moved = [r for r in np.flatnonzero(maps.any(axis=(1, 2))) if len(own[r])]
            if not moved and (left[rows] == 1.0).all():
                all_rows.append(rows)
                blocks.append(block)
                continue
            mine = np.unique(np.concatenate([rows, *(own[r] for r in moved)]))
            place = np.searchsorted(mine, rows)
            is_interpolated = isinstance(block, InterpolatedBlock)
            kind = np.float32 if is_interpolated else np.asarray(block[:0]).dtype
            found = np.zeros((len(mine), block.shape[1]), kind)
            for piece in row_pieces(len(rows), block.shape[1]):
                found[place[piece]] = left[rows[piece], None] * block[piece]
            for r in moved:
                found[np.searchsorted(mine, own[r])] += basis[r] @ maps[r]
            all_rows.append(mine)
            blocks.append(found)
        again = None if subspace.again is None else partial(self.blended, subspace, points, shares)
        return Subspace(subspace.n_vertices, tuple(all_rows), tuple(blocks), again)

    def blended_gradients(self, gradients: FloatArray, shares: FloatArray) -> FloatArray:
        """Return *gradients* (k, 3, m) of W~ at points that belong to the parts by *shares*."""
        left = 1.0 - shares.sum(axis=0)
        of_parts = self.axes @ self.gradients
        return np.asarray(left[:, None, None] * gradients + np.tensordot(shares.T, of_parts, 1))


def _shares(mesh: Mesh, parts: Sequence[IntArray], collar: float, smoothness: float) -> FloatArray:
    """Return alpha (q, n): the blend weights of the parts and of the rest of the surface."""
    away = np.array(
        [
            csgraph.dijkstra(
                mesh.adjacency, directed=False, indices=ids, min_only=True, limit=collar
            )
            for ids in parts
        ]
    )
    inside = np.maximum(collar - away, 0.0)  # the distance to the border of the collar
    for r in range(len(parts)):  # no part is in the collar of another one
        others = np.delete(away, r, axis=0)
        inside[r] = np.minimum(inside[r], others.min(axis=0, initial=np.inf))
    distance = np.concatenate([inside, np.minimum(away.min(axis=0), collar)[None]])
    return blend_weights(distance > 0.0, distance, smoothness)[:-1]
