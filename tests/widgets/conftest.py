"""Settings for the tests of the widgets."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from vtk_segdeform.widgets.editor import controller, preparing


@pytest.fixture(scope="session", autouse=True)
def restless() -> Iterator[None]:
    """Load kernels as soon as nothing happens, so that no test waits for a second of rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller, "_REST", 0.0)
        yield


@pytest.fixture(scope="module")
def unprepared() -> Iterator[None]:
    """Do not prepare sessions for pulls in the background: for tests of the other modes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(preparing, "lacking", lambda *_: None)
        yield
