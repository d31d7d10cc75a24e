"""Reading of files by VTK and PyMeshLab in a confined process.

Their readers trust a file: a wrong count, deep nesting or an exponential entity can crash the
process, and a file can name other files that are then read as well.  So `reading_child` runs them
in another process, which is limited to the given file, and returns plain arrays.  These are
checked here, and again by whoever uses them; nothing of them is read by VTK.

The process starts in 0.2 s and is kept for the next file.  A frozen or embedded application has no
Python interpreter to start, so it reads in its own process and logs a warning.
"""

from __future__ import annotations

import atexit
import importlib.util
import io
import json
import logging
import math
import os
import re
import signal
import subprocess
import tempfile
import threading
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import MeshError
from ..files import landlock
from ..interpreter import python_program
from . import reading_child

_log = logging.getLogger(__name__)
_SECONDS, _PER_MEGABYTE = 30.0, 2.0
_MEMORY, _REPLY, _PER_BYTE = 2 << 30, 64 << 20, 64  # bytes, and more for each of the file
_LONGEST = 65_536  # bytes of a name
_FRAME = 256  # bytes of the headers of a name and its values
_MAGIC = b"\x93NUMPY\x01\x00"
_HEAD = re.compile(  # what `reading_child` writes; numpy evaluates a header as an expression
    rb"\{'descr': '([<>|][iuf][1248])', 'fortran_order': False, 'shape': \(([\d, ]{0,60})\), \} *\n"
)
_PACKAGES = {"vtk": ("vtkmodules", "numpy"), "meshlab": ("pymeshlab", "numpy")}
_KEPT = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT", "TEMP")
_START = "import runpy, sys; sys.path += {path!r}; runpy.run_path({child!r}, run_name='__main__')"
Arrays = dict[str, Any]


def read_confined(tool: str, path: Path) -> Arrays:
    """Return the arrays that *tool*, "vtk" or "meshlab", finds in a file, by name.

    They are numbers of at most 64 bits; `reading_child` lists their names.

    Raises
    ------
    MeshError
        If the file cannot be read, takes too much memory or time, or crashes the reader.
    """
    path = path.absolute()
    size = path.stat().st_size
    request: dict[str, Any] = {
        "tool": tool,
        "path": str(path),
        "memory": _MEMORY + _PER_BYTE * size,
        "seconds": math.ceil(_SECONDS + _PER_MEGABYTE * size / 1e6),
    }
    most = _REPLY + _PER_BYTE * size
    python = python_program()
    if python is None:
        _log.warning("%s is read without protection: no Python interpreter was found", path)
        reply = io.BytesIO()
        reading_child.answer(reply, **request)
        reply.seek(0)
        arrays = _reply(reply, most)
    else:
        with _lock:
            idle = _idle.pop(tool, None)
        if idle is not None and not idle.is_alive():
            idle.end()
            idle = None
        child = idle or _Child(python, tool)
        try:
            arrays = child.read(request, most)
        except BaseException:  # Ctrl+C as well
            child.end()
            raise
        with _lock:
            surplus = _idle.get(tool)
            _idle[tool] = child
        if surplus is not None:
            surplus.end()
    if (error := arrays.get("error")) is not None:
        raise MeshError(error.tobytes().decode(errors="replace"))
    return arrays


class _Child:
    """A process that reads one file after another."""

    def __init__(self, python: str, tool: str) -> None:
        paths = dict.fromkeys(filter(None, map(_folder_of, _PACKAGES[tool])))
        paths[str(Path(landlock.__file__).parent)] = None
        start = _START.format(path=list(paths), child=reading_child.__file__)
        self._empty = tempfile.TemporaryDirectory(prefix="segdeform-")
        self._process: subprocess.Popen[bytes] = subprocess.Popen(
            [python, "-I", "-S", "-X", "utf8", "-c", start],
            cwd=self._empty.name, env=_environment(), start_new_session=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )  # fmt: skip
        if os.name == "posix":  # elsewhere a folder in use cannot be removed
            self._empty.cleanup()

    def read(self, request: dict[str, Any], most: int) -> Arrays:
        """Return the arrays of the reply to *request*; MeshError if there is none."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        is_late = threading.Event()

        def stop() -> None:
            is_late.set()
            self._kill()

        timer = threading.Timer(request["seconds"], stop)
        timer.start()
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
            return _reply(self._process.stdout, most)
        except (EOFError, OSError):
            code = self._process.wait()
            if is_late.is_set():
                raise MeshError(f"reading was stopped after {request['seconds']} s") from None
            names = {each.value: each.name for each in signal.Signals}
            if code < 0:  # the process that waits for requests, which opens no file
                how = names.get(-code, f"signal {-code}")
                raise MeshError(f"another program ended the reader ({how}); try again") from None
            how = names.get(code - 128, f"code {code}")
            raise MeshError(
                f"the reader crashed ({how}); the file is damaged or too large"
            ) from None
        finally:
            timer.cancel()

    def is_alive(self) -> bool:
        return self._process.poll() is None

    def end(self) -> None:
        """End the process, and what it has started."""
        self._kill()
        self._process.wait()
        self._empty.cleanup()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:  # what was not written before
                    continue

    def _kill(self) -> None:
        if hasattr(os, "killpg") and self._process.returncode is None:
            try:
                os.killpg(self._process.pid, signal.SIGKILL)
            except ProcessLookupError:
                return
        else:
            self._process.kill()


_idle: dict[str, _Child] = {}  # by tool
_lock = threading.Lock()


@atexit.register
def _end_all() -> None:
    while _idle:
        _idle.popitem()[1].end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # the pipes are the parent's


def _reply(stream: IO[bytes], most: int) -> Arrays:
    """Return the arrays of a reply by name; MeshError if they take more than *most* bytes."""
    arrays: Arrays = {}
    while True:
        name = _array(stream, _LONGEST)
        if not len(name):
            return arrays
        values = _array(stream, most)
        most -= values.nbytes + _FRAME  # also for empty arrays, of which there could be any number
        arrays[name.tobytes().decode()] = values


def _array(stream: IO[bytes], most: int) -> Any:
    """Return the next array, in numpy's format; MeshError if it is not one of plain numbers.

    EOFError if the stream ends before it does.
    """
    begin = _exactly(stream, len(_MAGIC) + 2)
    head = _exactly(stream, int.from_bytes(begin[len(_MAGIC) :], "little"))
    found = _HEAD.fullmatch(head)
    if not begin.startswith(_MAGIC) or found is None:
        raise MeshError("the reader did not return plain numbers")
    kind = np.dtype(found[1].decode())
    shape = tuple(int(each) for each in found[2].decode().split(",") if each.strip())
    size = math.prod(shape) * kind.itemsize
    if size > most:
        raise MeshError(f"its data take more than {_PER_BYTE} times the memory of the file")
    return np.frombuffer(_exactly(stream, size), dtype=kind).reshape(shape)


def _exactly(stream: IO[bytes], size: int) -> bytearray:
    """Return the next *size* bytes; EOFError if there are fewer."""
    data = bytearray(size)
    rest = memoryview(data)
    while len(rest):
        n_read = stream.readinto(rest)  # type: ignore[attr-defined]
        if not n_read:
            raise EOFError
        rest = rest[n_read:]
    return data


def _folder_of(package: str) -> str | None:
    """Return the folder that *package* is imported from."""
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        return None
    return str(Path(found.origin).absolute().parent.parent)


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    if os.name == "nt" and "PATH" in os.environ:  # libraries are found there
        kept["PATH"] = os.environ["PATH"]
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    return kept | dict.fromkeys(threads, "1")
