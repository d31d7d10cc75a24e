"""Python processes of ours, which import nothing from the working directory.

    python_command(code, ...)   the command of a process that runs *code*
    python_environment()        its environment
    spawning()                  the same for processes that multiprocessing starts

With ``-c`` and ``-m`` Python looks for modules in the working directory first.  That is where the
user has downloads, and a file ``random.py`` among them would be run.  So the code of a process
begins by setting its path to that of this process; `sys` is built in.  Before the code, Python 3.13
imports `linecache`: PYTHONSAFEPATH, which Python 3.10 does not know and does not need, leaves the
working directory out.  The option ``-I`` would also ignore PYTHONHOME, without which some
applications with Python inside cannot start it.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from multiprocessing import get_context, spawn
from multiprocessing.context import SpawnContext
from pathlib import Path

from .errors import MissingDependencyError

_ROOT = str(Path(__file__).resolve().parents[1])


def python_command(code: str, *arguments: str, options: Sequence[str] = ()) -> list[str]:
    """Return the command of a process that runs *code*, to be started with `python_environment`.

    Parameters
    ----------
    code : str
        Imports what this process can import, apart from modules in the working directory.
    *arguments : str
        Its ``sys.argv[1:]``.
    options : sequence of str
        Options of the interpreter, such as ``-S``.

    Raises
    ------
    MissingDependencyError
        If there is no interpreter to start, as in a frozen or embedded application.
    """
    python = python_program()
    if python is None:
        raise MissingDependencyError("this application has no Python interpreter to start")
    start = f"import sys; sys.path[:] = {_module_path()!r}\n{code}"
    return [python, *options, "-c", start, *arguments]


def python_environment(**variables: str) -> dict[str, str]:
    """Return the environment of a process of ours: that of this one, changed by *variables*.

    PYTHONPATH is left out: an empty entry means the working directory, and `python_command` has the
    others.
    """
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return {**inherited, "PYTHONSAFEPATH": "1", **variables}


def python_program() -> str | None:
    """Return the path of the Python interpreter, or None if there is none to start."""
    program = spawn.get_executable()
    if getattr(sys, "frozen", False) or not program:
        return None
    name = os.fsdecode(program)
    return name if Path(name).stem.lower().startswith(("python", "pypy", "pvpython")) else None


@contextlib.contextmanager
def spawning() -> Iterator[SpawnContext]:
    """Yield a context whose processes are started within this ``with`` block.

    They import `multiprocessing` before their path can be set, so meanwhile the working directory
    is the folder of the Python installation, and it is theirs from then on.
    """
    folder = os.getcwd()
    os.chdir(sys.prefix)
    try:
        yield get_context("spawn")
    finally:
        os.chdir(folder)


def _module_path() -> list[str]:
    """Return the absolute entries of the path, and last the folder of this package."""
    path = [entry for entry in sys.path if os.path.isabs(entry)]
    return path if _ROOT in path else [*path, _ROOT]
