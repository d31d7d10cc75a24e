"""Settings for the tests of the whole package."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from vtk_segdeform.deformer import problem


@pytest.fixture(scope="module")
def bound_once_in_memory() -> Iterator[None]:
    """Bind equal meshes, regions and cages once, unless in a folder or with reports of progress."""
    known: dict[str, Any] = {}
    bind = problem.cached_binding

    def bound(inputs: Any, folder: Any, progress: Any = None) -> Any:
        if folder is not None or progress is not None:
            return bind(inputs, folder, progress)
        key = inputs.digest()
        if key not in known:
            known[key] = bind(inputs, folder)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "cached_binding", bound)
        yield
