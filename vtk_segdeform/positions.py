"""Vertices with a place to be: fixed ones (6) and handles (7), as weighted squares.

    sum_i omega_i |x_i - u_i|^2,    x_i = W~_i p

Vertices joined by mesh edges form a *set*: a fixed patch, or a handle that moves on its own.
Every set weighs the same, shared out evenly over its vertices, so that a handle of one vertex
holds as well as a patch of a thousand; in a patch of many thousands, neighbours share a place,
their mean.  A coarse cage cannot put every vertex of a set in place; `stiffening` finds how much
more weight the sets need that are off by too much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph

from .arrays import FloatArray, IntArray, as_ids, as_points
from .errors import ConstraintError
from .mesh import Mesh
from .rotations import group_by_position
from .subspace import Subspace

FARTHEST_APART = 20.0
"""Diagonals of a mesh between places of what it is held by.

So far apart, volumes are rounded to a few 1e-13 of themselves; it grows with the cube of that."""

_MANY, _PLACES = 1000, 500  # vertices of a set beyond which it has so many places
_MOST_CHECKED = 5000  # vertices of a border
_ALONE = 1.5  # a vertex that shares its place may be off by so much more than the place
_Set: TypeAlias = tuple[slice, FloatArray | None, FloatArray]


@dataclass(frozen=True, eq=False)
class Pull:
    """The term for targets that stay, as r rows: sum_i omega_i |rows_i p - aims_i|^2 + beyond."""

    rows: FloatArray  # (r, m)
    aims: FloatArray  # (r, 3)
    weights: FloatArray  # (r,)
    beyond: float

    def value_and_slope(self, p: FloatArray) -> tuple[float, FloatArray]:
        """Return the term at *p* (m, 3) and half its gradient (m, 3)."""
        away = self.rows @ p - self.aims
        pull = away * self.weights[:, None]
        return self.beyond + float(np.vdot(away, pull)), self.rows.T @ pull


@dataclass(frozen=True, eq=False)
class Checks:
    """Vertices without a weight at which sets that share places are checked.

    A set is off by most at its border, through which the rest of the mesh pulls, or else far from
    the middle of a place.
    """

    rows: FloatArray  # W~ at them, (c, m)
    set_of: IntArray  # (c,)


@dataclass(frozen=True, eq=False)
class PositionTerm:
    """The term for k vertices in sets; `strength` (s,) multiplies the weight of each set.

    A set of many vertices reaches few cage vertices: its rows Q R count as R, with targets Q^T u.
    What of the targets is beyond Q no pose can meet, and it says nothing of where to go.

    Where vertices share places, targets are those of the k places and of the c vertices checked.
    """

    rows: FloatArray  # W~ at the k places, (k, m)
    set_of: IntArray  # (k,), in order
    base: FloatArray  # omega before strength, (k,), the same within a set
    strength: FloatArray
    mean: sparse.csr_array | None = None  # (k + c, v), from the vertices held to the targets
    checks: Checks | None = None
    known: list[_Set] | None = None  # what `_sets` is, if it is known

    @property
    def weights(self) -> FloatArray:
        """omega, (k,)."""
        return self.base * self.strength[self.set_of]

    @cached_property
    def _sets(self) -> list[_Set]:
        """For each set its places, Q if it is worth it, and R; or else its rows."""
        if self.known is not None:
            return self.known
        size = np.bincount(self.set_of, minlength=len(self.strength))
        ends = np.cumsum(size)
        sets: list[_Set] = []
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
        """Return rows^T omega rows, (m, m)."""
        return (self.rows.T * self.weights) @ self.rows

    def toward(self, u: FloatArray) -> Pull:
        """Return the term for targets *u* (k, 3)."""
        aims, beyond, omega = [np.empty((0, 3))], 0.0, self.weights
        for places, q, _ in self._sets:
            aim = u[places]
            if q is not None:
                aim = q.T @ u[places]
                left = u[places] - q @ aim
                beyond += float(omega[places.start] * np.vdot(left, left))
            aims.append(aim)
        rows, weights = self._short
        return Pull(rows, np.concatenate(aims), weights, beyond)

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

    def errors(self, p: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return by how much each set is off at *p* (m, 3): at its places, and where it is checked.

        Both (s,).  The latter counts for two thirds, and is 0 for a set that shares no places.
        """
        count = len(self.rows)
        places = self._worst(self.rows @ p - u[:count], self.set_of)
        if self.checks is None:
            return places, np.zeros_like(places)
        checks = self._worst(self.checks.rows @ p - u[count:], self.checks.set_of)
        return places, checks / _ALONE

    def _worst(self, away: FloatArray, set_of: IntArray) -> FloatArray:
        worst = np.zeros(len(self.strength))
        np.maximum.at(worst, set_of, np.sqrt(np.einsum("ij,ij->i", away, away)))
        return worst

    def with_strength(self, strength: FloatArray) -> PositionTerm:
        """Return the same with other weights."""
        return replace(self, strength=strength, known=self._sets)


def position_term(
    subspace: Subspace, mesh: Mesh, held: list[IntArray], weight: float
) -> PositionTerm:
    """Return the term for sets of vertices *held*, each of total *weight*.

    Parameters
    ----------
    subspace : Subspace
        W~.
    mesh : Mesh
        At rest.
    held : list of (k_s,) int
        The vertices of each set, as they follow each other in the targets.
    weight : float
        Of each set.
    """
    places = [_places(mesh.vertices[ids]) for ids in held]
    size = np.array([int(place.max()) + 1 for place in places], dtype=np.int64)
    set_of = np.repeat(np.arange(len(held)), size)
    base = weight / size[set_of]
    strength = np.ones(len(held))
    ids = np.concatenate([np.zeros(0, dtype=np.int64), *held])
    if len(ids) == len(set_of):
        return PositionTerm(subspace.at(ids), set_of, base, strength)
    begins = np.concatenate([[0], np.cumsum(size)])
    row = np.concatenate([begin + place for begin, place in zip(begins, places, strict=False)])
    share = 1.0 / np.bincount(row)[row]
    mean = sparse.coo_array((share, (row, np.arange(len(ids))))).tocsr()
    on_mesh = sparse.coo_array((share, (row, ids)), (len(set_of), mesh.n_vertices)).tocsr()
    count = np.array([len(own) for own in held])
    begins = np.cumsum(count) - count
    at, shares = [], np.flatnonzero(size < count)
    for k in shares:
        farthest = _farthest(mesh.vertices[held[k]], places[k])
        at.append(begins[k] + np.union1d(_border(mesh, held[k]), farthest))
    checked = np.concatenate(at)
    checks = Checks(subspace.at(ids[checked]), np.repeat(shares, [len(own) for own in at]))
    to_targets = sparse.vstack([mean, sparse.eye_array(len(ids)).tocsr()[checked]]).tocsr()
    return PositionTerm(
        subspace.left(on_mesh), set_of, base, strength, mean=to_targets, checks=checks
    )


def _border(mesh: Mesh, ids: IntArray) -> IntArray:
    """Return places in *ids* (k,) of vertices with neighbours elsewhere; of many, every so many."""
    outside = np.ones(mesh.n_vertices)
    outside[ids] = 0.0
    border = np.flatnonzero(mesh.adjacency[ids] @ outside)
    return border[:: 1 + len(border) // _MOST_CHECKED]


def _farthest(points: FloatArray, place: IntArray) -> IntArray:
    """Return which of *points* (k, 3) is farthest from the middle of each *place* (k,)."""
    share = 1.0 / np.bincount(place)
    middle = np.stack([np.bincount(place, x) * share for x in points.T], axis=1)
    order = np.lexsort((np.linalg.norm(points - middle[place], axis=1), place))
    return order[np.cumsum(np.bincount(place)) - 1]


def _places(points: FloatArray) -> IntArray:
    """Return (k,) the place of each point of a set: its own, or one shared by those near by."""
    if len(points) <= _MANY:
        return np.arange(len(points))
    return group_by_position(points, _PLACES)


def errors_at(
    ids: Sequence[IntArray], places: Sequence[FloatArray], unit: float, x: FloatArray
) -> tuple[float, ...]:
    """Return, for each list of vertices of *x* (n, 3), how far its farthest is from its place.

    Over *unit*; 0 where none is listed.
    """
    ways = [np.take(x, own, axis=0) - there for own, there in zip(ids, places, strict=True)]
    return tuple(math.sqrt(np.einsum("ij,ij->i", way, way).max(initial=0.0)) / unit for way in ways)


def checked_constraints(
    mesh: Mesh, fixed: ArrayLike, handle: ArrayLike
) -> tuple[IntArray, IntArray]:
    """Return the vertex numbers of *fixed* and *handle*, or raise a ConstraintError."""
    try:
        fixed = as_ids(fixed, mesh.n_vertices, "fixed")
        handle = as_ids(handle, mesh.n_vertices, "handle")
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    both = np.intersect1d(fixed, handle)
    if len(both):
        raise ConstraintError(
            f"{len(both)} vertices are both fixed and handle (the first is {both[0]}); "
            "take them out of one of the two"
        )
    return fixed, handle


def checked_targets(targets: ArrayLike, n_handle: int) -> FloatArray:
    """Return *targets* as (n_handle, 3), or raise a ConstraintError; without handles, any empty."""
    try:
        array = as_points(targets, "targets") if n_handle or np.size(targets) else np.empty((0, 3))
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    if len(array) != n_handle:
        raise ConstraintError(
            f"targets must give one point for each of the {n_handle} handle vertices; "
            f"got shape {array.shape}"
        )
    return array


def require_together(mesh: Mesh, *places: FloatArray) -> None:
    """Raise a ConstraintError if *places* (k, 3), targets and fixed, are senselessly far apart."""
    held = [points for points in places if len(points)]
    if not held:
        return
    low = np.min([points.min(axis=0) for points in held], axis=0)
    high = np.max([points.max(axis=0) for points in held], axis=0)
    apart = float((high - low).max()) / mesh.diagonal
    if not apart <= FARTHEST_APART:
        raise ConstraintError(
            f"targets and fixed vertices are {apart:.3g} diagonals of the mesh apart; at most "
            f"{FARTHEST_APART:.0f} are allowed: are both in the same unit?"
        )


def connected_sets(mesh: Mesh, ids: IntArray) -> list[IntArray]:
    """Return places in *ids* (k,), one array for each set of vertices joined by mesh edges."""
    if not len(ids):
        return []
    among = sparse.csr_array(mesh.adjacency[ids][:, ids])
    count, label = csgraph.connected_components(among, directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]
