"""Rows of W~ of a large mesh, interpolated on a grid much finer than the cage.

Mean value coordinates are smooth functions of a point inside their cage.  So those of a million
vertices follow from the nodes of a regular grid of spacing h around the surface, by quadratic
B-splines B,

    w(x) = sum_k c_k B(x_1 / h - k_1) B(x_2 / h - k_2) B(x_3 / h - k_3)
    c_k  = w_k - 1/8 (sum of the three second differences of w at node k)

which reproduce quadratic functions, so the error is of third order; with continuous derivatives,
so that no facets appear on the surface.  Affine functions are reproduced exactly, and with them the
two properties of the coordinates: they sum to 1, and give each vertex its place at rest.

Where a cage is closer to the surface than `fit_cages` makes it, a check of some vertices halves h,
or gives up.  Rough rows have twice that h and an eighth of the nodes.

A vertex stores its offset from the nearest node only.  A map computes the motion of the nodes first
and then, for each vertex, the sum over the 27 nodes around it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..cages import Cage, mean_value_coordinates
from ..kernels import ROWS_AT_ONCE, compiled_kernels, inputs
from ..progress import Progress, part

_SPACING = 0.08  # h, relative to sqrt(area of the cage / its vertices)
_ROUGH = 2.0  # times the spacing of rough rows, whose error is of third order
_CHECKED, _TOLERANCE = 256, 0.01  # vertices; largest sum of the errors in a row
_MOST_NODES = 0.5  # per vertex; with more, the coordinates themselves are as fast
_MARGIN = 3  # nodes around those of the vertices: B-splines and second differences need two


@dataclass(frozen=True, eq=False)
class InterpolatedBlock:
    """The rows of n vertices in the cage of a region, blend weights included; like an array.

    Parameters
    ----------
    blend : (n,) float
        Blend weights of the region.
    offsets : (n, 3) float32
        Of each vertex from the nearest node, in spacings: -1/2 to 1/2.
    cells : (n,) int32
        The number of this node among those with vertices nearby.
    lines : (cells, 9) int32
        For each of them the first rows of c in nine lines of three nodes each.
    values : (nodes, m) float
        c.
    """

    blend: FloatArray
    offsets: NDArray[np.float32]
    cells: NDArray[np.int32]
    lines: NDArray[np.int32]
    values: FloatArray

    @classmethod
    def of(
        cls,
        points: FloatArray,
        blend: FloatArray,
        cage: Cage,
        *,
        rough: bool = False,
        progress: Progress | None = None,
    ) -> InterpolatedBlock | None:
        """Return the rows of *points* (n, 3); None if the coordinates themselves are better."""
        coarser = _ROUGH if rough else 1.0
        edges = cage.vertices[cage.faces]
        normals = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
        area = 0.5 * float(np.linalg.norm(normals, axis=1).sum())
        checked = np.unique(np.linspace(0, len(points) - 1, _CHECKED).astype(np.int64))
        exact = mean_value_coordinates(points[checked], cage.vertices, cage.faces)
        exact *= blend[checked, None]
        for k, finer in enumerate((1.0, 0.5)):  # where the error is too large
            spacing = _SPACING * coarser * finer * np.sqrt(area / cage.n_vertices)
            share = part(progress, k / 2, (k + 1) / 2)
            block = cls._on_grid(points, blend, cage, spacing, share)
            if block is None:
                return None
            if np.abs(block[checked] - exact).sum(axis=1).max() <= _TOLERANCE * coarser**3:
                return block
        return None

    @classmethod
    def _on_grid(
        cls,
        points: FloatArray,
        blend: FloatArray,
        cage: Cage,
        spacing: float,
        progress: Progress | None,
    ) -> InterpolatedBlock | None:
        origin = points.min(axis=0) - _MARGIN * spacing
        offsets, place = np.empty((len(points), 3), np.float32), np.zeros(len(points), np.int64)
        shape = np.rint((points.max(axis=0) - origin) / spacing).astype(np.int64) + _MARGIN + 1
        if np.prod(shape.astype(float)) > 2.0**62:
            return None
        steps = np.array([shape[1] * shape[2], shape[2], 1])
        for axis in range(3):
            along = (points[:, axis] - origin[axis]) / spacing
            nearest = np.rint(along)
            offsets[:, axis] = along - nearest
            place += nearest.astype(np.int64) * steps[axis]
        used, cells = np.unique(place, return_inverse=True)
        around = np.array(list(itertools.product((-1, 0, 1), repeat=3))) @ steps
        met = np.unique(used[:, None] + around)
        beside = np.concatenate([steps, -steps])
        nodes = np.unique(met[:, None] + np.append(beside, 0))
        if len(nodes) > _MOST_NODES * len(points):
            return None
        w = np.empty((len(nodes), cage.n_vertices))
        for start in range(0, len(nodes), ROWS_AT_ONCE):
            some = nodes[start : start + ROWS_AT_ONCE]
            stop = start + len(some)
            at = origin + spacing * np.stack(np.unravel_index(some, shape), axis=1)
            share = part(progress, start / len(nodes), stop / len(nodes))
            w[start:stop] = mean_value_coordinates(at, cage.vertices, cage.faces, progress=share)
        values = 1.75 * w[np.searchsorted(nodes, met)]
        for step in beside:
            values -= 0.125 * w[np.searchsorted(nodes, met + step)]
        first = used[:, None] + around[::3]  # of lines along the last axis, which are consecutive
        lines = np.searchsorted(met, first).astype(np.int32)
        return cls(blend, offsets, cells.astype(np.int32), lines, values)

    @property
    def shape(self) -> tuple[int, int]:
        """(n, m)."""
        return len(self.blend), self.values.shape[1]

    @property
    def size(self) -> int:
        """Number of numbers in all rows."""
        return int(np.prod(self.shape))

    def __getitem__(self, rows: IntArray | slice) -> FloatArray:
        """Return some rows, (k, m)."""
        own = self._of(rows)
        if kernels := compiled_kernels(len(self.blend)):
            out = np.empty((len(own[0]), self.values.shape[1]))
            kernels.interpolated_rows(out, *inputs(*own, self.lines, self.values))
            return out
        pieces = [
            self._weights(slice(start, start + ROWS_AT_ONCE), own) @ self.values
            for start in range(0, len(own[0]), ROWS_AT_ONCE)
        ]
        return np.concatenate([np.empty((0, self.values.shape[1])), *pieces])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        """Return all rows."""
        return self[:].astype(dtype or np.float64, copy=False)

    def premultiplied(self, operator: sparse.csr_array) -> FloatArray:
        """Return operator @ rows, dense (k, m), for a sparse *operator* (k, n) with few columns."""
        by_column = operator.tocsc()
        met = np.flatnonzero(np.diff(by_column.indptr))
        out = np.zeros((operator.shape[0], self.values.shape[1]))
        for start in range(0, len(met), ROWS_AT_ONCE):
            some = met[start : start + ROWS_AT_ONCE]
            weights = self._weights(slice(None), self._of(some))
            out += (by_column[:, some] @ weights) @ self.values
        return out

    def adjoint(self, y: FloatArray) -> FloatArray:
        """Return the transpose times *y* (n, k): (m, k)."""
        own, at_nodes = self._of(slice(None)), np.zeros((len(self.values), y.shape[1]))
        if kernels := compiled_kernels(len(self.blend)):
            kernels.add_interpolated_adjoint(at_nodes, *inputs(y, *own, self.lines))
            return np.asarray(self.values.T @ at_nodes)
        for start in range(0, len(y), ROWS_AT_ONCE):
            piece = slice(start, start + ROWS_AT_ONCE)
            at_nodes += self._weights(piece, own).T @ y[piece]
        return np.asarray(self.values.T @ at_nodes)

    def add_to(
        self, x: FloatArray, rows: IntArray, at_nodes: FloatArray, *, start: int, stop: int
    ) -> None:
        """Add the motion of vertices start..stop to *rows* of *x*, given that of the nodes."""
        piece = slice(start, stop)
        if kernels := compiled_kernels(len(self.blend)):
            arguments = inputs(rows[piece], *self._of(piece), self.lines, at_nodes)
            kernels.add_interpolated(x, *arguments)
            return
        if len(self.blend) <= sizes.INTERPOLATED:
            weights = self._all_weights[piece]
        else:
            weights = self._weights(slice(None), self._of(piece))
        x[rows[piece]] += weights @ at_nodes

    @cached_property
    def _all_weights(self) -> sparse.csr_array:
        return self._weights(slice(None), self._of(slice(None)))

    def _of(self, rows: IntArray | slice) -> tuple[Any, ...]:
        return self.blend[rows], self.offsets[rows], self.cells[rows]

    def _weights(self, piece: slice, of: tuple[Any, ...]) -> sparse.csr_array:
        """Return the weights (k, nodes) of the values in some rows."""
        blend, offsets, cells = (array[piece] for array in of)
        t = offsets.astype(np.float64)
        x, y, z = np.moveaxis(
            np.stack([0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2], axis=2), 1, 0
        )
        x = x * blend[:, None]
        weights = x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]
        columns = self.lines[cells][:, :, None] + np.arange(3, dtype=np.int32)
        starts = 27 * np.arange(len(blend) + 1)
        shape = len(blend), len(self.values)
        return sparse.csr_array((weights.ravel(), columns.ravel(), starts), shape)
