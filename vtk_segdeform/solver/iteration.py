"""What an iteration is told, what it learns on its way, and what it returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import FloatArray, is_number, is_whole
from ..checks import as_flag, shown
from ..energy import Factor
from ..errors import ArgumentError
from ..progress import Progress
from .anderson import Anderson
from .position_constraints import Pull
from .solution import Status

_OLD, _LONG = 20, 1e-2  # steps after which the curvature is looked at again; or after one as long
_FAR = 2e-2  # a step so long that how volumes curve here says nothing of where it leads


@dataclass(frozen=True)
class SolverOptions:
    """How to iterate; the defaults are what the interactive editor uses."""

    tolerance: float = 1e-7  # root-mean-square move of the surface in a step, mesh size 1
    max_steps: int = 500
    window: int = 5  # Anderson's memory; 0 is the plain iteration of the paper
    exact_volume: bool = True  # False leaves the linearised multiplier of (21), for comparison
    progress: Progress | None = field(default=None, compare=False)  # called before every step

    def __post_init__(self) -> None:
        if not (is_number(self.tolerance) and self.tolerance > 0.0):
            raise ArgumentError(f"tolerance must be a positive number; got {shown(self.tolerance)}")
        for name, least in (("max_steps", 1), ("window", 0)):
            value = getattr(self, name)
            if not is_whole(value, least):
                raise ArgumentError(
                    f"{name} must be a whole number, {least} or more; got {shown(value)}"
                )
        as_flag(self.exact_volume, "exact_volume")


@dataclass(frozen=True, eq=False)
class Point:
    """A pose on the way, and what the objective and the constraints are there."""

    p: FloatArray
    x: FloatArray  # the surface that volumes are taken over; empty where nothing asks for it
    shape: float  # E
    shape_slope: FloatArray  # half its gradient
    rows: tuple[FloatArray, ...]  # of G, one (m, 3) for each constraint
    merit: float  # E, and what the targets pull
    slope: FloatArray  # d

    def toward(self, pull: Pull) -> Point:
        """Return the same for other targets."""
        value, slope = pull.value_and_slope(self.p)
        return replace(self, merit=self.shape + value, slope=self.shape_slope + slope)


@dataclass(eq=False)
class Course:
    """What an iteration learns on its way, so that a later call goes on as if it had not ended."""

    memory: Anderson
    factor: Factor
    age: int = _OLD  # of the factor, in steps
    size: float = math.inf  # of the last step
    _end: tuple[FloatArray, FloatArray, SolverOptions] | None = None

    @property
    def factor_is_old(self) -> bool:
        """Whether the curvature should be looked at again."""
        return self.age >= _OLD or self.size > _LONG

    @property
    def is_near(self) -> bool:
        """Whether the last step, if there was one, was not much longer than a frame of a drag."""
        return not _FAR < self.size < math.inf

    @property
    def is_astray(self) -> bool:
        """Whether the step just found is too long to be trusted to a factor from elsewhere."""
        return self.age > 1 and self.size > _LONG

    def for_other_targets(self, options: SolverOptions) -> Course:
        """Return a course that begins with what this one has learned."""
        self.memory.begin_elsewhere()
        memory = self.memory if self.memory.window == options.window else Anderson(options.window)
        return Course(memory, self.factor, self.age, 0.0)

    def renew(self, factor: Factor) -> None:
        """Take a factor made here."""
        self.factor, self.age = factor, 0

    def doubt_factor(self) -> None:
        """Make it old."""
        self.age = _OLD

    def ended(self, p: FloatArray, targets: FloatArray, options: SolverOptions) -> Course:
        """Remember where the call ended; return itself."""
        self._end = p, targets, replace(options, progress=None)
        return self

    def goes_on(self, p: FloatArray, targets: FloatArray, options: SolverOptions) -> bool:
        """Tell whether a call with these begins where this ended."""
        if self._end is None or replace(options, max_steps=1) != replace(self._end[2], max_steps=1):
            return False
        return np.array_equal(p, self._end[0]) and np.array_equal(targets, self._end[1])


@dataclass(frozen=True, eq=False)
class Iteration:
    """Where the iteration ended: cage vertices p (m, 3), and how."""

    p: FloatArray
    multipliers: FloatArray
    directions: tuple[FloatArray, ...]  # (m, 3) each: along which the volumes are restored
    status: Status
    steps: int
    step_size: float  # of the last step, root mean square over the surface
    shape: float  # E(p): the objective without the position term
    merits: tuple[float, ...]  # the objective at the start and after each step
