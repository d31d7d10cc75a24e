"""Settings for the tests of regions."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module", autouse=True)
def segmented_once() -> None:
    """Segment equal meshes each time: these tests are of that."""
