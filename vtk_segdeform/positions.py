"""Vertices with a place to be: fixed ones (6) and handles (7), as weighted squares.

    sum_i omega_i |x_i - u_i|^2,    x_i = W~_i p

Vertices joined by mesh edges form a *set*: a fixed patch, or a handle that moves on its own.
Every set weighs the same, shared out evenly over its vertices, so that a handle of one vertex
holds as well as a patch of a thousand; in a patch of many thousands, neighbours share a place,
their mean.  A coarse cage cannot put every vertex of a set in place; `PositionTerm.stiffened`
raises the weight of the sets that are off by too much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph

from .arrays import FloatArray, IntArray, as_ids, as_points
from .errors import ConstraintError
from .mesh import Mesh
from .rotations import group_by_position
from .subspace import Subspace

_MANY, _PLACES = 1000, 500  # vertices of a set beyond which it has so many places
_STIFFER = 10.0
_STIFFEST = 1e4  # times the weight it started with


@dataclass(frozen=True, eq=False)
class PositionTerm:
    """The term for k vertices in sets; `strength` (s,) multiplies the weight of each set."""

    rows: FloatArray  # W~ at the k places, (k, m)
    set_of: IntArray  # (k,)
    base: FloatArray  # omega before strength, (k,)
    strength: FloatArray
    mean: sparse.csr_array | None = None  # (k, v), from the vertices held to the places

    @property
    def weights(self) -> FloatArray:
        """omega, (k,)."""
        return self.base * self.strength[self.set_of]

    def quadratic(self) -> FloatArray:
        """Return rows^T omega rows, (m, m)."""
        return (self.rows.T * self.weights) @ self.rows

    def value_and_slope(self, p: FloatArray, u: FloatArray) -> tuple[float, FloatArray]:
        """Return the term at *p* and half its gradient (m, 3), for targets *u* (k, 3)."""
        away = self.rows @ p - u
        pull = away * self.weights[:, None]
        return float(np.vdot(away, pull)), self.rows.T @ pull

    def stiffened(self, errors: FloatArray, tolerance: float) -> PositionTerm | None:
        """Return the term with more weight where *errors* (k,) pass *tolerance*, or None.

        None means that nothing is off, or that what is off already has all the weight allowed.
        """
        worst = np.zeros(len(self.strength))
        np.maximum.at(worst, self.set_of, errors)
        raised = (worst > tolerance) & (self.strength < _STIFFEST)
        if not raised.any():
            return None
        return replace(self, strength=np.where(raised, self.strength * _STIFFER, self.strength))


def position_term(
    subspace: Subspace, vertices: FloatArray, held: list[IntArray], weight: float
) -> PositionTerm:
    """Return the term for sets of vertices *held*, each of total *weight*.

    Parameters
    ----------
    subspace : Subspace
        W~.
    vertices : (n, 3) float
        The mesh at rest.
    held : list of (k_s,) int
        The vertices of each set, as they follow each other in the targets.
    weight : float
        Of each set.
    """
    places = [_places(vertices[ids]) for ids in held]
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
    on_mesh = sparse.coo_array((share, (row, ids)), (len(set_of), len(vertices))).tocsr()
    return PositionTerm(subspace.left(on_mesh), set_of, base, strength, mean)


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


def connected_sets(mesh: Mesh, ids: IntArray) -> list[IntArray]:
    """Return places in *ids* (k,), one array for each set of vertices joined by mesh edges."""
    if not len(ids):
        return []
    among = sparse.csr_array(mesh.adjacency[ids][:, ids])
    count, label = csgraph.connected_components(among, directed=False)
    return [np.flatnonzero(label == k) for k in range(count)]
