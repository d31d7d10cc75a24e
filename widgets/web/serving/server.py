"""The server in front of all client processes: addresses, pages while waiting, start and end.

    /?token=...     start a client, or on this machine continue one that lost its page; sets its
                    cookie and redirects to its page
    /s/ID/          its page, and everything below: passed to its process (`proxy`)

The page starts the process, and starts it again if it has ended.
"""

from __future__ import annotations

import asyncio
import errno
import html
import logging
import signal
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from aiohttp import WSCloseCode, hdrs, web
from aiohttp.http import HttpProcessingError

from .access import ANY, LOOPBACK, Access, add_headers, refuse
from .client import Client, client_command
from .clients import Clients
from .connections import Connections
from .limits import Limits
from .proxy import End, new_session, pass_request, pass_socket, refuse_socket
from .run_folder import run_folder

DEFAULT_PORT = 8765
_PAGES = ("", "index.html")
_UPLOAD, _SOCKET = "upload", "ws"
_LONGEST = 255  # bytes of a path, as of a name in most file systems
_ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP")

_log = logging.getLogger(__name__)

_NOTE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>segdeform</title>
<meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">{refresh}
<style>body {{ font: 16px system-ui, sans-serif; margin: 30vh auto 0; max-width: 34em;
padding: 0 1em; text-align: center; }}</style></head><body><p>{text}</p></body></html>
"""


def _note(text: str, status: int, *, refresh: bool = False) -> web.Response:
    """Return a page with one sentence, which loads itself again if asked to."""
    again = '<meta http-equiv="refresh" content="0">' if refresh else ""
    body = _NOTE.format(text=html.escape(text), refresh=again)
    return web.Response(status=status, text=body, content_type="text/html")


def _is_own_fault(record: logging.LogRecord) -> bool:
    """Return whether a message of aiohttp is about an error of this program, not of a visitor."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, HttpProcessingError | web.RequestPayloadError | ConnectionError)


_log.addFilter(_is_own_fault)


@dataclass
class Server:
    """A running server, see `running`."""

    access: Access
    clients: Clients
    limits: Limits
    host: str
    port: int
    connections: Connections = field(init=False)

    def __post_init__(self) -> None:
        self._session = new_session()

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach the server."""
        return self.host in LOOPBACK

    def address(self, token: str) -> str:
        """Return the address that starts a client."""
        host = socket.gethostname() if self.host in ANY else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/?token={token}"

    def application(self) -> web.Application:
        """Return the web application."""
        application = web.Application(middlewares=[self.access.checked()])
        application.on_response_prepare.append(add_headers)
        application.router.add_get("/", self._enter, allow_head=False)
        application.router.add_get("/s/{id}/{tail:.*}", self._below)
        application.router.add_post("/s/{id}/{tail:.*}", self._below)
        return application

    async def end(self) -> None:
        """End all clients."""
        await self.clients.end()
        await self._session.close()

    async def _enter(self, request: web.Request) -> web.StreamResponse:
        self.access.require_token(request)
        # On this machine the work is that of the same user, whose page or browser has gone.
        client = self.clients.abandoned() if self.is_local else None
        if client is None and self.clients.is_full:
            refuse(
                503,
                f"All {self.limits.clients} clients of this server are in use. A client ends "
                f"{self.limits.keep:.0f} s after its page was closed.",
            )
        client = client or self.clients.new()
        path = f"/s/{client.id}/"
        with client.visit():  # so that nobody else continues it before its page is loaded
            response = web.Response(status=303, headers={hdrs.LOCATION: path})
            self.access.set_cookie(response, client.key, path)
        return response

    async def _below(self, request: web.Request) -> web.StreamResponse:
        client, name = self.clients.get(request.match_info["id"]), request.match_info["tail"]
        is_socket = name == _SOCKET and hdrs.UPGRADE in request.headers
        is_socket = is_socket and request.method == hdrs.METH_GET
        if client is None or not self.access.has_key(request, client.key):
            sentence = (
                "This client has ended, or belongs to another browser. Open the address that "
                "segdeform serve printed."
            )
            if is_socket:
                return await refuse_socket(request, End(WSCloseCode.POLICY_VIOLATION, sentence))
            refuse(403, sentence)
        if client.visits >= self.limits.requests:
            sentence = "There are too many requests at the same time. Close other pages."
            if is_socket:
                return await refuse_socket(request, End(WSCloseCode.TRY_AGAIN_LATER, sentence))
            refuse(429, sentence)
        with self.connections.answering(request):
            if is_socket:
                with client.page():
                    return await pass_socket(self._session, client, request, self.limits)
            with client.visit():
                return await self._answer(client, request)

    async def _answer(self, client: Client, request: web.Request) -> web.StreamResponse:
        tail = request.rel_url.raw_path.split("/", 3)[3]
        if len(tail) > _LONGEST or ".." in unquote(tail).replace("\\", "/").split("/"):
            refuse(404, "There is no such file.")
        if request.match_info["tail"] == _SOCKET:
            refuse(400, "This is no request for a WebSocket.")
        if request.method == hdrs.METH_POST:
            return await self._upload(client, request, tail)
        if tail in _PAGES and (note := await self._start(client)):
            return note
        return await self._pass(client, request, tail)

    async def _start(self, client: Client) -> web.Response | None:
        """Start the process of a page; return what the page shows meanwhile.

        The note loads the page again at once, and browsers show the note until that is answered.
        """
        if await client.started() is not None:
            return None
        if client.could_not_start:
            client.could_not_start = False
            return _note(f"{client.failure} Reload this page to try again.", 502)
        client.start()
        return _note("Starting the editor ...", 202, refresh=True)

    async def _upload(self, client: Client, request: web.Request, tail: str) -> web.StreamResponse:
        if tail.split("/")[0] != _UPLOAD:
            raise web.HTTPMethodNotAllowed(hdrs.METH_POST, ["GET", "HEAD"], text="Not allowed.\n")
        if client.uploads.locked():
            refuse(409, "Another upload is in progress; wait until it is complete.")
        async with client.uploads:
            return await self._pass(client, request, tail)

    async def _pass(self, client: Client, request: web.Request, tail: str) -> web.StreamResponse:
        if await client.started() is None:
            refuse(502, await client.reason())
        return await pass_request(self._session, client, request, tail, self.limits)


@asynccontextmanager
async def running(
    command: Sequence[str],
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    limits: Limits | None = None,
    parent: Path | None = None,
) -> AsyncIterator[Server]:
    """Run a server while the block lasts; afterwards its processes and files are gone.

    Parameters
    ----------
    command : sequence of str
        Program and first arguments of client processes.
    host : str
        Address or name to bind to.
    port : int, optional
        0: any free port.  By default 8765, or any free port if that one is in use.
    limits : Limits, optional
        Limits of the server.
    parent : Path, optional
        Where to create the private folder of this run.

    Raises
    ------
    OSError
        If the port is in use or the folder cannot be created.
    """
    limits = limits or Limits()
    with run_folder(parent) as folder, _bound(host, port) as listening:
        number = int(listening.getsockname()[1])
        clients = Clients(command, folder, limits)
        server = Server(Access(host, number), clients, limits, host, number)
        runner = web.AppRunner(
            server.application(), access_log=None, logger=_log, shutdown_timeout=2.0
        )
        await runner.setup()
        assert runner.server is not None
        server.connections = Connections(runner.server, limits)
        watching = asyncio.gather(clients.watch(), server.connections.watch())
        accepting = await asyncio.get_running_loop().create_server(
            server.connections, sock=listening
        )
        try:
            yield server
        finally:
            accepting.close()
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)
            await server.end()
            await runner.cleanup()


def _bound(host: str, port: int | None) -> socket.socket:
    family, _, _, _, place = socket.getaddrinfo(
        host, DEFAULT_PORT if port is None else port, type=socket.SOCK_STREAM
    )[0]
    try:
        return socket.create_server(place[:2], family=family)
    except OSError as fault:
        if port is not None or fault.errno != errno.EADDRINUSE:
            raise
        return socket.create_server((host, 0), family=family)


async def serve_until_stopped(
    file: Path | None,
    *,
    host: str,
    port: int | None,
    limits: Limits,
    started: Callable[[Server], None],
) -> None:
    """Serve *file* until the process is interrupted or told to end.

    Parameters
    ----------
    file : Path or None
        The mesh or session that pages open first.
    host, port, limits
        See `running`.
    started : callable
        Called with the server once it runs.
    """
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    async with running(client_command(file), host=host, port=port, limits=limits) as server:
        for name in filter(lambda name: hasattr(signal, name), _ENDINGS):
            with suppress(NotImplementedError):  # Windows: Ctrl+C raises KeyboardInterrupt
                loop.add_signal_handler(getattr(signal, name), stop.set)
        started(server)
        await stop.wait()
