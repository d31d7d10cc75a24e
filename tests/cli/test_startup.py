"""Imports of the command line: help and version need neither numpy nor a toolkit."""

from __future__ import annotations

import argparse
import subprocess
import sys

import pytest

from vtk_segdeform.benchmarks import report
from vtk_segdeform.cli.main import COMMANDS, EXPERIMENTS, _parser, command

EXPENSIVE = {
    "matplotlib", "numba", "PySide6", "pyvista", "pyvistaqt", "qtpy", "scipy", "vtk",
    "vtkmodules", "vtk_segdeform.benchmarks", "vtk_segdeform.cli.commands", "vtk_segdeform.widgets",
}  # fmt: skip


def imported_by(*words: str) -> set[str]:
    """Return the modules that a command imports, as the installed program runs it."""
    code = (
        "import sys; from vtk_segdeform.cli import main; "
        f"code = main({list(words)}); print('modules:', *sys.modules); sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.rpartition("modules:")[2].split())


@pytest.mark.parametrize("words", [["--help"], ["bench", "--help"], ["deform", "--help"]])
def test_help_imports_neither_numpy_nor_a_toolkit_nor_the_benchmarks(words):
    assert not imported_by(*words) & (EXPENSIVE | {"numpy"})


def test_the_version_imports_no_toolkit_and_no_benchmarks():
    assert not imported_by("--version") & EXPENSIVE


def test_every_command_has_a_function():
    (commands,) = (
        action.choices
        for action in _parser()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    assert set(COMMANDS) == set(commands)
    for name in commands:
        assert command(name).__name__ == name


def test_the_experiments_of_the_help_are_those_of_the_benchmarks():
    assert list(EXPERIMENTS) == list(report.EXPERIMENTS)
