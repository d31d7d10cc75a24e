"""The answer of a solve: the pose, and how well and by which way it was reached."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from .arrays import FloatArray


class Status(enum.Enum):
    """Why the iteration ended, in words a status bar can show."""

    CONVERGED = "converged"
    STEP_LIMIT = "stopped at the step limit; solve again to go on, or raise max_steps"
    STALLED = "no shorter step improves the shape; the targets may be out of reach"
    MISSED = (
        "converged, but not every handle or fixed vertex is in its place: "
        "use more cage vertices, move less, or leave more room between handle and fixed vertices"
    )

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose of the mesh, in the mesh's own unit and place."""

    vertices: FloatArray
    """(n, 3) float: the deformed mesh."""
    cage_vertices: tuple[FloatArray, ...]
    """One (m_r, 3) float per region: the cages that move it there."""
    steps: int
    """Gauss-Newton steps, those on the way to a far target included."""
    status: Status
    """Why the iteration ended; ``str(status)`` is advice."""
    merits: tuple[float, ...]
    """The objective at the start of the last leg and after each of its steps; it never rises."""
    errors: Callable[[FloatArray], tuple[float, ...]] = field(repr=False)
    """What measures `handle_error` and `fixed_error`."""
    volume: Callable[[], float] = field(repr=False)
    """What measures `volume_change`."""
    region_volumes: Callable[[FloatArray], FloatArray] = field(repr=False)
    """What measures `region_volume_change`."""

    @cached_property
    def _errors(self) -> tuple[float, ...]:
        return self.errors(self.vertices)

    @property
    def handle_error(self) -> float:
        """Distance of the farthest handle vertex from its target, in diagonals; on demand."""
        return self._errors[0]

    @property
    def fixed_error(self) -> float:
        """Distance of the farthest fixed vertex from its place, likewise."""
        return self._errors[1]

    @cached_property
    def volume_change(self) -> float:
        """(V - V0) / V0 of `vertices`, signed; measured on demand.

        The solver leaves about 1e-15.  Far from the origin the vertices cannot hold that: rounding
        them changes V by at most eps |x| A, eps = 2.2e-16, |x| the largest coordinate, A the
        surface's area, and by a hundredth of that as a rule: 1e-12 of a compact shape's at 1e4 to
        1e5 diagonals, 1e-11 of a wire's.
        """
        return self.volume()

    @cached_property
    def region_volume_change(self) -> FloatArray:
        """(V - V0) / V0 of each region that owns a face, closed at its border; on demand."""
        return self.region_volumes(self.vertices)
