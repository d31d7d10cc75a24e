"""The result of a solve: the pose, how it was reached, and its errors."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..arrays import FloatArray, IntArray
from ..checks import Described
from ..freezing import read_only
from ..mesh import Mesh

_T = TypeVar("_T")
_NAMED = 3  # parts in a sentence
_NOTHING: dict[str, float] = {}


CONVERGED = 1e-4
"""`Solution.remaining` of a converged pose, at most, in diagonals of the mesh.

It is the length of one Newton step.  The way to the minimum is longer: in 22 poses of animals and
random bodies 1 to 10 times, and 40 times while a limb was buckling.  So a converged pose is within
about 1e-3.  A finish goes on until its steps are 3e-6: 15 of 16 such poses were within 1.1e-4.
"""


class Status(enum.Enum):
    """How near a pose is to its minimum, and its handles to their targets, as a text.

    A pose is `CONVERGED` if solving again, or finishing again if it `is_finished`, would move no
    vertex by more than about 1e-3 of the diagonal of the mesh.  The status tells nothing about
    folds, and about crossings only if contact is avoided: see `Solution.crossings` and
    `Solution.folds`.
    """

    CONVERGED = "converged"
    STEP_LIMIT = "not fully converged: solve again or finish again to continue, or raise max_steps"
    STALLED = "no further improvement: move less, or add cage vertices"
    MISSED = (
        "the cages cannot reach this pose: add cage vertices, move less, or leave more room "
        "between handle and fixed vertices"
    )
    VOLUME_MISSED = (
        "a volume cannot be reached: change it less, set another one free, or leave more room "
        "between handle and fixed vertices"
    )
    RIGID_MISSED = (
        "a rigid part is bent, or vertices leave what they slide along: move less, or let fewer "
        "vertices of that part be fixed, in handles or rigid"
    )
    CROSSED = (
        "parts of the surface cross although contact is avoided: go there in smaller moves, or "
        "leave more room between them"
    )
    ALL_HELD = (
        "all vertices are fixed or in handles, so nothing is free to move: subdivide the mesh, or "
        "leave vertices between handle and fixed vertices free"
    )

    def __str__(self) -> str:
        return self.value


class HeldVolumes(NamedTuple):
    """The volumes of a pose that have goals, by name, their changes, and the largest error."""

    volumes: Mapping[str, float] = _NOTHING
    changes: Mapping[str, float] = _NOTHING
    error: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Described):
    """A pose of the mesh, in the coordinates of the mesh."""

    vertices: FloatArray
    """(n, 3) float: the deformed mesh."""
    cage_vertices: tuple[FloatArray, ...]
    """One (m_r, 3) float per region: the cages in this pose."""
    steps: int
    """Gauss-Newton steps, including those for waypoints to a far target."""
    status: Status
    """How near the pose is to its minimum; ``str(status)`` says what to do."""
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
    folded: Callable[[FloatArray], IntArray] = field(repr=False)
    """Computes `folds`."""
    shape_errors: Callable[[FloatArray], tuple[float, float]] = field(
        default_factory=lambda: lambda _: (0.0, 0.0), repr=False
    )
    """Computes `rigid_error` and `slide_error`."""
    remaining: float = 0.0
    """Estimate of the largest distance of a vertex to its place in the converged pose, in diagonals
    of the mesh: the length of Newton's step at this pose.  Infinite where it is not computed, in a
    solve with ``max_steps`` that has not converged."""
    unfinished: FloatArray | None = None
    """(n, 3) float: the mesh before it was finished by `Deformer.finish`, if it was."""
    held_volumes: Callable[[FloatArray], HeldVolumes] = field(
        default_factory=lambda: lambda _: HeldVolumes(), repr=False
    )
    """Computes `volumes`, `volume_changes` and `volume_error`."""
    unmoved: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(k,) int: the connected parts of the mesh, numbered as in `Mesh.components`, that stay where
    they are: they have no handle and no fixed vertices, and share no region with a part that has
    some.  The rest may bend through them."""

    def __post_init__(self) -> None:
        for name in ("vertices", "cage_vertices", "unmoved", "unfinished"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        return {
            "vertices": f"{len(self.vertices):,}",
            "status": self.status.name.lower().replace("_", " "),
            "steps": f"{self.steps:,}",
            "volume change": f"{self.volume_change:.1e}",
            "handle error": f"{self.handle_error:.1e} of the diagonal",
        }

    # Copies and pickles store the computed values instead of the functions.

    def __getstate__(self) -> dict[str, Any]:
        measured = {
            "errors": partial(_known, self._errors),
            "shape_errors": partial(_known, self._shape_errors),
            "volume": partial(_known, self.volume_change),
            "region_volumes": partial(_known, self.region_volume_change),
            "held_volumes": partial(_known, self._held_volumes),
        }
        return {each.name: vars(self)[each.name] for each in fields(self)} | measured

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, read_only(value))

    @cached_property
    def _errors(self) -> tuple[float, ...]:
        return self.errors(self.vertices)

    @property
    def is_finished(self) -> bool:
        """Whether it was finished on the mesh, which `status` and `remaining` are then about."""
        return self.unfinished is not None

    @property
    def handle_error(self) -> float:
        """Largest distance of a handle vertex from its target, in diagonals of the mesh.

        With a plane of symmetry the targets are those of symmetric motions: of a handle across the
        plane, or two that are each other's image, the means of the given targets and their images.
        """
        return self._errors[0]

    @property
    def fixed_error(self) -> float:
        """Largest distance of a fixed vertex from its place, in diagonals of the mesh."""
        return self._errors[1]

    @cached_property
    def _shape_errors(self) -> tuple[float, float]:
        return self.shape_errors(self.vertices)

    @property
    def rigid_error(self) -> float:
        """Largest distance of a vertex of a rigid part from its place in the best rigid fit.

        In diagonals of the mesh.  Of a finished pose about 1e-16, unless the handle and fixed
        vertices of the part move against each other; of the cages' own pose up to some 1e-3.
        """
        return self._shape_errors[0]

    @property
    def slide_error(self) -> float:
        """Largest distance of a sliding vertex from what it slides along, in diagonals."""
        return self._shape_errors[1]

    @cached_property
    def _held_volumes(self) -> HeldVolumes:
        return self.held_volumes(self.vertices)

    @property
    def volumes(self) -> dict[str, float]:
        """The volumes with goals, by name, in the mesh's unit cubed; see `Deformer`."""
        return dict(self._held_volumes.volumes)

    @property
    def volume_changes(self) -> dict[str, float]:
        """(V - V0) / V0 of the same, signed."""
        return dict(self._held_volumes.changes)

    @property
    def volume_error(self) -> float:
        """Largest error of a volume that is preserved, set or bounded, relative to it."""
        return self._held_volumes.error

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

    def unmoved_summary(self, mesh: Mesh) -> str:
        """Return which parts of *mesh* are `unmoved`, in one sentence; "" if there are none."""
        count = len(self.unmoved)
        if not count:
            return ""
        vertices = np.count_nonzero(np.isin(mesh.components, self.unmoved))
        numbers = ", ".join(str(k + 1) for k in self.unmoved[:_NAMED])
        numbers += f" and {count - _NAMED} more" if count > _NAMED else ""
        if count == 1:
            name, has, stays = "part", "has", "it stays where it is"
        else:
            name, has, stays = "parts", "have", "they stay where they are"
        who = f"{name} {numbers} ({vertices:,} vertices)"
        return f"{who} {has} no handle and no fixed vertices: {stays}"

    def folds(self) -> IntArray:
        """Return the faces (k,) that are turned over against the surface around them.

        Those that were so at rest are left out.  Computed on first call, in less time than
        `crossings`.
        """
        return self._folds

    @cached_property
    def _folds(self) -> IntArray:
        return read_only(self.folded(self.vertices))

    @cached_property
    def _crossings(self) -> IntArray:
        return read_only(self.crossed(self.vertices))


def _known(value: _T, *_: object) -> _T:
    return value
