"""Thin-plate splines through values at landmarks, as exactly as the landmarks are certain.

    s(x) = sum_j c_j phi(|x - a_j|) + affine(x),   phi(r) = r^2 log r
    (K + diag(smoothing)) c + P d = values,        P^T c = 0,   P = (1, a)

The minimum norm solution is taken, so landmarks may lie in a plane or coincide.  If uncertain
landmarks are off their targets by r_i on average as much as their standard deviation sigma_i,

    sum_i (r_i / sigma_i)^2 = number of uncertain landmarks,     smoothing_i = c sigma_i^2,

then the spline follows them no further than they are known: that determines c.

A spline has at most `CENTRES` centres.  What is left at other landmarks is interpolated by compact
functions, whose matrix is sparse.

Source
------
F. Bookstein, "Principal warps: thin-plate splines and the decomposition of deformations", IEEE
PAMI 11(6), 1989.  C. Reinsch, "Smoothing by spline functions", Numer. Math. 10, 1967: c.
H. Wendland, "Piecewise polynomial, positive definite and compactly supported radial functions of
minimal degree", Adv. Comput. Math. 4, 1995.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..arrays import FloatArray

CENTRES = 200
"""Of a spline: its matrix is dense."""
_RANK = 1e-12  # relative to the largest eigenvalue
_SMOOTHINGS = np.logspace(-12.0, 6.0, 37)  # c, times mean sigma^2 in sizes, that are compared
_NEIGHBOURS = 16  # of a landmark, within the reach of a compact function
_NUGGET = 1e-9  # for landmarks that coincide
_PIECE = 1 << 22  # distances computed at a time


class Spline:
    """A thin-plate spline with given centres; its matrix serves for any values.

    Parameters
    ----------
    centres : (k, 3) float
        a.
    smoothing : (k,) float
        0 where the spline interpolates.

    Attributes
    ----------
    bending : (k, k) float
        B: u^T B u is the bending energy of the spline with the values u (k,), up to a factor.
    """

    def __init__(self, centres: FloatArray, smoothing: FloatArray) -> None:
        self._middle = centres.mean(axis=0)
        self._size = float(np.linalg.norm(np.ptp(centres, axis=0))) or 1.0
        self._centres = (centres - self._middle) / self._size
        k = len(centres)
        matrix = np.zeros((k + 4, k + 4))
        matrix[:k] = self._basis(centres)
        matrix[k:, :k] = matrix[:k, k:].T
        matrix[np.arange(k), np.arange(k)] += smoothing
        self._inverse = linalg.pinvh(matrix, rtol=_RANK)[:, :k]
        self.bending = self._inverse[:k]

    def _basis(self, points: FloatArray) -> FloatArray:
        x = (points - self._middle) / self._size
        r = cdist(x, self._centres)
        phi = r * r * np.log(np.where(r > 0.0, r, 1.0))
        return np.hstack([phi, np.ones((len(x), 1)), x])

    def at(self, points: FloatArray, values: FloatArray) -> FloatArray:
        """Return s of the *values* (k, 3) of the centres at *points* (n, 3)."""
        factors = self._inverse @ values
        size = max(_PIECE // len(factors), 1)
        pieces = [points[i : i + size] for i in range(0, len(points), size)]
        return np.concatenate([np.empty((0, 3)), *(self._basis(q) @ factors for q in pieces)])


def smoothing_of(centres: FloatArray, values: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the smoothing (k,) of splines through *values* (k, 3) with deviations *sigma* (k,).

    The values and *sigma* are in the same unit; it is 0 where they are certain.
    """
    uncertain = sigma > 0.0
    if not uncertain.any():
        return np.zeros(len(sigma))
    shares = (sigma / np.sqrt(np.mean(sigma[uncertain] ** 2))) ** 2

    def misfit(c: float) -> float:
        off = Spline(centres, c * shares).at(centres, values) - values
        squares = (off[uncertain] ** 2).sum(axis=1) / sigma[uncertain] ** 2
        return float(squares.mean() / 3.0)  # sigma is of each coordinate

    low, high = 0, len(_SMOOTHINGS) - 1
    while low < high:  # the last c whose misfit is at most 1
        middle = (low + high + 1) // 2
        if misfit(_SMOOTHINGS[middle]) <= 1.0:
            low = middle
        else:
            high = middle - 1
    return np.asarray(_SMOOTHINGS[low] * shares)


class Compact:
    """Compact functions through values at any number of points.

    Parameters
    ----------
    centres : (k, 3) float
    values : (k, 3) float
    sigma : (k,) float
        Standard deviations of the values.
    """

    def __init__(self, centres: FloatArray, values: FloatArray, sigma: FloatArray) -> None:
        self._tree = cKDTree(centres)
        away, _ = self._tree.query(centres, [_NEIGHBOURS + 1])
        self._reach = float(np.median(away)) or 1.0
        matrix = self._matrix(self._tree)
        spread = float(np.mean(values**2)) or 1.0
        nugget = sparse.diags_array(_NUGGET + sigma**2 / spread)
        self._factors = splu(sparse.csc_array(matrix + nugget)).solve(np.ascontiguousarray(values))

    def _matrix(self, other: cKDTree) -> sparse.csr_array:
        near = other.sparse_distance_matrix(self._tree, self._reach, output_type="coo_matrix")
        r = near.data / self._reach
        entries = ((1.0 - r) ** 4 * (4.0 * r + 1.0), (near.row, near.col))
        return sparse.coo_array(entries, shape=(other.n, self._tree.n)).tocsr()

    def at(self, points: FloatArray) -> FloatArray:
        """Return their sum at *points* (n, 3)."""
        return np.asarray(self._matrix(cKDTree(points)) @ self._factors)
