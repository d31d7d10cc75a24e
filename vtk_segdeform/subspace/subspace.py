"""The subspace of the cages, x = W~ p: the block matrix of figure 6 of the paper, blended.

A mesh vertex is a blend of its positions in the cages of its regions, eqs. (2), (3):

    x_i = sum_r  alpha_ri  sum_j w_ij(r) p_j(r)

alpha are the blend weights of `Regions`, w the mean value coordinates in the cage of region r.
W~ is zero wherever a vertex is outside a region, so it is stored as one dense block per region,
blend weights included; the zeros are never stored.

The blocks of a large mesh are interpolated (`interpolated`), or else, where its cage is too close
to the surface, in single precision.  Its rounded numbers then *are* W~: every product
with it is computed in double precision, so x = W~ p is as linear, and its volume as exact, as with
double precision, and half as much memory is read.  Products go over a block piece by piece, so
that no large copy of it is made.

Long because every product with W~ has a way for blocks as arrays and for interpolated ones.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from .. import sizes
from ..arrays import FloatArray, IntArray, as_numbers
from ..cages import MOST_CAGE_VERTICES, Cage, mean_value_coordinates, require_enclosed
from ..errors import CageError, RegionError
from ..freezing import Frozen
from ..kernels import ROWS_AT_ONCE, compiled_kernels, in_parallel, inputs, writable
from ..progress import Progress, part
from ..regions import Regions
from .interpolated import InterpolatedBlock

_LARGEST_CAGE = 1e3  # diagonals of the mesh
_REGION_BITS = 32  # regions that are encoded in one integer
NUMBERS_PER_FACE = 16  # numbers whose product takes about as long as a face of a volume
_CACHED_NUMBERS = 1 << 17  # of a block, that are multiplied together: a megabyte
_DENSE_NUMBERS = 1 << 22  # of a dense piece: 32 megabytes


@dataclass(frozen=True, eq=False, repr=False)
class Subspace(Frozen):
    """W~ as blocks: rows[r] (n_r,) mesh vertices, blocks[r] (n_r, m_r), columns in cage order.

    Pickles have its inputs instead, which are a tenth as large, if it was computed in this process.
    Computing it again takes 0.3 s for 5,000 vertices.
    """

    n_vertices: int
    rows: tuple[IntArray, ...]
    blocks: tuple[FloatArray | InterpolatedBlock, ...]
    again: Callable[[], Subspace] | None = None  # computes it from its inputs

    def __getstate__(self) -> dict[str, Any]:
        known = vars(self)
        left = () if self.again is None else ("rows", "blocks")
        state = super().__getstate__() | {k: known[k] for k in ("_is_compiled",) if k in known}
        return {name: value for name, value in state.items() if name not in left}

    def __setstate__(self, state: dict[str, Any]) -> None:
        if (again := state["again"]) is not None:
            made = again()
            state = state | {"rows": made.rows, "blocks": made.blocks}
        super().__setstate__(state)

    def __deepcopy__(self, _: dict[int, Any]) -> Subspace:
        return self

    @cached_property
    def n_columns(self) -> int:
        """Number of cage vertices in all cages, m."""
        return sum(block.shape[1] for block in self.blocks)

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """For each region, the indices of its cage among all m cage vertices."""
        ends = np.cumsum([0, *(block.shape[1] for block in self.blocks)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))

    @cached_property
    def _is_compiled(self) -> bool:
        """Whether W~ has enough numbers for compiled kernels.

        The answer stays, so that the same cage vertices always give the same mesh, bit for bit.
        """
        size = sum(block.size for block in self.blocks) // NUMBERS_PER_FACE
        return compiled_kernels(size) is not None

    @cached_property
    def _pieces(self) -> list[tuple[IntArray, FloatArray | InterpolatedBlock, slice]]:
        """The rows, the block, as a kernel takes them, and the columns of each region."""
        pieces = []
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            if not isinstance(block, InterpolatedBlock):
                rows, block = inputs(rows, block)
            pieces.append((rows, block, columns))
        return pieces

    @cached_property
    def _rows_of(self) -> sparse.csr_array:
        """(n, r) int: 1 + the row of each vertex in the block of each region; 0 is outside."""
        each = [np.arange(1, len(rows) + 1) for rows in self.rows]
        region = np.repeat(np.arange(len(self.rows)), [len(rows) for rows in self.rows])
        entries = np.concatenate(each), (np.concatenate(self.rows), region)
        return sparse.coo_array(entries, (self.n_vertices, len(self.rows))).tocsr()

    def map(self, p: FloatArray, base: FloatArray | None = None) -> FloatArray:
        """Return x = W~ p, (n, k), for stacked cage vertices *p* (m, k).

        A *base* (n, 3) is added to the first three columns.
        """
        make = np.zeros if base is None else np.empty
        x = make((self.n_vertices, p.shape[1]))
        for rows, block, columns in self._pieces:
            if isinstance(block, InterpolatedBlock):
                _add_interpolated(x, rows, block, p[columns], base)
            else:
                _add_product(x, rows, block, p[columns], compiled=self._is_compiled, base=base)
            base = None
        return x

    def adjoint(self, y: FloatArray) -> FloatArray:
        """Return W~^T y, (m, 3), for *y* (n, 3) on the mesh."""
        p = np.empty((self.n_columns, y.shape[1]))
        kernels = compiled_kernels() if self._is_compiled and y.shape[1] == 3 else None
        y = writable(y) if kernels else y
        for rows, block, columns in self._pieces:
            if isinstance(block, InterpolatedBlock):
                p[columns] = block.adjoint(y[rows])
            elif kernels:
                kernels.add_adjoint(total := np.zeros((3, block.shape[1])), rows, block, y)
                p[columns] = total.T
            else:
                p[columns] = _adjoint_product(rows, block, y)
        return p

    def at(self, vertices: IntArray) -> FloatArray:
        """Return the rows of W~ for some mesh *vertices*, dense (k, m)."""
        out = np.zeros((len(vertices), self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            place = np.searchsorted(rows, vertices)
            found = np.flatnonzero(np.append(rows, -1)[place] == vertices)
            out[found, columns] = block[place[found]]
        return out

    def nonzeros(self, vertices: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the nonzero columns (c,) of W~ at *vertices* (k,), and W~ there (k, c)."""
        met = self._rows_of[vertices].tocsc()
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

    def sets_by_cages(self) -> list[IntArray]:
        """Return all vertices in sets; those of a set are moved by the same cages."""
        label = np.zeros(self.n_vertices, dtype=np.int64)
        for start in range(0, len(self.rows), _REGION_BITS):
            some = self.rows[start : start + _REGION_BITS]
            label <<= len(some)
            for bit, rows in enumerate(reversed(some)):
                label[rows] += 1 << bit
            label = np.unique(label, return_inverse=True)[1]
        order = np.argsort(label, kind="stable")
        return np.split(order, np.cumsum(np.bincount(label))[:-1])

    def premultiplied(self, operator: sparse.csr_array) -> FloatArray:
        """Return operator @ W~, dense (k, m), for a sparse *operator* (k, n) with few rows."""
        by_column = operator.tocsc()
        is_met = np.diff(by_column.indptr) > 0
        out = np.zeros((operator.shape[0], self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            met = np.flatnonzero(is_met[rows])
            if isinstance(block, InterpolatedBlock):
                out[:, columns] = block.premultiplied(by_column[:, rows].tocsr())
                continue
            for piece in row_pieces(len(met), block.shape[1]):
                out[:, columns] += by_column[:, rows[met[piece]]] @ _double(block[met[piece]])
        return out

    def averaged(self, mean: sparse.csr_array) -> Subspace:
        """Return the subspace of the points mean @ x, for sparse weights *mean* (k, n)."""
        rows, blocks, by_column = [], [], mean.tocsc()
        for members, block in zip(self.rows, self.blocks, strict=True):
            own = np.unique(by_column[:, members].indices).astype(np.int64)
            if isinstance(block, InterpolatedBlock):
                averages = block.premultiplied(by_column[:, members].tocsr()[own])
                rows.append(own)
                blocks.append(averages)
                continue
            averages = np.zeros((len(own), block.shape[1]))
            for piece in row_pieces(len(members), block.shape[1]):
                averages += by_column[:, members[piece]].tocsr()[own] @ _double(block[piece])
            rows.append(own)
            blocks.append(averages)
        return Subspace(mean.shape[0], tuple(rows), tuple(blocks))

    def sums_of_squares(self, clusters: IntArray) -> FloatArray:
        """Return sum_{i in g} W~_ij^2, (G, m), for *clusters* g of the vertices, (n,).

        Of interpolated rows the sums are over some of them, so only their ratios are meaningful.
        """
        out = np.zeros((int(clusters.max()) + 1, self.n_columns))
        for rows, block, columns in zip(self.rows, self.blocks, self.columns, strict=True):
            if isinstance(block, InterpolatedBlock):
                rows, block = rows[::16], block[::16]
            for piece in row_pieces(len(rows), block.shape[1]):
                size = piece.stop - piece.start
                places = (clusters[rows[piece]], np.arange(size))
                member = sparse.csr_array((np.ones(size), places), (len(out), size))
                out[:, columns] += member @ _double(block[piece]) ** 2
        return out


def _add_product(
    x: FloatArray,
    rows: IntArray,
    block: FloatArray,
    p: FloatArray,
    *,
    compiled: bool,
    base: FloatArray | None = None,
) -> None:
    """Add block @ p to the *rows* of x, in double precision whatever the block is in.

    *rows* and *block* are as `inputs` returns them.

    With *base* (n, 3), the first three columns of x (n, k) are first set to it and the others to
    0: piece by piece, while a piece is in the cache.
    """
    kernels = compiled_kernels() if compiled and p.shape[1] % 3 == 0 else None
    size = max(_CACHED_NUMBERS // block.shape[1], 1)
    if kernels:
        by_column = writable(p.T)
        size = max(8 * size, -(-len(rows) // 16))  # a call takes some microseconds

    def add(start: int, stop: int) -> None:
        _begin_rows(x, rows, base, start, stop)
        if kernels:
            kernels.add_product(x, rows, block, by_column, start, stop)
        else:
            x[rows[start:stop]] += _double(block[start:stop]) @ p

    if not len(rows):
        _begin_rows(x, rows, base, 0, 0)
    in_parallel(add, len(rows), size)


def _add_interpolated(
    x: FloatArray,
    rows: IntArray,
    block: InterpolatedBlock,
    p: FloatArray,
    base: FloatArray | None,
) -> None:
    """Do the same for a block whose rows are interpolated."""
    at_nodes = np.empty((len(block.values), p.shape[1]))

    def move(start: int, stop: int) -> None:
        at_nodes[start:stop] = block.values[start:stop] @ p

    def add(start: int, stop: int) -> None:
        _begin_rows(x, rows, base, start, stop)
        block.add_to(x, rows, at_nodes, start=start, stop=stop)

    if not len(rows):
        _begin_rows(x, rows, base, 0, 0)
    in_parallel(
        move,
        len(at_nodes),
        max(_CACHED_NUMBERS // block.shape[1], -(-len(at_nodes) // 16)),
    )
    in_parallel(add, len(rows), max(_CACHED_NUMBERS // 27, -(-len(rows) // 16)))


def _begin_rows(
    x: FloatArray, rows: IntArray, base: FloatArray | None, start: int, stop: int
) -> None:
    """Set x to *base*, if there is one, from rows[start] on and up to rows[stop]."""
    if base is not None:
        first = rows[start] if start else 0
        last = rows[stop] if stop < len(rows) else len(x)
        if x.shape[1] > 3:
            x[first:last] = 0.0
        x[first:last, :3] = base[first:last]


def _adjoint_product(rows: IntArray, block: FloatArray, y: FloatArray) -> FloatArray:
    """Return block.T @ y[rows], in double precision."""
    p = np.zeros((block.shape[1], y.shape[1]))
    for piece in row_pieces(len(rows), block.shape[1]):
        p += _double(block[piece]).T @ y[rows[piece]]
    return p


def _double(block: FloatArray) -> FloatArray:
    return block.astype(np.float64, copy=False)


def row_pieces(n: int, width: int) -> list[slice]:
    """Return 0..n in slices of rows whose dense arrays of *width* columns take 32 megabytes."""
    size = max(_DENSE_NUMBERS // width, 1)
    return [slice(start, min(start + size, n)) for start in range(0, n, size)]


def cage_subspace(
    regions: Regions,
    cages: Sequence[Cage],
    *,
    blend: ArrayLike | None = None,
    rough: bool = False,
    progress: Progress | None = None,
) -> Subspace:
    """Return W~: every mesh vertex expressed by the cages of its regions.

    Parameters
    ----------
    regions : Regions
        r regions over a mesh of n vertices.
    cages : sequence of r Cage
        The cage of each region, in the same order.
    blend : (r, n) float, optional
        Blend weights instead of ``regions.weights``: non-negative, columns that sum to 1, zero
        outside each region.
    rough : bool
        Interpolate the rows of a large mesh roughly: poses differ by some 1e-3 diagonals.
    progress : Progress, optional
        Called as the coordinates of each region are computed.

    Raises
    ------
    CageError
        If there is not one cage per region, a cage does not enclose its region, or it is so large
        that it hardly moves it.
    RegionError
        If *blend* has another shape, or is no partition of unity over the regions.
    """
    _check_cages(regions, cages)
    rows: list[IntArray] = []
    blocks: list[FloatArray | InterpolatedBlock] = []
    weights = regions.weights if blend is None else _checked_blend(blend, regions)
    for r, cage in enumerate(cages):
        share = part(progress, r / len(cages), (r + 1) / len(cages))
        members = np.flatnonzero(weights[r] > 0.0)
        points = regions.mesh.vertices[members]
        interpolated = None
        fewest = sizes.DECIMATED if rough else sizes.INTERPOLATED
        if regions.mesh.n_vertices > fewest:
            interpolated = InterpolatedBlock.of(
                points, weights[r, members], cage, rough=rough, progress=share
            )
        rows.append(members)
        if interpolated is not None:
            blocks.append(interpolated)
            continue
        is_large = np.count_nonzero(weights) * cage.n_vertices > sizes.SINGLE_PRECISION
        block = np.empty((len(members), cage.n_vertices), np.float32 if is_large else np.float64)
        for start in range(0, len(members), ROWS_AT_ONCE):
            piece = slice(start, min(start + ROWS_AT_ONCE, len(members)))
            ways = part(share, start / len(members), piece.stop / len(members))
            w = mean_value_coordinates(points[piece], cage.vertices, cage.faces, progress=ways)
            w *= weights[r, members[piece]][:, None]
            block[piece] = w
        blocks.append(block)
    again = partial(cage_subspace, regions, cages, blend=blend, rough=rough)
    return Subspace(regions.mesh.n_vertices, tuple(rows), tuple(blocks), again)


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
        raise CageError("cages must contain Cage objects; make one by Cage(vertices, faces)")
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
        if np.ptp(cage.vertices, axis=0).max() > _LARGEST_CAGE * mesh.diagonal:
            raise CageError(
                f"the cage of region {r} is more than {_LARGEST_CAGE:.0f} times as large as the "
                "mesh and hardly moves it; fit it more tightly"
            )
        require_enclosed(cage, regions, r, f"region {r}")
