"""``segdeform bench --interactive --open``: open a mesh file and drag at once, off-screen.

An editor in mode PULL opens a file in its event loop.  As soon as the mesh is drawn, the button is
pressed at a random vertex, and the pointer moves on until the surface has followed it for a while.

    drawn       from opening the file to the first picture of the mesh
    press       handling the press, which may draw the view
    followed    from opening the file to the first picture in which the grabbed vertex moved by at
                least half the motion of the pointer
    cpu         processor time of all threads from opening the file until then: what it takes on an
                idle machine if nothing ran in parallel
    bound       from opening the file to the first picture of a pose of the mesh itself
    draw        drawing one picture by OpenGL, median
    gap         longest turn of the event loop until it is bound, without the drawing in it
    again       a second press, at another vertex, and the first move after it
    error       largest relative volume error of all pictures

Until the mesh is bound, its stand-in is pulled and shown; see `session.StandIn`.

Each size runs in its own process, with neither kernels loaded nor a binding cached.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..benchmarks import in_own_process
from ..errors import MissingDependencyError
from ..geometry import signed_volume
from ..io import write_mesh
from ..models import cactus, sphere
from ..pictures import require_offscreen
from ..progress import Progress, tell
from ..session import Session
from ..widgets import DeformEditor, Mode
from ..widgets.films import OffScreen
from ..widgets.scene import Phase, Pointer

_SIZE = (800, 600)  # window size in pixels
_GOALS = {5430: 1.0, 50_000: 2.5, 1_000_000: 8.0}  # seconds until the surface follows
DRAWN_SIZES = tuple(_GOALS)
_HEAD = (
    "| vertices | drawn s | press ms | followed s | goal | cpu s | bound s | draw ms | gap ms "
    "| again ms | error |"
)
_STEP, _MOVES, _TURN = 5.0, 20, 0.01  # pixels per move, moves that are followed, seconds per turn
_NEAR = 0.02  # between a visible vertex and the surface at its pixel
_LONGEST = 120.0  # seconds until the surface must follow


def opening_table(
    *, sizes: tuple[int, ...] = DRAWN_SIZES[:2], progress: Progress | None = None
) -> str:
    """Return the measurements as a Markdown table with a row for each mesh.

    Parameters
    ----------
    sizes : tuple of int
        Numbers of vertices of the cactus.
    progress : Progress, optional
        Callback; it can cancel.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering fails.
    """
    lines = [
        f"a cactus opened from a file and dragged at once, in a window of {_SIZE[0]} x {_SIZE[1]}",
        "",
        _HEAD,
        "|" + "---:|" * (_HEAD.count("|") - 1),
    ]
    for k, size in enumerate(sizes):
        tell(progress, k / len(sizes), f"opening {size} vertices")
        lines.append(in_own_process(opening_row, size))
    return "\n".join(lines)


def opening_row(size: int) -> str:
    """Return the row of one mesh size, measured in this process."""
    require_offscreen()
    os.environ["SEGDEFORM_CACHE"] = "0"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "cactus.ply"
        mesh = cactus(size)
        write_mesh(path, mesh)
        del mesh
        run = _Run.of(path)
    goal = next((f"{s / run.followed:.2g} x" for n, s in _GOALS.items() if n == size), "–")
    return (
        f"| {size} | {run.drawn:.2f} | {1e3 * run.press:.0f} | {run.followed:.2f} | {goal} "
        f"| {run.cpu:.2f} | {run.bound:.2f} | {1e3 * median(run.draws):.0f} | {1e3 * run.gap:.0f} "
        f"| {1e3 * run.again:.0f} | {run.error:.1e} |"
    )


@dataclass
class _Run:
    """Times in seconds, and the largest relative volume error."""

    drawn: float = np.nan
    press: float = np.nan
    followed: float = np.nan
    cpu: float = np.nan
    bound: float = np.nan
    gap: float = 0.0
    again: float = np.nan
    error: float = 0.0
    draws: list[float] = field(default_factory=list)

    @classmethod
    def of(cls, path: Path) -> _Run:
        run, start = cls(), Session(sphere(300))
        with OffScreen(start, _SIZE) as window:
            window.surface.remove()
            editor = DeformEditor(window.view, start)
            editor.mode = Mode.PULL
            window.view.render()
            try:
                run._measure(editor, path)
            finally:
                editor.remove()
        return run

    def _measure(self, editor: DeformEditor, path: Path) -> None:
        view, first, rng = editor.view, editor.session, np.random.default_rng(3)
        began, cpu = time.perf_counter(), time.process_time()
        place: FloatArray | None = None
        vertex, at, volume = -1, np.zeros(2), np.nan

        def pictured(*_: object) -> None:
            session, now = editor.session, time.perf_counter() - began
            if session is first:
                return
            if np.isnan(self.drawn):
                self.drawn = now
            if vertex < 0:
                return
            shown = editor.widgets.surface.points
            self.error = max(self.error, abs(_volume(editor, shown) / volume - 1.0))
            if np.isnan(self.followed) and _follows(editor, vertex, at):
                self.followed, self.cpu = now, time.process_time() - cpu
            if np.isnan(self.bound) and session.is_dragging:
                self.bound = now

        drawing: list[float] = []
        tags = [
            view.window.AddObserver("StartEvent", lambda *_: drawing.append(time.perf_counter())),
            view.window.AddObserver(
                "EndEvent", lambda *_: self.draws.append(time.perf_counter() - drawing.pop())
            ),
        ]
        tag = view.renderer.AddObserver("EndEvent", pictured)
        editor.On()
        editor.controller.open(path)
        moves, last = 0, time.perf_counter()
        while moves < _MOVES:
            n_drawn = len(self.draws)
            view.interactor.InvokeEvent("TimerEvent")
            if place is None and not np.isnan(self.drawn) and not editor.is_busy:
                volume = _volume(editor, editor.session.mesh.vertices)
                vertex, place = _random_place(editor, rng)
                self.press = _send(view, "LeftButtonPressEvent", place)
            elif place is not None:
                moves += not np.isnan(self.bound)
                angle = 0.3 * moves if moves else 0.05 * time.perf_counter()
                at = (_STEP * (4 + moves)) * np.array([np.cos(angle), np.sin(angle)])
                _send(view, "MouseMoveEvent", place + at)
            now = time.perf_counter()
            if np.isnan(self.bound) or moves <= 1:
                self.gap = max(self.gap, now - last - sum(self.draws[n_drawn:]))
            if now - began > _LONGEST:
                raise MissingDependencyError(f"the surface did not follow: {editor.status}")
            time.sleep(max(0.0, _TURN - (now - last)))
            last = time.perf_counter()
        assert place is not None
        _send(view, "LeftButtonReleaseEvent", place + at)
        _, place = _random_place(editor, rng)
        self.again = _send(view, "LeftButtonPressEvent", place)
        self.again += _send(view, "MouseMoveEvent", place + 2.0 * _STEP)
        _send(view, "LeftButtonReleaseEvent", place + 2.0 * _STEP)
        view.renderer.RemoveObserver(tag)
        for each in tags:
            view.window.RemoveObserver(each)


def _random_place(editor: DeformEditor, rng: np.random.Generator) -> tuple[int, FloatArray]:
    """Return a random visible vertex, and its pixel (2,)."""
    view, session = editor.view, editor.session
    while True:
        vertex = rng.integers(session.mesh.n_vertices)
        place = np.round(view.to_display(session.vertices[[vertex]])[0, :2])
        point = editor.widgets.point_at(Pointer(Phase.PRESS, *place))
        if point is not None and np.linalg.norm(point - session.vertices[vertex]) < _NEAR:
            return int(vertex), np.asarray(place)


def _volume(editor: DeformEditor, vertices: FloatArray) -> float:
    return signed_volume(vertices, editor.session.mesh.faces)


def _follows(editor: DeformEditor, vertex: int, at: FloatArray) -> bool:
    """Return whether *vertex* is shown half of *at* (2,), in pixels, from its place at rest."""
    places = editor.session.mesh.vertices[vertex], editor.widgets.surface.points[vertex]
    seen = editor.view.to_display(np.vstack(places))
    return bool(np.linalg.norm((seen[1] - seen[0])[:2]) > 0.5 * np.linalg.norm(at))


def _send(view: Any, event: str, place: FloatArray) -> float:
    """Send one event, and return the seconds until it was handled."""
    x, y = (round(float(p)) for p in place)
    view.interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, None)
    began = time.perf_counter()
    view.interactor.InvokeEvent(event)
    return time.perf_counter() - began
