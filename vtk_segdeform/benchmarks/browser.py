"""A drag in the browser beside the same drag in process.

in process   the editor in an off-screen window: a move is followed by a picture; meanwhile moves
             are replaced by later ones
server       the editor in a Chromium without WebGL, so that the server draws
page         the same with WebGL; the page draws from W~ and the moves of the cage vertices

The mouse moves sixty times a second along a prescribed path, in Chromium by its own events.  A
picture is shown when the browser begins the next one; its latency is counted from the latest event
that it shows.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingDependencyError
from ..interpreter import spawning
from ..progress import Progress, tell
from ..session import Session
from .chromium import Chromium, ticks
from .measuring import in_own_process
from .scale import Scale
from .sections import Ratio, Section, Table
from .tasks import bent_cactus, prepare

_SIZE = 1400, 900  # pixels of the page
_RATE = 60.0  # moves per second
_WARM_UP, _MOVES = 60, 240  # moves; the first ones are not measured
_ROUNDS = 3  # of all drags, by turns: the speed of a shared machine varies
_SWING = 0.12, 0.04  # heights of the view, across and upwards
_PERIODS = 1.5, 1.0  # seconds
_TICK = 0.04  # seconds between two timer events in process
_REMOTE = 0.7  # frames of the server's drawing, at least, in those of the process
_DRAWN = {5430: 25.0, 50_000: 15.0}  # vertices: frames per second of the page, at least
_HEAD = (
    "vertices", "drawn", "frames / s", "latency, 50 %, ms", "latency, 95 %, ms", "bytes / frame",
    "server, ms / frame", "page, ms / frame", "graphics, ms / frame", "browser, ms / frame",
)  # fmt: skip
_SCRIPT = """
window.bench = { bytes: 0, frames: [] };
localStorage.setItem('segdeform drawing', '%s');
localStorage.setItem('segdeform steps seen', 'yes');
const Native = WebSocket;
window.WebSocket = class extends Native {
  constructor(...words) {
    super(...words);
    this.addEventListener('message', ({ data }) => {
      bench.bytes += data.byteLength ?? data.size ?? data.length;
    });
  }
};
new MutationObserver((changes) => changes.forEach(({ target }) => {
  const time = Number(target.dataset.time);
  requestAnimationFrame((now) => bench.frames.push([performance.now(), time]));
})).observe(document, { subtree: true, attributes: true, attributeFilter: ['data-number'] });
"""
_PICTURE = "Number(document.querySelector('canvas')?.dataset.number) > 0"
_SURFACE = "document.querySelector('.sd-live')?.dataset.surface > 0"


@dataclass(frozen=True)
class Drag:
    """What was measured during a drag."""

    frames: float  # per second
    latencies: tuple[float, float]  # milliseconds: median and 95 %
    size: float = math.nan  # bytes of a frame
    processors: tuple[float, ...] = ()  # milliseconds of a frame: see the table
    view: tuple[int, int] = _SIZE  # pixels


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the drags of the sizes of *scale* up to 50,000 vertices."""
    sizes = [size for size in scale.drag_sizes if size <= max(_DRAWN)]
    rows: list[tuple[Any, ...]] = []
    ratios, skipped = [], []
    for k, size in enumerate(sizes):
        runs: dict[str, list[Drag]] = {}
        works: dict[str, Callable[[], Drag]] = {
            "by the server": lambda: _in_browser(size, scale, draws=False),  # noqa: B023
            "by the page": lambda: _in_browser(size, scale, draws=True),  # noqa: B023
            "in process": lambda: in_own_process(in_process, size, scale, _view_of(runs)),  # noqa: B023
        }
        for n, name in enumerate(_ROUNDS * tuple(works)):
            share = n / (_ROUNDS * len(works))
            tell(progress, (k + share) / len(sizes), f"drag {name}, {size} vertices")
            if name not in works:
                continue
            try:
                drag = works[name]()
                runs.setdefault(name, []).append(drag)
            except MissingDependencyError as missing:
                del works[name]
                skipped.append(f"drag {name}, {size} vertices: {missing}")
        found = {name: _middle(drags) for name, drags in runs.items()}
        rows += [_row(size, name, drag) for name, drag in found.items()]
        rate = {name: drag.frames for name, drag in found.items()}
        if {"by the server", "in process"} <= rate.keys():
            share = rate["by the server"] / rate["in process"]
            what = f"frames by the server / in process, {size:,} vertices"
            ratios.append(Ratio(what, share, _REMOTE, at_most=False))
        if "by the page" in rate and size in _DRAWN:
            what = f"frames per second by the page, {size:,} vertices"
            ratios.append(Ratio(what, rate["by the page"], _DRAWN[size], at_most=False))
    return Section(
        "In the browser",
        text=[
            f"The top of a cactus with 3 regions and {scale.n_cage_vertices} cage vertices is "
            f"pulled to and fro, by {_RATE:.0f} moves of the mouse a second, for "
            f"{_MOVES / _RATE:.0f} s in a page of {_SIZE[0]} x {_SIZE[1]} pixels. Chromium has "
            "WebGL in software (SwiftShader) where the page draws, and none where the server does. "
            "*Latency* is the time from an event of the mouse to the picture that shows it. Each "
            f"drag is repeated {_ROUNDS} times, by turns, and the repetition with the median frame "
            "rate is listed. The last four columns are processor time over all cores, of the "
            "server and of Chromium's renderer, graphics and other processes."
        ],
        tables=[Table(_HEAD, rows)],
        ratios=ratios,
        skipped=skipped,
    )


def _view_of(runs: dict[str, list[Drag]]) -> tuple[int, int]:
    """Return the size of the view in the page, if it was drawn in there."""
    return next((drags[0].view for drags in runs.values()), _SIZE)


def _middle(drags: list[Drag]) -> Drag:
    """Return the drag with the median of frames."""
    return sorted(drags, key=lambda drag: drag.frames)[len(drags) // 2]


def _row(size: int, name: str, drag: Drag) -> tuple[Any, ...]:
    rest = drag.processors + (math.nan,) * (4 - len(drag.processors))
    return size, name, drag.frames, *drag.latencies, drag.size, *rest


def ready_session(size: int, scale: Scale) -> tuple[Session, int]:
    """Return a session of a cactus with cages and a fixed foot, bound, and the vertex to pull."""
    task = bent_cactus(size)
    deformer = prepare(task, 3, scale.n_cage_vertices).deformer
    session = Session(task.mesh)
    session.set_regions(deformer.regions)
    session.set_cages(deformer.cages)
    session.set_fixed(task.fixed)
    session.bind()
    return session, int(task.mesh.vertices[:, 2].argmax())


def _places(start: tuple[float, float], height: float) -> Iterator[tuple[float, float]]:
    for k in range(_WARM_UP + _MOVES):
        x, y = (
            height * swing * math.sin(2.0 * math.pi * k / _RATE / period)
            for swing, period in zip(_SWING, _PERIODS, strict=True)
        )
        yield start[0] + x, start[1] - y


def _drag_of(frames: list[tuple[float, float]], seconds: float, **more: Any) -> Drag:
    """Return the drag of *frames*, for each when it was shown and its event, in seconds."""
    delays = 1e3 * np.array([shown - event for shown, event in frames])
    middle, most = (float(np.quantile(delays, q)) if len(delays) else math.nan for q in (0.5, 0.95))
    return Drag(len(frames) / seconds, (middle, most), **more)


# In process.


def in_process(size: int, scale: Scale, view_size: tuple[int, int] = _SIZE) -> Drag:
    """Return the drag in an off-screen window of *view_size*."""
    _require_trame()
    from ..widgets.web import WebEditor

    session, top = ready_session(size, scale)
    web = WebEditor(session)  # for its view, which nobody serves
    editor, view = web.editor, web.editor.view
    editor.controller.finishing.is_wanted = False
    view.host = None
    view.window.SetSize(*view_size)
    view.interactor.UpdateSize(*view_size)
    editor.controller.camera.viewpoint.frame(animate=False)
    view.draw()
    frames, used = _moves(view, _seen(view, session.vertices[top]))
    measured = [frame for frame in frames if frame[1] >= _WARM_UP / _RATE]
    web.close()
    each = 1e3 * used / max(len(measured), 1)
    return _drag_of(measured, _MOVES / _RATE, processors=(each,))


def _seen(view: Any, point: Any) -> tuple[float, float]:
    """Return where *view* shows a *point* (3,), in pixels from the upper left."""
    x, y = view.to_display(point[None])[0][:2]
    return float(x), view.window.GetSize()[1] - 1 - float(y)


def _moves(view: Any, start: tuple[float, float]) -> tuple[list[tuple[float, float]], float]:
    """Return when frames were shown, and the events they show; and the processor time."""
    interactor, height = view.interactor, view.window.GetSize()[1]
    places, frames = [*_places(start, height)], []

    def send(event: str, place: tuple[float, float]) -> None:
        x, y = round(place[0]), height - 1 - round(place[1])
        interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, None)
        interactor.InvokeEvent(event)

    send("MouseMoveEvent", start)
    send("LeftButtonPressEvent", start)
    began, last, ticked, used = time.perf_counter(), -1, 0.0, 0.0
    while last + 1 < len(places):
        now = time.perf_counter() - began
        due = min(int(now * _RATE), len(places) - 1)
        if due == last:
            if now - ticked > _TICK:
                ticked = now
                interactor.InvokeEvent("TimerEvent")
            else:
                time.sleep(max(0.0, (last + 1) / _RATE - now))
            continue
        if last < _WARM_UP <= due:
            used = time.process_time()
        send("MouseMoveEvent", places[due])
        view.window.WaitForCompletion()
        last = due
        frames.append((time.perf_counter() - began, due / _RATE))
    used = time.process_time() - used
    send("LeftButtonReleaseEvent", places[-1])
    return frames, used


# In the browser.


def _in_browser(size: int, scale: Scale, *, draws: bool) -> Drag:
    """Return the drag in Chromium; with *draws* the page draws, else the server."""
    _require_trame()
    ours, theirs = Pipe()
    with contextlib.ExitStack() as stack:
        browser = stack.enter_context(Chromium(_SIZE, webgl=draws))
        with spawning() as context:
            server = context.Process(target=_serve, args=(size, scale, theirs), daemon=True)
            server.start()
        theirs.close()
        stack.callback(server.kill)
        stack.callback(server.join, 20.0)
        stack.callback(ours.close)  # which ends the server
        port = ours.recv()
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=_SCRIPT % _word(draws))
        browser.call("Page.navigate", url=f"http://127.0.0.1:{port}/index.html")
        browser.wait(_PICTURE)
        if draws:
            browser.wait(_SURFACE)
        time.sleep(1.0)  # the view rests, and the page has its last picture
        ours.send("top")
        return _dragged(browser, ours.recv(), server.pid)


def _word(draws: bool) -> str:
    return "yes" if draws else "no"


def _require_trame() -> None:
    if find_spec("trame") is None:
        raise MissingDependencyError("the server needs trame; pip install 'vtk-segdeform[web]'")


def _dragged(browser: Chromium, top: tuple[float, float], server: int | None) -> Drag:
    """Drag from *top*, fractions of the view, and return what the page has seen."""
    left, high, width, height = browser.evaluate(
        "(({left, top, width, height}) => [left, top, width, height])"
        "(document.querySelector('.sd-canvas').getBoundingClientRect())"
    )
    start = left + top[0] * width, high + top[1] * height
    browser.mouse("mouseMoved", start, held=False)
    browser.mouse("mousePressed", start, held=True)
    first: dict[str, float] = {}
    before: tuple[float, ...] = ()
    began = time.perf_counter()
    for k, place in enumerate(_places(start, height)):
        time.sleep(max(0.0, k / _RATE - (time.perf_counter() - began)))
        if k == _WARM_UP:
            first = browser.evaluate("({ now: performance.now(), bytes: bench.bytes })")
            before = _used(browser, server)
        browser.mouse("mouseMoved", place, held=True)
    last = browser.evaluate("({ ...bench, now: performance.now() })")
    after = _used(browser, server)
    browser.mouse("mouseReleased", place, held=False)
    shown = [(1e-3 * a, 1e-3 * b) for a, b in last["frames"] if first["now"] < a <= last["now"]]
    frames = max(len(shown), 1)
    return _drag_of(
        shown,
        1e-3 * (last["now"] - first["now"]),
        size=(last["bytes"] - first["bytes"]) / frames,
        view=(round(width), round(height)),
        processors=tuple(1e3 * (b - a) / frames for a, b in zip(before, after, strict=True)),
    )


def _used(browser: Chromium, server: int | None) -> tuple[float, ...]:
    """Return the processor time of the server and of Chromium's processes, in seconds."""
    stat = Path(f"/proc/{server}/stat")
    if not stat.is_file():
        return (math.nan,) * 4
    own = ticks(stat.read_text().rpartition(")")[2].split())
    by_kind = browser.processors()
    page, graphics = by_kind.get("renderer", 0.0), by_kind.get("gpu-process", 0.0)
    return own, page, graphics, sum(by_kind.values()) - page - graphics


def _serve(size: int, scale: Scale, pipe: Any) -> None:
    """Serve the editor until *pipe* is closed; say where its top is when asked."""
    from ..widgets.web import WebEditor

    session, top = ready_session(size, scale)
    web = WebEditor(session)
    web.editor.controller.finishing.is_wanted = False

    async def served() -> None:
        ended, loop = asyncio.Event(), asyncio.get_running_loop()

        def answer() -> None:
            try:
                pipe.recv()
            except EOFError:
                loop.remove_reader(pipe.fileno())
                ended.set()
                return
            view = web.editor.view
            place = _seen(view, session.vertices[top])
            pipe.send(tuple(np.divide(place, view.window.GetSize()).tolist()))

        loop.add_reader(pipe.fileno(), answer)
        await web.serve_until(ended, ready=pipe.send)

    asyncio.run(served())
