"""The volume band: the body resists where it is compressed or expanded by more than a quarter.

    V(x) = w sum_i A_i f(|s_i(x)| - 0.25),      f(e) = 0             for e < 0
                                                       e^2           for e < d
                                                       2 d e - d^2   beyond

s_i is the local volume change (`geometry.local_volume`) and A_i the area around vertex i.  The
total volume is preserved exactly whatever the pose, but without the band the inside of a bend loses
up to two thirds of its volume, which is gained elsewhere.

Beyond e = d the force does not grow: in a crease of a limb bent back onto itself no force restores
the volume, and a growing one would only move the rest of the body.

s is relative, and V an area like the energy of the cells: w and d depend neither on the mesh nor on
its units.  Inside the band V is 0, and costs s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..geometry import LocalVolume
from ..mesh import Mesh

_BAND = 0.25
_FULL = 0.05  # d
_STRENGTH = 1.0  # w


@dataclass(frozen=True, eq=False)
class VolumeBand:
    """V(x) of a mesh; made by `VolumeBand.of`."""

    local: LocalVolume

    @classmethod
    def of(cls, mesh: Mesh) -> VolumeBand:
        """Return the band of *mesh*."""
        return cls(LocalVolume(mesh))

    def value_and_slope(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return V at *x* (n, 3), and half its gradient (n, 3)."""
        if not self.local.is_defined:
            return 0.0, np.zeros_like(x)
        s, slope = self.local.change_with_slope(x)
        excess = s - np.clip(s, -_BAND, _BAND)
        bounded = np.clip(excess, -_FULL, _FULL)
        force = _STRENGTH * self.local.areas * bounded
        if not force.any():
            return 0.0, np.zeros_like(x)
        return float(force @ (2.0 * excess - bounded)), slope(force)
