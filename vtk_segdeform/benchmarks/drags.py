"""A drag, frame by frame, each solved as far as an eye can tell.

A frame has *converged* when the next step moves no vertex by more than 1e-4 of the diagonal.  How
many steps that takes is found by a copy that goes ahead; the frame itself is one call of so many
steps, and that is what is timed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from ..arrays import FloatArray
from ..deformer import Deformer
from ..solver import GaussNewton, Solution, Status
from .measuring import clocked, timed
from .tasks import NEAR, Task

_MOST_STEPS = 300
_FEW, _MANY = 1, 4  # steps between which the cost of one is measured
AS_PRINTED = 16  # the same for frames of the paper's own iteration, which takes 20 and more
_WARM, _TURNS = 2, 2  # frames before that; how often each is taken


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a drag."""

    solution: Solution
    steps: int
    seconds: float
    processors: float  # seconds of all of them


def steps_to_rest(deformer: Deformer, targets: FloatArray) -> tuple[int, Solution]:
    """Return after how many steps the next moves nothing by more than NEAR, and the pose there."""
    near = NEAR * deformer.mesh.diagonal
    here = deformer.solve(targets, max_steps=1)
    for steps in range(1, _MOST_STEPS):
        ahead = deformer.solve(targets, max_steps=1)
        if np.linalg.norm(ahead.vertices - here.vertices, axis=1).max() <= near:
            return steps, here
        here = ahead
    return _MOST_STEPS, here


def frames(deformer: Deformer, way: Sequence[FloatArray]) -> Iterator[Frame]:
    """Drag the handles along *way*, (k, 3) each, from where the deformer is at rest."""
    deformer.reset()
    for goal in way:
        steps, _ = steps_to_rest(deformer.copy(), goal)
        spent = time.process_time()
        solution, seconds = timed(partial(deformer.solve, goal, max_steps=steps))
        yield Frame(solution, steps, seconds, time.process_time() - spent)


def way_of(task: Task, moves: int) -> list[FloatArray]:
    """Return targets that move on by 1 % of the diagonal, from rest."""
    rest = task.mesh.vertices[task.handle]
    aside = task.shifted(0.01).targets - task.targets
    return [rest + (k + 1) * aside for k in range(moves)]


def seconds_per_step(
    cases: Sequence[tuple[Deformer, Task]], repeats: int, many: int = _MANY
) -> list[float]:
    """Return what one more step of a drag's frame costs in each of *cases*.

    It is the slope between frames of one step and of *many*, as the solver alone takes them.  The
    cases drag by turns, so that all meet the same load, and the same caches: each has just seen
    another's mesh go through them.  NaN where no frame takes that many steps, or the machine is
    too busy to tell.
    """
    slopes: list[list[float]] = [[] for _ in cases]
    ways = []
    for deformer, task in cases:
        deformer.reset()
        way = way_of(task, _WARM + 3 * repeats)
        ways.append([*way, *way[-2::-1]])  # there and back
    with clocked(GaussNewton, "minimise") as spent:
        for goals in zip(*ways, strict=True):
            times = [{_FEW: math.inf, many: math.inf} for _ in cases]
            for steps in _TURNS * [_FEW, many]:
                for (deformer, _), goal, quickest in zip(cases, goals, times, strict=True):
                    spent.clear()
                    pose = deformer.copy().solve(goal, max_steps=steps)
                    is_whole = pose.status is Status.STEP_LIMIT and pose.steps == steps
                    once = sum(spent) if is_whole else math.nan
                    quickest[steps] = min(quickest[steps], once)
            for (deformer, _), goal, quickest, own in zip(cases, goals, times, slopes, strict=True):
                slope = (quickest[many] - quickest[_FEW]) / (many - _FEW)
                if math.isfinite(slope):
                    own.append(slope)
                deformer.solve(goal, max_steps=many)
    found = [median(own[_WARM:] or [math.nan]) for own in slopes]
    return [slope if slope > 0.0 else math.nan for slope in found]
