"""How long things take here and now, as one table: set-up once, then every move of the mouse.

The cactus with one, three and six regions, the same number of cage vertices in all; its top is
turned by 60 degrees in one jump and then dragged on in steps of one degree.  Times are medians
of one run on this machine: read the ratios.
"""

from __future__ import annotations

import statistics
import time
from argparse import Namespace
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ..cage_fit import fit_cages
from ..deformer import Deformer
from ..mesh import Mesh
from ..models import cactus
from ..progress import Progress, part
from ..regions import Regions
from ..segmentation import segment
from ..solution import Solution
from .demo import bent_top
from .interactive import interactive_table
from .outputs import Say

_T = TypeVar("_T")
_HEAD = (
    "| regions | segment s | cages s | s per region | bind + factor s "
    "| jump ms | steps | ms per step | drag ms per move | volume change |"
)


def bench(options: Namespace, say: Say, progress: Progress) -> bool:
    """Print the table of timings: of the solver, or of a drag in a window."""
    n_cage = options.cage_vertices
    if options.interactive:
        say(interactive_table(n_cage_vertices=n_cage, progress=progress))
    else:
        say(table(n_vertices=options.size, n_cage_vertices=n_cage, progress=progress))
    return True


def table(
    *,
    n_vertices: int = 5430,
    n_cage_vertices: int = 155,
    regions: tuple[int, ...] = (1, 3, 6),
    moves: int = 10,
    progress: Progress | None = None,
) -> str:
    """Return the timings as a Markdown table, a row for each number of regions.

    Parameters
    ----------
    n_vertices, n_cage_vertices : int
        Size of the cactus and of all its cages together.
    regions : tuple of int
        How many regions to try.
    moves : int
        How many moves of one degree each the drag has.
    progress : Progress, optional
        Called between the parts; may cancel.
    """
    mesh = cactus(n_vertices)
    lines = [
        f"cactus, {mesh.n_vertices} vertices, {n_cage_vertices} cage vertices, "
        f"60 degrees in one jump, then {moves} moves of 1 degree",
        "",
        _HEAD,
        "|" + "---:|" * (_HEAD.count("|") - 1),
    ]
    for k, n_regions in enumerate(regions):
        step = part(progress, k / len(regions), (k + 1) / len(regions))
        lines.append(_row(mesh, n_regions, n_cage_vertices, moves, step))
    return "\n".join(lines)


def timed(work: Callable[[], _T]) -> tuple[_T, float]:
    """Return what *work* returns, and how many seconds it took."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def _row(
    mesh: Mesh, n_regions: int, n_cage_vertices: int, moves: int, progress: Progress | None
) -> str:
    def say(fraction: float) -> None:
        if progress is not None:
            progress(fraction, f"{n_regions} regions")

    say(0.0)
    regions, t_segment = timed(
        lambda: Regions.single(mesh) if n_regions == 1 else segment(mesh, n_regions=n_regions)
    )
    say(0.1)
    cages, t_cages = timed(lambda: fit_cages(mesh, regions, n_vertices=n_cage_vertices))
    say(0.6)
    pose = bent_top(mesh, np.radians(60.0))
    deformer, t_bind = timed(
        lambda: Deformer(mesh, regions, cages, fixed=pose.fixed, handle=pose.handle)
    )
    say(0.8)
    jumps = []
    for _ in range(3):
        deformer.reset()
        jumps.append(timed(lambda: deformer.solve(pose.targets)))
    solution, t_jump = jumps[0][0], statistics.median(seconds for _, seconds in jumps)
    drags = [
        _timed_solve(deformer, bent_top(mesh, np.radians(60.0 + 1.0 + k)).targets)
        for k in range(moves)
    ]
    t_drag = statistics.median(seconds for _, seconds in drags)
    worst = max(abs(s.volume_change) for s in [solution, *(s for s, _ in drags)])
    say(1.0)
    return (
        f"| {n_regions} | {t_segment:.2f} | {t_cages:.2f} | {t_cages / n_regions:.2f} "
        f"| {t_bind:.2f} | {1e3 * t_jump:.0f} | {solution.steps} "
        f"| {1e3 * t_jump / max(solution.steps, 1):.1f} | {1e3 * t_drag:.1f} | {worst:.0e} |"
    )


def _timed_solve(deformer: Deformer, targets: np.ndarray) -> tuple[Solution, float]:
    return timed(lambda: deformer.solve(targets))
