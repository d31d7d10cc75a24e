"""Frames with constraints, relative to those of the same drag without any.

The drags take turns, one frame each, so that a busy machine slows all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import zip_longest
from typing import Any

import numpy as np

from ..cages import fit_cages
from ..deformer import Deformer, Slide
from ..progress import Progress, tell
from ..regions import segment
from ..session import Session
from .drags import Drag, frames, ready, way_of_handle
from .measuring import by_turns, in_own_process, timed
from .results import Cell, Scale, Section, Table
from .tasks import Hand, divided_bar, warm_up, with_loose_parts

_WHOLE: dict[str, Any] = {"volumes": {"whole": "keep"}}
_COLUMNS = (
    "vertices", "constraint", "median, ms", "median / none", "95 % / none", "steps",
    "volume change", "finish, ms", "finish / none",
)  # fmt: skip
_SLOPES = ("vertices", "solve, ms", "direction / solve", "gradient / solve")
_TEXT = """\
A bar that inner walls divide into seven parts is bent by its end, turned back and bent again, and \
the pose is finished. In the row *none* only the whole volume is preserved, as it is in all rows. \
*Stiffness*: one half is four times as stiff as the other; *rigid part*: the middle third between \
fixed vertices and handle; *slides*: half of the fixed vertices slide instead, along planes in \
which the bar bends, or along the surface; *symmetry*: about the plane of the bend; *area*: also \
that of the whole surface; *centroid on an axis*: along the bar at rest; *followers*: four balls \
that lie against the bar. *Volume change* is the largest of all frames. *Derivatives* are those of \
the pose of a solve by its targets, in one direction and the gradient of a function. All times are \
of the processor, summed over its cores."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table with the rows of every size of *scale*."""
    rows: list[tuple[Cell, ...]] = []
    slopes: list[tuple[Cell, ...]] = []
    for k, size in enumerate(scale.drag_sizes):
        tell(progress, k / len(scale.drag_sizes), f"drags with constraints, {size} vertices")
        found = in_own_process(constrained, size, scale.n_cage_vertices)
        rows += [(size, *row) for row in found]
        slopes.append((size, *in_own_process(differentiated, size, scale.n_cage_vertices)))
    tables = [Table(_COLUMNS, rows, "frames and finish"), Table(_SLOPES, slopes, "derivatives")]
    return Section("Drags with constraints", _TEXT, tables)


def differentiated(size: int, n_cage_vertices: int) -> tuple[Cell, ...]:
    """Return the times of a solve of one mesh size, and of derivatives relative to it."""
    warm_up()
    bar = divided_bar(size)
    own = Hand.on(bar)
    regions = segment(bar, 3)
    cages = fit_cages(bar, regions, n_cage_vertices)
    deformer = Deformer(bar, regions, cages, fixed=own.fixed, handle=own.handle)
    rest, targets = deformer.copy(), own.targets(0.5)
    solution = deformer.solve(targets)
    works: list[Callable[[], object]] = [
        lambda: rest.copy().solve(targets),
        lambda: deformer.jvp(solution, targets),
        lambda: deformer.vjp(solution, solution.vertices),
    ]
    solve, direction, gradient = by_turns(works, 3)
    return 1e3 * solve, direction / solve, gradient / solve


def constrained(size: int, n_cage_vertices: int) -> list[tuple[Cell, ...]]:
    """Return the rows of one mesh size, measured in this process."""
    warm_up()
    sessions = begun(size, n_cage_vertices)
    drags = dict.fromkeys(sessions, Drag())
    ways = [frames(s, way_of_handle(own, is_short=True), None) for own, s in sessions.values()]
    for turn in zip_longest(*ways):
        drags.update((n, each) for n, each in zip(drags, turn, strict=True) if each is not None)
    rows: list[tuple[Cell, ...]] = []
    none: list[float] = []
    for name, drag in drags.items():
        _, finish = timed(sessions[name][1].finish)
        times = [*drag.felt[:2], finish]
        none = none or times
        median, most, end = (time / base for time, base in zip(times, none, strict=True))
        effort = int(np.median(drag.steps)), max(drag.volumes)
        rows.append((name, 1e3 * times[0], median, most, *effort, 1e3 * finish, end))
    return rows


def begun(size: int, n_cage_vertices: int) -> dict[str, tuple[Hand, Session]]:
    """Return a hand and a session in which its drag can begin, for each row."""
    bar = body = divided_bar(size)
    own, height = Hand.on(bar), bar.vertices[:, 2]
    ends = height[own.fixed].mean(), height[own.handle].mean()
    share = (height - ends[0]) / (ends[1] - ends[0])  # 0 at the fixed vertices, 1 at the handle
    sliding = own.fixed[share[own.fixed] > 0.0]
    rigid = np.where(np.abs(share - 0.5) < 1.0 / 6.0, np.inf, 1.0)
    along = int(np.ptp(bar.vertices, axis=0).argmax())
    three = {"volumes": dict.fromkeys(["whole", "body 0", "body 1"], "keep")}
    axis = ["whole", *(f"centroid {name}" for k, name in enumerate("xyz") if k != along)]
    rows: list[tuple[str, dict[str, Any], Any, list[Slide]]] = [
        ("none", _WHOLE, None, []),
        ("stiffness", _WHOLE, np.where(share > 0.5, 4.0, 1.0), []),
        ("rigid part", _WHOLE, rigid, []),
        ("slide along planes", _WHOLE, None, [Slide(sliding, "plane", own.axis)]),
        ("slide along the surface", _WHOLE, None, [Slide(sliding, "surface")]),
        ("symmetry", {**_WHOLE, "symmetry": "xyz"[np.abs(own.axis).argmax()]}, None, []),
        ("avoiding contact", {**_WHOLE, "avoid_contact": True}, None, []),
        ("three volumes", three, None, []),
        ("seven volumes", {}, None, []),
        ("area", {"volumes": dict.fromkeys(["whole", "area"], "keep")}, None, []),
        ("centroid on an axis", {"volumes": dict.fromkeys(axis, "keep")}, None, []),
        ("followers", _WHOLE, None, []),
    ]
    found: dict[str, tuple[Hand, Session]] = {}
    for name, options, stiffness, slides in rows:
        if name in ("none", "followers"):
            body = bar if name == "none" else with_loose_parts(bar, 4)
            own, session = Hand.on(body), Session(body)
            session.change_options(n_cage_vertices=n_cage_vertices)
            preparation = session.preparation()
        session = ready(preparation, own, handle=True, **options)
        session.set_stiffness(stiffness)
        if slides:
            session.set_fixed(np.setdiff1d(own.fixed, sliding))
            session.set_slides(slides)
        session.bind()
        found[name] = own, session
    return found
