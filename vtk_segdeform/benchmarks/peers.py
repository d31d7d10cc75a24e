"""Comparison with other programs on the same poses: time, volume and distortion.

The report lists programs that are not installed or that fail, with the reason.  Each program runs
in its own process, so that it cannot affect the memory, threads or OpenGL of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..errors import SegDeformError
from ..geometry import distortion
from ..progress import Progress
from ..solver import total_volume
from .experiments import distortion_percentile
from .measuring import run_in, timed
from .programs import Answer, blender_laplacian, libigl_arap, open3d_arap
from .scale import Scale
from .sections import Cell, Section, Table
from .tasks import Task, benchmark_folder, benchmark_pose, bent_cactus, prepare, warm_up

COLUMNS = (
    "method", "set-up, s", "solve, s", "iterations", "ms per iteration", "handle error",
    "volume change", "distortion", "99th percentile",
)  # fmt: skip
_LARGEST = {"Open3D ARAP": 60_000, "Blender Laplacian Deform": 60_000}
_BENCHMARK_VERTICES = 200  # cage vertices, as in the tests


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return one table for each pose."""
    poses: dict[str, Callable[[], Task]] = {
        f"cactus of {n} vertices, 60 degrees": partial(bent_cactus, n) for n in scale.peer_sizes
    }
    section = Section("Comparison with other programs")
    section.text.append(
        "All start at rest, solve for the final targets at once, and run until the pose is within "
        "1e-4 of the mesh diagonal of the converged one. vtk_segdeform tells by Newton's step; "
        "libigl by the last two iterations, whose motions form nearly a geometric series; Open3D "
        "and Blender, which do not report motions, by doubling the number of iterations until the "
        "pose no longer moves by more. The handle error is relative to the diagonal."
    )
    folder = benchmark_folder()
    if folder:
        names = ("cactus", "cylinder")
        poses |= {f"Botsch-Sorkine {n}": partial(benchmark_pose, folder, n) for n in names}
    else:
        section.skipped.append(
            "Botsch-Sorkine poses: SEGDEFORM_DATA does not name a folder that contains them"
        )
    for k, (name, make) in enumerate(poses.items()):
        task, rows = make(), []
        n_vertices = _BENCHMARK_VERTICES if "Botsch" in name else scale.n_cage_vertices
        for method, solve in methods(n_vertices).items():
            if progress:
                progress(k / len(poses), f"{method}: {name}")
            size = task.mesh.n_vertices
            if size > _LARGEST.get(method, size):
                section.skipped.append(f"{method}, {size} vertices: would take minutes")
                continue
            try:
                answer = run_in(scale.own_process, solve, task, scale.most_iterations)
            except (SegDeformError, RuntimeError, MemoryError, ValueError) as fault:
                section.skipped.append(f"{method}, {name}: {fault}")
                continue
            rows.append(row_of(method, task, answer))
        section.tables.append(Table(COLUMNS, rows, name))
    return section


def methods(n_vertices: int) -> dict[str, Callable[[Task, int], Answer]]:
    """Return the compared methods; *n_vertices* is the total of cage vertices."""
    return {
        "vtk_segdeform, three regions": partial(ours, n_regions=3, n_vertices=n_vertices),
        "vtk_segdeform, one cage": partial(ours, n_regions=1, n_vertices=n_vertices),
        "libigl ARAP": libigl_arap,
        "Open3D ARAP": open3d_arap,
        "Blender Laplacian Deform": blender_laplacian,
    }


def ours(task: Task, most: int, *, n_regions: int, n_vertices: int) -> Answer:
    """Solve *task* by a `Deformer`."""
    warm_up()
    prepared = prepare(task, n_regions, n_vertices, max_steps=most)
    solution, seconds = timed(lambda: prepared.deformer.solve(task.targets))
    return Answer(solution.vertices, prepared.seconds, seconds, solution.steps)


def row_of(method: str, task: Task, answer: Answer) -> tuple[Cell, ...]:
    """Return a row of `COLUMNS`."""
    mesh, x = task.mesh, answer.vertices
    away = np.linalg.norm(x[task.handle] - task.targets, axis=1).max(initial=0.0)
    return (
        method,
        answer.set_up,
        answer.solve,
        answer.iterations,
        1e3 * answer.solve / max(answer.iterations, 1),
        float(away / mesh.diagonal),
        total_volume(mesh).relative(x),
        distortion(mesh, x),
        distortion_percentile(mesh, x),
    )
