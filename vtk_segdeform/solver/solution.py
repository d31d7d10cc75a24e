"""The answer of a solve: the pose, and how well and by which way it was reached."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any, TypeVar

from ..arrays import FloatArray
from ..freezing import read_only

_T = TypeVar("_T")


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

    def __post_init__(self) -> None:
        for name in ("vertices", "cage_vertices"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    # Copies and pickles store the values measured on demand instead of the deformer.

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
        """Distance of the farthest handle vertex from its target, in diagonals; on demand."""
        return self._errors[0]

    @property
    def fixed_error(self) -> float:
        """Distance of the farthest fixed vertex from its place, likewise."""
        return self._errors[1]

    @cached_property
    def volume_change(self) -> float:
        """(V - V0) / V0 of `vertices`, signed; measured on demand.

        The solver reaches about 1e-15.  Far from the origin float64 coordinates are too coarse for
        that: rounding changes V by at most eps m A, where eps = 2.2e-16, m is the largest
        coordinate and A the surface area, and typically by a hundredth of that.  At 1e4 to 1e5
        diagonals this is 1e-12 of the volume of a compact shape and 1e-11 of that of a wire.
        """
        return self.volume()

    @cached_property
    def region_volume_change(self) -> FloatArray:
        """(V - V0) / V0 of each region that owns a face, closed at its border; on demand."""
        return read_only(self.region_volumes(self.vertices))


def _known(value: _T, *_: object) -> _T:
    return value
