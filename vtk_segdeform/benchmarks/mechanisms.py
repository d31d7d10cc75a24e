"""What each mechanism of the solver buys: the same drags and bends with each one turned off alone.

    handle    the end of a limb is dragged, see `drags`
    pull      its tip is pulled
    second    after that pull another point is, of a loose part if there is one
    twist     the handle is turned about the limb, by 270 degrees in steps of 5
    bend      the handle is turned by 90 degrees at once, and the pose is finished

Each pair of frames, with a mechanism and without it, is solved one after the other, so that a busy
machine slows both.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..deformer import Deformer, Problem
from ..energy import Factor, full_factor
from ..mesh import Mesh, SurfacePoint
from ..models import cactus, random_limbs
from ..progress import Progress, tell
from ..session import Preparation, Session
from ..solver import Anderson
from .drags import Drag, Shape, frames, ready, way_of_handle, way_of_tip
from .measuring import in_own_process, timed
from .results import Cell, Scale, Section, Table
from .tasks import Hand, with_loose_parts

_DRAGS, _PULLS, _SECOND = ("handle", "pull"), ("pull", "second"), ("second",)
_EVERY, _SHAPE, _BEND = (*_DRAGS, "bend"), (*_DRAGS, "twist", "bend"), ("bend",)
_PACKAGE = __name__.partition(".")[0]
_PROBLEM, _SOLVER = "deformer.problem:Problem", "solver.gauss_newton:GaussNewton"
_LIMIT = 8  # steps of a frame, as the widgets take on a machine that is not busy
_TURN = 0.5 * np.pi
_TWIST = np.radians(np.arange(5.0, 275.0, 5.0))
_REPEATS = 3  # of the bend
_CHECKED = 15  # one frame of so many is measured
_BUYS = 1.05  # less is hardly felt
# By how much others must differ to be seen: motions of the hand, diagonals, triangles, relative.
_SEEN = {"jump": 1.0, "away": 1e-4, "error": 1e-4, "folds": 1.0, "volume": 1e-9}
QUANTITIES = ("time", "steps", "distortion", "worst", "detail", *_SEEN)
Ways = list[tuple[Callable[[], contextlib.AbstractContextManager[None]], Preparation]]
Values = dict[str, tuple[float, float]]  # by quantity, with a mechanism and without it
BODIES: dict[str, Callable[[], Mesh]] = {
    "random limbs, loose parts": lambda: with_loose_parts(random_limbs(5000, 4), 4),
    "cactus": cactus,
    "random limbs": lambda: random_limbs(22_000, 1),
}
_TEXT = """\
Each mechanism is turned off alone; a number is that without it over that with it, so that 1 makes \
no difference. *Time* is of the processor, all frames together; *distortion* the mean of the \
poses, *worst* that of ten triangles, *detail* the change of dihedral angles. Of *jump* (farthest \
that a vertex moves between two frames, over how far the hand does), *away* (of a shown pose from \
the converged one, diagonals), *error* (of handles and pulled points, diagonals), *folds* \
(triangles turned over) and *volume* (relative) it is the difference, or 0 if nobody sees it: less \
than once the motion of the hand, 1e-4 diagonals, a triangle, or 1e-9 of the volume. The first \
table has the range of all bodies and cases, and in how many of these the mechanism improves \
something by 5 %, or by what is seen."""


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Something that the method does, and how it is turned off.

    Parameters
    ----------
    name, what : str
        What it is, in one line.
    place, attribute, instead : str, str, object
        While it is off, the module or class at *place* has *instead* as its *attribute*.
    cases : tuple of str
        What it can make a difference to.
    """

    name: str
    what: str
    place: str
    attribute: str
    instead: Any
    cases: tuple[str, ...]

    @contextlib.contextmanager
    def off(self) -> Iterator[None]:
        """Turn it off within this context."""
        owner = self.owner
        known = vars(owner)[self.attribute]
        setattr(owner, self.attribute, self.instead)
        try:
            yield
        finally:
            setattr(owner, self.attribute, known)

    @property
    def owner(self) -> Any:
        """The module or class."""
        module, _, cls = self.place.partition(":")
        found = sys.modules[f"{_PACKAGE}.{module}"]
        return getattr(found, cls) if cls else found


class _Plain(Anderson):
    """No acceleration."""

    def extrapolate(self, q: FloatArray, _residual: FloatArray) -> FloatArray:
        """Return *q*."""
        return q


def _without_volumes(*given: Any, added: FloatArray | None = None, **_: object) -> Factor | None:
    return full_factor(*given, added=added)


def _no_quadratic(problem: Problem, *_: object) -> FloatArray:
    return np.zeros_like(problem.energy.quadratic)


MECHANISMS = (
    Mechanism(
        "Anderson acceleration", "combines the last steps",
        "solver.gauss_newton", "Anderson", _Plain, _EVERY,
    ),
    Mechanism(
        "extrapolation", "a frame starts ahead, along the way of the last ones",
        _SOLVER, "_ahead", lambda _, here, *__: here, _DRAGS,
    ),
    Mechanism(
        "exact Hessian", "steps with the derivatives of rotations, not only the paper's matrix",
        _SOLVER, "_factor_at", lambda solver, _: solver._factor, _EVERY,
    ),
    Mechanism(
        "Hessian of volumes", "the second derivatives of volumes in it",
        "solver.gauss_newton", "full_factor", _without_volumes, _EVERY,
    ),
    Mechanism(
        "coarse volume", "steps preserve the volume of some 2,000 points",
        "sizes", "COARSE_VOLUME", 1 << 62, _EVERY,
    ),
    Mechanism(
        "scaled volume", "beyond 20,000 vertices a pose is scaled to its exact volume",
        "sizes", "SCALED_VOLUME", 1 << 62, _EVERY,
    ),
    Mechanism(
        "inside of the body", "rotations of points inside are in the energy",
        "deformer.binding", "with_interior", lambda energy, *_: energy, _SHAPE,
    ),
    Mechanism(
        "cage stiffness", "the edges of the cages are in the energy",
        "deformer.binding", "with_cage_stiffness", lambda energy, *_: energy, _SHAPE,
    ),
    Mechanism(
        "anchors of loose parts", "weak springs on parts without handles",
        _PROBLEM, "anchors_of_loose_parts", _no_quadratic, (*_EVERY, *_SECOND),
    ),
    Mechanism(
        "waypoints", "a far motion goes through intermediate targets",
        "deformer.path:Path", "_way_to", lambda *_: iter(()), _BEND,
    ),
    Mechanism(
        "rings", "the neighbours of a pulled point resist a spike",
        "deformer.local", "_with_rings", lambda _, __, solver: solver.energy, _PULLS,
    ),
    Mechanism(
        "load at the press", "forces that are not in balance remain as a constant load",
        _SOLVER, "unbalanced", lambda _, p, *__: np.zeros_like(p), _SECOND,
    ),
    Mechanism(
        "steadying", "springs that make the pose at the press stable",
        _SOLVER, "steadying", lambda *_: 0.0, _SECOND,
    ),
    Mechanism(
        "layers and parts that move together", "distances of a pull go across thin walls",
        "deformer.locality:SurfaceSamples", "_joined", property(lambda self: self.edges), _SECOND,
    ),
    Mechanism(
        "acceleration of the finish", "combines its last steps",
        "finish.finisher", "Anderson", _Plain, _BEND,
    ),
    Mechanism(
        "cells of the finish", "rotations are shared over more than a ring of triangles",
        "finish.cell_energy", "_CELL", 0.0, _BEND,
    ),
    Mechanism(
        "proximal weight", "the finish keeps long waves where the cages found them",
        _PROBLEM, "cage_weights",
        property(lambda self: np.zeros(self.mesh.n_vertices)), _BEND,
    ),
)  # fmt: skip


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a summary and all ratios, for every mechanism, body and case."""
    found: dict[tuple[str, str, str], Values] = {}
    bodies = list(BODIES)[: scale.mechanism_bodies]
    for k, body in enumerate(bodies):
        tell(progress, k / len(bodies), f"mechanisms: {body}")
        for (name, case), values in in_own_process(measured, body).items():
            found[name, body, case] = values
    tables = [_summary(found), *(_table(found, body) for body in bodies)]
    return Section("What the mechanisms buy", _TEXT, tables)


def measured(body: str) -> dict[tuple[str, str], Values]:
    """Return both values of each quantity, with a mechanism and without it, by name and case."""
    mesh = BODIES[body]()
    own, given = Hand.on(mesh), Session(mesh).preparation()
    found = {}
    for each in MECHANISMS:
        with each.off():
            without = bound_again(own, given)  # which keeps nothing that was computed with it
        for case in each.cases:
            found[each.name, case] = compared(each, case, own, (given, without))
    return found


def bound_again(own: Hand, given: Preparation) -> Preparation:
    """Return a preparation with the regions and cages of *given*."""
    deformer = Deformer(own.mesh, given.regions, given.cages)
    return Preparation(given.regions, given.cages, deformer)


def compared(
    mechanism: Mechanism, case: str, own: Hand, preparations: tuple[Preparation, Preparation]
) -> Values:
    """Return both values of each of `QUANTITIES`, with *mechanism* and without it."""
    ways: Ways = [(contextlib.nullcontext, preparations[0]), (mechanism.off, preparations[1])]
    measure = _bends if case == "bend" else _drags
    with_it, without = measure(case, own, ways)
    return {name: (with_it[name], without[name]) for name in with_it}


def _drags(case: str, own: Hand, ways: Ways) -> list[dict[str, float]]:
    """Return the quantities of two drags, with each frame of one after that of the other."""
    drags, running = [Drag(), Drag()], []
    for way, preparation in ways:
        with way():
            session, goals, pulled = begun(case, own, preparation)
        running.append((way, preparation, session, frames(session, goals, pulled, _LIMIT)))
    is_going = [True, True]
    while any(is_going):
        for k, (way, preparation, session, drag) in enumerate(running):
            with way():
                so_far = next(drag, None)
                is_going[k] = so_far is not None
                if so_far is not None:
                    drags[k] = so_far
                    if len(so_far.steps) % _CHECKED == 0:
                        so_far.measure(session, preparation)
    return [_quantities(drag) for drag in drags]


def _bends(_case: str, own: Hand, ways: Ways) -> list[dict[str, float]]:
    """Return the quantities of a pose that is reached in one jump and finished."""
    found: list[list[dict[str, float]]] = [[], []]
    for _ in range(_REPEATS):
        for (way, preparation), bends in zip(ways, found, strict=True):
            with way():
                bends.append(bend(own, preparation))
    return [{k: min(each[k] for each in bends) for k in bends[0]} for bends in found]


def begun(
    case: str, own: Hand, preparation: Preparation
) -> tuple[Session, list[FloatArray], SurfacePoint | None]:
    """Return a session in which a drag can begin, its goals, and the point that is pulled."""
    session = ready(preparation, own, handle=case not in _PULLS)
    if case == "twist":
        return session, [own.twisted(angle) for angle in _TWIST], None
    if case == "handle":
        return session, way_of_handle(own, is_short=True), None
    if case == "second":
        mesh = own.mesh
        session.pull(own.point, own.pulled_to(1.0))
        session.commit()
        away = np.linalg.norm(mesh.vertices - mesh.vertices[own.tip], axis=1)
        smallest = mesh.components == np.bincount(mesh.components).argmin()
        own = replace(own, tip=int(np.where(smallest, away, -1.0).argmax()))
    return session, way_of_tip(session, own, is_short=True), own.point


def bend(own: Hand, preparation: Preparation) -> dict[str, float]:
    """Return the quantities of the case "bend"."""
    session = ready(preparation, own, handle=True)
    steps, seconds = timed(lambda: turn_and_finish(session, own))
    solution = session.solution
    assert solution is not None
    shape = Shape.of(own.mesh, solution)
    return {
        "time": seconds,
        "steps": float(steps),
        "volume": abs(solution.volume_change),
        **{name: float(value) for name, value in vars(shape).items() if name != "away"},
    }


def turn_and_finish(session: Session, own: Hand) -> int:
    """Turn the handle by 90 degrees at once, and finish the pose; return the solver's steps."""
    steps = session.drag(own.targets(_TURN)).steps
    if session.is_unsettled:
        steps += session.refine().steps
    session.finish()
    return steps


def improves(values: Values) -> bool:
    """Return whether anything is better with a mechanism than without it, so that it is felt."""
    return any(
        without - given >= _SEEN[name] if name in _SEEN else without >= _BUYS * given
        for name, (given, without) in values.items()
        if name != "steps"  # which explain the time
    )


def _effect(name: str, given: float, without: float) -> float:
    return without - given if name in _SEEN else without / given


def _summary(found: Mapping[tuple[str, str, str], Values]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for each in MECHANISMS:
        own = [values for (name, _, _), values in found.items() if name == each.name]
        ranges = [_range(name, [v[name] for v in own if name in v]) for name in QUANTITIES]
        rows.append((each.name, each.what, *ranges, f"{sum(map(improves, own))} of {len(own)}"))
    return Table(("mechanism", "what it is", *QUANTITIES, "improves"), rows, "all bodies and cases")


def _range(name: str, pairs: list[tuple[float, float]]) -> str:
    effects = [_effect(name, *pair) for pair in pairs]
    if not effects:
        return "–"
    if name in _SEEN:
        return f"{max(effects):.0e}" if max(effects) >= _SEEN[name] else "0"
    return f"{min(effects):.2f} to {max(effects):.2f}"


def _table(found: Mapping[tuple[str, str, str], Values], body: str) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (name, case, *(_effect(q, *values[q]) if q in values else None for q in QUANTITIES))
        for (name, own, case), values in found.items()
        if own == body
    ]
    return Table(("mechanism", "case", *QUANTITIES), rows, body, mixed=True)


def _quantities(drag: Drag) -> dict[str, float]:
    return {
        "time": sum(drag.seconds[1:]),
        "steps": float(sum(drag.steps)),
        "jump": drag.jump,
        "volume": max(drag.volumes),
        **{name: float(drag.each(name).mean()) for name in ("distortion", "detail")},
        **{name: float(drag.each(name).max()) for name in ("worst", "away", "error", "folds")},
    }
