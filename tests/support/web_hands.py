"""A `WebEditor` served by a thread, and a page of it in a real browser."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgpack
import pytest
from aiohttp import ClientSession
from chromium import Chromium, Page
from wslink.chunking import generate_chunks

T = TypeVar("T")
HELLO = {"id": "system:c0:0", "method": "wslink.hello", "args": [{"secret": "wslink-secret"}]}
STATE = {"id": "rpc:c0:9", "method": "trame.state.get", "args": []}
_SHOWN = "Number(document.querySelector('canvas')?.dataset.number) > 0"
_STEPS = "document.querySelectorAll('.sd-history .sd-row').length"
_WORK = "!!document.querySelector('.sd-work, .sd-progress')"


class Served:
    """The editor of *mesh*, served until the end of the ``with`` block.

    VTK's window belongs to the thread that serves it: use `call` for all but reading.  Meanwhile
    no thread searches for garbage, since it would free windows of the other one.
    """

    def __init__(self, mesh: Any, **keywords: Any) -> None:
        self._make = lambda: self._web_editor(mesh, keywords)
        self._started: Future[int] = Future()
        self._thread = threading.Thread(target=self._run)
        self.folder: Path = keywords.get("folder", Path())

    def __enter__(self) -> Served:
        gc.collect()
        gc.disable()
        self._thread.start()
        self.port = self._started.result(60)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            asyncio.run_coroutine_threadsafe(self.web.server.stop(), self.loop).result(20)
            self._thread.join(20)
        finally:
            gc.enable()
        assert not self._thread.is_alive()

    @property
    def url(self) -> str:
        """The address of the page."""
        return f"http://127.0.0.1:{self.port}/index.html"

    def call(self, function: Callable[[], T]) -> T:
        """Call *function* in the thread of the editor, and return its result."""

        async def called() -> T:
            return function()

        return asyncio.run_coroutine_threadsafe(called(), self.loop).result(20)

    def wait(self, condition: Callable[[], object], seconds: float = 40.0) -> None:
        """Wait until *condition* holds, which is called in the thread of the editor."""
        deadline = time.monotonic() + seconds
        while not self.call(condition):
            assert time.monotonic() < deadline, self.web.editor.status
            time.sleep(0.02)

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing is dragged, refined or computed."""
        editor = self.web.editor
        live = editor.widgets.puller, editor.widgets.dragger
        is_used = any(each.is_grabbing or each.is_refining for each in live)
        return not (is_used or editor.is_busy or editor.is_preparing)

    def page(self, browser: Chromium, **keywords: Any) -> Page:
        """Open the page, and wait for its first picture."""
        page = browser.page(self.url, **keywords)
        page.wait(_SHOWN, 60.0)
        self.wait(lambda: self.is_at_rest)
        return page

    def seen(self, page: Page, point: Any) -> tuple[float, float]:
        """Return where *page* shows a *point* (3,), in CSS pixels."""
        view = self.web.editor.view
        x, y = self.call(lambda: view.to_display(point[None])[0][:2])
        width, height = view.window.GetSize()
        left, top, wide, high = page.box(".sd-canvas")
        return left + wide * x / width, top + high * (1.0 - y / height)

    def _run(self) -> None:
        try:
            self.web = self._make()
            asyncio.run(self._serve())
            del self.web  # VTK's objects end in the thread that made them
            gc.collect()
        except BaseException as error:
            if not self._started.done():
                self._started.set_exception(error)
            raise

    async def _serve(self) -> None:
        self.loop = asyncio.get_running_loop()
        await self.web.serve(ready=self._started.set_result)

    @staticmethod
    def _web_editor(mesh: Any, keywords: dict[str, Any]) -> Any:
        from vtk_segdeform.widgets.web import WebEditor, web_editor

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(web_editor, "_SAMPLES", 0)  # multisampling in software takes long
            return WebEditor(mesh, **keywords)


def line(start: tuple[float, float], end: tuple[float, float], n: int) -> list[tuple[float, float]]:
    """Return *n* points from *start* to *end*."""
    (x, y), (u, v) = start, end
    return [(x + (u - x) * k / (n - 1), y + (v - y) * k / (n - 1)) for k in range(n)]


def only_file(folder: Path, pattern: str, seconds: float = 20.0) -> Path:
    """Wait for the one file that matches, and return it."""
    deadline = time.monotonic() + seconds
    while not (found := [*folder.glob(pattern)]):
        assert time.monotonic() < deadline, [*folder.iterdir()]
        time.sleep(0.05)
    return found[0]


def pull(
    page: Page, start: tuple[float, float], by: tuple[float, float], frame: Page | None = None
) -> None:
    """Pull the surface at *start*, and wait until the step is made and nothing is computed.

    The editor is in the *page* itself, or in a *frame* of it.
    """
    frame = frame or page
    before = frame.evaluate(_STEPS)
    page.drag(line(start, (start[0] + by[0], start[1] + by[1]), 8), pause=0.05)
    frame.wait(f"{_STEPS} > {before}")
    rested(frame)


def rested(page: Page) -> None:
    """Wait until the page shows a picture, and nothing is computed."""
    page.wait(_SHOWN, 120.0)
    since = time.monotonic()
    while time.monotonic() < since + 1.0:
        if page.evaluate(_WORK):
            since = time.monotonic()
        time.sleep(0.05)


def call(method: str, *args: Any, **more: Any) -> dict[str, Any]:
    return {"id": "rpc:c0:1", "method": method, "args": [*args], **more}


@asynccontextmanager
async def connected(url: str, *, enters: bool = True):
    """Connect as a page; yield a function that sends a message, and one that returns all answers.

    It sends `STATE` and waits for that answer, too, so the connection still works.
    """
    async with ClientSession() as session, session.ws_connect(url) as socket:

        async def send(message):
            if isinstance(message, str):
                await socket.send_str(message)
            else:
                data = message if isinstance(message, bytes) else msgpack.packb(message)
                await socket.send_bytes(b"".join(generate_chunks(data, 0)))

        async def answers():
            await send(STATE)
            found = []
            while True:
                data = (await socket.receive(20)).data
                assert isinstance(data, bytes), (data, socket.close_code)
                answer = msgpack.unpackb(data[12:])
                if answer["id"] == STATE["id"]:
                    return found
                if not str(answer["id"]).startswith("publish:"):
                    found.append(answer)

        if enters:
            await send(HELLO)
            assert "error" not in (await answers())[0]
        yield send, answers
