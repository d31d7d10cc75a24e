"""A client process for tests of the server: it starts in 0.2 s and does what a page tells it.

GET  index.html     its process id and its state
GET  headers        the headers of the request, as JSON
GET  fail           half an answer
POST upload         the number of bytes that arrived
ws                  set X       keep X in the autosave
                    get         answer the state
                    count       answer how many messages were handled
                    sleep S     block for S seconds
                    take N      take N megabytes of memory
                    crash       end at once
                    other       the same message back
"""

from __future__ import annotations

import argparse
import asyncio
import importlib.util
import os
import time
from pathlib import Path

from aiohttp import WSMsgType, web

_HELD: list[bytearray] = []
_secret_py = Path(__file__).parents[2] / "widgets" / "web" / "serving" / "secret.py"


def _secret_module():
    """Return `serving.secret` without the rest of the package."""
    spec = importlib.util.spec_from_file_location("secret", _secret_py)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Page:
    """The state of the page, in the autosave, and what it answers."""

    def __init__(self, autosave: Path) -> None:
        self.autosave, self.handled = autosave, 0

    @property
    def state(self) -> str:
        return self.autosave.read_text() if self.autosave.exists() else ""

    async def root(self, request):
        raise web.HTTPFound("index.html")

    async def index(self, request):
        response = web.Response(text=f"{os.getpid()} {self.state}")
        response.set_cookie("from-the-client", "1")
        return response

    async def headers(self, request):
        return web.json_response(dict(request.headers))

    async def fail(self, request):
        response = web.StreamResponse()
        await response.prepare(request)
        await response.write(b"half")
        os._exit(1)

    async def upload(self, request):
        size = 0
        async for part in request.content.iter_any():
            size += len(part)
        return web.Response(text=str(size))

    async def socket(self, request):
        socket = web.WebSocketResponse(max_msg_size=0)
        await socket.prepare(request)
        async for message in socket:
            if message.type not in (WSMsgType.TEXT, WSMsgType.BINARY):
                break
            self.handled += 1
            if message.type == WSMsgType.BINARY:
                await socket.send_bytes(message.data)
                continue
            word, _, rest = message.data.partition(" ")
            if word == "set":
                self.autosave.write_text(rest)
            elif word == "sleep":
                time.sleep(float(rest))
            elif word == "take":
                _HELD.append(bytearray(b"1") * (int(rest) << 20))
            elif word == "crash":
                os._exit(3)
            answers = {"get": self.state, "count": str(self.handled)}
            await socket.send_str(answers.get(word, message.data))
        return socket


async def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("file", nargs="?")
    parser.add_argument("--port", type=int)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--upload-limit", type=int)
    options = parser.parse_args()
    own = _secret_module()
    secret = own.read_secret()
    own.end_with_stdin()
    if options.file == "broken":
        own.announce_error("broken cannot be read.")
        raise SystemExit(1)
    page = Page(options.folder / "autosave.segdeform")
    app = web.Application(middlewares=[own.guard(secret)], client_max_size=1 << 40)
    app.router.add_get("/", page.root)
    app.router.add_get("/index.html", page.index)
    app.router.add_get("/headers", page.headers)
    app.router.add_get("/fail", page.fail)
    app.router.add_get("/ws", page.socket)
    app.router.add_post("/upload", page.upload)
    runner = web.AppRunner(app)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", options.port).start()
    own.announce(runner.addresses[0][1])
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main())
