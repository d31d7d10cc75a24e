"""``segdeform bench --interactive``: live pulls, and how far their poses are from converged ones.

The top of a cactus is pulled along prescribed paths, in prescribed steps and without a window.

    frame       solving one move of the pointer, median
    steps       of the solver in a frame, median and 90 %
    frozen      longest time in which no frame shows a new pose
    error       largest distance between a shown pose and the converged one for the same targets,
                in percent of the diagonal, over vertices farther from the hand than the radius
    lag         largest distance of the pulled vertex from its target, in percent of the diagonal
    volume      largest relative volume error of all frames
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

from ..arrays import FloatArray
from ..models import cactus
from ..progress import Progress, part, tell
from ..session import Preparation, Session
from ..solver import Status

_PATHS = {  # places of the pointer, in diagonals
    "slow": np.linspace(0.0, 0.15, 31)[1:],
    "fast": np.linspace(0.0, 0.3, 11)[1:],
    "jerky": np.array([0.02, 0.25, 0.25, -0.1, -0.1, 0.2, 0.02, 0.3]),
}
_STEPS = 3  # of an event, as in the widgets
_RADIUS = 0.15  # diagonals, of a pull by default
_MOST_REFINEMENTS = 12
_HEAD = (
    "| vertices | pull | frame ms | steps | steps, 90 % | frozen ms | error % | lag % | volume |"
)


def pull_table(
    *,
    sizes: tuple[int, ...] = (5430, 50_000),
    pulls: tuple[str, ...] = tuple(_PATHS),
    progress: Progress | None = None,
) -> str:
    """Return the measurements as a Markdown table, with a row for each size and each of *pulls*."""
    lines = [_HEAD, "|" + "---:|" * (_HEAD.count("|") - 1)]
    for k, size in enumerate(sizes):
        own = part(progress, k / len(sizes), (k + 1) / len(sizes))
        mesh = cactus(size)
        preparation = Session(mesh).preparation(part(own, 0.0, 0.3))
        for n, name in enumerate(pulls):
            tell(own, 0.3 + 0.7 * n / len(pulls), f"pulling: {name}")
            session = Session(mesh)
            session.accept(preparation)
            row = _row(session, preparation, _PATHS[name])
            lines.append(f"| {mesh.n_vertices} | {name} | {row} |")
    return "\n".join(lines)


def _row(session: Session, preparation: Preparation, path: FloatArray) -> str:
    mesh = session.mesh
    top = int(mesh.vertices[:, 2].argmax())
    start, far = mesh.vertices[top], np.linalg.norm(mesh.vertices - mesh.vertices[top], axis=1)
    is_far = far > _RADIUS * mesh.diagonal
    times, steps, error, lag, volume, waited, frozen = [], [], 0.0, 0.0, 0.0, 0.0, 0.0
    session.pull(top, start, max_steps=1)  # the press
    for place in path:
        before, began = session.vertices, time.perf_counter()
        to = start + [place * mesh.diagonal, 0.0, 0.0]
        solution = session.pull(top, to, max_steps=_STEPS)
        times.append(1e3 * (time.perf_counter() - began))
        steps.append(solution.steps)
        is_new = session.vertices is not before
        waited = 0.0 if is_new else waited + times[-1]
        frozen, volume = max(frozen, waited), max(volume, abs(session.volume_change))
        if is_new:
            lag = max(lag, float(np.linalg.norm(session.vertices[top] - to)))
            off = np.linalg.norm(converged(session, preparation) - session.vertices, axis=1)
            error = max(error, float(off[is_far].max(initial=0.0)))
    share = 100.0 / mesh.diagonal
    return (
        f"{median(times):.1f} | {median(steps):.0f} | {np.quantile(steps, 0.9):.0f} | "
        f"{frozen:.0f} | {share * error:.2f} | {share * lag:.2f} | {volume:.0e}"
    )


def converged(session: Session, preparation: Preparation) -> FloatArray:
    """Return the converged pose (n, 3) for the targets of *session*."""
    other = Session(session.mesh, state=session.state)
    other.accept(preparation)
    for _ in range(_MOST_REFINEMENTS):
        if other.refine().status is not Status.STEP_LIMIT:
            break
    return other.vertices
