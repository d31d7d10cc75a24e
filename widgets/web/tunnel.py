"""Pages of an editor without a server: all that they send goes through the channel of a notebook.

A message is a dict with "kind", the "page" that it is from or for, and at most one buffer:

    from a page                             to a page
    open                                    document  BUFFER: the page as HTML, compressed by gzip
    connect                                 connected
    frame    "text", or a BUFFER            frame     BUFFER
    close                                   close     "reason"
    request  "id", "path", "query", "size"  more      "id": send the next part
    part     "id", BUFFER; empty: the last  answer    "id", "status", BUFFER
    here                                    ping      to a page that may have gone
                                            refused   "reason"
                                            ended

"connect", "frame" and "close" are those of a WebSocket, which the page believes to have; "request"
and "part" are uploads and downloads as in `transfer`.

Nothing tells the kernel that a browser has gone, but a page may draw only while it is alone.  So
when one connects, the others are asked whether they are still there.
"""

from __future__ import annotations

import asyncio
import gzip
import logging
import uuid
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

from aiohttp import web

from vtk_segdeform.checks import shown

from .web_editor import WebEditor
from .whole_page import whole_page

_TURNS, _TURN = 5, 1.0  # seconds in turns of the loop, until a silent page counts as gone

_log = logging.getLogger(__name__)

Send = Callable[[dict[str, Any], list[bytes]], object]
"""``send(content, buffers)`` sends a message to the pages."""


class Tunnel:
    """The pages of one editor, which listens nowhere; made in its event loop.

    Parameters
    ----------
    editor : WebEditor
        The editor, served with ``port=None``.
    send : callable
        Sends a message; see `Send`.
    """

    def __init__(self, editor: WebEditor, send: Send) -> None:
        self._editor, self._send_message = editor, send
        self._loop = asyncio.get_running_loop()
        self._document = b""
        self._connections: dict[str, _Connection] = {}  # by page
        self._uploads: dict[tuple[str, object], asyncio.Queue[bytes]] = {}  # by page and "id"
        self._tasks: set[asyncio.Task[None]] = set()
        self._is_closed = False
        self._handlers: dict[str, Callable[..., object]] = {
            "open": self._open, "connect": self._connect, "frame": self._frame,
            "close": self._disconnect, "request": self._request, "part": self._part,
            "here": lambda *_: None,
        }  # fmt: skip

    def receive(self, content: Any, buffers: Sequence[Any] = ()) -> None:
        """Handle a message of a page; from any thread, such as those of a kernel's subshells."""
        self._loop.call_soon_threadsafe(self._receive, content, buffers)

    def _receive(self, content: Any, buffers: Sequence[Any]) -> None:
        page = content.get("page") if isinstance(content, dict) else None
        try:
            handle = self._handlers[content["kind"]]
            if self._is_closed:
                self._send(page, "ended")
                return
            if page in self._connections:
                self._connections[page].is_here = True
            handle(page, content, bytes(buffers[0]) if buffers else b"")
        except (LookupError, TypeError) as fault:
            _log.info("a page sent %s: %r", shown(content), fault)
            self._send(page, "refused", reason=f"This message is not valid: {shown(content)}")

    def close(self) -> None:
        """Tell all pages that the editor has ended, and end their connections."""
        self._is_closed = True
        for page in self._connections:
            self._send(page, "ended")
        for task in self._tasks:
            task.cancel()

    def _send(self, page: object, kind: str, *buffers: bytes, **more: object) -> None:
        self._send_message({"kind": kind, "page": page, **more}, [*buffers])

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Start *work*, which ends with the tunnel."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    # The page and its WebSocket.

    def _open(self, page: str, *_: object) -> None:
        if not self._document:
            self._document = gzip.compress(whole_page(self._editor.server).encode())
        self._send(page, "document", self._document)

    def _connect(self, page: str, *_: object) -> None:
        self._disconnect(page)  # of before the frame was loaded again
        others = [each for name, each in self._connections.items() if name != page]
        connection = _Connection(self._editor.endpoint, partial(self._send, page))
        self._connections[page] = connection
        self._start(connection.run()).add_done_callback(partial(self._gone, page, connection))
        self._send(page, "connected")
        if others:
            self._start(self._drop_silent(others))

    def _frame(self, page: str, content: dict[str, Any], data: bytes) -> None:
        if page in self._connections:
            self._connections[page].inbox.put_nowait(content.get("text", data))
        else:
            self._send(page, "close", reason="The connection to the kernel was lost.")

    def _disconnect(self, page: str, *_: object) -> None:
        if page in self._connections:
            self._connections[page].inbox.put_nowait(None)

    def _gone(self, page: str, connection: _Connection, _: object) -> None:
        if self._connections.get(page) is connection:
            del self._connections[page]
            self._send(page, "close", reason="")

    async def _drop_silent(self, connections: list[_Connection]) -> None:
        """Ask these pages whether they are there, and end the connections of the others."""
        for each in connections:
            each.is_here = False
            each.send("ping")
        for _ in range(_TURNS):
            await asyncio.sleep(_TURN)  # a long cell takes one turn, however long
        for each in connections:
            if not each.is_here:
                each.inbox.put_nowait(None)

    # Uploads and downloads.

    def _request(self, page: str, content: dict[str, Any], _: object) -> None:
        number, action, query = content["id"], content["path"], content["query"]
        parts: asyncio.Queue[bytes] = asyncio.Queue()
        self._uploads[page, number] = parts

        async def read() -> bytes:
            self._send(page, "more", id=number)
            return await parts.get()

        async def answer() -> None:
            transfer, (what, _, suffix) = self._editor.transfer, action.partition("/")
            try:
                if what == "upload":
                    found = await transfer.take(query, content.get("size"), read)
                elif what == "download":
                    found = await transfer.give(suffix, query)
                else:
                    found = web.Response(status=404, text="There is no such file.")
            finally:
                del self._uploads[page, number]
            body = found.body if isinstance(found.body, bytes) else b""
            self._send(page, "answer", body, id=number, status=found.status)

        self._start(answer())

    def _part(self, page: str, content: dict[str, Any], data: bytes) -> None:
        self._uploads[page, content["id"]].put_nowait(data)


class _Connection:
    """A WebSocket, as the handlers of wslink use one; its frames are put into the `inbox`."""

    def __init__(self, endpoint: Any, send: Callable[..., None]) -> None:
        self._endpoint, self.send = endpoint, send
        self.inbox: asyncio.Queue[bytes | str | None] = asyncio.Queue()
        self.is_here = True
        self.closed = False

    async def send_bytes(self, data: bytes) -> None:
        """Send a frame."""
        self.send("frame", data)

    async def run(self) -> None:
        """Give frames to wslink, one after the other, until there is None."""
        endpoint, client = self._endpoint, uuid.uuid4().hex
        endpoint.connections[client] = self
        await endpoint.onConnect(None, client)
        try:
            while (data := await self.inbox.get()) is not None:
                await endpoint.onMessage(
                    isinstance(data, bytes), SimpleNamespace(data=data), client
                )
        finally:
            self.closed = True
            await endpoint.onClose(client)
            del endpoint.connections[client]
            endpoint.authentified_client_ids.discard(client)
