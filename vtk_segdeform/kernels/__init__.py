"""Fast loops: threads, and compiled kernels that each have a twin in numpy.

The files, in reading order:

    dispatch    compiled kernels where numba is available and the array is large enough
    threads     long loops over rows on all cores
    compiled    the kernels themselves, compiled by numba
"""

from .dispatch import advice, compiled_kernels, inputs, writable
from .threads import in_parallel, n_threads, one_blas_thread

__all__ = [
    "advice",
    "compiled_kernels",
    "in_parallel",
    "inputs",
    "n_threads",
    "one_blas_thread",
    "writable",
]
