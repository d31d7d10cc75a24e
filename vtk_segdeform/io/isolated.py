"""Reading of files by native libraries in a child process, with limits on memory and time.

The readers of VTK and PyMeshLab do not validate files: a wrong count, deep nesting or an
exponential entity can crash the process.  So a child process, `reading_child`, reads the file and
returns the result in files written by VTK.  It starts in 0.2 s.

A frozen or embedded application has no Python interpreter to start, so it reads in its own process
and logs a warning.
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import spawn
from pathlib import Path

from ..errors import MeshError
from . import reading_child

_log = logging.getLogger(__name__)
_SECONDS, _PER_MEGABYTE = 30.0, 2.0
_MEMORY, _PER_BYTE = 2 << 30, 64  # bytes, in addition to a multiple of the file size
_START = """import runpy, sys
sys.path[:] = {path!r}
if {tool!r} == "vtk":
    sys.modules["numpy"] = None  # VTK works without it and starts in half the time
runpy.run_path({child!r}, run_name="__main__")
"""


@contextmanager
def read_isolated(tool: str, path: Path) -> Iterator[Path]:
    """Read *path* in a child process; yield the folder with the results of `reading_child`.

    Parameters
    ----------
    tool : str
        "vtk" or "meshlab".
    path : Path
        The file to read.

    Raises
    ------
    MeshError
        If the file cannot be read, takes too much memory or time, or crashes the process.
    """
    size = path.stat().st_size
    seconds = _SECONDS + _PER_MEGABYTE * size / 1e6
    with tempfile.TemporaryDirectory(prefix="segdeform-") as name:
        folder = Path(name)
        python = _python()
        if python is None:
            _log.warning("%s is read without protection: no Python interpreter was found", path)
            reading_child.main(tool, str(path.absolute()), name, "0")
            code = 0
        else:
            start = _START.format(path=sys.path, tool=tool, child=reading_child.__file__)
            try:
                arguments = [tool, str(path.absolute()), name, str(_MEMORY + _PER_BYTE * size)]
                code = _exit_code([python, "-S", "-c", start, *arguments], name, seconds)
            except subprocess.TimeoutExpired:
                raise MeshError(f"reading was stopped after {seconds:.0f} s") from None
        error = folder / "error.txt"
        if error.exists():
            raise MeshError(error.read_text(encoding="utf-8"))
        if code:
            how = signal.Signals(-code).name if code < 0 else f"code {code}"
            raise MeshError(f"the reader crashed ({how}); the file is damaged or too large")
        yield folder


def _exit_code(arguments: list[str], folder: str, seconds: float) -> int:
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    done = subprocess.run(
        arguments, cwd=folder, env={**os.environ, **one_thread}, timeout=seconds, check=False,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )  # fmt: skip
    return done.returncode


def _python() -> str | None:
    """Return the path of the Python interpreter, or None if there is none to start."""
    program = spawn.get_executable()
    if getattr(sys, "frozen", False) or not program:
        return None
    name = os.fsdecode(program)
    return name if Path(name).stem.lower().startswith(("python", "pypy", "pvpython")) else None
