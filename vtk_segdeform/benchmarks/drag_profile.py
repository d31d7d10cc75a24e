"""Profile of a drag for meshes of 5 thousand to a million vertices, with limits.

The parts are those of `frame_profile`.  They are compared with one iteration of libigl's ARAP, and
with the time to read W from memory once.
"""

from __future__ import annotations

import numpy as np

from ..errors import MissingDependencyError
from ..progress import Progress, part
from . import charts
from .frame_profile import Profile, profile_of
from .measuring import run_in
from .programs import arap_iteration_seconds
from .scale import Scale
from .sections import Figure, Ratio, Section, Table
from .tasks import bent_cactus

_NAN = float("nan")
_MAX_FRAME = 33.0  # milliseconds: thirty frames per second
_MAX_READS = 2.5  # or this multiple of the time to read W from memory
_MAX_FRAME_BY_ARAP = {5430: 1.0, 50_000: 1.0 / 3.0, 500_000: 0.1}  # vertices: frame / iteration
_MAX_SET_UP = {5430: 1.5, 50_000: 5.0, 1_000_000: 60.0}  # vertices: seconds


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the profile for every size of *scale*, with ratios and limits."""
    profiles, skipped = [], []
    for k, size in enumerate(scale.drag_sizes):
        step = part(progress, k / len(scale.drag_sizes), (k + 1) / len(scale.drag_sizes))
        if step:
            step(0.0, f"drag of {size} vertices")
        found = run_in(scale.own_process, profile_of, size, scale)
        if step:
            step(0.8, f"ARAP iteration of {size} vertices")
        try:
            task = bent_cactus(size)
            arap, arap_processors = run_in(
                scale.own_process, arap_iteration_seconds, task, scale.repeats
            )
        except (MissingDependencyError, RuntimeError, MemoryError) as missing:
            skipped.append(f"libigl ARAP, {size} vertices: {missing}")
            arap = arap_processors = _NAN
        profiles.append(
            Profile(**{**vars(found), "arap": 1e3 * arap, "arap_processors": 1e3 * arap_processors})
        )
    return Section(
        "Profile of a drag",
        text=[
            f"Cactus, 3 regions, {scale.n_cage_vertices} cage vertices. Handles move by 1 % of the "
            "mesh diagonal per frame. A frame has converged when the next step moves no vertex by "
            "more than 1e-4 of the diagonal. Times are median milliseconds. *Smallest mesh* is a "
            "step of the smallest mesh, alternating with steps of this one, so that processor "
            "caches are equally cold. *Processor time* is summed over all cores. Set-up writes a "
            "cache to disk; *reopen* loads the binding of the same mesh, regions and cages from "
            "it.",
        ],
        tables=[_frame_table(profiles), _option_table(profiles), _set_up_table(profiles)],
        figures=_figures(profiles),
        ratios=_ratios(profiles),
        skipped=skipped,
    )


def _frame_table(profiles: list[Profile]) -> Table:
    columns = (
        "vertices", "frame", "steps", "step", "step, smallest mesh", "other", "map", "volume",
        "normals", "render", "read W", "ARAP iteration", "frame / ARAP",
        "processor time: frame", "processor time: ARAP", "volume change",
    )  # fmt: skip
    rows = [
        (
            p.vertices, p.frame, p.steps, p.step, p.smallest_step, p.other, p.map, p.volume,
            p.normals, p.render, p.read, p.arap, p.frame / p.arap,
            p.processors, p.arap_processors, p.volume_change,
        )
        for p in profiles
    ]  # fmt: skip
    return Table(columns, rows, "a frame; times in milliseconds")


def _option_table(profiles: list[Profile]) -> Table:
    columns = "vertices", "avoid folds", "avoid contact"
    rows = [(p.vertices, p.with_folds, p.with_contact) for p in profiles]
    return Table(columns, rows, "a frame with an option, divided by one without; nothing is near")


def _set_up_table(profiles: list[Profile]) -> Table:
    columns = ("vertices", "segment", "cages", "bind", "total", "reopen", "peak memory, GB")
    rows = [
        (p.vertices, p.segment, p.cages, p.bind, p.set_up, p.reopen, p.memory) for p in profiles
    ]
    return Table(columns, rows, "set-up; times in seconds")


def _figures(profiles: list[Profile]) -> list[Figure]:
    names = [f"{p.vertices:,}" for p in profiles]
    stages = ("other", "stepping", "map", "volume", "normals", "render")
    shares = {stage: [float(getattr(p, stage)) for p in profiles] for stage in stages}
    shares = {stage: values for stage, values in shares.items() if not np.isnan(values).any()}
    lines = {
        "milliseconds": {
            "frame": [p.frame for p in profiles],
            "one step": [p.step for p in profiles],
            "map + volume": [p.map + p.volume for p in profiles],
            "reading W from memory": [p.read for p in profiles],
            "one ARAP iteration": [p.arap for p in profiles],
        }
    }
    sizes = [float(p.vertices) for p in profiles]
    return [
        Figure(
            "drag-times.png",
            "Times of a converged frame, its parts and an ARAP iteration, by mesh size.",
            lambda path: charts.line_plot(path, sizes, lines, across="vertices", logarithmic=True),
        ),
        Figure(
            "drag-shares.png",
            "Shares of the time of a rendered frame; numbers are milliseconds.",
            lambda path: charts.stack_plot(path, names, shares, across="share of the frame, %"),
        ),
    ]


def _ratios(profiles: list[Profile]) -> list[Ratio]:
    by_size = {p.vertices: p for p in profiles}
    ratios = []
    for n, limit in _MAX_FRAME_BY_ARAP.items():
        if p := by_size.get(n):
            what = f"converged frame / ARAP iteration, {n:,} vertices"
            ratios.append(Ratio(what, p.frame / p.arap, limit))
            # Frame and iteration are not timed alternately: on a busy machine, compare this ratio.
            ratios.append(
                Ratio(f"{what}, in processor time", p.processors / p.arap_processors, limit)
            )
    ratios += [
        Ratio(f"frame that avoids contact / frame, {p.vertices:,} vertices", p.with_contact, 1.1)
        for p in profiles
    ]
    for n, limit in _MAX_SET_UP.items():
        if p := by_size.get(n):
            ratios.append(Ratio(f"set-up at {n:,} vertices, s", p.set_up, limit))
            ratios.append(Ratio(f"reopen / set-up at {n:,} vertices", p.reopen / p.set_up, 0.1))
    largest = by_size.get(1_000_000)
    if largest:
        allowed = max(_MAX_FRAME, _MAX_READS * largest.read)
        ratios.append(Ratio("peak memory of set-up at 1,000,000 vertices, GB", largest.memory, 2.0))
        ratios.append(Ratio("frame at 1,000,000 vertices, ms", largest.frame, allowed))
        what = f"time per solver step, 1,000,000 / {profiles[0].vertices:,} vertices"
        ratios.append(Ratio(what, largest.step / largest.smallest_step, 1.5))
    worst = max(p.volume_change for p in profiles)
    return [*ratios, Ratio("largest volume change of all frames", worst, 1e-12)]
