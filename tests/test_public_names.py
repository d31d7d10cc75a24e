"""The names of the package, each imported on first use."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import vtk_segdeform as sd


def printed(code: str) -> str:
    """Return what a new Python prints."""
    words = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def test_the_import_of_the_package_imports_no_library():
    found = printed("import sys, vtk_segdeform; print(*sys.modules)").split()
    assert not {"numba", "numpy", "pyvista", "qtpy", "scipy", "vtkmodules"} & set(found)


def test_dir_lists_public_names_and_subpackages_that_are_not_imported_yet():
    found = printed("import vtk_segdeform as sd; print(*dir(sd))").split()
    assert {*sd.__all__, *sd._SUBPACKAGES, "__version__"} <= set(found)


def test_every_listed_name_exists():
    assert set(sd.__all__) == {*sd._MODULE_OF, "errors", "models"}
    for name in dir(sd):
        getattr(sd, name)
    for name in sd._SUBPACKAGES:
        assert isinstance(getattr(sd, name), ModuleType)


def test_a_name_is_imported_once():
    assert sd.Mesh is sd.mesh.Mesh
    assert vars(sd)["Mesh"] is sd.Mesh
    assert sd.Cancelled is sd.errors.Cancelled


def test_no_import_of_a_folder_replaces_a_public_function():
    """Python sets an imported submodule as an attribute of its package."""
    folders = {path.name for path in Path(sd.__file__).parent.iterdir() if path.is_dir()}
    assert not folders & set(sd._MODULE_OF)
    assert callable(sd.repair)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Meshes'"):
        sd.Meshes  # noqa: B018
