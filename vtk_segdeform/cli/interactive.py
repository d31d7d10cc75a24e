"""``segdeform bench --interactive``: time the parts of a drag by mouse events, off-screen.

    solve       from the mouse event to the new pose; each step of the solver includes x = W~ p
    map         copying the vertex positions into the rendered mesh
    overlay     local volume change, its colours and label
    normals     normals of the deformed mesh
    render      drawing by OpenGL

A session notifies listeners in the order in which they were added, so that the parts are separated
by listeners that record the time: one added before the mesh display, one after it, and one after
the overlay.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

from ..cages import fit_cages
from ..models import cactus
from ..progress import Progress, part
from ..regions import segment
from ..session import Change, Session
from ..widgets.films import OffScreen
from ..widgets.handle_dragger import HandleDragger
from ..widgets.scene import Phase
from ..widgets.volume_overlay import VolumeOverlay
from .demo import bent_top

_SIZE = (800, 600)  # window size in pixels
_STAGES = ("solve", "map", "overlay", "normals", "render")
_HEAD = "| vertices | event ms | solve | map | overlay | normals | render | steps | solve + map |"
_SWING = 0.15  # length of the drag, as a fraction of the window height


def interactive_table(
    *,
    sizes: tuple[int, ...] = (5430, 50_000),
    n_cage_vertices: int = 155,
    moves: int = 30,
    progress: Progress | None = None,
) -> str:
    """Return the median times over a drag as a Markdown table with a row for each mesh.

    Parameters
    ----------
    sizes : tuple of int
        Numbers of vertices of the cactus.
    n_cage_vertices : int
        Total of its three cages.
    moves : int
        Number of mouse moves.
    progress : Progress, optional
        Callback; it can cancel.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering fails.
    """
    lines = [
        f"cactus, 3 regions, {n_cage_vertices} cage vertices, {moves} moves of a drag in a window "
        f"of {_SIZE[0]} x {_SIZE[1]}; medians in milliseconds",
        "",
        _HEAD,
        "|" + "---:|" * (_HEAD.count("|") - 1),
    ]
    for k, size in enumerate(sizes):
        step = part(progress, k / len(sizes), (k + 1) / len(sizes))
        lines.append(_row(size, n_cage_vertices, moves, step))
    return "\n".join(lines)


def _row(size: int, n_cage_vertices: int, moves: int, progress: Progress | None) -> str:
    session = _ready(size, n_cage_vertices, part(progress, 0.0, 0.8))
    times: dict[str, list[float]] = {stage: [] for stage in ("event", "steps", *_STAGES)}
    stamps: list[float] = []

    def stamp(change: Change) -> None:
        if change & Change.POSE:
            stamps.append(time.perf_counter())

    session.on_change(stamp)
    with OffScreen(session, _SIZE) as window:
        view, surface = window.view, window.surface
        session.on_change(stamp)
        overlay = VolumeOverlay(view, session, surface)
        overlay.show()
        session.on_change(stamp)
        dragger = HandleDragger(view, session, surface)
        dragger.refine_while_resting = False
        dragger.On()
        view.render()
        centre = dragger.gizmo.centre
        assert centre is not None
        start = view.to_display(centre[None])[0, :2]
        swing = _SWING * _SIZE[1] * np.sin(np.linspace(0.0, np.pi, moves + 2)[1:-1])
        _send(view.interactor, "LeftButtonPressEvent", start)
        for across in swing:
            stamps.clear()
            began = time.perf_counter()
            _send(view.interactor, "MouseMoveEvent", start + [across, 0.0])
            ended = time.perf_counter()
            solved, mapped, overlaid = stamps[:3]
            # The event updates the normals as part of the map: time them by a second update.
            again = time.perf_counter()
            surface.update_normals()
            normals = time.perf_counter() - again
            shown = max(mapped - solved - normals, 0.0)
            spent = (solved - began, shown, overlaid - mapped, normals, ended - overlaid)
            for stage, seconds in zip(_STAGES, spent, strict=True):
                times[stage].append(1e3 * seconds)
            times["event"].append(1e3 * (ended - began))
            times["steps"].append(session.solution.steps if session.solution else 0)
        _send(view.interactor, "LeftButtonReleaseEvent", view.pointer(Phase.RELEASE).position)
        for widget in (dragger, overlay):
            widget.remove()
    of = {name: median(values) for name, values in times.items()}
    share = (of["solve"] + of["map"]) / of["event"]
    return (
        f"| {session.mesh.n_vertices} | {of['event']:.1f} | "
        + " | ".join(f"{of[stage]:.1f}" for stage in _STAGES)
        + f" | {of['steps']:.0f} | {100 * share:.0f} % |"
    )


def _ready(size: int, n_cage_vertices: int, progress: Progress | None) -> Session:
    """Return a session of a cactus with cages and a handle, bound."""
    mesh = cactus(size)
    pose = bent_top(mesh, np.radians(60.0))
    session = Session(mesh)
    session.set_regions(segment(mesh, 3, progress=part(progress, 0.0, 0.2)))
    assert session.regions is not None
    cages = fit_cages(mesh, session.regions, n_cage_vertices, progress=part(progress, 0.2, 0.5))
    session.set_cages(cages)
    session.set_fixed(pose.fixed)
    session.handles.add(pose.handle)
    session.bind(part(progress, 0.5, 1.0))
    return session


def _send(interactor: object, event: str, place: np.ndarray) -> None:
    x, y = (round(float(p)) for p in place)
    interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, None)  # type: ignore[attr-defined]
    interactor.InvokeEvent(event)  # type: ignore[attr-defined]
