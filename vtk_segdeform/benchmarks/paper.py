"""Tables 1 and 2 of the paper, with the paper as printed (`deformer.as_printed`).

    table 1    cactus of 5430 vertices, 155 cage vertices: 0.55 s per step with one cage, 0.2 s with
               three regions, 4 steps, volume +0.02 %
    table 2    time by number of regions; its numbers are not legible, the text says that they fall

The paper gives neither the pose, nor the unit of the mesh, nor when an iteration has converged.
Here the trunk is bent by 60 degrees in one jump, or dragged by 1 % of the mesh diagonal per frame;
a pose has converged when the next step moves no vertex by more than 1e-4 of the diagonal; and the
diagonal is 100 units, with other units in a table of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from statistics import median

import numpy as np

from ..cages import scaled_cages
from ..deformer import Deformer, PaperDeformer
from ..geometry import distortion
from ..mesh import inside_points
from ..progress import Progress, tell
from .measuring import by_turns, timed
from .peers import CONVERGED
from .results import Cell, Scale, Section, Table
from .tasks import Task, bent_cactus, make_regions

_SPEED_UP, _STEPS = 0.55 / 0.2, 4  # in the paper
_DIAGONAL, _DIAGONALS = 100.0, (1.0, 10.0, 100.0, 1000.0)  # units of length
_SCALE = 1.2  # of the cages
_MIN_CAGE = 8  # vertices of a cage
_TIMED, _ROUNDS = 3, 3  # steps in one measurement; measurements per repeat
_FRAMES = 12  # of a drag
_MOST_STEPS = 500  # of a bend


@dataclass(frozen=True)
class Bend:
    """How steps from rest bend the cactus, until they have converged."""

    steps: int
    volume_change: float
    early: float  # volume change after 4 steps
    fourth: float  # motion in the fourth step, in diagonals
    handle_error: float  # in diagonals
    distortion: float


@dataclass(frozen=True)
class Drag:
    """Frames of a drag: medians of steps and processor time, and the largest volume change."""

    steps: int
    seconds: float
    volume_change: float


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return both tables, and the influence of the unit of length."""
    n, task = scale.n_cage_vertices, in_units(bent_cactus(scale.paper_size), _DIAGONAL)
    tell(progress, 0.0, "table 1")
    cases = [printed(task, n_regions, n) for n_regions in (1, 3)]
    bends = [bend(case, task) for case in cases]
    drags = [drag(case, task) for case in cases]
    short = [drag(case, task, _STEPS) for case in cases]
    steps, products = seconds_per_step(cases, task, scale.repeats)
    tell(progress, 0.3, "table 2")
    second = _table_two(task, scale)
    tell(progress, 0.6, "units of length")
    units = _table_of_units(task, n)

    def percent(each: list[Drag]) -> list[float]:
        return [100.0 * case.volume_change for case in each]

    rows: list[tuple[Cell, ...]] = [
        ("cage vertices", *(len(case.p) for case in cases), 155, 155),
        ("non-zeros of W", *(case.W.nnz for case in cases), None, None),
        ("vertices outside their cages", *map(_outside, cases), None, None),
        ("step, s", *steps, 0.55, 0.2),
        ("- products with W, s", *products, None, None),
        ("steps of the bend", *(each.steps for each in bends), _STEPS, _STEPS),
        ("its volume change, %", *(100.0 * each.volume_change for each in bends), 0.02, 0.02),
        ("- after 4 steps, %", *(100.0 * each.early for each in bends), None, None),
        ("- motion in step 4, diagonals", *(each.fourth for each in bends), None, None),
        ("its distortion", *(each.distortion for each in bends), None, None),
        ("its handle error, diagonals", *(each.handle_error for each in bends), None, None),
        ("steps per frame of the drag", *(each.steps for each in drags), _STEPS, _STEPS),
        ("frame, s", *(each.seconds for each in drags), 1.3, 0.4),
        ("its volume change, %", *percent(drags), 0.02, 0.02),
        ("- with 4 steps per frame, %", *percent(short), None, None),
    ]
    columns = ("quantity", "one cage", "three regions", "paper: one cage", "paper: three regions")
    text = (
        f"{task.mesh.n_vertices} vertices, {n} cage vertices. Three regions make a step "
        f"{steps[0] / steps[1]:.2f} times as fast as one cage ({_SPEED_UP:.2f} times in the "
        f"paper): W has {cases[0].W.nnz / cases[1].W.nnz:.2f} times fewer non-zeros, and products "
        f"with W are {products[0] / products[1]:.2f} times as fast. The times of a frame in the "
        "paper are read as exchanged, since they contradict its text. All times are of the "
        "processor."
    )
    first = Table(columns, rows, "table 1, as printed", mixed=True)
    return Section("Tables 1 and 2 of the paper", text, [first, second, units])


def in_units(task: Task, diagonal: float) -> Task:
    """Return *task* with a mesh whose diagonal is so many units of length."""
    factor = diagonal / task.mesh.diagonal
    mesh = task.mesh.with_vertices(factor * task.mesh.vertices)
    return replace(task, mesh=mesh, targets=factor * task.targets)


def printed(task: Task, n_regions: int, n_vertices: int) -> PaperDeformer:
    """Return the paper as printed, with automatic regions, and simplified and scaled cages."""
    regions = make_regions(task.mesh, n_regions)
    cages = scaled_cages(regions, n_vertices, _SCALE)
    return Deformer.as_printed(task.mesh, regions, cages, fixed=task.fixed, handle=task.handle)


def bend(deformer: PaperDeformer, task: Task) -> Bend:
    """Take steps from rest to the targets of *task*."""
    deformer.reset()
    early = deformer.solve(task.targets, max_steps=_STEPS, tolerance=CONVERGED)
    late, steps = early, early.steps
    if early.step_lengths[-1] > CONVERGED:
        late = deformer.solve(task.targets, max_steps=_MOST_STEPS, tolerance=CONVERGED)
        steps += late.steps
    off = np.linalg.norm(late.vertices[task.handle] - task.targets, axis=1).max()
    return Bend(
        steps=steps,
        volume_change=late.volume_change,
        early=early.volume_change,
        fourth=float(early.step_lengths[-1]),
        handle_error=float(off) / task.mesh.diagonal,
        distortion=distortion(task.mesh, late.vertices),
    )


def drag(deformer: PaperDeformer, task: Task, max_steps: int = _MOST_STEPS) -> Drag:
    """Drag the handle of *task* from rest by 1 % of the diagonal per frame, but for the first."""
    deformer.reset()
    solve = partial(deformer.solve, max_steps=max_steps, tolerance=CONVERGED)
    aside = 0.01 * task.mesh.diagonal * np.array([0.6, 0.8, 0.0])
    solutions, seconds = [], []
    for k in range(_FRAMES):
        targets = task.mesh.vertices[task.handle] + (k + 1) * aside
        solution, spent = timed(partial(solve, targets))
        solutions.append(solution)
        seconds.append(spent)
    return Drag(
        steps=int(median(each.steps for each in solutions[1:])),
        seconds=median(seconds[1:]),
        volume_change=max((each.volume_change for each in solutions), key=abs),
    )


def seconds_per_step(
    cases: Sequence[PaperDeformer], task: Task, repeats: int
) -> tuple[list[float], list[float]]:
    """Return the processor time of a step of each case, and of its products with W and W^T."""
    u = np.concatenate([task.mesh.vertices[cases[0].fixed], task.targets])

    def steps(case: PaperDeformer) -> None:
        for _ in range(_TIMED):
            case.step(case.W @ case.p, u)

    def products(case: PaperDeformer) -> None:
        for _ in range(_TIMED):
            x = case.W @ case.p
            _ = case.W.T @ x, case.W.T @ x

    works: list[Callable[[], None]] = [partial(do, c) for do in (steps, products) for c in cases]
    times = [seconds / _TIMED for seconds in by_turns(works, _ROUNDS * repeats)]
    return times[: len(cases)], times[len(cases) :]


def _table_two(task: Task, scale: Scale) -> Table:
    n = scale.n_cage_vertices
    cases = [printed(task, r, n) for r in scale.regions if r * _MIN_CAGE <= n]
    steps, products = seconds_per_step(cases, task, scale.repeats)
    rows = []
    for case, step, product in zip(cases, steps, products, strict=True):
        bent = bend(case, task)
        count = case.regions.n_regions, len(case.p), case.W.nnz
        rows.append((*count, step, product, bent.steps, bent.distortion))
    columns = ("regions", "cage vertices", "non-zeros of W", "step, s", "products with W, s")
    return Table((*columns, "steps of the bend", "distortion"), rows, "table 2, as printed")


def _table_of_units(task: Task, n_vertices: int) -> Table:
    rows = []
    for diagonal in _DIAGONALS:
        scaled = in_units(task, diagonal)
        bent = bend(printed(scaled, 3, n_vertices), scaled)
        rows.append((diagonal, bent.steps, bent.handle_error, bent.distortion))
    columns = ("diagonal, units", "steps of the bend", "handle error, diagonals", "distortion")
    return Table(columns, rows, "three regions, as printed, in other units of length", mixed=True)


def _outside(case: PaperDeformer) -> int:
    """Return how many vertices are outside the cage of a region of theirs."""
    found = np.zeros(case.mesh.n_vertices, dtype=bool)
    for r, cage in enumerate(case.cages):
        ids = case.regions.members(r)
        found[ids] |= ~inside_points(case.mesh.vertices[ids], cage.vertices, cage.faces)
    return int(found.sum())
