"""The last operation of a solve: the mesh itself comes onto its own volume, exactly.

    along    x + t W~ z      t the root of a cubic; for every mesh, and for volumes of regions
    scaled   c + s (x - c)   s^3 = V_0 / V; for large meshes, where only x itself is then mapped

The steps before have taken the volume over a stand-in (`stand_in`), so a little is missing.
Mean value coordinates follow scaling: the cages are scaled alike, and x = W~ p still.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arrays import FloatArray
from .constraints import VolumeConstraint, moved, restore

_CACHED = 1 << 14  # vertices at a time


def along(
    constraints: Sequence[VolumeConstraint], paths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return steps (c,) along c directions, and the vertices (n, 3) after them.

    *paths* (n, 3 + 3 c) has the vertices and their directions side by side.
    """
    steps = restore(constraints, paths)
    return steps, moved(paths, steps)


def scaled(constraint: VolumeConstraint, x: FloatArray, centre: FloatArray) -> float:
    """Scale *x* (n, 3) in place about *centre* (3,) onto the volume; return by how much.

    Where the surface is inside-out, so that no size would do, nothing is scaled.
    """
    ratio = constraint.relative(x)
    if not ratio > -1.0:
        return 1.0
    scale = float(np.cbrt(1.0 / (1.0 + ratio)))

    offsets, flat = np.tile((1.0 - scale) * centre, _CACHED), x.reshape(-1)
    for start in range(0, len(flat), len(offsets)):  # other threads would take longer to wake
        piece = flat[start : start + len(offsets)]
        piece *= scale
        piece += offsets[: len(piece)]
    return scale
