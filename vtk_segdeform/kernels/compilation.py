"""Compilation of all kernels in the background, once per machine and version.

    is_pending()    whether the kernels are not in numba's cache yet
    begin()         start processes that compile them, unless others do already
    wait()          return when they are in the cache

Each kernel takes up to a second, all of them 20 s of processor time.  Processes of low priority
compile them side by side, and then write an empty file, the stamp, to the folder that numba's
cache is in.  Its name is a hash of what numba's cache depends on.

They are not waited for, not even at the end of this process: they continue, so that the next
process finds compiled kernels, and so does the process after one that was killed, as numba writes
each kernel at once and renames its files.  A lock file lets only one process start them.
Where none can be started, or numba's cache cannot be written, a kernel is compiled when it is
called, by the process that calls it.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path

from .. import files
from ..errors import MissingDependencyError
from ..importing import imported, in_thread
from ..interpreter import python_command, python_environment

_MOST = 4  # processes: each takes 200 MB of memory
_NICE = 10  # on Windows: below normal
_POLL = 0.1  # seconds
_CODE = "from vtk_segdeform.kernels import compilation; compilation.{}"
_FOLDER = Path(__file__).parent / "compiled"
_STAMP = ".segdeform-{}.compiled"
_LOCK = ".segdeform-compiling.lock"

_started: list[Future[int]] = []  # the exit codes of processes that this one has started


def is_pending() -> bool:
    """Tell whether kernels would be compiled when they are called, and should not be called yet.

    False as well if compiling them in the background has failed, or is impossible.
    """
    stamp = _stamp()
    if stamp is None or stamp.exists():
        return False
    return not any(each.done() and each.result() for each in _started)


def begin() -> None:
    """Begin to compile the kernels in the background, unless they are being compiled or cached."""
    stamp = _stamp()
    if stamp is None or not is_pending():
        return
    if _started and _started[-1].done():  # because another process was compiling them
        _started.clear()
    if not _started and not _is_locked(stamp):
        _started.append(_start("compile_all()"))


def wait() -> None:
    """Return when `is_pending` is False."""
    while is_pending():
        begin()
        time.sleep(_POLL)


def compile_all() -> None:
    """Compile all kernels, in this process and others; called in a process of its own."""
    _let_others_go_first()
    stamp = _stamp()
    handle = None if stamp is None else files.hold(stamp.parent / _LOCK)
    if stamp is None or handle is None or stamp.exists():
        return
    waiting, end = os.pipe()  # the numbers of files: each process reads the next
    os.write(end, bytes(range(len(_sources()))))
    os.close(end)
    others = [_start("compile_some(0)", waiting) for _ in range(1, _n_processes())]
    compile_some(waiting)
    for other in others:
        other.result()
    _compile(_sources())  # what another process has left because it was killed
    stamp.touch()


def compile_some(waiting: int) -> None:
    """Compile the files whose numbers are read from *waiting*, one byte each."""
    _let_others_go_first()
    while number := os.read(waiting, 1):
        _compile([_sources()[number[0]]])


def _let_others_go_first() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the process at the terminal
    if hasattr(os, "nice"):
        os.nice(max(_NICE - os.nice(0), 0))


def _sources() -> list[Path]:
    """Return the files with kernels, large ones first, as they take longer."""
    return sorted(_FOLDER.glob("*.py"), key=lambda file: (-file.stat().st_size, file))


def _compile(sources: list[Path]) -> None:
    """Compile the kernels in *sources*, or load them if they are in the cache.

    A kernel is in the same file as those that it calls, so no two processes save the same one.
    """
    compiled = imported(f"{__package__}.compiled.kernels")
    imported(f"{__package__}.compiled")
    names = {file.stem for file in sources}
    for kernel, combinations in compiled.KERNELS:
        if kernel.py_func.__module__.rpartition(".")[2] in names:
            for types in combinations:
                kernel.compile(types)


def _start(call: str, stdin: int = subprocess.DEVNULL) -> Future[int]:
    """Start a process that calls a function of this module; return its future exit code."""
    variables = {}
    if folder := os.environ.get("NUMBA_CACHE_DIR"):
        variables["NUMBA_CACHE_DIR"] = os.path.abspath(folder)
    try:
        process = subprocess.Popen(
            python_command(_CODE.format(call)), env=python_environment(**variables),
            cwd=sys.prefix, stdin=stdin, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            creationflags=getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
            | getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )  # fmt: skip
    except (OSError, MissingDependencyError):
        failed = Future[int]()
        failed.set_result(1)
        return failed
    return in_thread(process.wait, daemon=True)


def _n_processes() -> int:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(cores or 1, _MOST)


def _is_locked(stamp: Path) -> bool:
    """Tell whether another process is compiling the kernels."""
    try:
        handle = files.hold(stamp.parent / _LOCK)
    except OSError:
        return False
    if handle is None:
        return True
    os.close(handle)
    return False


@functools.cache
def _stamp() -> Path | None:
    """Return the file that says that the kernels are in the cache.

    None if numba is missing, or there is no folder to write its cache to.
    """
    found = importlib.util.find_spec("numba")
    folder = _folder()
    if found is None or found.origin is None or folder is None:
        return None
    key = hashlib.blake2b(Path(found.origin).with_name("_version.py").read_bytes(), digest_size=8)
    states = ((file.name, file.stat()) for file in _sources())
    sources = (f"{name} {state.st_mtime_ns} {state.st_size}" for name, state in states)
    place = "" if folder.is_relative_to(_FOLDER) else str(_FOLDER)  # a copied tree stays compiled
    for part in (*sources, place, sys.version, *_processor()):
        key.update(part.encode())
    return folder / _STAMP.format(key.hexdigest())


def _processor() -> tuple[str, ...]:
    """Return what machine code depends on."""
    binding = imported("llvmlite.binding")
    chosen = (os.environ.get(f"NUMBA_CPU_{part}", "") for part in ("NAME", "FEATURES"))
    features = binding.get_host_cpu_features().flatten()
    return (binding.get_process_triple(), binding.get_host_cpu_name(), features, *chosen)


def _folder() -> Path | None:
    """Return a folder for the stamp: the first that can be written to, in the order of numba.

    None if there is none, or ``SEGDEFORM_CACHE=0`` excludes the user's.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    for folder in (given, _FOLDER / "__pycache__", files.cache_folder()):
        if folder:
            try:
                os.makedirs(folder, exist_ok=True)
            except OSError:
                continue
            if os.access(folder, os.W_OK):
                return Path(folder).absolute()
    return None
