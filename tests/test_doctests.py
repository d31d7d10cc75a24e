"""Every example in a docstring is run, and prints what it says."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "vtk_segdeform"
OURS = sorted(PACKAGE.rglob("*.py"))
WIDGETS = sorted((ROOT / "widgets").glob("*.py"))


def module_names() -> list[str]:
    """Return the dotted names, as an installed package has them."""
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in OURS]
    names += [f"vtk_segdeform.widgets.{path.stem}" for path in WIDGETS]
    return [name.removesuffix(".__init__") for name in names]


@pytest.mark.parametrize("name", module_names())
def test_the_examples_print_what_they_say(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # an example that writes a file writes it here
    module = importlib.import_module(name)
    failed, _ = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert not failed


def test_an_example_that_lies_is_caught():
    liar = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "liar", None, 0)
    assert doctest.DocTestRunner(verbose=False).run(liar, out=lambda _: None).failed == 1
