"""Measuring time, and running in a child process.

Programs that may crash or compete for threads run in a child process, by `in_own_process`.
"""

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
    """Return the result of *work* and its seconds."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def by_turns(works: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Return the median processor time of each of *works*, in seconds, run alternately."""
    rounds = [[processor_seconds(work, 1) for work in works] for _ in range(repeats)]
    return [statistics.median(times) for times in zip(*rounds, strict=True)]


def processor_seconds(work: Callable[[], object], repeats: int) -> float:
    """Return the processor time of one run of *work*, over all cores."""
    work()
    start = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - start) / repeats


def in_own_process(work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
    """Return the result of *work*, a function of a module, run in a new process.

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


def run_in(own_process: bool, work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
    """Return the result of *work*, run in a new process or in this one."""
    return in_own_process(work, *args, **kwargs) if own_process else work(*args, **kwargs)


def conditions() -> list[str]:
    """Describe the machine and the software, one line each."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    limits = ", ".join(f"{name}={os.environ[name]}" for name in _THREADS if name in os.environ)
    return [
        f"{processor()}; {cores} cores for this process; {platform.system()}{_load()}",
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"vtk_segdeform {__version__}",
        f"{n_threads()} threads, with{'' if compiled_kernels() else 'out'} compiled kernels; "
        f"threads of other libraries: {limits or 'not limited'}",
    ]


def _load() -> str:
    """Return the load of the machine, with a warning if it is too high to measure time."""
    if not hasattr(os, "getloadavg"):
        return ""
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    warning = "; **the machine is busy: times are unreliable**" if load > cores + 0.5 else ""
    return f"; load {load:.1f} in the last minute{warning}"


def processor() -> str:
    """Return the name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
