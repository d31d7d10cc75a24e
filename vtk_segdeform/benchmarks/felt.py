"""What a drag feels like: every frame of a hand that turns back, hesitates and flicks.

set-up    regions, cages, and binding them
first     the first frame; of a pull it includes the press
frames    median, 95 % and longest of the others, beside one iteration of libigl's ARAP
away      of a shown pose from the converged one
jump      farthest that a vertex moves between two frames, over how far the hand does
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from ..deformer import Deformer
from ..errors import MissingDependencyError
from ..mesh import Mesh
from ..models import cactus, random_limbs
from ..progress import Progress, tell
from ..session import Preparation, Session
from .drags import Drag, frames, ready, way_of_handle, way_of_tip
from .measuring import in_own_process, timed
from .peers import arap_iteration_seconds
from .results import Cell, Scale, Section, Table
from .tasks import Hand, Task, warm_up

BODIES: dict[str, Callable[[int], Mesh]] = {
    "cactus": cactus,
    "random limbs": partial(random_limbs, seed=1),
}
_CHECKED = 9  # every ninth pose is measured
_TEXT = """\
A hand turns the end of a limb by 84 degrees, turns back through the start to 48 degrees on the \
other side, flicks, hesitates and returns; or it pulls the tip as far. *Random limbs* is a solid \
made at run time. A frame is one call of `Session.drag` or `Session.pull` with as many steps as \
the widgets take (8 at most), or while the hand hesitates of \
`Session.refine`, until the pose has settled. All times are of the processor, summed over its \
cores. *ARAP* is one iteration of libigl's as-rigid-as-possible deformation of the same mesh, in \
the same process. *Away* is the largest distance of a shown pose from the converged one, in \
diagonals, of every ninth frame: median and largest. *Jump* is the farthest that a vertex moves \
between two frames, over how far the hand does."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the measurements for every size of *scale*."""
    set_up: list[tuple[Cell, ...]] = []
    rows: list[tuple[Cell, ...]] = []
    section = Section("Drags as they are felt", _TEXT)
    for k, size in enumerate(scale.drag_sizes):
        for body in BODIES:
            tell(progress, k / len(scale.drag_sizes), f"drags of {body}, {size} vertices")
            times, drags, arap, fault = in_own_process(felt, body, size, scale)
            set_up.append((body, size, *times, sum(times)))
            rows += [(body, size, name, *_row(drag, arap)) for name, drag in drags.items()]
            if fault:
                section.skipped.append(f"ARAP, {body}, {size} vertices: {fault}")
    parts = ("body", "vertices", "regions", "cages", "binding", "total")
    section.tables.append(Table(parts, set_up, "set-up, seconds"))
    columns = (
        "body", "vertices", "drag", "first, ms", "median", "95 %", "longest",
        "ARAP iteration, ms", "median / ARAP", "95 % / ARAP", "longest / ARAP",
        "steps", "most", "away", "largest", "jump", "volume change",
    )  # fmt: skip
    section.tables.append(Table(columns, rows, "frames"))
    return section


def felt(body: str, size: int, scale: Scale) -> tuple[list[float], dict[str, Drag], float, str]:
    """Set up one of `BODIES` with *size* vertices, drag it by a handle, and pull it.

    Returned are the seconds of the parts of the set-up, the drags by name, and the seconds of an
    iteration of ARAP, or NaN and the reason.
    """
    warm_up()
    mesh = BODIES[body](size)
    own, session = Hand.on(mesh), Session(mesh)
    session.change_options(n_cage_vertices=scale.n_cage_vertices)
    _, segment = timed(session.segment)
    _, cages = timed(session.fit_cages)
    assert session.regions is not None
    # Not by the session, which would find an earlier binding on the disk.
    deformer, bind = timed(partial(Deformer, mesh, session.regions, session.cages))
    preparation = Preparation(session.regions, session.cages, deformer)
    session, bind_handle = timed(lambda: ready(preparation, own, handle=True))
    drags = {"handle": dragged(session, own, preparation, pulls=False)}
    session = ready(preparation, own, handle=False)
    drags["pull"] = dragged(session, own, preparation, pulls=True)
    arap, fault = math.nan, ""
    try:
        task = Task(body, mesh, own.fixed, own.handle, own.targets(0.5))
        arap = arap_iteration_seconds(task, scale.repeats)
    except MissingDependencyError as missing:
        fault = str(missing)
    return [segment, cages, bind + bind_handle], drags, arap, fault


def dragged(session: Session, own: Hand, preparation: Preparation, *, pulls: bool) -> Drag:
    """Drag the handle of *session*, or pull the tip, along the path of `drags.hand`."""
    goals = way_of_tip(session, own) if pulls else way_of_handle(own)
    drag = Drag()
    for k, drag in enumerate(frames(session, goals, own.point if pulls else None), 1):
        if k % _CHECKED == 0:
            drag.measure(session, preparation)
    return drag


def _row(drag: Drag, arap: float) -> tuple[Cell, ...]:
    away = drag.each("away")
    return (
        1e3 * drag.seconds[0], *(1e3 * t for t in drag.felt), 1e3 * arap,
        *(t / arap for t in drag.felt), int(np.median(drag.steps)), max(drag.steps),
        float(np.median(away)), float(away.max()), drag.jump, max(drag.volumes),
    )  # fmt: skip
