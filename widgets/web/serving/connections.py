"""Limits for connections that send nothing, or only part of a request.

Anyone who reaches the port can open connections, without a token.  So connections on which no
request of a client is being answered are limited in time and number.  Beyond that number, the
oldest connection of the address with the most of them is closed; others are still served.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from aiohttp import web

from .limits import Limits


class Connections:
    """Makes the protocols of a server's connections, for ``loop.create_server``.

    Parameters
    ----------
    server : aiohttp.web.Server
        The server.
    limits : Limits
        Limits of the server.
    """

    def __init__(self, server: web.Server, limits: Limits) -> None:
        self._server, self._limits = server, limits
        self._answered: set[asyncio.BaseTransport | None] = set()
        self._late: set[asyncio.BaseTransport | None] = set()

    def __call__(self) -> web.RequestHandler:
        """Return the protocol of a new connection."""
        asyncio.get_running_loop().call_soon(self._make_room)  # the earlier ones are open then
        return self._server()

    @contextmanager
    def answering(self, request: web.Request) -> Iterator[None]:
        """Keep the connection of a client's *request* while that is being answered."""
        transport = request.transport
        self._answered.add(transport)
        self._late.discard(transport)
        try:
            yield
        finally:
            self._answered.discard(transport)

    async def watch(self) -> None:
        """Close connections that have waited for too long; never return."""
        while True:
            await asyncio.sleep(0.5 * self._limits.patience)
            waiting = self._waiting()
            for transport in waiting:
                if transport in self._late:
                    transport.abort()
            self._late = set(waiting)

    def _waiting(self) -> list[asyncio.WriteTransport]:
        """Return the connections on which no request of a client is being answered, by age."""
        transports = [protocol.transport for protocol in self._server.connections]
        return [
            each
            for each in transports
            if not (each is None or each.is_closing() or each in self._answered)
        ]

    def _make_room(self) -> None:
        waiting = self._waiting()
        if len(waiting) >= self._limits.waiting:
            hosts = [str((each.get_extra_info("peername") or [""])[0]) for each in waiting]
            [(crowd, _)] = Counter(hosts).most_common(1)
            waiting[hosts.index(crowd)].abort()
