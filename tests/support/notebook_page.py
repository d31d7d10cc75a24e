"""A page that displays the widget of an editor, as a notebook would: its channel is a WebSocket."""

from __future__ import annotations

import asyncio
import base64
import json
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web
from chromium import Chromium, Page
from web_hands import Served, rested

_PAGE = """
<link rel="icon" href="data:,">
<p class="picture">A picture</p>
<div id="output"></div>
<script type="module">
import widget from './page/widget.js';
const handlers = new Set(), socket = new WebSocket(`ws://${location.host}/comm`);
const packed = (each) => new Promise((resolve) => {
  const reader = new FileReader();
  reader.onload = () => resolve(reader.result.split(',')[1]);
  reader.readAsDataURL(new Blob([each]));
});
const unpacked = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
let sent = Promise.resolve();
const model = {
  get: () => 'picture',
  on: (_, handler) => handlers.add(handler),
  off: (_, handler) => handlers.delete(handler),
  send(content, _, buffers = []) {
    sent = sent.then(async () => socket.send(
      JSON.stringify([content, await Promise.all(buffers.map(packed))])));
  },
};
socket.onmessage = ({ data }) => {
  const [content, buffers] = JSON.parse(data);
  for (const each of handlers) each(content, buffers.map(unpacked));
};
const el = document.querySelector('#output');
socket.onopen = () => { window.end = widget.render({ model, el }); };
</script>
"""


class InNotebook(Served):
    """The editor of *mesh*, which listens nowhere, and a page that displays its widget."""

    def page(self, browser: Chromium, **keywords: Any) -> Page:
        """Open the page, and wait for the first picture in the frame of the editor."""
        page = browser.page(self.url.replace("index.html", ""), **keywords)
        rested(InFrame(page))
        self.wait(lambda: self.is_at_rest)
        return page

    async def _serve(self) -> None:
        from vtk_segdeform.widgets.web import widget

        self.loop = asyncio.get_running_loop()
        self.tunnel, self.widget = widget.tunnel_of(self.web, "picture")
        self._outputs: list[asyncio.Queue[str]] = []
        self.widget.comm.publish_msg = self._publish
        app = web.Application()
        app.router.add_get("/", _page)
        app.router.add_static("/page", Path(widget.__file__).with_name("page"))
        app.router.add_get("/comm", self._comm)
        runner = web.AppRunner(app, shutdown_timeout=0.1)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        port = runner.addresses[0][1]
        try:
            await self.web.serve(port=None, ready=lambda _: self._started.set_result(port))
        finally:
            await runner.cleanup()
            self.widget.close()

    async def _comm(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=0)
        await socket.prepare(request)
        messages: asyncio.Queue[str] = asyncio.Queue()
        self._outputs.append(messages)

        async def forward() -> None:
            while True:
                await socket.send_str(await messages.get())

        forwarding = asyncio.ensure_future(forward())
        async for message in socket:
            assert message.type is WSMsgType.TEXT
            content, texts = json.loads(message.data)
            data = {"method": "custom", "content": content}
            buffers = [memoryview(base64.b64decode(each)) for each in texts]
            self.widget.comm.handle_msg({"content": {"data": data}, "buffers": buffers})
        forwarding.cancel()
        self._outputs.remove(messages)
        return socket

    def _publish(self, _: str, data: Any, buffers: Any = (), **__: object) -> None:
        """Send what the widget sends to all pages, as a kernel does."""
        if data.get("method") == "custom":
            texts = [base64.b64encode(each).decode() for each in buffers or ()]
            for messages in self._outputs:
                messages.put_nowait(json.dumps([data["content"], texts]))


class InFrame:
    """The frame of the editor in a page, for scripts."""

    def __init__(self, page: Page) -> None:
        self._page = page

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression in the frame; until there is one, None."""
        return self._page.evaluate(
            "((window) => { const document = window?.document;"
            f" return document?.body ? ({script}) : null; }})"
            "(document.querySelector('iframe')?.contentWindow)"
        )

    def __getattr__(self, name: str) -> Any:
        """Return a method of pages, which works in the frame."""
        return getattr(Page, name).__get__(self)

    def place(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return where in the page *point* of the frame is."""
        left, top, _, _ = self._page.box("iframe")
        return left + point[0], top + point[1]


async def _page(_: web.Request) -> web.Response:
    return web.Response(text=_PAGE, content_type="text/html")
