"""Drags as a hand makes them: it turns back, hesitates and flicks.

A drag calls `Session.drag` or `Session.pull` as the widgets do, without a window: at each move with
as many steps as fit between two events, and while the hand rests `Session.refine` until the pose
has settled.  Some of the poses are measured, and compared with the converged one, to which another
session solves from there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..geometry import distortion, triangle_distortion
from ..kernels import one_blas_thread
from ..mesh import HalfEdges, Mesh, SurfacePoint
from ..session import Preparation, Session
from ..solver import Solution
from ..widgets.handle_dragger import STEPS
from .tasks import Hand

_WORST = 10  # triangles
_LEAST_MOTION = 1e-3  # diagonals: of shorter motions no jump is computed
_MOST_STEPS = 200  # to the converged pose: far more than it takes


@dataclass(frozen=True)
class Shape:
    """How good a pose is."""

    error: float  # of handles or of the pulled point, diagonals
    distortion: float
    worst: float  # distortion of ten triangles
    detail: float  # change of dihedral angles, root mean square, degrees
    folds: int  # triangles
    away: float = np.nan  # farthest vertex from the converged pose, diagonals

    @classmethod
    def of(cls, mesh: Mesh, solution: Solution, away: float = np.nan) -> Shape:
        """Measure *solution*, a pose of *mesh*."""
        x = solution.vertices
        first, second = HalfEdges(mesh.faces, mesh.n_vertices).pairs.T // 3
        turned = [_angles(p[mesh.faces], first, second) for p in (mesh.vertices, x)]
        weights = mesh.face_areas[first] + mesh.face_areas[second]
        change = (turned[1] - turned[0] + np.pi) % (2.0 * np.pi) - np.pi
        return cls(
            error=solution.handle_error,
            distortion=distortion(mesh, x),
            worst=float(np.sort(triangle_distortion(mesh, x))[-_WORST:].mean()),
            detail=float(np.degrees(np.sqrt(np.average(change**2, weights=weights)))),
            folds=len(solution.folds()),
            away=away,
        )


@dataclass
class Drag:
    """The frames of a drag, and the shapes of those poses that were measured."""

    seconds: list[float] = field(default_factory=list)  # of the processor
    steps: list[int] = field(default_factory=list)
    jumps: list[float] = field(default_factory=list)  # motion of the farthest vertex / of the hand
    volumes: list[float] = field(default_factory=list)  # largest relative error
    shapes: list[Shape] = field(default_factory=list)

    @property
    def felt(self) -> tuple[float, float, float]:
        """Median, 95 % and longest of all frames but the first, in seconds."""
        median, most, longest = np.quantile(self.seconds[1:], [0.5, 0.95, 1.0]).tolist()
        return median, most, longest

    @property
    def jump(self) -> float:
        """The largest of `jumps`."""
        return float(np.nanmax(self.jumps))

    def each(self, name: str) -> FloatArray:
        """Return a quantity of `shapes`."""
        return np.array([vars(shape)[name] for shape in self.shapes], dtype=float)

    @one_blas_thread()  # whose threads, once they have begun, also spin during later frames
    def measure(self, session: Session, preparation: Preparation) -> None:
        """Measure the present pose of *session*."""
        x, solution = session.vertices, session.solution
        assert solution is not None
        away = np.linalg.norm(converged(session, preparation) - x, axis=1).max()
        away = float(away) / session.mesh.diagonal
        self.shapes.append(Shape.of(session.mesh, solution, away))


def hand(*, is_short: bool = False) -> list[tuple[float, FloatArray]]:
    """Return the path of the hand: how far it has turned, in radians, and a shift in diagonals.

    It goes out, turns back through the start to the other side, flicks back, hesitates, and
    returns slowly; while it moves it wobbles.  The short path turns back before the start.
    """
    places, counts = (1.4, -0.8, 0.9, 0.9, 0.2), (50, 60, 12, 10, 40)
    if is_short:
        places, counts = (0.8, 0.3, 1.0, 1.0, 0.7), (25, 14, 5, 10, 12)
    legs = zip((0.0, *places), places, counts, strict=False)
    turns = np.pi / 3.0 * np.concatenate([np.linspace(*leg) for leg in legs])[1:]
    k = np.cumsum(np.diff(turns, prepend=0.0) != 0.0)  # stops while the hand rests
    aside = np.stack([0.02 * np.sin(k / 7), 0.015 * np.cos(k / 11) - 0.015, 0.0 * k], axis=1)
    return list(zip(turns.tolist(), aside, strict=True))


def ready(preparation: Preparation, own: Hand, *, handle: bool, **options: Any) -> Session:
    """Return a bound session; with *handle* it has the fixed vertices and the handle of *own*."""
    session = Session(own.mesh)
    session.change_options(**options)
    session.accept(preparation)
    if handle:
        session.set_fixed(own.fixed)
        session.handles.add(own.handle)
    session.bind()
    return session


def way_of_handle(own: Hand, *, is_short: bool = False) -> list[FloatArray]:
    """Return the targets (k, 3) of the handle along the path of `hand`."""
    return [own.targets(turn, aside) for turn, aside in hand(is_short=is_short)]


def way_of_tip(session: Session, own: Hand, *, is_short: bool = False) -> list[FloatArray]:
    """Return where the point at the tip is pulled to, (3,) each, along the path of `hand`."""
    start, path = own.point.at(session.vertices), hand(is_short=is_short)
    return [own.pulled_to(turn, aside, start=start) for turn, aside in path]


def frames(
    session: Session,
    goals: Sequence[FloatArray],
    pulled: SurfacePoint | None,
    limit: int | None = None,
) -> Iterator[Drag]:
    """Drag the handle of *session* along its targets, or the point *pulled*.

    After each frame the drag so far is given.  *limit* is the number of steps of a frame, at most;
    None: that of the widgets.
    """
    x = session.vertices
    move: Callable[..., Solution] = session.drag
    before = x[session.state.handle] if pulled is None else pulled.at(x)
    if pulled is not None:
        move = partial(session.pull, pulled)
    drag, steps, diagonal, last = Drag(), limit or STEPS, session.mesh.diagonal, x
    for goal in goals:
        moved = float(np.linalg.norm(goal - before, axis=-1).max())
        if moved == 0.0 and not session.is_unsettled:
            continue
        began = time.process_time()
        solve = partial(move, goal) if moved > 0.0 else session.refine
        solution = solve(max_steps=steps)
        drag.seconds.append(time.process_time() - began)
        x, before = session.vertices, goal
        jump = float(np.linalg.norm(x - last, axis=1).max()) / max(moved, 1e-300)
        drag.jumps.append(jump if moved > _LEAST_MOTION * diagonal else np.nan)
        drag.steps.append(solution.steps)
        drag.volumes.append(max(abs(session.volume_change), solution.volume_error))
        last = x
        yield drag


def converged(session: Session, preparation: Preparation) -> FloatArray:
    """Return the converged pose (n, 3) for the targets of *session*, from its pose."""
    other = Session(session.mesh, state=session.state)
    other.accept(preparation)
    return other.refine(max_steps=_MOST_STEPS).vertices


def _angles(corners: FloatArray, first: IntArray, second: IntArray) -> FloatArray:
    """Return the angles (e,) between adjacent faces, positive where the surface is convex."""
    a, b, c = corners.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    p, q, middles = normals[first], normals[second], corners.mean(axis=1)
    sign = np.sign(np.einsum("ij,ij->i", p, middles[first] - middles[second]))
    cosine = np.clip(np.einsum("ij,ij->i", p, q), -1.0, 1.0)
    return np.asarray(sign * np.arccos(cosine))
