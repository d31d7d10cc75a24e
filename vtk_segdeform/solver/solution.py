"""The result of a solve: the pose, how it was reached, and its errors."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any, TypeVar

from ..arrays import FloatArray, IntArray
from ..freezing import read_only

_T = TypeVar("_T")


class Status(enum.Enum):
    """Why the iteration ended, as a text for a status bar."""

    CONVERGED = "converged"
    STEP_LIMIT = "not fully converged: solve again to continue, or raise max_steps"
    STALLED = "no further improvement: the cages may not be able to reach this pose"
    MISSED = (
        "the cages cannot reach this pose: add cage vertices, move less, or leave more room "
        "between handle and fixed vertices"
    )
    ALL_HELD = (
        "all vertices are fixed or in handles, so nothing is free to move: subdivide the mesh, or "
        "leave vertices between handle and fixed vertices free"
    )

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose of the mesh, in the coordinates of the mesh."""

    vertices: FloatArray
    """(n, 3) float: the deformed mesh."""
    cage_vertices: tuple[FloatArray, ...]
    """One (m_r, 3) float per region: the cages in this pose."""
    steps: int
    """Gauss-Newton steps, including those for waypoints to a far target."""
    status: Status
    """Why the iteration ended; ``str(status)`` says what to do."""
    merits: tuple[float, ...]
    """The objective before and after each step from the last waypoint on; it never rises."""
    errors: Callable[[FloatArray], tuple[float, ...]] = field(repr=False)
    """Computes `handle_error` and `fixed_error`."""
    volume: Callable[[], float] = field(repr=False)
    """Computes `volume_change`."""
    region_volumes: Callable[[FloatArray], FloatArray] = field(repr=False)
    """Computes `region_volume_change`."""
    crossed: Callable[[FloatArray], IntArray] = field(repr=False)
    """Computes `crossings`."""
    remaining: float = 0.0
    """Estimate of the largest distance of a vertex to its place in the converged pose, in diagonals
    of the mesh, for a solve `within` a distance; otherwise infinite until it has converged."""
    targets: FloatArray | None = None
    """(k, 3) float: the targets of this pose, if it is on the way to those of the solve."""

    def __post_init__(self) -> None:
        for name in ("vertices", "cage_vertices"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    # Copies and pickles store the computed values instead of the functions.

    def __getstate__(self) -> dict[str, Any]:
        measured = {
            "errors": partial(_known, self._errors),
            "volume": partial(_known, self.volume_change),
            "region_volumes": partial(_known, self.region_volume_change),
        }
        return {each.name: vars(self)[each.name] for each in fields(self)} | measured

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, read_only(value))

    @cached_property
    def _errors(self) -> tuple[float, ...]:
        return self.errors(self.vertices)

    @property
    def handle_error(self) -> float:
        """Largest distance of a handle vertex from its target, in diagonals of the mesh."""
        return self._errors[0]

    @property
    def fixed_error(self) -> float:
        """Largest distance of a fixed vertex from its place, in diagonals of the mesh."""
        return self._errors[1]

    @cached_property
    def volume_change(self) -> float:
        """(V - V0) / V0 of `vertices`, signed; computed on first access.

        The volume of an open surface is that under lids over its borders.  If nothing is enclosed
        the change is 0.

        The solver reaches about 1e-15.  Far from the origin float64 coordinates are too coarse for
        that: rounding changes V by at most eps m A, where eps = 2.2e-16, m is the largest
        coordinate and A the surface area, and typically by a hundredth of that.  At 1e4 to 1e5
        diagonals this is 1e-12 of the volume of a compact shape and 1e-11 of that of a wire.
        """
        return self.volume()

    @cached_property
    def region_volume_change(self) -> FloatArray:
        """(V - V0) / V0 of each region that has a face around a volume, closed at its border."""
        return read_only(self.region_volumes(self.vertices))

    def crossings(self) -> IntArray:
        """Return the faces (k,) that cross or touch others, and did not at rest.

        Computed on first call, in about 0.2 s for 50,000 vertices.
        """
        return self._crossings

    @cached_property
    def _crossings(self) -> IntArray:
        return read_only(self.crossed(self.vertices))


def _known(value: _T, *_: object) -> _T:
    return value
