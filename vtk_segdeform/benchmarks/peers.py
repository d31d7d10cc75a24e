"""The same poses by libigl's as-rigid-as-possible deformation: time, volume and distortion."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..errors import MissingDependencyError, SegDeformError
from ..geometry import distortion, triangle_distortion
from ..mesh import Mesh
from ..progress import Progress, tell
from ..solver import total_volume
from .measuring import by_turns, in_own_process, timed
from .results import Cell, Scale, Section, Table
from .tasks import Task, benchmark_poses, bent_cactus, prepare, warm_up

CONVERGED = 1e-4  # mesh diagonals from the converged pose
_MOST_ITERATIONS = 5000
_BENCHMARK_VERTICES = 200  # cage vertices, as in the tests
_COLUMNS = (
    "method", "set-up, s", "solve, s", "iterations", "ms per iteration", "handle error",
    "volume change", "distortion", "99th percentile",
)  # fmt: skip
_TEXT = """\
All start at rest, solve for the final targets at once, and run until the pose is within 1e-4 of \
the mesh diagonal of the converged one. vtk_segdeform tells by Newton's step, libigl by the last \
two iterations, whose motions form nearly a geometric series. The handle error is relative to the \
diagonal. All times are of the processor."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return one table for each pose."""
    section = Section("Comparison with libigl", _TEXT)
    tasks = [(bent_cactus(size), scale.n_cage_vertices) for size in scale.peer_sizes]
    poses = benchmark_poses()
    tasks += [(task, _BENCHMARK_VERTICES) for task in poses]
    if not poses:
        section.skipped.append("Botsch-Sorkine poses: SEGDEFORM_DATA does not name their folder")
    for k, (task, n_vertices) in enumerate(tasks):
        title, rows = f"{task.name}, {task.mesh.n_vertices} vertices", []
        methods: dict[str, Callable[[Task], tuple[Cell, ...]]] = {
            "vtk_segdeform, three regions": partial(ours, n_regions=3, n_vertices=n_vertices),
            "vtk_segdeform, one cage": partial(ours, n_regions=1, n_vertices=n_vertices),
            "libigl ARAP": arap,
        }
        for method, solve in methods.items():
            tell(progress, k / len(tasks), f"{method}: {title}")
            try:
                rows.append((method, *in_own_process(solve, task)))
            except (SegDeformError, MemoryError) as fault:
                section.skipped.append(f"{method}, {title}: {fault}")
        section.tables.append(Table(_COLUMNS, rows, title))
    return section


def ours(task: Task, n_regions: int, n_vertices: int) -> tuple[Cell, ...]:
    """Return a row of the table, by a `Deformer`."""
    warm_up()
    make = partial(prepare, task, n_regions, n_vertices, max_steps=_MOST_ITERATIONS)
    deformer, set_up = timed(make)
    solution, seconds = timed(lambda: deformer.solve(task.targets))
    return _row(task, solution.vertices, (set_up, seconds, solution.steps))


def arap(task: Task) -> tuple[Cell, ...]:
    """Return a row of the table, by libigl's deformation (spokes and rims)."""
    iterate, set_up = timed(lambda: _arap_iteration(task))
    near, start = CONVERGED * task.mesh.diagonal, np.array(task.mesh.vertices)
    (pose, count), seconds = timed(
        lambda: iterate_to_convergence(start, near, _MOST_ITERATIONS, iterate)
    )
    return _row(task, pose, (set_up, seconds, count))


def arap_iteration_seconds(task: Task, repeats: int) -> float:
    """Return the processor time of one iteration of libigl's ARAP, the median of *repeats*."""
    iterate, start = _arap_iteration(task), np.array(task.mesh.vertices)
    return by_turns([lambda: iterate(start)], repeats)[0]


def iterate_to_convergence(
    start: FloatArray, near: float, most: int, iterate: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, int]:
    """Iterate from *start* until *near* (a length) the limit; return the result and the count.

    Iterations of as-rigid-as-possible deformation converge linearly: they move the farthest vertex
    by d, q d, q^2 d ..., so that d q / (1 - q) remains.
    """
    here, before = start, math.inf
    for count in range(1, most + 1):
        ahead = iterate(here)
        moved = float(np.linalg.norm(ahead - here, axis=1).max())
        here, rate, before = ahead, moved / before if before else 0.0, moved
        if count > 1 and rate < 1.0 and moved * rate / (1.0 - rate) <= near:
            return here, count
    return here, most


def _arap_iteration(task: Task) -> Callable[[FloatArray], FloatArray]:
    try:
        import igl
    except ImportError as fault:
        raise MissingDependencyError(f"libigl is not installed ({fault})") from None
    data: Any = igl.ARAPData()
    constrained = np.concatenate([task.fixed, task.handle]).astype(np.int32)
    igl.arap_precomputation(task.mesh.vertices, task.mesh.faces, 3, constrained, data)
    data.max_iter = 1
    places = np.concatenate([task.mesh.vertices[task.fixed], task.targets])
    return lambda x: np.asarray(igl.arap_solve(places, data, x))


def _row(task: Task, x: FloatArray, effort: tuple[float, float, int]) -> tuple[Cell, ...]:
    mesh, (set_up, seconds, count) = task.mesh, effort
    away = np.linalg.norm(x[task.handle] - task.targets, axis=1).max(initial=0.0)
    return (
        set_up, seconds, count, 1e3 * seconds / max(count, 1), float(away / mesh.diagonal),
        total_volume(mesh).relative(x), distortion(mesh, x), _distortion_percentile(mesh, x),
    )  # fmt: skip


def _distortion_percentile(mesh: Mesh, vertices: FloatArray) -> float:
    """Return the distortion that is exceeded on one percent of the surface."""
    each = triangle_distortion(mesh, vertices)
    order = np.argsort(each)
    share = np.cumsum(mesh.face_areas[order]) / mesh.face_areas.sum()
    return float(each[order[np.searchsorted(share, 0.99)]])
