"""The subspace of the cages, x = W~ p: the block matrix of the paper's figure 6, blended.

Vertex i of the mesh is a blend of what the cages of its regions say, eqs. (2), (3):

    x_i = sum_r  alpha_ri  sum_j w_ij(r) p_j(r)

alpha are the blend weights of `Regions`, w the mean value coordinates in the cage of region r.
W~ is zero wherever a vertex is outside a region, so it is kept as one dense block per region,
blend included; nothing below ever forms the zeros.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import FloatArray, IntArray, as_numbers
from ..cages import MOST_CAGE_VERTICES, Cage, mean_value_coordinates
from ..errors import CageError, RegionError
from ..kernels import compiled_kernels
from ..progress import Progress, part
from ..regions import Regions
from .products import Groups, add_product, adjoint_product, double, is_heavy, pieces

_LARGEST = 1e3  # mesh diagonals a cage may measure
_BOUND = 1 << 15  # vertices at a time
_AT_ONCE = 1 << 20  # numbers in all blocks that one thread multiplies in one call
_BITS = 32  # regions processed at a time, one bit each
_SINGLE = 8_000_000  # numbers in a block times regions beyond which W~ is kept in single precision


@dataclass(frozen=True, eq=False)
class Subspace:
    """W~ as blocks: rows[r] (n_r,) mesh vertices, blocks[r] (n_r, m_r), columns in cage order."""

    n_vertices: int
    rows: tuple[IntArray, ...]
    blocks: tuple[FloatArray, ...]

    @cached_property
    def n_columns(self) -> int:
        """Number of cage vertices in all cages, m."""
        return sum(block.shape[1] for block in self.blocks)

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """For each region, its cage's place among all m cage vertices."""
        ends = np.cumsum([0, *(block.shape[1] for block in self.blocks)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))

    @cached_property
    def _is_heavy(self) -> bool:
        return is_heavy(self.blocks)

    @cached_property
    def _is_small(self) -> bool:
        return self._is_heavy and 0 < sum(block.size for block in self.blocks) <= _AT_ONCE

    @cached_property
    def _groups(self) -> Groups:
        return Groups.of([(ids, *self.reaching(ids)) for ids in self.reached_alike()])

    @cached_property
    def _places(self) -> sparse.csr_array:
        """(n, r) int: 1 + the place of each vertex among the rows of a region."""
        each = [np.arange(1, len(rows) + 1) for rows in self.rows]
        region = np.repeat(np.arange(len(self.rows)), [len(rows) for rows in self.rows])
        entries = np.concatenate(each), (np.concatenate(self.rows), region)
        return sparse.coo_array(entries, (self.n_vertices, len(self.rows))).tocsr()

    def start(self, points: FloatArray) -> FloatArray:
        """Return *points* (n, 3) of the mesh as `map` begins with them: as they are."""
        return points

    def map(self, p: FloatArray, start: FloatArray | None = None) -> FloatArray:
        """Return x = W~ p, (n, k), for stacked cage vertices *p* (m, k).

        With `start` of some points these are added to the first three columns.
        """
        if self._is_small and p.shape[1] % 3 == 0 and (kernels := compiled_kernels()):
            return self._groups.map(p, start, kernels)
        make = np.zeros if start is None else np.empty
        x = make((self.n_vertices, p.shape[1]))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            add_product(x, rows, block, p[columns], heavy=self._is_heavy, base=start)
            start = None
        return x

    def adjoint(self, y: FloatArray) -> FloatArray:
        """Return W~^T y, (m, 3), for *y* (n, 3) on the mesh."""
        if self._is_small and y.shape[1] == 3 and (kernels := compiled_kernels()):
            return self._groups.adjoints([y], self.n_columns, kernels)[0]
        p = np.empty((self.n_columns, y.shape[1]))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            p[columns] = adjoint_product(rows, block, y, heavy=self._is_heavy)
        return p

    def adjoints(self, ys: Sequence[FloatArray]) -> list[FloatArray]:
        """Return `adjoint` of each of *ys* (n, 3); W~ is read once for two of them."""
        if self._is_small and (kernels := compiled_kernels()):
            return self._groups.adjoints(ys, self.n_columns, kernels)
        return [self.adjoint(y) for y in ys]

    def at(self, vertices: IntArray) -> FloatArray:
        """Return the rows of W~ for some mesh *vertices*, dense (k, m)."""
        place = np.full(self.n_vertices, -1)
        out = np.zeros((len(vertices), self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            place[:] = -1
            place[rows] = np.arange(len(rows))
            found = place[vertices]
            out[found >= 0, columns] = block[found[found >= 0]]
        return out

    def reaching(self, vertices: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the columns of W~ that reach *vertices* (k,), in order, and W~ there (k, c)."""
        met = self._places[vertices].tocsc()
        reached = []
        for r in np.flatnonzero(np.diff(met.indptr)):
            entries = slice(met.indptr[r], met.indptr[r + 1])
            found = met.data[entries] - 1
            reached.append((met.indices[entries], found, self.blocks[r], self.columns[r]))
        w = np.zeros((len(vertices), sum(own.stop - own.start for *_, own in reached)))
        end = 0
        for mine, found, block, own in reached:
            begin, end = end, end + own.stop - own.start
            w[mine, begin:end] = block[found]
        columns = [np.arange(own.start, own.stop) for *_, own in reached]
        return np.concatenate([np.arange(0), *columns]), w

    def reached_alike(self) -> list[IntArray]:
        """Return all vertices, those together that the same cages reach."""
        label = np.zeros(self.n_vertices, dtype=np.int64)
        for start in range(0, len(self.rows), _BITS):
            some = self.rows[start : start + _BITS]
            label <<= len(some)
            for bit, rows in enumerate(reversed(some)):
                label[rows] += 1 << bit
            label = np.unique(label, return_inverse=True)[1]
        order = np.argsort(label, kind="stable")
        return np.split(order, np.cumsum(np.bincount(label))[:-1])

    def left(self, operator: sparse.csr_array) -> FloatArray:
        """Return operator @ W~, dense (k, m), for a sparse *operator* (k, n) with few rows."""
        by_column = operator.tocsc()
        is_met = np.diff(by_column.indptr) > 0
        out = np.zeros((operator.shape[0], self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            met = np.flatnonzero(is_met[rows])
            for piece in pieces(len(met), block.shape[1]):
                out[:, columns] += by_column[:, rows[met[piece]]] @ double(block[met[piece]])
        return out

    def averaged(self, mean: sparse.csr_array) -> Subspace:
        """Return the subspace of the points mean @ x, for sparse weights *mean* (k, n)."""
        rows, blocks, by_column = [], [], mean.tocsc()
        for members, block in zip(self.rows, self.blocks, strict=True):
            own = np.unique(by_column[:, members].indices).astype(np.int64)
            averages = np.zeros((len(own), block.shape[1]))
            for piece in pieces(len(members), block.shape[1]):
                averages += by_column[:, members[piece]].tocsr()[own] @ double(block[piece])
            rows.append(own)
            blocks.append(averages)
        return Subspace(mean.shape[0], tuple(rows), tuple(blocks))

    def squares(self, groups: IntArray) -> FloatArray:
        """Return sum_{i in g} W~_ij^2, (G, m), for the group of each vertex *groups* (n,)."""
        out = np.zeros((int(groups.max()) + 1, self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            for piece in pieces(len(rows), block.shape[1]):
                size = piece.stop - piece.start
                places = (groups[rows[piece]], np.arange(size))
                member = sparse.csr_array((np.ones(size), places), (len(out), size))
                out[:, columns] += member @ double(block[piece]) ** 2
        return out


def bind(
    regions: Regions,
    cages: Sequence[Cage],
    *,
    blend: ArrayLike | None = None,
    progress: Progress | None = None,
) -> Subspace:
    """Express every mesh vertex by the cages of its regions.

    Parameters
    ----------
    regions : Regions
        r regions over a mesh of n vertices.
    cages : sequence of r Cage
        The cage of each region, in the same order.
    blend : (r, n) float, optional
        Blend weights instead of ``regions.weights``: non-negative, columns that sum to 1, zero
        outside each region.
    progress : Progress, optional
        Called as the coordinates of each region are computed.

    Raises
    ------
    CageError
        If there is not one cage per region, or a cage leaves out part of its region or is so
        large that it hardly moves it.
    RegionError
        If *blend* is not as said above.
    """
    _check_cages(regions, cages)
    weights = regions.weights if blend is None else _checked_blend(blend, regions)
    rows, blocks = [], []
    for r, cage in enumerate(cages):
        share = part(progress, r / len(cages), (r + 1) / len(cages))
        members = np.flatnonzero(weights[r] > 0.0)
        points = regions.mesh.vertices[members]
        is_large = np.count_nonzero(weights) * cage.n_vertices > _SINGLE
        block = np.empty((len(members), cage.n_vertices), np.float32 if is_large else np.float64)
        for start in range(0, len(members), _BOUND):
            piece = slice(start, min(start + _BOUND, len(members)))
            ways = part(share, start / len(members), piece.stop / len(members))
            w = mean_value_coordinates(points[piece], cage.vertices, cage.faces, progress=ways)
            w *= weights[r, members[piece]][:, None]
            block[piece] = w
        rows.append(members)
        blocks.append(block)
    return Subspace(regions.mesh.n_vertices, tuple(rows), tuple(blocks))


def _checked_blend(blend: ArrayLike, regions: Regions) -> FloatArray:
    weights = as_numbers(blend, "blend")
    if weights.shape != regions.membership.shape:
        raise RegionError(f"blend must have shape {regions.membership.shape}; got {weights.shape}")
    unity = np.isfinite(weights).all() and np.abs(weights.sum(axis=0) - 1.0).max() <= 1e-9
    if not unity or (weights < 0.0).any() or weights[~regions.membership].any():
        raise RegionError(
            "blend must be non-negative, sum to 1 at every vertex and be 0 outside each region"
        )
    return weights


def _check_cages(regions: Regions, cages: Sequence[Cage]) -> None:
    if not all(isinstance(cage, Cage) for cage in cages):
        raise CageError("cages must hold Cage objects; make one by Cage(vertices, faces)")
    if len(cages) != regions.n_regions:
        raise CageError(f"{regions.n_regions} regions need as many cages; got {len(cages)}")
    total = sum(cage.n_vertices for cage in cages)
    if total > MOST_CAGE_VERTICES:
        raise CageError(
            f"the cages have {total} vertices; the limit of the solver is {MOST_CAGE_VERTICES}: "
            "use coarser cages, or fewer regions"
        )
    mesh = regions.mesh
    for r, cage in enumerate(cages):
        if np.ptp(cage.vertices, axis=0).max() > _LARGEST * mesh.diagonal:
            raise CageError(
                f"the cage of region {r} is more than {_LARGEST:.0f} times as large as the mesh "
                "and hardly moves it; make it fit more tightly"
            )
        members = mesh.vertices[regions.membership[r]]
        cage.require_encloses(members, f"vertices of region {r}")
