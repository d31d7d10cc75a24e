"""Processor time, child processes, and the conditions of a run."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
import scipy

from ..errors import MissingDependencyError
from ..interpreter import spawning
from ..kernels import compiled_kernels, n_threads
from ..version import __version__

_T = TypeVar("_T")
_P = ParamSpec("_P")
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def timed(work: Callable[[], _T]) -> tuple[_T, float]:
    """Return the result of *work* and its processor time in seconds, over all cores."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def by_turns(works: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Return the median processor time of each of *works*, in seconds.

    They run alternately, each twice, and the first one, which fills the caches, is not timed.
    """

    def warm(work: Callable[[], object]) -> float:
        work()
        return timed(work)[1]

    rounds = [[warm(work) for work in works] for _ in range(repeats)]
    return [statistics.median(times) for times in zip(*rounds, strict=True)]


def in_own_process(work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
    """Return the result of *work*, a function of a module, run in a new process.

    It has memory, threads and OpenGL of its own.

    Raises
    ------
    MissingDependencyError
        If the process crashed.
    """
    try:
        with spawning() as context:
            pool = ProcessPoolExecutor(1, mp_context=context)
            result = pool.submit(work, *args, **kwargs)
        with pool:
            return result.result()
    except BrokenProcessPool:
        raise MissingDependencyError("its process crashed") from None


def conditions() -> list[str]:
    """Describe the machine and the software, one line each."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    limits = ", ".join(f"{name}={os.environ[name]}" for name in _THREADS if name in os.environ)
    load = f"; load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return [
        f"{_processor()}; {cores} cores for this process; {platform.system()}{load}",
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"vtk_segdeform {__version__}",
        f"{n_threads()} threads, with{'' if compiled_kernels() else 'out'} compiled kernels; "
        f"threads of other libraries: {limits or 'not limited'}",
    ]


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
