"""Settings for the tests of subspaces."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module", autouse=True)
def bound_once_in_memory() -> None:
    """Bind equal meshes each time: these tests change how."""
