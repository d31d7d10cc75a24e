"""Drags, frame by frame, each solved to visual convergence.

A frame has *converged* when the next step moves no vertex by more than 1e-4 of the mesh diagonal.
The number of steps is found with a copy of the deformer; the frame itself is one call with this
number of steps, which is timed.
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
from .tasks import CONVERGED, Task

_MOST_STEPS = 300
_FEW, _MANY = 1, 4  # the cost of a step is the slope between frames of few and of many steps
_WARM_UP, _TURNS = 2, 2  # frames that are not measured; measurements of each frame


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a drag."""

    solution: Solution
    steps: int
    seconds: float
    processors: float  # processor time, seconds


def steps_to_convergence(deformer: Deformer, targets: FloatArray) -> tuple[int, Solution]:
    """Return the number of steps until convergence, and the solution."""
    near = CONVERGED * deformer.mesh.diagonal
    here = deformer.solve(targets, max_steps=1)
    for steps in range(1, _MOST_STEPS):
        ahead = deformer.solve(targets, max_steps=1)
        if np.linalg.norm(ahead.vertices - here.vertices, axis=1).max() <= near:
            return steps, here
        here = ahead
    return _MOST_STEPS, here


def frames(deformer: Deformer, path: Sequence[FloatArray]) -> Iterator[Frame]:
    """Drag the handles along a *path* of targets (k, 3), starting at rest."""
    deformer.reset()
    for targets in path:
        steps, _ = steps_to_convergence(deformer.copy(), targets)
        start = time.process_time()
        solution, seconds = timed(partial(deformer.solve, targets, max_steps=steps))
        yield Frame(solution, steps, seconds, time.process_time() - start)


def times_beside_first(deformers: Sequence[Deformer], path: Sequence[FloatArray]) -> list[float]:
    """Return the time of a drag along *path* with each of *deformers*, relative to the first.

    Each frame takes the steps that the first one needs.  The deformers alternate, so that the load
    of the machine is the same for all of them.
    """
    spent = np.zeros(len(deformers))
    for each in deformers:
        each.reset()
    for number, targets in enumerate(path):
        steps, _ = steps_to_convergence(deformers[0].copy(), targets)
        solves = [partial(each.solve, targets, max_steps=steps) for each in deformers]
        times = np.array([timed(solve)[1] for solve in solves])
        spent += times if number >= _WARM_UP else 0.0
    return [float(each) for each in spent / spent[0]]


def drag_path(task: Task, moves: int) -> list[FloatArray]:
    """Return targets that move by 1 % of the mesh diagonal per frame, starting at rest."""
    rest = task.mesh.vertices[task.handle]
    aside = task.shifted(0.01).targets - task.targets
    return [rest + (k + 1) * aside for k in range(moves)]


def seconds_per_step(cases: Sequence[tuple[Deformer, Task]], repeats: int) -> list[float]:
    """Return the time of one step of the solver in each of *cases*.

    This is the slope between the times of frames of one step and of four.  The cases alternate,
    so that the load of the machine and the state of processor caches are the same for all of them.
    NaN if no frame takes that many steps, or if the machine is too busy.
    """
    slopes: list[list[float]] = [[] for _ in cases]
    paths = []
    for deformer, task in cases:
        deformer.reset()
        path = drag_path(task, _WARM_UP + 3 * repeats)
        paths.append([*path, *path[-2::-1]])  # there and back
    with clocked(GaussNewton, "minimise") as spent:
        for goals in zip(*paths, strict=True):
            times = [{_FEW: math.inf, _MANY: math.inf} for _ in cases]
            for steps in _TURNS * [_FEW, _MANY]:
                for (deformer, _), goal, quickest in zip(cases, goals, times, strict=True):
                    spent.clear()
                    pose = deformer.copy().solve(goal, max_steps=steps)
                    is_whole = pose.status is Status.STEP_LIMIT and pose.steps == steps
                    once = sum(spent) if is_whole else math.nan
                    quickest[steps] = min(quickest[steps], once)
            for (deformer, _), goal, quickest, own in zip(cases, goals, times, slopes, strict=True):
                slope = (quickest[_MANY] - quickest[_FEW]) / (_MANY - _FEW)
                if math.isfinite(slope):
                    own.append(slope)
                deformer.solve(goal, max_steps=_MANY)
    found = [median(own[_WARM_UP:] or [math.nan]) for own in slopes]
    return [slope if slope > 0.0 else math.nan for slope in found]
