"""Settings for the tests of the widgets."""

from __future__ import annotations

import pytest

from vtk_segdeform.widgets.editor import preparing


@pytest.fixture
def unprepared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not prepare sessions for pulls in the background: for tests of the other modes."""
    monkeypatch.setattr(preparing, "lacking", lambda _: None)
