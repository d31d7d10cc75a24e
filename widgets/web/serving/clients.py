"""All clients of a server: their number, their ends, and what they take."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from .client import Client
from .limits import Limits

_WATCH = 1.0  # seconds between two looks at memory and time, at most


class Clients:
    """The clients of a server.

    Parameters
    ----------
    command : sequence of str
        Program and first arguments of their processes.
    folder : Path
        The private folder of this run.
    limits : Limits
        Limits of the server.
    """

    def __init__(self, command: Sequence[str], folder: Path, limits: Limits) -> None:
        self._command, self._folder, self._limits = command, folder, limits
        self._clients: dict[str, Client] = {}

    @property
    def is_empty(self) -> bool:
        """Whether there is no client."""
        return not self._clients

    @property
    def is_full(self) -> bool:
        """Whether there can be no other client now."""
        return len(self._clients) >= self._limits.clients

    def new(self) -> Client:
        """Return a new client, whose process does not run yet."""
        client = Client(self._command, self._folder, self._limits)
        self._clients[client.id] = client
        return client

    def abandoned(self) -> Client | None:
        """Return the client whose page went last, if there is one."""
        found = [client for client in self._clients.values() if client.is_abandoned]
        return min(found, key=lambda client: client.absent, default=None)

    def get(self, name: str) -> Client | None:
        """Return the client with this id, if there is one."""
        return self._clients.get(name)

    async def watch(self) -> None:
        """End processes that take too much memory, and clients that have gone; never return."""
        while True:
            await asyncio.sleep(min(_WATCH, 0.25 * self._limits.keep))
            for client in list(self._clients.values()):
                if client.memory > self._limits.memory:
                    most = self._limits.memory / 1e9
                    await client.end(f"The editor took more than {most:.3g} GB of memory.")
                if client.absent > self._limits.keep:
                    await self._remove(client)

    async def end(self) -> None:
        """End all clients."""
        await asyncio.gather(*map(self._remove, list(self._clients.values())))

    async def _remove(self, client: Client) -> None:
        self._clients.pop(client.id, None)
        await client.close()
