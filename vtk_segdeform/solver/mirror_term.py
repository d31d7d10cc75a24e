"""Symmetry of the cages: displacements of pairs of points are mirror images of each other.

    sum_i omega |u_i - M u'_i|^2 = sum_i omega ((n . (u_i + u'_i))^2 + |(I - n n^T)(u_i - u'_i)|^2)

with the displacements u, u' of both points of a pair since rest, linear in the cage vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from .terms import NO_SURFACE


@dataclass(frozen=True, eq=False)
class MirrorTerm:
    """A `Term`; made by `MirrorTerm.of`."""

    across: FloatArray  # (m, m), of the component along the normal
    along: FloatArray  # (m, m), of those in the plane
    normal: FloatArray  # n n^T, (3, 3)
    rest: FloatArray  # (m, 3)

    is_always_active = True

    @classmethod
    def of(
        cls,
        rows: FloatArray,
        mates: FloatArray,
        *,
        normal: FloatArray,
        rest: FloatArray,
        weight: float,
    ) -> MirrorTerm:
        """Return the term of pairs with the *rows* and *mates* (k, m) of W~, and cages at *rest*.

        *normal* (3,) is that of the plane, *weight* omega.
        """
        plus, minus = rows + mates, rows - mates
        outer = np.outer(normal, normal)
        return cls(weight * plus.T @ plus, weight * minus.T @ minus, outer, rest)

    def renewed(self, _: FloatArray, /) -> MirrorTerm:
        """Return the term itself: it is the same at all poses."""
        return self

    def value_and_slope(
        self, p: FloatArray, _: FloatArray = NO_SURFACE, /
    ) -> tuple[float, FloatArray]:
        """Return the term at cages *p* (m, 3), and half its gradient (m, 3)."""
        u = p - self.rest
        across = u @ self.normal
        slope = self.across @ across + self.along @ (u - across)
        return float(np.vdot(u, slope)), slope

    def hessian(self, _: FloatArray, __: FloatArray = NO_SURFACE, /) -> FloatArray:
        """Return half the Hessian, (3m, 3m), stacked axis by axis; it is constant."""
        return np.kron(self.normal, self.across) + np.kron(np.eye(3) - self.normal, self.along)

    def share(self, _: FloatArray, __: FloatArray, /) -> float:
        """Return 1: no step is limited."""
        return 1.0
