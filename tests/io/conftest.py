"""Settings for the tests of files."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest


@pytest.fixture
def vtk_without_child() -> Iterator[None]:
    """Read files of VTK in this process for one test, as `vtk_in_process` does for a module."""
    from vtk_segdeform.io import isolated, reading_child

    outside: Callable[[list[str], str, float], int] = isolated._exit_code

    def here(arguments: list[str], folder: str, seconds: float) -> int:
        tool, path, results, _ = arguments[-4:]
        if tool != "vtk":
            return outside(arguments, folder, seconds)
        reading_child.main(tool, path, results, "0")
        return 0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolated, "_exit_code", here)
        yield
