"""A guess of the axis that points up, of a surface whose file does not say.

Files use y or z.  An object stands on its larger footprint: the convex hull of the vertices within
3 % of the height above the lowest one, seen from below, compared with the hull at the top.  Where
the two axes differ little, as for a bar, the longer one is up.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..arrays import FloatArray, bounds_of

_FOOTPRINT_HEIGHT = 0.03  # of the height: the vertices that belong to a footprint


def guess_up_axis(vertices: FloatArray) -> int:
    """Return 1 or 2: the axis, y or z, that points up.

    Parameters
    ----------
    vertices : (n, 3) float
        Of any unit and position.
    """
    low, high = bounds_of(vertices)
    extent = high - low
    unit = float(np.sort(extent)[1])
    if not unit > 0.0:  # points on a line
        return 1 if extent[1] > extent[2] else 2
    points = (vertices[:: max(1, len(vertices) // 100_000)] - low) / unit
    y, z = (_footprint(points, axis, extent[axis] / unit) for axis in (1, 2))
    if abs(y - z) > 0.01:  # squares of the middle extent; less is chance
        return 1 if y > z else 2
    return 1 if extent[1] > extent[2] else 2


def _footprint(points: FloatArray, axis: int, height: float) -> float:
    """Return the area of the hull at the bottom, less that at the top."""
    across = np.delete(points, axis, axis=1)
    bottom = points[:, axis] <= _FOOTPRINT_HEIGHT * height
    top = points[:, axis] >= (1.0 - _FOOTPRINT_HEIGHT) * height
    return _hull_area(across[bottom]) - _hull_area(across[top])


def _hull_area(points: FloatArray) -> float:
    try:
        return float(ConvexHull(points).volume)  # in two dimensions, the area
    except (QhullError, ValueError):  # fewer than three points, or all of them on a line
        return 0.0
