"""Fast loops: threads, and compiled kernels, each with an equivalent in numpy.

The files, in reading order:

    compilation compilation of the kernels in the background, once
    dispatch    compiled kernels if numba is available and the arrays are large enough
    threads     parallel loops over rows
    compiled    the kernels, compiled by numba
"""

from .dispatch import (
    advice,
    compiled_checks,
    compiled_kernels,
    inputs,
    is_compiling,
    load_early,
    load_for,
    load_late,
    wait_until_compiled,
    writable,
)
from .threads import (
    ROWS_AT_ONCE,
    in_parallel,
    n_threads,
    nearest,
    one_blas_thread,
    one_thread,
    quick_turns,
)

__all__ = [
    "ROWS_AT_ONCE",
    "advice",
    "compiled_checks",
    "compiled_kernels",
    "in_parallel",
    "inputs",
    "is_compiling",
    "load_early",
    "load_for",
    "load_late",
    "n_threads",
    "nearest",
    "one_blas_thread",
    "one_thread",
    "quick_turns",
    "wait_until_compiled",
    "writable",
]
