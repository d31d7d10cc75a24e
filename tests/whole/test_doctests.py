"""Every example in a docstring runs and prints the output shown."""

from __future__ import annotations

import doctest
import importlib
import linecache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "vtk_segdeform"
OURS = sorted(PACKAGE.rglob("*.py"))
WIDGETS = sorted((ROOT / "widgets").rglob("*.py"))
ELSEWHERE = {"vtk_segdeform.filters.paraview_plugin"}  # imported by ParaView only


def module_names() -> list[str]:
    """Return the dotted names of all modules of the installed package."""
    places = [path.relative_to(ROOT) for path in OURS]
    places += [Path("vtk_segdeform", path.relative_to(ROOT)) for path in WIDGETS]
    names = [".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in places]
    return [name for name in names if name not in ELSEWHERE]


@pytest.mark.parametrize("name", module_names())
def test_the_examples_of_a_module_are_right(name, monkeypatch, tmp_path, cached_models):
    monkeypatch.chdir(tmp_path)  # for examples that write files
    if name.startswith("vtk_segdeform.widgets.qt"):
        pytest.importorskip("pyvistaqt", exc_type=ImportError)
    module = importlib.import_module(name)
    linecache.clearcache()  # otherwise doctest checks every cached file before each docstring
    failed, _ = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert not failed


def test_a_wrong_example_is_found():
    wrong = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, 0)
    assert doctest.DocTestRunner(verbose=False).run(wrong, out=lambda _: None).failed == 1
