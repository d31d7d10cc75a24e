"""Inner points for given surface points: no cell inverted, and as little distortion as possible.

    minimise  E(x) = sum_c v_c e(J_c),      x given on the surface
    e = |J|^2 / (3 chi^(2/3)) + (d^2 + 1) / (2 chi),      d = det J

J_c is the gradient of the map from rest to x at corner c of a cell, which has the volume v_c at
rest.  The first term changes if angles do, the second one if the volume does; e is 2 at rest.  With
chi = d it is infinite where a cell is inverted.  While there are inverted cells,

    chi = (d + sqrt(d^2 + eps^2)) / 2,      eps^2 = 1e-4 + 0.04 min(d)^2

keeps e finite, but so large that these cells turn back.

The start is harmonic: displacements inside are those of an elastic sheet in each coordinate, one
linear system.  Then Newton's method is used with the part of the Hessian that is positive, as e is
convex in (J, d, chi) and only d and chi are not linear in J.  Every linear system is solved by
conjugate gradients: a sparse factor of 100,000 hexahedra takes half a minute, and the iteration
needs a rough direction only.

Corners without a free point are left out.  So are corners that are flat or inverted at rest, from
which nothing can be measured.

Source
------
V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, "Foldover-free maps in 50
lines of code", ACM Trans. Graph. 40(4), 2021.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray
from ..progress import Progress, tell
from .cells import Corners, cofactors, determinants, edges, gradient_operator

_FLAT = 1e-9  # determinant, relative to the product of the lengths
_STEPS, _HALVINGS = 60, 15
_GAIN = 1e-5  # relative decrease of E below which the iteration ends
_HARMONIC, _DIRECTION = 1e-4, 0.1  # residuals of conjugate gradients, relative
_ROUNDS = 1000
_SLOPE = 1e-4  # share of the predicted decrease that a step must reach
_EPS, _TIMES = 1e-4, 0.04  # eps^2
_Linear = Callable[[FloatArray], FloatArray]


def inner_points(
    corners: Corners,
    rest: FloatArray,
    start: FloatArray,
    free: BoolArray,
    *,
    progress: Progress | None = None,
) -> FloatArray:
    """Return all points (p, 3), with the free ones where E is smallest.

    Parameters
    ----------
    corners : Corners
        Of the mesh at rest.
    rest, start : (p, 3) float
        All points at rest, and those that are not free where they are to be.
    free : (p,) bool
        The points that are found.
    progress : Progress, optional
        Called before every step; may raise `Cancelled`.
    """
    if not free.any():
        return start
    middle = rest.mean(axis=0)
    energy = _Energy(corners, rest - middle, free)
    x = energy.harmonic(start - middle)
    eps = _eps(energy.at(x, 1.0).d)
    state = energy.at(x, eps)
    for step in range(_STEPS):
        tell(progress, step / _STEPS, "moving the inside")
        slope = energy.slope(state)
        direction = energy.direction(state, slope)
        predicted = float(np.vdot(slope, direction))
        if predicted >= 0.0:
            break
        for halving in range(_HALVINGS):
            share = 0.5**halving
            moved = x.copy()
            moved[free] += share * direction
            there = energy.at(moved, eps)
            if there.value <= state.value + _SLOPE * share * predicted:
                break
        else:
            break
        gain = (state.value - there.value) / there.value
        x, state = moved, there
        was, eps = eps, _eps(state.d)
        if gain < _GAIN and (eps > 0.0 or was == 0.0):
            break
        if eps != was:
            state = energy.at(x, eps)
    tell(progress, 1.0, "moved the inside")
    result = x + middle
    result[~free] = start[~free]
    return np.asarray(result)


def _eps(d: FloatArray) -> float:
    smallest = float(d.min(initial=1.0))
    return 0.0 if smallest > 0.0 else (_EPS + _TIMES * smallest**2) ** 0.5


class _State(NamedTuple):
    """E and what its derivatives need, of c corners."""

    value: float
    d: FloatArray
    gradients: FloatArray
    cofactors: FloatArray
    chi: FloatArray
    slope: FloatArray
    """chi'."""
    angles: FloatArray
    """|J|^2 / (3 chi^(2/3))."""


class _Energy:
    """E of the corners with *free* points (p,) of a mesh at *rest* (p, 3)."""

    def __init__(self, corners: Corners, rest: FloatArray, free: BoolArray) -> None:
        spanned = edges(rest, corners.points)
        found, lengths = determinants(spanned), np.linalg.norm(spanned, axis=2)
        used = corners.signs * found > _FLAT * lengths.prod(axis=1)
        used &= (corners.volumes > 0.0) & free[corners.points].any(axis=1)
        ids = corners.points[used]
        self._hats, self._gradient = gradient_operator(rest, ids)
        self._ids, self._volumes = ids, corners.volumes[used]
        self._rest, self._free = rest, free
        self._back = self._gradient.T.tocsr()

    def harmonic(self, start: FloatArray) -> FloatArray:
        """Return *start* with harmonic displacements at the free points."""
        weights = sparse.diags_array(np.repeat(self._volumes, 3))
        laplacian = (self._back @ weights @ self._gradient).tocsr()
        moves = np.where(self._free[:, None], 0.0, start - self._rest)
        own = laplacian[self._free]
        inner = own[:, self._free]
        scale = _inverted(inner.diagonal())[:, None]
        found = np.stack(
            [
                _conjugate_gradients(lambda p: inner @ p, scale, right[:, None], _HARMONIC)[:, 0]
                for right in -(own @ moves).T
            ],
            axis=1,
        )
        moves[self._free] = found
        return np.asarray(self._rest + moves)

    def at(self, x: FloatArray, eps: float) -> _State:
        """Return E at *x* (p, 3); its value is infinite if *eps* is 0 and a corner is inverted."""
        gradients = (self._gradient @ x).reshape(-1, 3, 3)
        cofactor = cofactors(gradients)
        d = np.einsum("ci,ci->c", gradients[:, 0], cofactor[:, 0])
        root = np.sqrt(d**2 + eps**2)
        chi, slope = d, np.ones_like(d)
        if eps:
            with np.errstate(divide="ignore"):
                chi = np.where(d > 0.0, 0.5 * (d + root), 0.5 * eps**2 / (root - d))
            slope = chi / root
        elif d.min(initial=1.0) <= 0.0:
            return _State(np.inf, d, gradients, cofactor, chi, slope, chi)
        angles = np.einsum("cij,cij->c", gradients, gradients) / (3.0 * chi ** (2.0 / 3.0))
        value = float(self._volumes @ (angles + 0.5 * (d**2 + 1.0) / chi))
        return _State(value, d, gradients, cofactor, chi, slope, angles)

    def slope(self, state: _State) -> FloatArray:
        """Return the derivative of E by the free points (k, 3)."""
        _, d, gradients, cofactor, chi, slope, angles = state
        by_gradient = self._volumes * (2.0 / 3.0) * chi ** (-2.0 / 3.0)
        by_volume = d / chi - slope / chi * (2.0 / 3.0 * angles + 0.5 * (d**2 + 1.0) / chi)
        forces = by_gradient[:, None, None] * gradients
        forces += (self._volumes * by_volume)[:, None, None] * cofactor
        return np.asarray((self._back @ forces.reshape(-1, 3))[self._free])

    def direction(self, state: _State, slope: FloatArray) -> FloatArray:
        """Return a step of Newton's method, (k, 3), from the derivative *slope*."""
        hessian, diagonal = self.hessian(state)
        return _conjugate_gradients(hessian, _inverted(diagonal), -slope, _DIRECTION)

    def hessian(self, state: _State) -> tuple[_Linear, FloatArray]:
        """Return the positive part of the Hessian as a function, and its diagonal (k, 3).

            a |P|^2 + 2 b (J : P) (C : P) + k (C : P)^2        for a change P of J

        C are the cofactors of J.
        """
        _, d, gradients, cofactor, chi, slope, angles = state
        a = self._volumes * (2.0 / 3.0) * chi ** (-2.0 / 3.0)
        b = -2.0 / 3.0 * a * slope / chi
        k = (10.0 / 9.0) * angles * (slope / chi) ** 2
        k += (1.0 - d * slope / chi) ** 2 / chi + slope**2 / chi**3
        k *= self._volumes
        own, other = gradients.reshape(-1, 9), cofactor.reshape(-1, 9)
        whole = np.zeros_like(self._rest)

        def times(moves: FloatArray) -> FloatArray:
            whole[self._free] = moves
            change = (self._gradient @ whole).reshape(-1, 9)
            along = np.einsum("ci,ci->c", other, change)
            forces = a[:, None] * change
            forces += (b * along)[:, None] * own
            forces += (b * np.einsum("ci,ci->c", own, change) + k * along)[:, None] * other
            return np.asarray((self._back @ forces.reshape(-1, 3))[self._free])

        diagonal = np.zeros_like(self._rest)
        for corner in range(4):
            hat = self._hats[:, :, corner]
            j = np.einsum("cji,cj->ci", gradients, hat)
            c = np.einsum("cji,cj->ci", cofactor, hat)
            values = a[:, None] * np.einsum("cj,cj->c", hat, hat)[:, None]
            values = values + 2.0 * b[:, None] * j * c + k[:, None] * c**2
            for axis in range(3):
                diagonal[:, axis] += np.bincount(
                    self._ids[:, corner], values[:, axis], len(diagonal)
                )
        return times, diagonal[self._free]


def _inverted(diagonal: FloatArray) -> FloatArray:
    """Return 1 / *diagonal*; 0 where no corner has a say, so that nothing moves there."""
    positive = diagonal > 0.0
    return np.where(positive, 1.0 / np.where(positive, diagonal, 1.0), 0.0)


def _conjugate_gradients(
    matrix: _Linear, scale: FloatArray, right: FloatArray, tolerance: float
) -> FloatArray:
    """Return x with matrix(x) = *right*, up to a *tolerance* relative to the first residual.

    *scale* is the inverse of the diagonal of the matrix.
    """
    x, residual = np.zeros_like(right), right
    search = scaled = scale * residual
    size = float(np.vdot(residual, scaled))
    goal = tolerance**2 * size
    for _ in range(_ROUNDS):
        if size <= goal:
            break
        image = matrix(search)
        curvature = float(np.vdot(search, image))
        if curvature <= 0.0:
            break
        x = x + size / curvature * search
        residual = residual - size / curvature * image
        scaled = scale * residual
        before, size = size, float(np.vdot(residual, scaled))
        search = scaled + size / before * search
    return x
