"""A page behind a secret path: only the address that contains the secret reaches it.

    http://127.0.0.1:8765/SECRET/

Pages in frames of other sites get no cookies, so the secret is in the path.  All addresses in the
page are relative and stay below it.  Another site cannot know the path, whatever it calls this
server and whatever it makes a browser send.
"""

from __future__ import annotations

import hmac
import weakref
from pathlib import PurePosixPath

from aiohttp import hdrs, web
from aiohttp.typedefs import Handler

_COMPRESSED = frozenset({".css", ".html", ".js", ".svg", ".ttf"})  # not compressed already
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # no other page may learn the address
    "X-Content-Type-Options": "nosniff",
}
_LONGEST_PATH = 255  # bytes of a path, as of a name in most file systems
_WRONG = "Open the whole address that segdeform has printed: it contains a secret.\n"


def below(secret: str, application: web.Application, *, once: str = "") -> web.Application:
    """Return an application that serves another one below the path ``/SECRET/``, and 403 elsewhere.

    The first request for ``/ONCE`` is redirected there: command lines, which other users of the
    machine can see, contain that path.

    aiohttp caches applications that have a middleware, with all that they refer to, even after they
    have ended.  So this one has only a weak reference: keep the other one while it is to be served.
    """
    inner, unused = weakref.ref(application), {once} - {""}

    @web.middleware
    async def served(request: web.Request, handler: Handler) -> web.StreamResponse:
        del handler  # of the path with the secret, which has none
        _, given, *rest = [*request.rel_url.raw_path.split("/", 2), ""]
        if any(_same(given, each) for each in unused):
            unused.clear()
            return web.Response(status=303, headers={hdrs.LOCATION: f"{secret}/", **_HEADERS})
        if len(rest) < 2 or not _same(given, secret):
            return web.Response(status=403, text=_WRONG)
        if len(rest[0]) > _LONGEST_PATH:
            return web.Response(status=404, text="There is no such file.\n")
        place = request.rel_url.with_path(f"/{rest[0]}", encoded=True, keep_query=True)
        # Static files may have been added to this application, after it replaced the other one.
        for each in filter(None, (inner(), request.app)):
            match = await each.router.resolve(request.clone(rel_url=place))
            if match.http_exception is None:
                break
        request.match_info.update(match)
        response = _compressed(request, await match.handler(request))
        if not response.prepared:
            response.headers.update(_HEADERS)
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
    return hmac.compare_digest(given.encode("utf-8", "surrogateescape"), secret.encode())
