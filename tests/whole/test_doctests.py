"""Every example in a docstring runs and prints the output shown."""

from __future__ import annotations

import doctest
import importlib
import linecache
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "vtk_segdeform"
WIDGETS = ROOT / "widgets"  # installed as vtk_segdeform.widgets
ELSEWHERE = {"vtk_segdeform.filters.paraview_plugin"}  # imported by ParaView only


def modules() -> dict[str, Path]:
    """Return the files of all modules of the installed package, by dotted name."""
    files = {path.relative_to(ROOT): path for path in sorted(PACKAGE.rglob("*.py"))}
    for path in sorted(WIDGETS.rglob("*.py")):
        files[Path("vtk_segdeform", path.relative_to(ROOT))] = path
    names = {
        ".".join(place.with_suffix("").parts).removesuffix(".__init__"): path
        for place, path in files.items()
    }
    return {name: path for name, path in names.items() if name not in ELSEWHERE}


MODULES = modules()
# In the campaign only: the first makes bodies like those of its tests, pages call the others.
LONG = {
    "vtk_segdeform.models.shapes",
    "vtk_segdeform.landmarks.fit",
    "vtk_segdeform.batches.random_poses",
}
WITH_EXAMPLES = [
    pytest.param(name, marks=pytest.mark.campaign if name in LONG else ())
    for name, path in MODULES.items()
    if ">>> " in path.read_text("utf-8")
]


def imported(name: str) -> ModuleType:
    if name.startswith("vtk_segdeform.widgets.qt"):
        pytest.importorskip("pyvistaqt", exc_type=ImportError)
    return importlib.import_module(name)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_examples_of_a_module_are_right(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # for examples that write files
    module = imported(name)
    linecache.clearcache()  # otherwise doctest checks every cached file before each docstring
    failed, attempted = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert attempted
    assert not failed


@pytest.mark.parametrize("folder", sorted({name.rpartition(".")[0] for name in MODULES} - {""}))
def test_the_modules_of_a_folder_can_be_imported(folder):
    for name in MODULES:
        if name.rpartition(".")[0] == folder:
            assert imported(name).__name__ == name
