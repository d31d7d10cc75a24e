"""What a deformer is held by: fixed vertices, handles and volumes, made once for a set of them.

Positions are in the coordinates of the solver, where the mesh has size 1; see `frame`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..mesh import SurfacePoint
from ..solver import Contact, GaussNewton, ScaledSurface, VolumeConstraint, Volumes

_NONE, _NO_POINTS = np.zeros(0, dtype=np.int64), np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class PulledPoints:
    """Points that handles of one vertex move; see `locality`."""

    places: IntArray = field(default_factory=lambda: _NONE)  # (q,), among the places of all sets
    targets: IntArray = field(default_factory=lambda: _NONE)  # (q,), their targets
    points: tuple[SurfacePoint, ...] = ()  # (q,)
    levers: FloatArray = field(default_factory=lambda: _NO_POINTS)  # (q, 3), from their vertices
    spread: float = 0.0  # within which a finish leaves the surface alone, in the mesh's unit

    def moved(self, places: FloatArray) -> FloatArray:
        """Return the *places* (s, 3) with those of the points instead of their vertices."""
        if not len(self.places):
            return places
        places = places.copy()
        places[self.places] += self.levers
        return places

    def at(self, x: FloatArray) -> FloatArray:
        """Return where the points of the mesh *x* (n, 3) are, (q, 3)."""
        return np.array([point.at(x) for point in self.points]).reshape(-1, 3)


class HandlePoint(NamedTuple):
    """A point of the surface that the target of a handle vertex moves."""

    place: int
    """Among those of all sets."""
    target: int
    point: SurfacePoint


class Preserved(NamedTuple):
    """The volumes to preserve; the same for all handles on the same bodies."""

    constraints: tuple[VolumeConstraint, ...]
    """On the mesh."""
    volumes: Volumes
    """On the surface of the steps."""
    scaled: ScaledSurface | None
    """If poses are scaled to their exact volume."""


@dataclass(frozen=True, eq=False)
class Constraints:
    """Fixed vertices and handles; made by `Deformer.hold` and `Deformer.local`."""

    fixed_at: FloatArray  # the fixed vertices in scene coordinates
    handles: list[IntArray]  # indices into the targets, one array for each connected handle
    places_of_targets: sparse.csr_array  # (s, k), from targets to the places of their sets
    places_of_fixed: FloatArray  # (s, 3)
    fixed_box: FloatArray  # (2, 3), corners of the box around the fixed vertices; or (0, 3)
    anchors: FloatArray  # (c, 3), the centres when the c bodies of a pose are scaled
    preserved: Preserved
    solver: GaussNewton  # as it begins
    contact: Contact | None  # one of its terms
    pulled: PulledPoints
    unmoved: IntArray  # `Solution.unmoved`
    keeps: FloatArray | None = None  # (s,): how firmly the finish of a pull keeps samples in place

    def places(self, targets: FloatArray) -> FloatArray:
        """Return the places (s, 3) of all sets, for *targets* (k, 3) of the handles."""
        return np.asarray(self.places_of_targets @ targets + self.places_of_fixed)
