"""The client's side of `client`: its secret, its life and its port.

A client process listens on 127.0.0.1, where other users of the machine can connect as well.  So it
answers only requests that carry a secret, which the server writes to its standard input.  The
server keeps that pipe open; when the server ends, however it ends, the pipe closes and the client
process ends with it.

Scripts and styles are compressed here, because only these pages may be far from their server.
"""

from __future__ import annotations

import hmac
import json
import os
import signal
import threading
import weakref
from pathlib import PurePosixPath

from aiohttp import hdrs, web
from aiohttp.typedefs import Handler, Middleware

HEADER = "X-Segdeform-Secret"
_INPUT, _OUTPUT = 0, 1  # file descriptors
_COMPRESSED = frozenset({".css", ".html", ".js", ".svg", ".ttf"})  # not compressed already


def read_secret() -> str:
    """Return the first line of the standard input."""
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(_INPUT, 1)):
        line += byte
    return line.decode("ascii").strip()


def end_with_stdin() -> None:
    """Kill this process, in any state, once its standard input is closed."""
    threading.Thread(target=_wait_and_end, name="end with stdin", daemon=True).start()


def _wait_and_end() -> None:
    while os.read(_INPUT, 4096):  # not sys.stdin, whose lock would block the interpreter's exit
        pass
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


def announce(port: int) -> None:
    """Tell the server that this process accepts connections on *port* of 127.0.0.1."""
    _write_line({"port": port})


def announce_error(sentence: str) -> None:
    """Tell the server why this process cannot start; the page shows the sentence."""
    _write_line({"error": sentence})


def _write_line(fields: dict[str, int | str]) -> None:
    os.write(_OUTPUT, json.dumps(fields).encode() + b"\n")


def guard(secret: str) -> Middleware:
    """Return a middleware that answers 403 to requests without the secret."""

    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not _same(request.headers.get(HEADER, ""), secret):
            return web.Response(status=403, text="This port is internal to segdeform serve.\n")
        return _compressed(request, await handler(request))

    return guarded


def below(secret: str, application: web.Application) -> web.Application:
    """Return an application that serves another one below the path ``/SECRET/``, and 403 elsewhere.

    For pages in frames of other sites, to which browsers send no cookies.

    aiohttp caches applications that have a middleware, with all that they refer to, even after they
    have ended.  So this one has only a weak reference: keep the other one while it is to be served.
    """
    inner = weakref.ref(application)

    @web.middleware
    async def served(request: web.Request, handler: Handler) -> web.StreamResponse:
        del handler  # of the path with the secret, which has none
        _, given, *rest = request.rel_url.raw_path.split("/", 2)
        if not rest or not _same(given, secret):
            return web.Response(status=403, text="This page belongs to a notebook.\n")
        place = request.rel_url.with_path(f"/{rest[0]}", encoded=True, keep_query=True)
        # Static files may have been added to this application, after it replaced the other one.
        for each in filter(None, (inner(), request.app)):
            match = await each.router.resolve(request.clone(rel_url=place))
            if match.http_exception is None:
                break
        request.match_info.update(match)
        response = _compressed(request, await match.handler(request))
        if not response.prepared:  # the secret is in the address, which no other page may learn
            response.headers["Referrer-Policy"] = "no-referrer"
            response.headers["Cache-Control"] = "no-store"
        return response

    return web.Application(middlewares=[served])


def _compressed(request: web.Request, response: web.StreamResponse) -> web.StreamResponse:
    """Return *response*: a whole file of the page is compressed if the browser accepts it."""
    is_whole = request.method == hdrs.METH_GET and hdrs.RANGE not in request.headers
    if not isinstance(response, web.FileResponse) or not is_whole:
        return response
    if PurePosixPath(request.path).suffix in _COMPRESSED:
        response.headers[hdrs.VARY] = hdrs.ACCEPT_ENCODING
        response.enable_compression()
    return response


def _same(given: str, secret: str) -> bool:
    return bool(secret) and hmac.compare_digest(_bytes(given), _bytes(secret))


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")  # headers may contain any bytes
