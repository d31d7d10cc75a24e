"""Who may talk to the server: the token, cookies, Host, Origin and the headers of every answer.

The address that the server prints contains a token made for this run.  Opening it starts a client
and sets a cookie with a key that only this client has, valid below its own path ``/s/ID/``.  It
outlives the browser, so that a page whose browser was killed is continued by the next one.

A page of another site cannot use that cookie (SameSite, HttpOnly), cannot open a WebSocket or post
(its Origin differs from our Host), and cannot give our address another name (Host).  Host is
compared without its port, so that a forwarded port (``ssh -L``) works.
"""

from __future__ import annotations

import hmac
import re
import secrets
from typing import NoReturn

from aiohttp import hdrs, web
from aiohttp.typedefs import Handler, Middleware

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
ANY = frozenset({"0.0.0.0", "::", ""})  # reached by all names of the machine
_DAYS = 90  # that a browser keeps a cookie: longer than a client is expected to live
_HOST = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[A-Za-z0-9._-]+))(?::\d{1,5})?")

_ERRORS = {
    400: web.HTTPBadRequest,
    403: web.HTTPForbidden,
    404: web.HTTPNotFound,
    408: web.HTTPRequestTimeout,
    409: web.HTTPConflict,
    429: web.HTTPTooManyRequests,
    502: web.HTTPBadGateway,
    503: web.HTTPServiceUnavailable,
}


def refuse(status: int, sentence: str) -> NoReturn:
    """Answer with an HTTP status and a sentence for the user."""
    raise _ERRORS[status](text=f"{sentence}\n")


class Access:
    """The token of one run, and checks of requests.

    Parameters
    ----------
    host : str
        The host that the server is bound to.
    port : int
        Its port.
    """

    def __init__(self, host: str, port: int) -> None:
        self.token = secrets.token_urlsafe(32)
        self._once: set[str] = set()
        self._cookie = f"segdeform-{port}"
        self._names = None if host in ANY else LOOPBACK | {host.strip("[]").lower()}

    def token_for_once(self) -> str:
        """Return a token that can be used once, for command lines, which other users can see."""
        token = secrets.token_urlsafe(32)
        self._once.add(token)
        return token

    def require_token(self, request: web.Request) -> None:
        """Raise HTTPForbidden unless the query of *request* is a token of this run."""
        given = request.query.getall("token", [""])[-1]
        if any(_same(given, token) for token in self._once):
            self._once.discard(given)
        elif not _same(given, self.token):
            refuse(403, "Open the address that segdeform serve printed; it contains a token.")

    def set_cookie(self, response: web.StreamResponse, key: str, path: str) -> None:
        """Let the browser send *key* with requests below *path*, also after a restart."""
        age = _DAYS * 24 * 3600
        response.set_cookie(
            self._cookie, key, path=path, max_age=age, httponly=True, samesite="Strict"
        )

    def has_key(self, request: web.Request, key: str) -> bool:
        """Return whether *request* has the cookie with *key*."""
        return _same(request.cookies.get(self._cookie, ""), key)

    def checked(self) -> Middleware:
        """Return a middleware that refuses forged hosts and other origins."""

        @web.middleware
        async def checked(request: web.Request, handler: Handler) -> web.StreamResponse:
            hosts = request.headers.getall(hdrs.HOST, [])
            # `request.host` is the one in the address, if the request has a whole address.
            if len(hosts) != 1 or not all(map(self._is_ours, (hosts[0], request.host))):
                refuse(403, "This server does not answer under this host name.")
            if request.method == hdrs.METH_POST or hdrs.UPGRADE in request.headers:
                origins = request.headers.getall(hdrs.ORIGIN, [])
                if len(origins) != 1 or origins[0].lower() not in _origins(hosts[0].lower()):
                    refuse(403, "Requests from pages of other sites are refused.")
            return await handler(request)

        return checked

    def _is_ours(self, host: str) -> bool:
        match = _HOST.fullmatch(host)
        name = (match["six"] or match["name"]).lower() if match else ""
        return bool(name) and (self._names is None or name in self._names)


def _origins(host: str) -> tuple[str, str]:
    return f"http://{host}", f"https://{host}"  # https: behind a proxy


def _same(given: str, expected: str) -> bool:
    """Compare in constant time."""
    return hmac.compare_digest(given.encode("utf-8", "surrogateescape"), expected.encode())


async def add_headers(request: web.BaseRequest, response: web.StreamResponse) -> None:
    """Add the headers that all answers have; a signal handler, after the checks of the host."""
    host = request.headers.get(hdrs.HOST, "")
    sockets = f" ws://{host} wss://{host}" if _HOST.fullmatch(host) else ""
    # Vue compiles templates in the page, which needs 'unsafe-eval'; trame's page has a script.
    policy = (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; media-src 'self' data: "
        f"blob:; font-src 'self' data:; connect-src 'self'{sockets}; worker-src 'self' blob:; "
        "frame-ancestors 'none'; base-uri 'self'; form-action 'self'; object-src 'none'"
    )
    response.headers.update(
        {
            "Content-Security-Policy": policy,
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "Server": "segdeform",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
        }
    )
    response.headers.setdefault("Cache-Control", "no-store")
