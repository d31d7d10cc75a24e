"""From opening a mesh file to a surface that follows the pointer, in an editor off-screen.

An editor in mode PULL opens a cactus in its event loop.  As soon as the mesh is drawn, the button
is pressed at a random vertex, and the pointer moves on until the mesh itself has followed it for a
while; until it is bound, its stand-in does (`session.StandIn`).  Each size runs in its own process,
with neither kernels loaded nor a binding cached.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..errors import MissingDependencyError
from ..io import write_mesh
from ..models import cactus, sphere
from ..pictures import require_offscreen
from ..progress import Progress, tell
from ..session import Session
from ..widgets import DeformEditor, Mode
from ..widgets.films import off_screen
from ..widgets.scene import Phase, Pointer
from .measuring import in_own_process
from .results import Scale, Section, Table

_SIZE = (800, 600)  # window size in pixels
_STEP, _MOVES, _TURN = 5.0, 20, 0.01  # pixels per move, moves that are followed, seconds per turn
_NEAR = 0.02  # between a visible vertex and the surface at its pixel
_LONGEST = 300.0  # seconds until the surface must follow
_COLUMNS = ("vertices", "drawn, s", "press, ms", "followed, s", "processor, s", "bound, s")
_TEXT = f"""\
A cactus is opened from a file and pulled at once, in a window of {_SIZE[0]} x {_SIZE[1]}. \
*Drawn* and *followed* are the seconds from opening the file to the first picture of the mesh, and \
to the first in which the grabbed vertex has moved by at least half the motion of the pointer; \
*processor* is the processor time of all threads until then, *bound* the time until the mesh \
itself is pulled instead of its stand-in. *Press* is the handling of the press."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a row for every size of *scale*."""
    rows, skipped = [], []
    for k, size in enumerate(scale.drag_sizes):
        tell(progress, k / len(scale.drag_sizes), f"opening {size} vertices")
        try:
            rows.append(in_own_process(opened, size))
        except MissingDependencyError as fault:
            skipped.append(f"{size} vertices: {fault}")
    tables = [Table(_COLUMNS, rows, "from a file to a drag")]
    return Section("Opening a file", _TEXT, tables, skipped)


def opened(size: int) -> tuple[float, ...]:
    """Return the row of one mesh size, measured in this process."""
    require_offscreen()
    os.environ["SEGDEFORM_CACHE"] = "0"
    with TemporaryDirectory() as folder, off_screen(start := Session(sphere(300)), _SIZE) as view:
        path = Path(folder) / "cactus.ply"
        write_mesh(path, cactus(size))
        view.renderer.RemoveAllViewProps()  # the editor draws the surface itself
        editor = DeformEditor(view, start)
        editor.mode = Mode.PULL
        view.render()
        try:
            run = _Run(editor)
            run.open_and_pull(path)
        finally:
            editor.remove()
    return size, run.drawn, 1e3 * run.press, run.followed, run.processor, run.bound


@dataclass
class _Run:
    """What happened so far; times in seconds from opening the file."""

    editor: DeformEditor
    drawn: float = np.nan
    press: float = np.nan
    followed: float = np.nan
    processor: float = np.nan
    bound: float = np.nan
    vertex: int = -1
    at: FloatArray = field(default_factory=lambda: np.zeros(2))  # motion of the pointer, pixels

    def open_and_pull(self, path: Path) -> None:
        """Open a file, press at a vertex, and move until the mesh has followed."""
        editor, view = self.editor, self.editor.view
        first, rng = editor.session, np.random.default_rng(3)
        began, processor = time.perf_counter(), time.process_time()

        def pictured(*_: object) -> None:
            now = time.perf_counter() - began
            if editor.session is first:
                return
            self.drawn = now if np.isnan(self.drawn) else self.drawn
            if np.isnan(self.followed) and self._follows():
                self.followed, self.processor = now, time.process_time() - processor
            if np.isnan(self.bound) and self.vertex >= 0 and editor.session.is_dragging:
                self.bound = now

        tag = view.renderer.AddObserver("EndEvent", pictured)
        editor.On()
        editor.controller.open(path)
        place: FloatArray | None = None
        moves = 0
        while moves < _MOVES:
            turn = time.perf_counter()
            view.interactor.InvokeEvent("TimerEvent")
            if place is None and not np.isnan(self.drawn) and not editor.is_busy:
                self.vertex, place = self._random_place(rng)
                self.press = _send(view, "LeftButtonPressEvent", place)
            elif place is not None:
                moves += not np.isnan(self.bound)
                angle = 0.3 * moves if moves else 0.05 * time.perf_counter()
                self.at = (_STEP * (4 + moves)) * np.array([np.cos(angle), np.sin(angle)])
                _send(view, "MouseMoveEvent", place + self.at)
            if turn - began > _LONGEST:
                raise MissingDependencyError(f"the surface did not follow: {editor.status}")
            time.sleep(max(0.0, _TURN - (time.perf_counter() - turn)))
        assert place is not None
        _send(view, "LeftButtonReleaseEvent", place + self.at)
        view.renderer.RemoveObserver(tag)

    def _random_place(self, rng: np.random.Generator) -> tuple[int, FloatArray]:
        """Return a random visible vertex, and its pixel (2,)."""
        view, session = self.editor.view, self.editor.session
        while True:
            vertex = rng.integers(session.mesh.n_vertices)
            place = np.round(view.to_display(session.vertices[[vertex]])[0, :2])
            point = self.editor.widgets.point_at(Pointer(Phase.PRESS, *place))
            if point is not None and np.linalg.norm(point - session.vertices[vertex]) < _NEAR:
                return int(vertex), np.asarray(place)

    def _follows(self) -> bool:
        """Return whether the vertex is shown half of `at` from its place at rest."""
        if self.vertex < 0:
            return False
        session, shown = self.editor.session, self.editor.widgets.surface.points
        seen = self.editor.view.to_display(
            np.vstack([session.mesh.vertices[self.vertex], shown[self.vertex]])
        )
        return bool(np.linalg.norm((seen[1] - seen[0])[:2]) > 0.5 * np.linalg.norm(self.at))


def _send(view: Any, event: str, place: FloatArray) -> float:
    """Send one event, and return the seconds until it was handled."""
    x, y = (round(float(p)) for p in place)
    view.interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, None)
    began = time.perf_counter()
    view.interactor.InvokeEvent(event)
    return time.perf_counter() - began
