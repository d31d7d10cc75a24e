"""Barrier against folds: the body below the surface does not turn inside out.

A triangle (a, b, c) of a coarse surface and a point d inside the body make a tetrahedron.  J is its
volume relative to that at rest, negative where the body is turned inside out.  While J is below a
threshold J_0, the objective has the term

    b(J) = (J_0 - J)^3 / (J_0^2 J)

times the tetrahedron's share of the volume.  It is convex, twice differentiable, and infinite from
J = 0 on.  It is weak: it costs hardly anything unless a tetrahedron is almost flat.

Poses that are folded already, such as those of cages moved by hand, must have a way back.  So
tetrahedra that are inverted where a solve begins are left out of this solve.

The inner point d is in the middle of the largest balls inside the body that touch the surface at
the three corners, as the mean of the surface points around these balls.  So all corners are linear
in the surface, the coarse one that the solver's steps have anyway.  Neighbouring triangles share an
inner point where it is well inside the balls of all of them.  While no J is below J_0 the term
costs the inner points and the determinants: 4 to 10 % of a frame.

It has a price where it is active, at bends beyond 90 degrees: a body that may not fold in a crease
bends over a greater length.  In 25 poses of five bodies, bent and twisted by up to 150 degrees, the
triangles are distorted 1.03 times as much in the median, and 1.2 to 1.75 times in seven poses;
5 triangles are folded instead of 31.

Of the Hessian only b'' dJ dJ^T is used, one row for each tetrahedron with J < J_0.  The rest,
b' d^2 J, is not convex; steps without it are as few.

Source
------
C. Schueller, L. Kavan, D. Panozzo, O. Sorkine-Hornung, "Locally injective mappings", Symposium on
Geometry Processing 2013: barriers of this kind.  The balls: `geometry.local_volume`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.linalg import blas
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import cluster_positions, inner_balls
from ..kernels import compiled_kernels, inputs
from ..subspace import Subspace
from .terms import NO_SURFACE

_THRESHOLD = 0.25  # J_0
_LEAST_RATIO = 1e-4  # J up to which a tetrahedron counts as inverted
_STRENGTH = 3e-3  # of all tetrahedra together, in scales of the shape energy
_AROUND, _REACH = 16, 1.3  # points around a ball, within so many of its radii from its middle
_INNER = 400  # inner points that triangles share
_SHARED = 0.5  # of the radius of its own ball, within which a triangle uses a shared inner point
_LEAST_HEIGHT = 0.1  # of a tetrahedron, relative to the root of its triangle's area
_MOST = 8_000  # tetrahedra
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Barrier:
    """A term of the solver (`terms.Term`); made by `Barrier.of`.

    Parameters
    ----------
    surface : Subspace
        W~ of the s points of the coarse surface.
    points : (s + i, s) sparse
        From the surface to its points and, after them, the inner points.
    corners : (t, 4) int
        The tetrahedra: the three corners of a triangle, seen from inside, and the inner point.
    volumes : (t,) float
        Six times their volumes at rest, which are positive.
    weights : (t,) float
        Of the tetrahedra.
    """

    surface: Subspace
    points: sparse.csr_array
    corners: IntArray
    volumes: FloatArray
    weights: FloatArray

    @classmethod
    def of(
        cls,
        surface: Subspace,
        faces: IntArray,
        rest: FloatArray,
        *,
        encloses: BoolArray,
        strength: float,
    ) -> Barrier:
        """Return the barrier of a coarse *surface* with cages at *rest* (m, 3).

        Parameters
        ----------
        surface : Subspace
            W~ of its s points.
        faces : (f, 3) int
            Its triangles.
        rest : (m, 3) float
            The cages at rest.
        encloses : (s,) bool
            Whether each point is on a part that encloses a volume; an open sheet may fold.
        strength : float
            The scale of the shape energy.
        """
        faces = faces[encloses[faces].all(axis=1)]
        faces = faces[:: 1 + len(faces) // _MOST]
        x = surface.map(rest)
        points, corners = _identity(len(x)), np.empty((0, 4), dtype=np.int64)
        if len(faces):
            inner, corners = _tetrahedra(x, faces)
            points = sparse.csr_array(sparse.vstack([points, inner]))
        volumes = _determinants(points @ x, corners)
        weights = _STRENGTH * strength * volumes / max(volumes.sum(), _TINY)
        return cls(surface, points, corners, volumes, weights)

    def ratios(self, p: FloatArray, x: FloatArray = NO_SURFACE) -> FloatArray:
        """Return J of each tetrahedron for cages at *p* (m, 3), (t,); *x* is as in `terms`."""
        return self._ratios(self._at(p, x))

    def value_and_slope(
        self, p: FloatArray, x: FloatArray = NO_SURFACE
    ) -> tuple[float, FloatArray]:
        """Return the barrier at *p* (m, 3) and half its gradient (m, 3)."""
        y = self._at(p, x)
        j = self._ratios(y)
        if j.min(initial=1.0) >= _THRESHOLD:
            return 0.0, np.zeros_like(p)
        active = np.flatnonzero(j < _THRESHOLD)
        value, first, _ = _barrier(j[active])
        if not np.isfinite(value).all():
            return np.inf, np.zeros_like(p)
        moves = self._slopes(y, active) * (0.5 * self.weights[active] * first)[:, None, None]
        slope = np.zeros_like(y)
        np.add.at(slope, self.corners[active], moves)
        return float(self.weights[active] @ value), self.surface.adjoint(self.points.T @ slope)

    def hessian(self, p: FloatArray, x: FloatArray = NO_SURFACE) -> FloatArray | None:
        """Return half its Hessian at *p* without b' d^2 J, (3m, 3m); None at 0."""
        y = self._at(p, x)
        j = self._ratios(y)
        active = np.flatnonzero(j < _THRESHOLD)
        if not len(active):
            return None
        scale = np.sqrt(0.5 * self.weights[active] * _barrier(j[active])[2])
        moves = self._slopes(y, active) * scale[:, None, None]
        ids, place = np.unique(self.corners[active], return_inverse=True)
        w = self.surface.premultiplied(self.points[ids])[place.reshape(-1, 4)]
        rows = (np.swapaxes(moves, 1, 2) @ w).reshape(len(active), -1)
        return np.asarray(blas.dsyrk(1.0, rows.T, lower=0).T)

    def begun_at(self, p: FloatArray, x: FloatArray = NO_SURFACE) -> Barrier:
        """Return the barrier of a solve that begins at *p* (m, 3), where it is finite."""
        kept = self.ratios(p, x) > _LEAST_RATIO
        corners, volumes, weights = self.corners[kept], self.volumes[kept], self.weights[kept]
        return replace(self, corners=corners, volumes=volumes, weights=weights)

    def share(self, _step: FloatArray) -> float:
        """Return 1: where a step leads too far, the term is infinite."""
        return 1.0

    def _at(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """Return the surface points and inner points, (s + i, 3)."""
        return np.asarray(self.points @ (x if len(x) else self.surface.map(p)))

    def _slopes(self, x: FloatArray, active: IntArray) -> FloatArray:
        """Return the derivatives of J of some tetrahedra by their corners, (k, 4, 3)."""
        corners = self.corners[active]
        of_edges = _cofactors(x[corners[:, 1:]] - x[corners[:, :1]])
        of_edges /= self.volumes[active, None, None]
        return np.concatenate([-of_edges.sum(axis=1, keepdims=True), of_edges], axis=1)

    def _ratios(self, x: FloatArray) -> FloatArray:
        if kernels := compiled_kernels(len(self.corners)):
            kernels.determinants(*inputs(x, self.corners), out := np.empty(len(self.corners)))
            out /= self.volumes
            return out
        return _determinants(x, self.corners) / self.volumes


def _barrier(j: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return b and its first two derivatives at *j* (k,), all below the threshold."""
    at = np.maximum(j, _LEAST_RATIO)
    short = _THRESHOLD - at
    value = np.where(j > _LEAST_RATIO, short**3 / at / _THRESHOLD**2, np.inf)
    first = -(short**2) * (2.0 * at + _THRESHOLD) / (at * _THRESHOLD) ** 2
    return value, first, 2.0 * _THRESHOLD / at**3 - 2.0 / _THRESHOLD**2


def _determinants(x: FloatArray, corners: IntArray) -> FloatArray:
    """Return six times the volumes of tetrahedra, (t,)."""
    a, b, c, d = x[corners.T]
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a))


def _cofactors(rows: FloatArray) -> FloatArray:
    """Return the derivatives of the determinants of 3 x 3 matrices, (k, 3, 3)."""
    a, b, c = np.moveaxis(rows, 1, 0)
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _tetrahedra(x: FloatArray, faces: IntArray) -> tuple[sparse.csr_array, IntArray]:
    """Return inner points (i, s) of a surface *x* (s, 3), and the tetrahedra (t, 4) of *faces*.

    The corners of a tetrahedron are those of a triangle, and len(x) + an inner point.  Flat
    tetrahedra are left out.
    """
    used, place = np.unique(faces, return_inverse=True)
    place = place.reshape(-1, 3)
    around, diameters = _around_balls(x[used], place)
    thirds = np.full(place.size, 1.0 / 3.0), (np.repeat(np.arange(len(faces)), 3), place.ravel())
    mean = sparse.coo_array(thirds, (len(faces), len(used))).tocsr()
    around, diameters = sparse.csr_array(mean @ around), mean @ diameters
    inside, own = np.asarray(around @ x[used]), np.arange(len(faces))
    cluster = cluster_positions(inside, _INNER, seeded=False)
    means = np.stack([np.bincount(cluster, axis) for axis in inside.T]) / np.bincount(cluster)
    shared = np.asarray(cKDTree(inside).query(means.T)[1])[cluster]
    beside = np.linalg.norm(inside[shared] - inside, axis=1)
    y, n, chosen = np.concatenate([x, inside]), len(x), own.copy()
    is_shared = beside <= 0.5 * _SHARED * diameters
    is_shared &= _are_solid(y, np.column_stack([faces[:, [0, 2, 1]], n + shared]))
    chosen[is_shared] = shared[is_shared]
    corners = np.column_stack([faces[:, [0, 2, 1]], n + chosen])
    solid = _are_solid(y, corners)
    kept, number = np.unique(chosen[solid], return_inverse=True)
    corners = np.column_stack([corners[solid, :3], n + number])
    entries = around[kept].tocoo()
    places = entries.row, used[entries.col]
    return sparse.coo_array((entries.data, places), (len(kept), n)).tocsr(), corners


def _around_balls(x: FloatArray, faces: IntArray) -> tuple[sparse.csr_array, FloatArray]:
    """Return the mean (n, n) of the points *x* (n, 3) around the ball at each, and its diameter."""
    n, own = len(x), np.arange(len(x))
    inward, opposite, diameters = inner_balls(x, faces)
    middle = x + 0.5 * diameters[:, None] * inward
    away, near = map(np.asarray, cKDTree(x).query(middle, k=min(_AROUND, n)))
    # Those of another limb nearby face the ball.
    facing = np.einsum("ijk,ijk->ij", x[near] - middle[:, None], inward[near])
    is_around = (away <= 0.5 * _REACH * diameters[:, None]) & (facing < 0.0)
    rows, which = np.nonzero(is_around)
    places = np.concatenate([own, own, rows]), np.concatenate([own, opposite, near[rows, which]])
    sums = sparse.coo_array((np.ones(len(places[0])), places), (n, n)).tocsr()
    return sparse.csr_array(sparse.diags_array(1.0 / sums.sum(axis=1)) @ sums), diameters


def _are_solid(y: FloatArray, corners: IntArray) -> BoolArray:
    """Return which of the tetrahedra *corners* (t, 4) of the points *y* are not flat, (t,)."""
    a, b, c = y[corners[:, :3].T]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(_determinants(y, corners) > _LEAST_HEIGHT * area**1.5)


def _identity(n: int) -> sparse.csr_array:
    return sparse.csr_array(sparse.eye_array(n))
