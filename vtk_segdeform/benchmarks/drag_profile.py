"""Where a drag's time goes, from 5 thousand to a million vertices, and what it must keep to.

    begin     of a frame: how the energy curves where it starts, what holds the handles
    step      one more step of the solver; must not depend on the size of the mesh
    map       x = W p, and the direction in which the volume is restored beside it
    volume    the exact volume of the whole mesh: one cubic, one check
    normals   by VTK;  render: off the screen, by whatever OpenGL there is

Handles move by 1 % of the diagonal a frame; a frame is as many steps as `drags` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from ..arrays import FloatArray
from ..constraints import total_volume
from ..errors import MissingDependencyError
from ..progress import Progress, part
from ..subspace import Subspace
from ..threads import in_parallel
from . import charts
from .drags import frames, seconds_per_step, way_of
from .drawing import drawing_seconds
from .measuring import called, forget_peak, median_seconds, peak_memory, timed
from .programs import arap_iteration_seconds
from .scale import Scale
from .sections import Figure, Ratio, Section, Table
from .tasks import bent_cactus, bound, deformer_of, warm_up

_NAN = float("nan")
_SLOWEST = 33.0  # milliseconds: thirty frames a second
_STREAMS = 2.5  # or so many times as long as W takes to come from memory
_OF_ARAP = {5430: 1.0, 50_000: 1.0 / 3.0, 500_000: 0.1}  # a frame, in ARAP iterations
_SET_UP = {5430: 1.5, 50_000: 5.0, 1_000_000: 60.0}  # seconds
_PIECE = 1 << 18


@dataclass(frozen=True)
class Profile:
    """What was measured at one size; times in milliseconds, set-up in seconds."""

    vertices: int
    segment: float
    cages: float
    bind: float
    again: float  # a second deformer over the same mesh, regions and cages
    memory: float  # gigabytes, at most, while setting up
    frame: float
    steps: int
    step: float
    map: float
    volume: float
    normals: float
    render: float
    stream: float
    change: float  # of the volume, the largest of all frames
    processors: float  # of a frame, milliseconds of all of them
    arap: float = _NAN
    arap_processors: float = _NAN

    @property
    def set_up(self) -> float:
        """Seconds from a mesh to its first frame."""
        return self.segment + self.cages + self.bind

    @property
    def stepping(self) -> float:
        """Of the frame: its steps."""
        return self.steps * self.step

    @property
    def begin(self) -> float:
        """Of the frame: what is not steps, map or volume."""
        return max(self.frame - self.stepping - self.map - self.volume, 0.0)


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
            "1e-4 of it. Milliseconds, medians. *Processors* is what one of them alone would have "
            "taken, whatever else the machine did. *Again* opens the same mesh once more.",
        ],
        tables=[_frame_table(profiles), _set_up_table(profiles)],
        figures=_figures(profiles),
        ratios=_ratios(profiles),
        absent=absent,
    )


def profiled(size: int, scale: Scale) -> Profile:
    """Return the profile of one size, without ARAP; run it in a process of its own."""
    task = bent_cactus(size)
    warm_up()
    forget_peak()
    ready = bound(task, 3, scale.n_cage_vertices)
    memory = peak_memory()
    deformer = ready.deformer
    drag = list(frames(deformer, way_of(task, scale.frames)))[1:]
    pose = drag[-1].solution.vertices
    directions = np.random.default_rng(0).random((deformer.subspace.n_columns, 6))
    path = np.hstack([task.mesh.vertices, pose - task.mesh.vertices])
    whole = total_volume(task.mesh)
    try:
        normals, render = drawing_seconds(task.mesh, pose, scale.repeats)
    except MissingDependencyError:
        normals = render = _NAN
    again = timed(lambda: deformer_of(task, deformer.regions, deformer.cages))[1]
    return Profile(
        vertices=task.mesh.n_vertices,
        segment=ready.segment,
        cages=ready.cages,
        bind=ready.bind,
        again=again,
        memory=memory,
        frame=1e3 * median(frame.seconds for frame in drag),
        steps=int(median(frame.steps for frame in drag)),
        step=1e3 * seconds_per_step(deformer, task, scale.repeats),
        map=1e3 * median_seconds(lambda: deformer.subspace.map(directions), scale.repeats),
        volume=1e3
        * median_seconds(lambda: (whole.exact_step(path), whole.violation(pose)), scale.repeats),
        normals=1e3 * normals,
        render=1e3 * render,
        stream=1e3 * median_seconds(lambda: _stream(deformer.subspace), scale.repeats),
        processors=1e3 * median(frame.processors for frame in drag),
        change=max(abs(frame.solution.volume_change) for frame in drag),
    )


def _stream(subspace: Subspace) -> None:
    """Read W once, by all threads."""
    for block in subspace.blocks:
        flat = block.reshape(-1)

        def read(start: int, stop: int, flat: FloatArray = flat) -> None:
            np.dot(flat[start:stop], flat[start:stop])

        in_parallel(read, len(flat), _PIECE)


def _frame_table(profiles: list[Profile]) -> Table:
    columns = (
        "vertices", "frame ms", "steps", "ms per step", "begin", "map", "volume", "normals",
        "render", "W once", "ARAP iteration", "frame / ARAP",
        "processors: frame", "ARAP", "volume change",
    )  # fmt: skip
    rows = [
        (
            p.vertices, p.frame, p.steps, p.step, p.begin, p.map, p.volume, p.normals, p.render,
            p.stream, p.arap, p.frame / p.arap, p.processors, p.arap_processors, p.change,
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
    ratios = [
        Ratio(f"converged frame / ARAP iteration, {n:,} vertices", p.frame / p.arap, limit)
        for n, limit in _OF_ARAP.items()
        if (p := by_size.get(n))
    ]
    for n, limit in _SET_UP.items():
        if p := by_size.get(n):
            ratios.append(Ratio(f"set-up at {n:,} vertices, s", p.set_up, limit))
            ratios.append(Ratio(f"again / set-up at {n:,} vertices", p.again / p.set_up, 0.1))
    largest = by_size.get(1_000_000)
    if largest:
        allowed = max(_SLOWEST, _STREAMS * largest.stream)
        ratios.append(Ratio("peak memory of set-up at 1,000,000 vertices, GB", largest.memory, 2.0))
        ratios.append(Ratio("frame at 1,000,000 vertices, ms", largest.frame, allowed))
    if largest and (small := by_size.get(5430)):
        what = "time per solver step, 1,000,000 / 5,430 vertices"
        ratios.append(Ratio(what, largest.step / small.step, 1.5))
    worst = max(p.change for p in profiles)
    return [*ratios, Ratio("largest volume change of all frames", worst, 1e-12)]
