"""What a drag feels like: every frame of a hand that turns back, hesitates and flicks.

set-up    regions, cages, and binding them
first     the first frame; of a pull it includes the press
frames    median, 95 % and longest of the others, beside one iteration of libigl's ARAP
away      of a shown pose from the converged one
jump      farthest that a vertex moves between two frames, over how far the hand does
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..deformer import Deformer
from ..errors import MissingDependencyError
from ..mesh import Mesh
from ..models import cactus, random_limbs
from ..progress import Progress, tell
from ..session import Preparation, Session
from . import charts
from .bodies import Hand
from .drags import Drag, dragged, ready
from .measuring import run_in
from .programs import arap_iteration_seconds
from .scale import Scale
from .sections import Cell, Figure, Ratio, Section, Table
from .tasks import Task, warm_up

SEED = 1
BODIES: dict[str, Callable[[int], Mesh]] = {
    "cactus": cactus,
    "random limbs": partial(random_limbs, seed=SEED),
}
# Vertices: median, 95 % and longest of frames, in iterations of ARAP.
_MOST = {5430: (1.0, 2.0, 4.0), 50_000: (0.33, 0.6, 1.0), 500_000: (0.1, 0.15, 0.25)}
_APART = "handle, avoiding contact"
_MOST_AWAY, _MOST_VOLUME, _MOST_CONTACT = 1e-3, 1e-12, 1.1


@dataclass(frozen=True, eq=False)
class Felt:
    """A body set up, dragged by a handle, and pulled; times in seconds of the processor."""

    body: str
    vertices: int
    segment: float
    cages: float
    bind: float
    drags: dict[str, Drag]
    arap: float  # one iteration; NaN without libigl
    without_arap: str  # why


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the measurements for every size of *scale*, with ratios and limits."""
    found = []
    for k, size in enumerate(scale.drag_sizes):
        for body in BODIES:
            tell(progress, k / len(scale.drag_sizes), f"drags of {body}, {size} vertices")
            found.append(run_in(scale.own_process, felt, body, size, scale))
    return Section(
        "Drags as they are felt",
        text=[
            (
                "A hand turns the end of a limb by 84 degrees, turns back through the start to 48 "
                "degrees on the other side, flicks, hesitates and returns; or it pulls the tip as "
                "far. *Random limbs* is a solid made at run time. A frame is one call of "
                "`Session.drag` or `Session.pull` with as many steps as the widgets take (3 to 8, "
                "by the time of the last ones), or while the hand hesitates of `Session.refine`, "
                "until the pose has settled. All times are of the processor, summed over its "
                "cores. *ARAP* is one iteration of libigl's as-rigid-as-possible deformation of "
                "the same mesh, in the same process. *Away* is the "
                "largest distance of a shown pose from the converged one, in diagonals, of every "
                "ninth frame: median and largest. *Jump* is the farthest that a vertex moves "
                "between two frames, over how far the hand does."
            )
        ],
        tables=[_set_up_table(found), _frame_table(found)],
        figures=[_figure(found)],
        ratios=_ratios(found),
        skipped=[
            f"ARAP, {each.body}, {each.vertices} vertices: {each.without_arap}"
            for each in found
            if each.without_arap
        ],
    )


def felt(body: str, size: int, scale: Scale) -> Felt:
    """Return the measurements of one of `BODIES` with *size* vertices."""
    warm_up()
    mesh = BODIES[body](size)
    own, session = Hand.on(mesh), Session(mesh)
    session.change_options(n_cage_vertices=scale.n_cage_vertices)
    times = [time.process_time()]
    session.segment()
    times.append(time.process_time())
    session.fit_cages()
    times.append(time.process_time())
    assert session.regions is not None
    # Not by the session, which would find an earlier binding on the disk.
    deformer = Deformer(mesh, session.regions, session.cages)
    preparation = Preparation(session.regions, session.cages, deformer)
    session = ready(preparation, own, handle=True)
    times.append(time.process_time())
    drags = {"handle": dragged(session, own, preparation, pulls=False)}
    session = ready(preparation, own, handle=True, avoid_contact=True)
    drags[_APART] = dragged(session, own, preparation, pulls=False)
    session = ready(preparation, own, handle=False)
    drags["pull"] = dragged(session, own, preparation, pulls=True)
    arap, fault = math.nan, ""
    try:
        task = Task(body, mesh, own.fixed, own.handle, own.targets(0.5))
        arap = arap_iteration_seconds(task, scale.repeats)
    except MissingDependencyError as missing:
        fault = str(missing)
    segment, cages, bind = np.diff(times).tolist()
    return Felt(body, mesh.n_vertices, segment, cages, bind, drags, arap, fault)


def _set_up_table(found: list[Felt]) -> Table:
    columns = ("body", "vertices", "regions", "cages", "binding", "total")
    rows = [
        (f.body, f.vertices, f.segment, f.cages, f.bind, f.segment + f.cages + f.bind)
        for f in found
    ]
    return Table(columns, rows, "set-up, seconds")


def _frame_table(found: list[Felt]) -> Table:
    columns = (
        "body", "vertices", "drag", "first, ms", "median", "95 %", "longest",
        "ARAP iteration, ms", "median / ARAP", "95 % / ARAP", "longest / ARAP",
        "steps", "most", "away", "largest", "jump", "volume change",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (
            f.body, f.vertices, name, 1e3 * d.first, *(1e3 * t for t in d.felt), 1e3 * f.arap,
            *(t / f.arap for t in d.felt), int(np.median(d.steps)), int(d.steps.max()),
            float(np.median(d.away)), float(d.away.max()), d.jump, d.volume,
        )
        for f in found
        for name, d in f.drags.items()
    ]  # fmt: skip
    return Table(columns, rows, "frames")


def _figure(found: list[Felt]) -> Figure:
    panels = {f"{body}, ms": lines([f for f in found if f.body == body]) for body in BODIES}
    sizes = sorted({float(each.vertices) for each in found})
    return Figure(
        "drag-times.png",
        "Median and longest frame of a drag and a pull, and one ARAP iteration, by mesh size.",
        lambda path: charts.line_plot(path, sizes, panels, across="vertices", logarithmic=True),
    )


def lines(own: list[Felt]) -> dict[str, list[float]]:
    """Return the lines of a body in the figure, milliseconds for each size."""
    times = {}
    for name in ("handle", "pull"):
        felt = [each.drags[name].felt for each in own]
        times[f"{name}, median"] = [1e3 * median for median, _, _ in felt]
        times[f"{name}, longest"] = [1e3 * longest for _, _, longest in felt]
    return times | {"ARAP iteration": [1e3 * each.arap for each in own]}


def _ratios(found: list[Felt]) -> list[Ratio]:
    ratios = []
    for each in found:
        for name, d in each.drags.items():
            what = f"{each.body}, {each.vertices:,} vertices, {name}"
            for part, time_of, most in zip(
                ("median", "95 %", "longest"), d.felt, _MOST.get(each.vertices, ()), strict=False
            ):
                ratios.append(Ratio(f"{what}: {part} frame / ARAP", time_of / each.arap, most))
            ratios.append(Ratio(f"{what}: away", float(d.away.max()), _MOST_AWAY))
            ratios.append(Ratio(f"{what}: volume change", d.volume, _MOST_VOLUME))
        if _APART in each.drags:
            plain, apart = (each.drags[name].felt[0] for name in ("handle", _APART))
            what = f"{each.body}, {each.vertices:,} vertices: frame that avoids contact / not"
            ratios.append(Ratio(what, apart / plain, _MOST_CONTACT))
    return ratios
