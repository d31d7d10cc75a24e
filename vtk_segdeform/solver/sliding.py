"""Sliding: vertices that stay on a plane, a line or a surface, but may move along it.

    sum_i omega |N_i (x_i - c_i)|^2

c_i is the point of the track nearest to x_i, and N_i the projection on the normals of the track
there.  Those of a surface are of the last pose, and renewed after each solve: for x_i on it their
plane is tangent.  So the term is quadratic, with half the Hessian

    sum_i omega r_i^T r_i (x) N_i,    r_i the row of W~

Unlike contact it is always active.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..arrays import FloatArray, IntArray, largest_length
from .terms import NO_SURFACE

_RENEWED = 1e-4  # mesh sizes between old and new planes up to which they remain

Track: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Returns the nearest points (k, 3) of a plane, line or surface, and N there, (k, 3, 3)."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """A `Term` of vertices on one track.

    Parameters
    ----------
    columns : (c,) int
        The cage vertices that move them.
    rows : (k, c) float
        Their rows of W~ in these columns.
    track : Track
        What they slide along.
    weight : float
        omega.
    points : (k, 3) float
        c.
    normals : (k, 3, 3) float
        N.
    """

    columns: IntArray
    rows: FloatArray
    track: Track
    weight: float
    points: FloatArray
    normals: FloatArray

    is_always_active = True

    @classmethod
    def at(
        cls,
        p: FloatArray,
        moved_by: tuple[IntArray, FloatArray],
        track: Track,
        weight: float,
    ) -> Sliding:
        """Return the term with c and N of the pose with cages *p* (m, 3).

        *moved_by* are the columns and rows, as `Subspace.nonzeros` returns them.
        """
        columns, rows = moved_by
        return cls(columns, rows, track, weight, *track(rows @ p[columns]))

    def renewed(self, p: FloatArray) -> Sliding:
        """Return the term with c and N of cages *p* (m, 3); itself if they are hardly other."""
        other = Sliding.at(p, (self.columns, self.rows), self.track, self.weight)
        change = largest_length(self._away(p) - other._away(p))
        return other if change > _RENEWED else self

    def value_and_slope(
        self, p: FloatArray, _: FloatArray = NO_SURFACE, /
    ) -> tuple[float, FloatArray]:
        """Return the term at cages *p* (m, 3), and half its gradient (m, 3)."""
        away, slope = self._away(p), np.zeros_like(p)
        slope[self.columns] = self.weight * (self.rows.T @ away)
        return self.weight * float(np.vdot(away, away)), slope

    def hessian(self, p: FloatArray, _: FloatArray = NO_SURFACE, /) -> FloatArray:
        """Return half the Hessian, (3m, 3m), stacked axis by axis; it is constant."""
        m, normals = len(p), self.normals
        full = np.zeros((3 * m, 3 * m))
        for a in range(3):
            for b in range(a + 1):
                block = (self.rows.T * (self.weight * normals[:, a, b])) @ self.rows
                full[np.ix_(a * m + self.columns, b * m + self.columns)] = block
                full[np.ix_(b * m + self.columns, a * m + self.columns)] = block
        return full

    def share(self, _: FloatArray, __: FloatArray, /) -> float:
        """Return 1: no step is limited."""
        return 1.0

    def _away(self, p: FloatArray) -> FloatArray:
        """Return N (x - c), (k, 3)."""
        return np.asarray(
            np.einsum("kab,kb->ka", self.normals, self.rows @ p[self.columns] - self.points)
        )
