"""Sliding: vertices that stay on a plane, a line or a surface, but may move along it.

    sum_i omega |x_i - c(x_i)|^2,     c(x) the point of it that is nearest to x

Half its Hessian is that of the squared distance to the tangent plane, or line, at c:

    sum_i omega r_i^T r_i (x) N_i,    N_i the projection on the normals, r_i the row of W~

Unlike contact it is always active.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..arrays import FloatArray
from .terms import NO_SURFACE

Track: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Returns the nearest points (k, 3) of a plane, line or surface, and N there, (k, 3, 3)."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """A `Term` of vertices on one track.

    Parameters
    ----------
    rows : (k, m) float
        Their rows of W~.
    track : Track
        What they slide along.
    weight : float
        omega.
    """

    rows: FloatArray
    track: Track
    weight: float

    is_always_active = True

    def value_and_slope(
        self, p: FloatArray, _: FloatArray = NO_SURFACE, /
    ) -> tuple[float, FloatArray]:
        """Return the term at cages *p* (m, 3), and half its gradient (m, 3)."""
        away = self._away(p)[0]
        return self.weight * float(np.vdot(away, away)), self.weight * (self.rows.T @ away)

    def hessian(self, p: FloatArray, _: FloatArray = NO_SURFACE, /) -> FloatArray:
        """Return half the Hessian at *p*, (3m, 3m), stacked axis by axis."""
        m, normals = len(p), self._away(p)[1]
        full = np.empty((3 * m, 3 * m))
        for a in range(3):
            for b in range(a + 1):
                block = (self.rows.T * (self.weight * normals[:, a, b])) @ self.rows
                full[a * m : (a + 1) * m, b * m : (b + 1) * m] = block
                full[b * m : (b + 1) * m, a * m : (a + 1) * m] = block
        return full

    def share(self, _: FloatArray, __: FloatArray, /) -> float:
        """Return 1: no step is limited."""
        return 1.0

    def _away(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x - c(x) (k, 3), and N (k, 3, 3)."""
        x = self.rows @ p
        nearest, normals = self.track(x)
        return x - nearest, normals
