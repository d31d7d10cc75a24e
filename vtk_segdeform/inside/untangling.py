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
from scipy.sparse.linalg import LinearOperator, cg

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import ROWS_AT_ONCE, compiled_kernels, in_parallel, inputs
from ..progress import Progress, tell
from .cells import Corners, cofactors, determinants, edges, hat_gradients

_FLAT = 1e-9  # determinant, relative to the product of the lengths
_STEPS, _HALVINGS = 60, 15
_GAIN = 1e-5  # relative decrease of E below which the iteration ends
_HARMONIC, _DIRECTION = 1e-4, 0.1  # residuals of conjugate gradients, relative
_ROUNDS = 1000
_SLOPE = 1e-4  # share of the predicted decrease that a step must reach
_EPS, _TIMES = 1e-4, 0.04  # eps^2
_FACES_PER_CORNER = 20  # of a volume, that take as long
_SUMS = 4  # of parts of the corners, so that results do not depend on the number of threads
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
    terms: FloatArray
    """(c, 22): J, its cofactors C, and a, s, b, k.  The slope of the energy is a J + s C, and the
    positive part of its Hessian is a |P|^2 + 2 b (J : P) (C : P) + k (C : P)^2 for a change P of J.
    """


class _Energy:
    """E of the corners with *free* points (p,) of a mesh at *rest* (p, 3)."""

    def __init__(self, corners: Corners, rest: FloatArray, free: BoolArray) -> None:
        spanned = edges(rest, corners.points)
        found, lengths = determinants(spanned), np.linalg.norm(spanned, axis=2)
        used = corners.signs * found > _FLAT * lengths.prod(axis=1)
        used &= (corners.volumes > 0.0) & free[corners.points].any(axis=1)
        hats = np.swapaxes(hat_gradients(spanned[used]), 1, 2).reshape(-1, 12)
        self._ids, self._hats, self._volumes = inputs(
            corners.points[used], hats, corners.volumes[used]
        )
        self._rest, self._free = rest, free
        self._rough = hats.astype(np.float32)  # enough for directions, whose products take longest

    def harmonic(self, start: FloatArray) -> FloatArray:
        """Return *start* with harmonic displacements at the free points."""
        terms = np.zeros((len(self._ids), 22))
        terms[:, 18] = self._volumes
        laplacian, diagonal = self._hessian(terms)
        moves = np.where(self._free[:, None], 0.0, start - self._rest)
        moves[self._free] = _conjugate_gradients(
            lambda p: self._spread(laplacian, p),
            _inverted(diagonal),
            -laplacian(moves)[self._free],
            _HARMONIC,
        )
        return np.asarray(self._rest + moves)

    def at(self, x: FloatArray, eps: float) -> _State:
        """Return E at *x* (p, 3); its value is infinite if *eps* is 0 and a corner is inverted."""
        terms, found = np.empty((len(self._ids), 22)), np.empty((len(self._ids), 2))
        kernels = compiled_kernels(_FACES_PER_CORNER * len(self._ids))
        compute: Callable[..., None] = kernels.corner_terms if kernels else _corner_terms
        given = self._ids, self._hats, self._volumes, *inputs(x)
        in_parallel(
            lambda start, stop: compute(*given, eps, terms, found, start, stop),
            len(terms),
            ROWS_AT_ONCE,
        )
        return _State(float(found[:, 1].sum()), found[:, 0], terms)

    def slope(self, state: _State) -> FloatArray:
        """Return the derivative of E by the free points (k, 3)."""
        return self._forces(state.terms)[self._free, :3]

    def direction(self, state: _State, slope: FloatArray) -> FloatArray:
        """Return a step of Newton's method, (k, 3), from the derivative *slope*."""
        hessian, diagonal = self.hessian(state)
        return _conjugate_gradients(hessian, _inverted(diagonal), -slope, _DIRECTION)

    def hessian(self, state: _State) -> tuple[_Linear, FloatArray]:
        """Return the positive part of the Hessian as a function, and its diagonal (k, 3)."""
        product, diagonal = self._hessian(state.terms)
        return lambda moves: self._spread(product, moves), diagonal

    def _spread(self, product: _Linear, moves: FloatArray) -> FloatArray:
        """Return *product* at the free points for *moves* (k, 3) of them alone."""
        whole = np.zeros_like(self._rest)
        whole[self._free] = moves
        return product(whole)[self._free]

    def _hessian(self, terms: FloatArray) -> tuple[_Linear, FloatArray]:
        """Return the Hessian of all points (p, 3) as a function, and its diagonal (k, 3)."""
        hats, read = inputs(self._rough, terms.astype(np.float32))

        def product(moves: FloatArray) -> FloatArray:
            kernels = compiled_kernels(_FACES_PER_CORNER * len(self._ids))
            add = kernels.add_corner_products if kernels else _add_corner_products
            (given,) = inputs(moves)
            return self._sum(lambda *part: add(self._ids, hats, read, given, *part), 3)

        return product, self._forces(terms)[self._free, 3:]

    def _forces(self, terms: FloatArray) -> FloatArray:
        """Return the slope and the diagonal of the Hessian at all points, (p, 6)."""
        kernels = compiled_kernels(_FACES_PER_CORNER * len(self._ids))
        add: Callable[..., None] = kernels.add_corner_forces if kernels else _add_corner_forces
        given = self._ids, self._hats, *inputs(terms)
        return self._sum(lambda *part: add(*given, *part), 6)

    def _sum(self, add: Callable[[FloatArray, int, int], None], columns: int) -> FloatArray:
        """Return the sum (p, columns) over all corners of what *add* adds for some of them."""
        share = -(-len(self._ids) // _SUMS)
        sums = np.zeros((_SUMS, len(self._rest), columns))
        in_parallel(
            lambda start, stop: add(sums[start // share], start, stop), len(self._ids), share
        )
        return np.asarray(sums.sum(axis=0))


def _corner_terms(
    ids: IntArray,
    hats: FloatArray,
    volumes: FloatArray,
    x: FloatArray,
    eps: float,
    terms: FloatArray,
    found: FloatArray,
    start: int,
    stop: int,
) -> None:
    """Do `kernels.compiled.corners.corner_terms`."""
    some = slice(start, stop)
    own = np.einsum("cqj,cqi->cji", hats[some].reshape(-1, 4, 3), x[ids[some]])
    other, v = cofactors(own), volumes[some]
    d = np.einsum("ci,ci->c", own[:, 0], other[:, 0])
    chi, rate = d, 1.0 / d
    with np.errstate(divide="ignore", invalid="ignore"):
        if eps:
            root = np.sqrt(d**2 + eps**2)
            chi = np.where(d > 0.0, 0.5 * (d + root), 0.5 * eps**2 / (root - d))
            rate = 1.0 / root
        angles = np.einsum("cij,cij->c", own, own) / (3.0 * chi ** (2.0 / 3.0))
        bulk = 0.5 * (d**2 + 1.0) / chi
        a = v * (2.0 / 3.0) * chi ** (-2.0 / 3.0)
        found[some, 0] = d
        found[some, 1] = np.where(chi > 0.0, v * (angles + bulk), np.inf)
        terms[some, :9], terms[some, 9:18] = own.reshape(-1, 9), other.reshape(-1, 9)
        terms[some, 18] = a
        terms[some, 19] = v * (d / chi - rate * (2.0 / 3.0 * angles + bulk))
        terms[some, 20] = -2.0 / 3.0 * a * rate
        k = (10.0 / 9.0) * angles * rate**2 + ((1.0 - d * rate) ** 2 + rate**2) / chi
        terms[some, 21] = v * k


def _add_corner_forces(
    ids: IntArray, hats: FloatArray, terms: FloatArray, out: FloatArray, start: int, stop: int
) -> None:
    """Do `kernels.compiled.corners.add_corner_forces`."""
    some = slice(start, stop)
    hat = hats[some].reshape(-1, 4, 3)
    own, other = (terms[some, k : k + 9].reshape(-1, 3, 3) for k in (0, 9))
    a, s, b, k = terms[some, 18:, None, None].swapaxes(0, 1)
    j, c = hat @ own, hat @ other
    square = (hat**2).sum(axis=2, keepdims=True)
    diagonal = a * square + 2.0 * b * j * c + k * c**2
    _add(out, ids[some], np.concatenate([a * j + s * c, diagonal], axis=2))


def _add_corner_products(
    ids: IntArray,
    hats: FloatArray,
    terms: FloatArray,
    moves: FloatArray,
    out: FloatArray,
    start: int,
    stop: int,
) -> None:
    """Do `kernels.compiled.corners.add_corner_products`."""
    some = slice(start, stop)
    hat, own, other = hats[some].reshape(-1, 4, 3), terms[some, :9], terms[some, 9:18]
    change = np.einsum("cqj,cqi->cji", hat, moves[ids[some]]).reshape(-1, 9)
    a, _, b, k = terms[some, 18:, None].swapaxes(0, 1)
    along, align = ((each * change).sum(axis=1, keepdims=True) for each in (other, own))
    forces = a * change + b * along * own + (b * align + k * along) * other
    _add(out, ids[some], hat @ forces.reshape(-1, 3, 3))


def _add(out: FloatArray, ids: IntArray, values: FloatArray) -> None:
    """Add *values* (c, 4, k) to the rows *ids* (c, 4) of *out* (p, k)."""
    for column in range(out.shape[1]):
        out[:, column] += np.bincount(ids.ravel(), values[:, :, column].ravel(), len(out))


def _inverted(diagonal: FloatArray) -> FloatArray:
    """Return 1 / *diagonal*; 0 where no corner has a say, so that nothing moves there."""
    positive = diagonal > 0.0
    return np.where(positive, 1.0 / np.where(positive, diagonal, 1.0), 0.0)


def _conjugate_gradients(
    matrix: _Linear, scale: FloatArray, right: FloatArray, tolerance: float
) -> FloatArray:
    """Return x with matrix(x) = *right* (k, 3), up to a *tolerance* relative to *right*.

    *scale* (k, 3) is the inverse of the diagonal of the matrix.
    """
    shape, square = right.shape, (right.size, right.size)
    given = LinearOperator(square, lambda x: matrix(x.reshape(shape)).ravel(), dtype=np.float64)
    diagonal = sparse.diags_array(scale.ravel())
    found, _ = cg(given, right.ravel(), rtol=tolerance, maxiter=_ROUNDS, M=diagonal)
    return np.asarray(found.reshape(shape))
