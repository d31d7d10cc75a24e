"""The coordinates in which a mesh is deformed.

    scene     the coordinates of the caller
    solver    (x - centre) / size        size about 1 at the origin: tolerances need no unit
    pose      x - origin                 in which deformed vertices and volumes are computed

The centre is the mean of the vertices, and the size is the diameter of the ball about it that
contains them; unlike a box, it does not depend on how the mesh is turned.  The origin is zero for
a mesh near the origin of the scene, so that poses are computed in the coordinates of the caller.
Far from it, it is the centre, or else coordinates would lose digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Frame:
    """Centre, size and origin of a mesh; made by `Frame.of`."""

    centre: FloatArray  # (3,)
    size: float
    origin: FloatArray  # (3,)

    @classmethod
    def of(cls, vertices: FloatArray) -> Frame:
        """Return the frame of a mesh with *vertices* (n, 3)."""
        centre = vertices.mean(axis=0)
        size = 2.0 * float(np.linalg.norm(vertices - centre, axis=1).max())
        is_far = float(np.linalg.norm(centre)) > size
        return cls(centre, size, centre if is_far else np.zeros(3))

    def inward(self, points: FloatArray) -> FloatArray:
        """Return *points* (k, 3) of the scene in solver coordinates."""
        inside: FloatArray = points - self.centre
        inside /= self.size
        return inside

    def outward(self, points: FloatArray) -> FloatArray:
        """Return *points* (k, 3) in solver coordinates as points of the scene."""
        outside: FloatArray = points * self.size
        outside += self.centre
        return outside

    @property
    def is_far(self) -> bool:
        """Whether the origin is not that of the scene."""
        return bool(self.origin.any())

    def about_origin(self, points: FloatArray) -> FloatArray:
        """Return *points* (k, 3) of the scene in pose coordinates."""
        return points - self.origin if self.is_far else points

    def in_scene(self, points: FloatArray) -> FloatArray:
        """Return *points* (k, 3) in pose coordinates as points of the scene."""
        return points + self.origin if self.is_far else points
