"""Where a drag's time goes, from 5 thousand to a million vertices, and what it must keep to.

The parts are told in `frame_profile`; beside them stand one iteration of libigl's ARAP, and the
time that W takes to come from memory once.
"""

from __future__ import annotations

import numpy as np

from ..errors import MissingDependencyError
from ..progress import Progress, part
from . import charts
from .frame_profile import Profile, profiled
from .measuring import called
from .programs import arap_iteration_seconds
from .scale import Scale
from .sections import Figure, Ratio, Section, Table
from .tasks import bent_cactus

_NAN = float("nan")
_SLOWEST = 33.0  # milliseconds: thirty frames a second
_STREAMS = 2.5  # or so many times as long as W takes to come from memory
_OF_ARAP = {5430: 1.0, 50_000: 1.0 / 3.0, 500_000: 0.1}  # a frame, in ARAP iterations
_SET_UP = {5430: 1.5, 50_000: 5.0, 1_000_000: 60.0}  # seconds


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the profile at every size of *scale*, and the ratios that must hold."""
    profiles, absent = [], []
    for k, size in enumerate(scale.drag_sizes):
        step = part(progress, k / len(scale.drag_sizes), (k + 1) / len(scale.drag_sizes))
        if step:
            step(0.0, f"a drag at {size} vertices")
        found = called(scale.own_process, profiled, size, scale)
        if step:
            step(0.8, f"one ARAP iteration at {size} vertices")
        try:
            task = bent_cactus(size)
            arap, of_arap = called(scale.own_process, arap_iteration_seconds, task, scale.repeats)
        except (MissingDependencyError, RuntimeError, MemoryError) as missing:
            absent.append(f"libigl ARAP at {size} vertices: {missing}")
            arap = of_arap = _NAN
        profiles.append(
            Profile(**{**vars(found), "arap": 1e3 * arap, "arap_processors": 1e3 * of_arap})
        )
    return Section(
        "Where the time of a drag goes",
        words=[
            f"Cactus, 3 regions, {scale.n_cage_vertices} cage vertices. Handles move by 1 % of the "
            "diagonal a frame; a frame has converged when the next step moves nothing by more than "
            "1e-4 of it. Milliseconds, medians. *Smallest's* is a step of the smallest mesh, by "
            "turns with steps of this one: caches are as cold. *Processors* is what one of them "
            "alone would have taken, whatever else the machine did. Set-up leaves a cache on "
            "disk; *again* opens the same mesh, regions and cages from it.",
        ],
        tables=[_frame_table(profiles), _set_up_table(profiles)],
        figures=_figures(profiles),
        ratios=_ratios(profiles),
        absent=absent,
    )


def _frame_table(profiles: list[Profile]) -> Table:
    columns = (
        "vertices", "frame ms", "steps", "ms per step", "smallest's", "begin", "map", "volume",
        "normals", "render", "W once", "ARAP iteration", "frame / ARAP",
        "processors: frame", "ARAP", "volume change",
    )  # fmt: skip
    rows = [
        (
            p.vertices, p.frame, p.steps, p.step, p.beside, p.begin, p.map, p.volume,
            p.normals, p.render, p.stream, p.arap, p.frame / p.arap,
            p.processors, p.arap_processors, p.change,
        )
        for p in profiles
    ]  # fmt: skip
    return Table(columns, rows, "a frame, in milliseconds")


def _set_up_table(profiles: list[Profile]) -> Table:
    columns = ("vertices", "segment", "cages", "bind + factor", "all", "again", "peak GB")
    rows = [(p.vertices, p.segment, p.cages, p.bind, p.set_up, p.again, p.memory) for p in profiles]
    return Table(columns, rows, "set-up, in seconds")


def _figures(profiles: list[Profile]) -> list[Figure]:
    names = [f"{p.vertices:,}" for p in profiles]
    stages = ("begin", "stepping", "map", "volume", "normals", "render")
    shares = {stage: [float(getattr(p, stage)) for p in profiles] for stage in stages}
    shares = {stage: values for stage, values in shares.items() if not np.isnan(values).any()}
    lines = {
        "milliseconds": {
            "frame": [p.frame for p in profiles],
            "one more step": [p.step for p in profiles],
            "map + volume": [p.map + p.volume for p in profiles],
            "W once through memory": [p.stream for p in profiles],
            "one ARAP iteration": [p.arap for p in profiles],
        }
    }
    sizes = [float(p.vertices) for p in profiles]
    return [
        Figure(
            "drag-times.png",
            "A converged frame, its parts, and one ARAP iteration, over the size of the mesh.",
            lambda path: charts.line_plot(path, sizes, lines, across="vertices", logarithmic=True),
        ),
        Figure(
            "drag-shares.png",
            "Where the time of a drawn frame goes; numbers in the bars are milliseconds.",
            lambda path: charts.stack_plot(path, names, shares, across="share of the frame, %"),
        ),
    ]


def _ratios(profiles: list[Profile]) -> list[Ratio]:
    by_size = {p.vertices: p for p in profiles}
    ratios = []
    for n, limit in _OF_ARAP.items():
        if p := by_size.get(n):
            what = f"converged frame / ARAP iteration, {n:,} vertices"
            ratios.append(Ratio(what, p.frame / p.arap, limit))
            # The two were not timed together: on a busy machine only this says who is faster.
            ratios.append(
                Ratio(f"{what}, in processor time", p.processors / p.arap_processors, limit)
            )
    for n, limit in _SET_UP.items():
        if p := by_size.get(n):
            ratios.append(Ratio(f"set-up at {n:,} vertices, s", p.set_up, limit))
            ratios.append(Ratio(f"again / set-up at {n:,} vertices", p.again / p.set_up, 0.1))
    largest = by_size.get(1_000_000)
    if largest:
        allowed = max(_SLOWEST, _STREAMS * largest.stream)
        ratios.append(Ratio("peak memory of set-up at 1,000,000 vertices, GB", largest.memory, 2.0))
        ratios.append(Ratio("frame at 1,000,000 vertices, ms", largest.frame, allowed))
        what = f"time per solver step, 1,000,000 / {profiles[0].vertices:,} vertices, by turns"
        ratios.append(Ratio(what, largest.step / largest.beside, 1.5))
    worst = max(p.change for p in profiles)
    return [*ratios, Ratio("largest volume change of all frames", worst, 1e-12)]
