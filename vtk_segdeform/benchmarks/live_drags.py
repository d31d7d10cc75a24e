"""Live drags: the steps of a frame, and how far shown poses are from converged ones.

A frame is one move of the pointer, solved as the widgets do it: poses that are estimated to be near
a converged one, in the steps of one event (`Session.drag` with ``within``).  Its error is the
largest distance of a vertex, farther from the hand than the radius of a pull, from its place in the
converged pose for the targets that the frame has reached, in percent of the diagonal.

The drags move a handle or pull a point along three axes, and rotate it about them; *jerks* move by
up to a quarter of the diagonal at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from statistics import median
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray
from ..mesh import Mesh
from ..progress import Progress, tell
from ..session import Preparation, Session
from ..solver import Solution, Status
from .sections import Table

_WITHIN, _STEPS = 0.0025, 4  # of the widgets: diagonals, and steps of an event
_HAND = 0.15  # diagonals: vertices nearer to the pulled point are near the hand
_FIXED, _HANDLE = 0.08, 0.08  # shares of the height, of the diagonal
_ANGLE = 4.0  # radians of a rotation for a motion by a diagonal
_FAST = tuple(0.03 * (k + 1) for k in range(10))  # places of the hand, in diagonals
_JERKS = 0.02, 0.25, 0.25, -0.1, 0.2
_MOST_REFINEMENTS = 12

_Solve = Callable[..., Solution]


class LiveFrame(NamedTuple):
    """One frame of a live drag."""

    steps: int
    seconds: float
    error: float
    """In diagonals; 0 if the frame shows the pose of the one before."""
    is_shown: bool
    """Whether it shows a new pose."""


def live_frames(
    session: Session, preparation: Preparation, moves: list[_Solve], hand: FloatArray
) -> Iterator[LiveFrame]:
    """Make *moves* of a drag at *hand* (3,); each is called with its limits."""
    far = np.linalg.norm(session.mesh.vertices - hand, axis=1) > _HAND * session.mesh.diagonal
    for move in moves:
        before, began = session.vertices, time.perf_counter()
        solution = move(max_steps=_STEPS, within=_WITHIN)
        seconds = time.perf_counter() - began
        error, is_shown = 0.0, session.vertices is not before
        if is_shown:
            away = np.linalg.norm(converged(session, preparation) - session.vertices, axis=1)[far]
            error = float(away.max(initial=0.0)) / session.mesh.diagonal
        yield LiveFrame(solution.steps, seconds, error, is_shown)


def converged(session: Session, preparation: Preparation) -> FloatArray:
    """Return the converged pose (n, 3) for the targets that the current pose has reached."""
    state, solution = session.state, session.solution
    if state.pose is not None and solution is not None and solution.targets is not None:
        names, lengths = list(state.handles), [len(ids) for ids in state.handles.values()]
        parts = np.split(solution.targets, np.cumsum(lengths)[:-1])
        targets = dict(zip(names, parts, strict=True))
        state = replace(state, pose=replace(state.pose, targets=targets))
    other = Session(session.mesh, state=state)
    other.accept(preparation)
    for _ in range(_MOST_REFINEMENTS):
        if other.refine().status is not Status.STEP_LIMIT:
            break
    return other.vertices


def live_table(bodies: dict[str, Mesh], progress: Progress | None = None) -> Table:
    """Return the frames of all drags of *bodies*, a row for each kind of drag."""
    rows = []
    for k, (name, mesh) in enumerate(bodies.items()):
        tell(progress, k / len(bodies), f"live drags of {name}")
        preparation = Session(mesh).preparation()
        for kind in ("handle", "pull"):
            for way, places in (("shift", _FAST), ("turn", _FAST), ("jerk", _JERKS)):
                frames: list[LiveFrame] = []
                for axis in range(3):
                    session = Session(mesh)
                    session.accept(preparation)
                    moves, hand = _drag(session, kind, way == "turn", axis, places)
                    frames += live_frames(session, preparation, moves, hand)
                steps = [frame.steps for frame in frames]
                rows.append(
                    (
                        name,
                        f"{kind}, {way}",
                        float(median(steps)),
                        float(np.quantile(steps, 0.9)),
                        100.0 * max(frame.error for frame in frames),
                        1e3 * median(frame.seconds for frame in frames),
                        100.0 * float(np.mean([frame.is_shown for frame in frames])),
                    )
                )
    head = "body", "drag", "steps", "steps, 90 %", "error, %", "solve, ms", "frames shown, %"
    return Table(head, rows, "live drags: steps of a frame, and errors far from the hand")


def _drag(
    session: Session, kind: str, turns: bool, axis: int, places: tuple[float, ...]
) -> tuple[list[_Solve], FloatArray]:
    """Return the moves of a drag of the top of the mesh, and where that is."""
    mesh = session.mesh
    height = mesh.vertices[:, int(np.ptp(mesh.vertices, axis=0).argmax())]
    top = int(height.argmax())
    hand = mesh.vertices[top]
    if kind == "handle":
        fixed = height < height.min() + _FIXED * np.ptp(height)
        near = np.linalg.norm(mesh.vertices - hand, axis=1) < _HANDLE * mesh.diagonal
        session.set_fixed(fixed)
        session.add_handle(near & ~fixed, "top")
    moves: list[_Solve] = []
    for place in places:
        motion = np.eye(4)
        if turns:
            motion[:3, :3] = Rotation.from_rotvec(_ANGLE * place * np.eye(3)[axis]).as_matrix()
            motion[:3, 3] = hand - motion[:3, :3] @ hand
        else:
            motion[axis, 3] = place * mesh.diagonal
        if kind == "handle":
            moves.append(partial(session.move_handle, "top", motion))
        else:
            moves.append(partial(session.pull, top, motion if turns else hand + motion[:3, 3]))
    return moves, hand
