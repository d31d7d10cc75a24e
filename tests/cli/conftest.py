"""Settings for the tests of commands: equal meshes are segmented, caged and bound once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module", autouse=True)
def computed_once(fitted_once: Any, bound_once: None) -> Iterator[None]:
    """Segment and fit equal inputs once, although a command follows the progress of both."""
    from vtk_segdeform.cages import fit
    from vtk_segdeform.cli import commands

    known: dict[Any, Any] = {}
    fitted, segment = fit._fit, commands.segment

    def fit_once(patch: Any, n: int, offset: Any, _progress: Any = None) -> Any:
        return fitted(patch, n, offset, None)

    def segment_once(mesh: Any, n_regions: Any = None, **options: Any) -> Any:
        follows = {name: each for name, each in options.items() if name != "progress"}
        key = mesh.vertices.tobytes(), mesh.faces.tobytes(), n_regions, repr(follows)
        if key not in known:
            known[key] = segment(mesh, n_regions, **options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "_fit", fit_once)
        patch.setattr(commands, "segment", segment_once)
        yield
