"""Compilation of the kernels by numba: without the GIL, and cached on disk where possible.

numba caches compiled code in ``NUMBA_CACHE_DIR``, beside the source or, if that is read-only, in
the user's cache folder.  Without any writable folder numba raises an error; the kernels are then
compiled again in every process.

numba cannot be interrupted while it compiles or loads a kernel: its tables would stay incomplete.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numba

from ...importing import completed


def kernel(**options: Any) -> Any:
    """Return a decorator that compiles a function with numba's *options* at its first call."""
    # Nothing calls a kernel from C, and an entry for that is a fifteenth of the compilation.
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}

    def compiled(function: Any) -> Any:
        try:
            made = numba.njit(cache=True, **options)(function)
        except RuntimeError:  # no writable cache folder
            made = numba.njit(**options)(function)
        compile_for = made._compile_for_args  # called for each new list of types
        made._compile_for_args = lambda *args: completed(partial(compile_for, *args))
        return made

    return compiled
