"""Anderson acceleration of a fixed-point iteration p -> q(p).

With residuals h = q(p) - p, the next p is the combination of the last few q whose residuals,
combined alike, cancel best:

    gamma = argmin | h_k - sum_j gamma_j (h_j+1 - h_j) |
    p     = q_k - sum_j gamma_j (q_j+1 - q_j)

The differences are of the map only: if q changes by a constant, as with new targets, they serve on.

Source
------
D. G. Anderson, "Iterative procedures for nonlinear integral equations", J. ACM 12(4), 1965.
H. F. Walker, P. Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numer. Anal.
49(4), 2011.
"""

from __future__ import annotations

import copy

import numpy as np

from ..arrays import FloatArray


class Anderson:
    """The last few (p, h) and the combination of them whose residual is smallest.

    Residuals are measured in the norm of H.  Plain distances between cage vertices also count
    vertices that hardly move the mesh, and take a sixth more steps.
    """

    def __init__(self, window: int) -> None:
        self.window = window
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._moves: list[FloatArray] = []  # differences of q = p + h
        self._changes: list[FloatArray] = []  # differences of the residual

    def copy(self) -> Anderson:
        """Return another with the same steps."""
        return copy.copy(self)  # lists and arrays are replaced, never changed

    def pause(self) -> None:
        """Keep the differences, which hold for other targets, too, but not the last step."""
        self._last = None

    def forget(self) -> None:
        """Discard all steps."""
        self._last, self._moves, self._changes = None, [], []

    def extrapolate(self, q: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the accelerated successor of p, whose plain successor is *q* = p + h."""
        if self._last is not None:
            self._moves = [*self._moves, (q - self._last[0]).ravel()][-self.window :]
            changes = [*self._changes, (residual - self._last[1]).ravel()]
            self._changes = changes[-self.window :]
        self._last = q, residual
        if not self._changes:
            return q
        gamma = np.linalg.lstsq(np.array(self._changes).T, residual.ravel(), rcond=1e-10)[0]
        return q - (gamma @ np.array(self._moves)).reshape(q.shape)
