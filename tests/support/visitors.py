"""Visitors of a server of client processes that are stand-ins (`standin_client`)."""

from __future__ import annotations

import asyncio
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import aiohttp
from yarl import URL

from vtk_segdeform.widgets.web.serving import Limits, running

STANDIN = [sys.executable, str(Path(__file__).with_name("standin_client.py"))]
LIMITS = Limits(upload=100_000, message=1 << 16, rate=50.0, burst=600, unread=16, start=300.0)
POSTED = {"content-type": "application/octet-stream"}


class Visitor:
    """A browser with one cookie, which sends the Origin of the server unless told otherwise."""

    def __init__(self, server, session) -> None:
        self.server, self.session = server, session
        self.base = f"http://127.0.0.1:{server.port}"
        self.path, self.cookie = "", ""

    async def get(self, path, **headers):
        """Return status, text and headers; the path is sent as it is."""
        async with self.session.get(
            URL(self.base + path, encoded=True), headers={"Cookie": self.cookie, **headers},
            allow_redirects=False,
        ) as answer:  # fmt: skip
            return answer.status, await answer.text(), answer.headers

    async def post(self, path, data):
        headers = {"Origin": self.base, "Cookie": self.cookie, **POSTED}
        url = self.base + self.path + path
        async with self.session.post(url, data=data, headers=headers) as answer:
            return answer.status, await answer.text()

    async def enter(self):
        """Start a client; return the id of its process and its state."""
        token = self.server.access.token
        status, text, headers = await self.get(f"/?token={token}")
        assert status == 303, text
        self.path, self.cookie = headers["Location"], headers["Set-Cookie"].split(";")[0]
        return await self.load()

    async def load(self):
        """Load the page as a browser does; return the id of the process and its state."""
        status, text, _ = await self.get(f"{self.path}index.html")
        if status == 202:
            assert "Starting the editor" in text
            status, text, _ = await self.get(f"{self.path}index.html")
        assert status == 200, text
        process, _, state = text.partition(" ")
        return int(process), state

    def socket(self):
        headers = {"Origin": self.base, "Cookie": self.cookie}
        patience = aiohttp.ClientWSTimeout(ws_close=1.0)
        url = f"{self.base}{self.path}ws"
        return self.session.ws_connect(url, headers=headers, timeout=patience)

    async def ask(self, *messages):
        """Send messages by a new WebSocket; return the last answer."""
        async with self.socket() as socket:
            for message in messages:
                await socket.send_str(message)
                answer = await socket.receive(300)
        return answer.data

    async def raw(self, head, body=b""):
        """Send bytes; return the first line and the end of the answer."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.server.port)
        writer.write(head.replace("\n", "\r\n").encode() + body)
        answer = await asyncio.wait_for(reader.read(4096), 300)
        writer.close()
        return answer.decode("latin-1")


@asynccontextmanager
async def serving(folder, limits=LIMITS, command=STANDIN):
    """Yield a server and a function that returns new visitors."""
    async with (
        running(command, port=0, limits=limits, parent=folder) as server,
        aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as session,
    ):
        yield server, lambda: Visitor(server, session)
