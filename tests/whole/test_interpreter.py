"""No process of ours runs a file of the folder that the user works in."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys

import pytest

from vtk_segdeform import interpreter
from vtk_segdeform.benchmarks import in_own_process
from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.interpreter import python_command, python_environment
from vtk_segdeform.pictures import canvas


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a module of every name that could be imported; each writes "run"."""
    place = tmp_path_factory.mktemp("downloads")
    names = {*sys.stdlib_module_names, *importlib.metadata.packages_distributions()}
    names |= {name.partition(".")[0] for name in sys.modules} | {"sitecustomize", "usercustomize"}
    for name in filter(str.isidentifier, names):
        text = f"open({str(place / 'run')!r}, 'a').write({name!r} + ' ')\n"
        (place / f"{name}.py").write_text(text)
    return place


@pytest.fixture
def downloads(folder, monkeypatch):
    """Work in `folder`, with an empty entry in PYTHONPATH; nothing there may have been run."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep + os.environ.get("PYTHONPATH", "elsewhere"))
    monkeypatch.setattr(sys, "path", ["", ".", *sys.path])
    yield folder
    assert not (folder / "run").exists(), (folder / "run").read_text()


def output_of(code, *options):
    command = python_command(code, "one", "two", options=options)
    done = subprocess.run(
        command, env=python_environment(FOUND="x"), capture_output=True, text=True, check=True
    )
    return done.stdout.split()


def test_the_folder_would_be_run_otherwise(folder):
    command = [sys.executable, "-c", "import random"]
    assert subprocess.run(command, cwd=folder, check=False, stderr=subprocess.DEVNULL)
    assert (folder / "run").read_text()  # Python 3.13 imports linecache before the code
    (folder / "run").unlink()


def test_a_process_imports_what_this_one_does(downloads):
    code = (
        "import random, runpy, sys, numpy, vtk_segdeform; import os;"
        "print(vtk_segdeform.__file__, *sys.argv[1:], os.environ['FOUND'])"
    )
    for options in ((), ("-S",)):
        file, *others = output_of(code, *options)
        assert file == sys.modules["vtk_segdeform"].__file__
        assert others == ["one", "two", "x"]


def test_a_checkout_in_the_working_directory_is_found_after_everything_else(monkeypatch):
    monkeypatch.chdir(interpreter._ROOT)
    outside = [entry for entry in sys.path if entry and not entry.startswith(interpreter._ROOT)]
    monkeypatch.setattr(sys, "path", ["", *outside])
    code = "import sys, vtk_segdeform.errors; print(*sys.path[-1:], vtk_segdeform.__file__)"
    assert output_of(code, "-S") == [interpreter._ROOT, sys.modules["vtk_segdeform"].__file__]


@pytest.mark.usefixtures("downloads")
def test_pictures_are_checked_elsewhere():
    canvas.require_offscreen.__wrapped__()


def test_benchmarks_run_elsewhere(downloads):
    assert in_own_process(os.getcwd) != str(downloads)
    assert os.getcwd() == str(downloads)


def test_an_application_without_interpreter_starts_no_process(monkeypatch):
    monkeypatch.setattr(interpreter.spawn, "get_executable", lambda: "/opt/editor/bin/editor")
    monkeypatch.setattr(subprocess, "run", None)
    with pytest.raises(MissingDependencyError, match="no Python interpreter"):
        python_command("")
    canvas.require_offscreen.__wrapped__()
    monkeypatch.setattr(interpreter.spawn, "get_executable", lambda: sys.executable.encode())
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert interpreter.python_program() is None
