"""Other ways to deform, in the same run, on the same poses: wall time, volume, distortion.

A way that is not installed here, or that gives up, is named in the report with its reason.  Each
runs in a process of its own, so that none can spoil another's memory, threads or OpenGL.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..errors import SegDeformError
from ..geometry import distortion, signed_volume
from ..progress import Progress
from .experiments import worst_hundredth
from .full_space import full_space
from .measuring import called, timed
from .programs import Answer, blender_laplacian, libigl_arap, open3d_arap
from .scale import Scale
from .sections import Cell, Section, Table
from .tasks import Task, benchmark_folder, benchmark_pose, bent_cactus, bound, warm_up

COLUMNS = (
    "way", "set-up s", "solve s", "iterations", "ms each", "handle error", "volume %", "distortion",
    "worst 1 %",
)  # fmt: skip
_LARGEST = {"full space": 60_000, "Open3D ARAP": 60_000, "Blender Laplacian Deform": 60_000}
_BENCHMARK_VERTICES = 200  # of the cages, as in the tests


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return one table for each pose."""
    poses: dict[str, Callable[[], Task]] = {
        f"cactus of {n} vertices, 60 degrees": partial(bent_cactus, n) for n in scale.peer_sizes
    }
    section = Section("Beside other ways to deform")
    section.words.append(
        "A way has come to rest when its next iteration moves nothing by more than 1e-4 of the "
        f"diagonal, at most {scale.most_iterations} iterations; ours go on to 1e-7. Open3D and "
        "Blender cannot be asked, and run up to 50; Open3D sets up and solves in one call. All "
        "start from rest, in one jump. The handle error is a share of the diagonal: ARAP holds its "
        "handles exactly, cages to 5e-4."
    )
    folder = benchmark_folder()
    if folder:
        names = ("cactus", "cylinder")
        poses |= {f"Botsch-Sorkine {n}": partial(benchmark_pose, folder, n) for n in names}
    else:
        section.absent.append(
            "the Botsch-Sorkine poses: SEGDEFORM_DATA does not name a folder that has them"
        )
    for k, (name, make) in enumerate(poses.items()):
        task, rows = make(), []
        n_vertices = _BENCHMARK_VERTICES if "Botsch" in name else scale.n_cage_vertices
        for way, solve in ways(n_vertices).items():
            if progress:
                progress(k / len(poses), f"{way}: {name}")
            size = task.mesh.n_vertices
            if size > _LARGEST.get(way, size):
                section.absent.append(f"{way} at {size} vertices: left out, it would take minutes")
                continue
            try:
                answer = called(scale.own_process, solve, task, scale.most_iterations)
            except (SegDeformError, RuntimeError, MemoryError, ValueError) as fault:
                section.absent.append(f"{way}, {name}: {fault}")
                continue
            rows.append(row_of(way, task, answer))
        section.tables.append(Table(COLUMNS, rows, name))
    return section


def ways(n_vertices: int) -> dict[str, Callable[[Task, int], Answer]]:
    """Return what is compared; ours have so many cage vertices in all."""
    return {
        "vtk_segdeform, three regions": partial(ours, n_regions=3, n_vertices=n_vertices),
        "vtk_segdeform, one cage": partial(ours, n_regions=1, n_vertices=n_vertices),
        "full space": partial(without_cages, n_vertices=n_vertices),
        "libigl ARAP": libigl_arap,
        "Open3D ARAP": open3d_arap,
        "Blender Laplacian Deform": blender_laplacian,
    }


def ours(task: Task, most: int, *, n_regions: int, n_vertices: int) -> Answer:
    """Solve *task* by a `Deformer`, to its own tolerance; *most* does not bind it."""
    warm_up()
    ready = bound(task, n_regions, n_vertices, max_steps=max(most, 500))
    solution, seconds = timed(lambda: ready.deformer.solve(task.targets))
    return Answer(solution.vertices, ready.seconds, seconds, solution.steps)


def without_cages(task: Task, most: int, *, n_vertices: int) -> Answer:
    """Solve *task* over all vertices; three cages only say how the terms weigh."""
    return full_space(task, bound(task, 3, n_vertices).deformer.subspace, most)


def row_of(way: str, task: Task, answer: Answer) -> tuple[Cell, ...]:
    """Return one row, under `COLUMNS`."""
    mesh, x = task.mesh, answer.vertices
    volume = signed_volume(mesh.vertices, mesh.faces)
    away = np.linalg.norm(x[task.handle] - task.targets, axis=1).max(initial=0.0)
    return (
        way,
        answer.set_up,
        answer.solve,
        answer.iterations,
        1e3 * answer.solve / max(answer.iterations, 1),
        float(away / mesh.diagonal),
        100.0 * (signed_volume(x, mesh.faces) - volume) / volume,
        distortion(mesh, x),
        worst_hundredth(mesh, x),
    )
