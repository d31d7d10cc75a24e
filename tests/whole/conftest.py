"""Settings for the tests of the whole package: equal meshes are segmented once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from vtk_segdeform.deformer import problem
from vtk_segdeform.regions import segmentation


@pytest.fixture(scope="package", autouse=True)
def segmented_once() -> Iterator[None]:
    """Find the parts of equal coarse surfaces once, unless with reports of progress."""
    known: dict[Any, Any] = {}
    find = segmentation._parts

    def found(surface: Any, n_regions: int | None, progress: Any) -> Any:
        if progress is not None:
            return find(surface, n_regions, progress)
        inputs = hashlib.blake2b()
        tables = (surface.graph, surface.contact)
        arrays = [array for t in tables for array in (t.data, t.indices, t.indptr)]
        for array in (surface.vertices, surface.faces, surface.areas, *arrays):
            inputs.update(np.ascontiguousarray(array))
        key = inputs.digest(), n_regions
        if key not in known:
            known[key] = find(surface, n_regions, None)
        return known[key].copy()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmentation, "_parts", found)
        yield


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
