"""One browser for all tests of a process; an event loop for the tests of a module."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator

# aiohttp reads the certificates of the system when it is imported, also in each of the processes
# that the tests start, for 0.1 s; no test needs any.
os.environ.setdefault("SSL_CERT_FILE", os.devnull)

import pytest
from chromium import Chromium

from vtk_segdeform import Mesh, models


@pytest.fixture(scope="session")
def browser() -> Iterator[Chromium]:
    """Yield a browser; whoever opens a page in it closes it."""
    with Chromium() as browser:
        yield browser


@pytest.fixture(scope="session")
def cactus() -> Mesh:
    """Return the mesh that the pages show."""
    return models.cactus(700)


class Loop(asyncio.SelectorEventLoop):
    """An event loop whose clock can be put forward, so that no test has to hurry or to wait."""

    _ahead = 0.0

    def time(self) -> float:
        """Return the time in seconds."""
        return super().time() + self._ahead

    def put_forward(self, seconds: float) -> None:
        """Let *seconds* pass at once."""
        self._ahead += seconds


@pytest.fixture(scope="module")
def do():
    """Run a coroutine, and the server with it; the server runs only then."""
    loop = Loop()
    yield loop.run_until_complete
    if rest := asyncio.all_tasks(loop):  # connections that a visitor broke off
        for task in rest:
            task.cancel()
        loop.run_until_complete(asyncio.wait(rest))
    loop.close()
