"""Position constraints: fixed vertices (6) and handles (7), as weighted squares.

    sum_i omega_i |x_i - u_i|^2,    x_i = W~_i p

Vertices joined by mesh edges form a *set*: a fixed patch, or a handle that moves independently.
All sets have the same total weight, divided evenly among their vertices, so that a handle of one
vertex is as strong as a patch of a thousand; in larger sets neighbours share a place, their mean.
A coarse cage cannot put every vertex of a set in its place.

Anchors keep samples of the surface where they are, softly and without a place to meet: the locality
of a pull.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..freezing import Frozen
from ..geometry import cluster_positions
from ..mesh import Mesh
from ..subspace import Subspace

_SetRows: TypeAlias = tuple[slice, FloatArray | None, FloatArray]


@dataclass(frozen=True, eq=False)
class Anchors:
    """Samples of the surface softly kept where they are at *p*: sum_s w_s |x_s - x_s(p)|^2.

    The samples are rows of W~, so that the sum is <q - p, Q (q - p)> for cages at q, whatever the
    number of samples: Q = sum_s w_s W~_s^T W~_s.

    A constant load, which adds -2 <load, q - p>, makes *p* a pose at rest under other constraints.
    """

    quadratic: FloatArray  # Q, (m, m)
    p: FloatArray  # (m, 3)
    load: FloatArray  # (m, 3)

    def value_and_slope(self, q: FloatArray) -> tuple[float, FloatArray]:
        """Return the sum for cages at *q* (m, 3) and half its gradient (m, 3)."""
        away = q - self.p
        kept = self.quadratic @ away
        return float(np.vdot(away, kept - 2.0 * self.load)), kept - self.load


@dataclass(frozen=True, eq=False)
class TargetTerm:
    """The term for given targets, as r rows: sum_i omega_i |rows_i p - aims_i|^2 + constant.

    And that of the anchors, if there are any.
    """

    rows: FloatArray  # (r, m)
    aims: FloatArray  # (r, 3)
    weights: FloatArray  # (r,)
    constant: float
    anchors: Anchors | None = None

    def value_and_slope(self, p: FloatArray) -> tuple[float, FloatArray]:
        """Return the term at *p* (m, 3) and half its gradient (m, 3)."""
        away = self.rows @ p - self.aims
        weighted = away * self.weights[:, None]
        value, slope = self.constant + float(np.vdot(away, weighted)), self.rows.T @ weighted
        if self.anchors is None:
            return value, slope
        more, steeper = self.anchors.value_and_slope(p)
        return value + more, slope + steeper


@dataclass(frozen=True, eq=False, repr=False)
class PositionTerm(Frozen):
    """The term for k vertices in sets.

    A set of many vertices is moved by few cage vertices: its rows Q R are replaced by R, with
    targets Q^T u.  The rest of the targets, which no pose can meet, adds a constant.
    """

    rows: FloatArray  # W~ at the k places, (k, m)
    set_of: IntArray  # (k,), in order
    weights: FloatArray  # omega, (k,), the same within a set
    mean: sparse.csr_array | None = None  # (k, v), from the vertices of the sets to their places
    factored: list[_SetRows] | None = None  # `_sets`, if it has been computed
    anchors: Anchors | None = None

    @cached_property
    def _sets(self) -> list[_SetRows]:
        """For each set its places, Q and R; or None and its rows, if these are not more than R."""
        if self.factored is not None:
            return self.factored
        size = np.bincount(self.set_of)
        ends = np.cumsum(size)
        sets: list[_SetRows] = []
        for start, end in zip(ends - size, ends, strict=True):
            rows = self.rows[start:end]
            reached = np.flatnonzero(rows.any(axis=0))
            if len(rows) <= len(reached):
                sets.append((slice(start, end), None, rows))
                continue
            q, r = np.linalg.qr(rows[:, reached])
            short = np.zeros((len(r), rows.shape[1]))
            short[:, reached] = r
            sets.append((slice(start, end), q, short))
        return sets

    def quadratic(self) -> FloatArray:
        """Return rows^T omega rows, (m, m), and Q of the anchors."""
        of_sets = (self.rows.T * self.weights) @ self.rows
        return of_sets if self.anchors is None else of_sets + self.anchors.quadratic

    def toward(self, u: FloatArray) -> TargetTerm:
        """Return the term for targets *u* (k, 3)."""
        aims, constant, omega = [np.empty((0, 3))], 0.0, self.weights
        for places, q, _ in self._sets:
            aim = u[places]
            if q is not None:
                aim = q.T @ u[places]
                left = u[places] - q @ aim
                constant += float(omega[places.start] * np.vdot(left, left))
            aims.append(aim)
        rows, weights = self._short
        return TargetTerm(rows, np.concatenate(aims), weights, constant, self.anchors)

    @cached_property
    def _short(self) -> tuple[FloatArray, FloatArray]:
        """The rows of all sets, (r, m), and their weights (r,)."""
        omega = self.weights
        rows = [np.empty((0, self.rows.shape[1])), *(r for *_, r in self._sets)]
        weights = [np.full(len(r), omega[places.start]) for places, _, r in self._sets]
        return np.concatenate(rows), np.concatenate([np.empty(0), *weights])

    def value_and_slope(self, p: FloatArray, u: FloatArray) -> tuple[float, FloatArray]:
        """Return the term at *p* and half its gradient (m, 3), for targets *u* (k, 3)."""
        return self.toward(u).value_and_slope(p)

    def local(self, rows: FloatArray, anchors: Anchors) -> PositionTerm:
        """Return the term with other *rows* (k, m) of the places, and with *anchors*."""
        return replace(self, rows=rows, factored=None, anchors=anchors)


def position_term(
    subspace: Subspace, mesh: Mesh, sets: list[IntArray], weight: float
) -> PositionTerm:
    """Return the term for *sets* of vertices, each of total *weight*.

    Parameters
    ----------
    subspace : Subspace
        W~.
    mesh : Mesh
        At rest.
    sets : list of (k_s,) int
        The vertices of each set, in the order of the targets.
    weight : float
        Of each set.
    """
    places = [_places(mesh.vertices[ids]) for ids in sets]
    size = np.array([int(place.max()) + 1 for place in places], dtype=np.int64)
    set_of = np.repeat(np.arange(len(sets)), size)
    weights = weight / size[set_of]
    ids = np.concatenate([np.zeros(0, dtype=np.int64), *sets])
    if len(ids) == len(set_of):
        return PositionTerm(subspace.at(ids), set_of, weights)
    begins = np.concatenate([[0], np.cumsum(size)])
    row = np.concatenate([begin + place for begin, place in zip(begins, places, strict=False)])
    share = 1.0 / np.bincount(row)[row]
    mean = sparse.coo_array((share, (row, np.arange(len(ids))))).tocsr()
    on_mesh = sparse.coo_array((share, (row, ids)), (len(set_of), mesh.n_vertices)).tocsr()
    return PositionTerm(subspace.premultiplied(on_mesh), set_of, weights, mean=mean)


def _places(points: FloatArray) -> IntArray:
    """Return (k,) the place of each point of a set: its own, or one shared with its neighbours."""
    if len(points) <= sizes.SHARED_PLACES:
        return np.arange(len(points))
    return cluster_positions(points, sizes.PLACES)


def errors_at(
    ids: Sequence[IntArray], places: Sequence[FloatArray], unit: float, x: FloatArray
) -> tuple[float, ...]:
    """Return the largest distance of vertices of *x* (n, 3) from their places, for each list.

    In multiples of *unit*; 0 for an empty list.
    """
    offsets = [np.take(x, own, axis=0) - there for own, there in zip(ids, places, strict=True)]
    squares = (np.einsum("ij,ij->i", each, each).max(initial=0.0) for each in offsets)
    return tuple(math.sqrt(square) / unit for square in squares)


def connected_sets(mesh: Mesh, ids: IntArray) -> list[IntArray]:
    """Return indices into *ids* (k,), one array for each set of vertices joined by mesh edges."""
    if not len(ids):
        return []
    among = sparse.csr_array(mesh.adjacency[ids][:, ids])
    count, label = csgraph.connected_components(among, directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]
