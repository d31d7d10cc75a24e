"""An event loop for the tests of a module; the server runs while a test waits for it."""

from __future__ import annotations

import asyncio

import pytest


@pytest.fixture(scope="module")
def do():
    """Run a coroutine, and the server with it."""
    loop = asyncio.new_event_loop()
    yield lambda coroutine: loop.run_until_complete(asyncio.wait_for(coroutine, 200))
    if rest := asyncio.all_tasks(loop):  # connections that a visitor broke off
        for task in rest:
            task.cancel()
        loop.run_until_complete(asyncio.wait(rest))
    loop.close()
