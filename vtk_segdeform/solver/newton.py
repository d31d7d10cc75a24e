"""The iteration of both levels: of the cages (`gauss_newton`) and of the mesh (`finish.finisher`).

    minimise  an objective   subject to  volumes, g = 0                                    (20)

Every step is (21), with a Hessian that the objective chooses, and ends on the volumes.  So all
poses have the same volumes, and the objective itself is the merit, which falls in every step:

1. Anderson acceleration proposes a step.
2. If the merit there is not lower, or more than twice what the plain step promises, the plain step
   is tried, and shares 1/2, 1/4 ... of it: the epsilon of section 3.3.  (Of a handle that has moved
   on, the merit is so large that almost any step would lower it.  Merits are sums of squares, and
   the load of a pull leaves them positive; at one below zero the plain step is tried.)
3. If no share helps, the objective may have a step with another Hessian.

The iteration has converged if the step is short, or no gain beyond rounding is left.

Source
------
Sections 3.2 and 3.3 of the paper.  Y. Peng, B. Deng, J. Zhang, F. Geng, W. Qin, L. Liu, "Anderson
acceleration for geometry optimization and physics simulation", SIGGRAPH 2018 (the safeguard).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from ..arrays import FloatArray
from ..progress import Progress, tell
from .anderson import Anderson
from .solution import Status

_EPSILON = 2.0**-52  # relative gain of a step that is less than rounding
_ROUNDING = 1e-13  # relative gain that may be due to rounding
_SHORTEST = 1.0 / 64.0  # least share of a step
_PROMISED = 2.0  # what an accelerated step may leave, of the merit that the plain one promises


class Iterate(Protocol):
    """A pose on the volumes."""

    @property
    def at(self) -> FloatArray:
        """The unknowns, (k, 3)."""

    @property
    def merit(self) -> float:
        """The objective."""

    @property
    def slope(self) -> FloatArray:
        """Half its gradient d, (k, 3)."""


class Step(NamedTuple):
    """A step (21)."""

    h: FloatArray
    """(k, 3)."""
    directions: Sequence[FloatArray]
    """Z = H^-1 G^T, (k, 3) for each volume."""
    length: float
    """In the norm of the tolerance."""
    is_whole: bool = True
    """Whether *h* has not been limited."""


_Pose = TypeVar("_Pose", bound=Iterate)


class Objective(Protocol[_Pose]):
    """An objective and its volumes."""

    @property
    def constant(self) -> float:
        """The size of the terms of which the merit is the sum."""

    def step(self, here: _Pose, /) -> Step:
        """Return the step from *here*."""

    def another(self, here: _Pose, /) -> Step | None:
        """Return a step with another Hessian, after one that lowered nothing; None if none."""

    def allows(self, here: _Pose, at: FloatArray, /) -> bool:
        """Return whether the unknowns may become *at* in one motion from *here*."""

    def moved(self, at: FloatArray, directions: Sequence[FloatArray], /) -> _Pose:
        """Return the pose with unknowns *at*, moved along *directions* onto the volumes."""

    def residual(self, h: FloatArray, /) -> FloatArray:
        """Return *h* in the norm in which Anderson acceleration compares steps."""


@dataclass(frozen=True, eq=False)
class Minimum(Generic[_Pose]):
    """Where an iteration ended."""

    pose: _Pose
    status: Status
    merits: tuple[float, ...]  # at the start and after each step
    step: Step | None  # from the end on, if it was computed and is one


def minimise(
    objective: Objective[_Pose],
    here: _Pose,
    anderson: Anderson,
    *,
    tolerance: float,
    max_steps: int,
    progress: Progress | None = None,
    message: str = "solving",
    took: Callable[[Step], None] = lambda _: None,
) -> Minimum[_Pose]:
    """Iterate from *here*.

    Parameters
    ----------
    objective : Objective
        What to minimise.
    here : Iterate
        A pose on the volumes.
    anderson : Anderson
        The last steps, if the iteration continues.
    tolerance : float
        The length of a step at which it has converged.
    max_steps : int
        Most steps.
    progress : Progress, optional
        Called before every step; may cancel.
    message : str
        The text that it is called with.
    took : function of a Step
        Called after every step that was taken.
    """
    merits, step, status = [here.merit], None, Status.STEP_LIMIT
    while len(merits) <= max_steps:
        tell(progress, (len(merits) - 1) / max_steps, message)
        step = objective.step(here)
        gain = abs(float(np.vdot(here.slope, step.h)))  # twice that of the quadratic model
        size = objective.constant + abs(here.merit)
        if step.length <= tolerance or gain <= _EPSILON * size:
            status = Status.CONVERGED
            break
        ahead: _Pose | None = None
        trial: Step | None = step
        if step.is_whole:
            guess = anderson.extrapolate(here.at + step.h, objective.residual(step.h))
            if objective.allows(here, guess):
                most = min(here.merit, _PROMISED * (here.merit - gain))
                ahead = _lower(objective.moved(guess, step.directions), most)
        while ahead is None and trial is not None:
            anderson.forget()
            ahead = _shortened(objective, here, trial)
            if ahead is None:
                trial = objective.another(here)
        if ahead is None or trial is None:
            is_rounding = gain <= _ROUNDING * size
            status = Status.CONVERGED if is_rounding else Status.STALLED
            step = step if is_rounding else None
            break
        took(trial)
        here, step = ahead, None
        merits.append(here.merit)
    return Minimum(here, status, tuple(merits), step)


def _shortened(objective: Objective[_Pose], here: _Pose, step: Step) -> _Pose | None:
    """Return the first of the steps h, h/2, h/4 ... that lowers the merit, or None."""
    epsilon = 1.0
    while epsilon >= _SHORTEST:
        moved = objective.moved(here.at + epsilon * step.h, step.directions)
        if ahead := _lower(moved, here.merit):
            return ahead
        epsilon *= 0.5
    return None


def _lower(ahead: _Pose, most: float) -> _Pose | None:
    return ahead if ahead.merit < most else None


def constrained_step(
    solve: Callable[[Sequence[FloatArray]], list[FloatArray]],
    slope: FloatArray,
    rows: Sequence[FloatArray],
    g: FloatArray,
) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Return h (k, 3), lambda (c,) and Z, c times (k, 3), of (21).

        h = -H^-1 (d + G^T lambda),   lambda = (G H^-1 G^T)^-1 (g - G H^-1 d)

    Parameters
    ----------
    solve : function
        H^-1 of some (k, 3).
    slope : (k, 3) float
        d.
    rows : sequence of c (k, 3) float
        G.
    g : (c,) float
        The violations of the volumes.
    """
    h, *z = solve([-slope, *rows])  # -H^-1 d, and Z
    if not rows:
        return h, np.zeros(0), []
    across, along = np.reshape(rows, (len(rows), -1)), np.reshape(z, (len(z), -1))
    gh, gz = across @ h.ravel(), across @ along.T  # -G H^-1 d, and G Z
    found = np.linalg.lstsq(gz, g + gh, rcond=1e-12)[0]  # (G Z)^-1 (g - G H^-1 d)
    multipliers = np.asarray(found, dtype=np.float64)
    h -= (multipliers @ along).reshape(h.shape)
    return h, multipliers, z
