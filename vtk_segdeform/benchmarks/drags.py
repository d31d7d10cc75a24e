"""A drag, frame by frame, each solved as far as an eye can tell.

A frame has *converged* when the next step moves no vertex by more than 1e-4 of the diagonal.  How
many steps that takes is found by a copy that goes ahead; the frame itself is one call of so many
steps, and that is what is timed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from ..arrays import FloatArray
from ..deformer import Deformer
from ..solution import Solution, Status
from .measuring import timed
from .tasks import NEAR, Task

_MOST_STEPS = 300
_FEW, _MANY = 1, 4  # steps between which the cost of one is measured
_WARM, _TURNS = 2, 4  # frames before that; how often each is taken


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


def seconds_per_step(deformer: Deformer, task: Task, repeats: int) -> float:
    """Return what one more step of a drag's frame costs: the slope between few steps and many.

    NaN if no frame takes that many, or the machine is too busy to tell.
    """
    deformer.reset()
    slopes = []
    way = way_of(task, _WARM + 3 * repeats)
    for goal in [*way, *way[-2::-1]]:  # there and back
        # Copies begin alike, short and long by turns; of each the quickest, as what the map takes
        # beside the steps varies by more than one of them.
        seconds = dict.fromkeys((_FEW, _MANY), np.inf)
        for steps in _TURNS * [*seconds]:
            pose, once = timed(partial(deformer.copy().solve, goal, max_steps=steps))
            seconds[steps] = min(seconds[steps], once)
        if pose.status is Status.STEP_LIMIT and pose.steps == _MANY:
            slopes.append((seconds[_MANY] - seconds[_FEW]) / (_MANY - _FEW))
        deformer.solve(goal, max_steps=_MANY)
    slope = median(slopes[_WARM:] or [0.0])
    return slope if slope > 0.0 else float("nan")
