"""One browser for all tests of a process."""

from __future__ import annotations

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
    with Chromium(900, 620) as browser:
        yield browser


@pytest.fixture(scope="session")
def cactus() -> Mesh:
    """Return the mesh that the pages show."""
    return models.cactus(700)
