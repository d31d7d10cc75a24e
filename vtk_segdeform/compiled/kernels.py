"""How the kernels are compiled: without the interpreter's lock, and kept on disk where they can be.

numba keeps them beside the source or, where that cannot be written, in a folder of the user's; or
in the one that ``NUMBA_CACHE_DIR`` names.  Where there is none at all it would refuse; then every
process compiles for itself.
"""

from __future__ import annotations

from typing import Any

import numba


def kernel(**options: Any) -> Any:
    """Return a decorator that compiles a function with numba's *options* at its first call."""
    options = {"nogil": True, "error_model": "numpy", **options}

    def compiled(function: Any) -> Any:
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError:  # no folder to keep it in
            return numba.njit(**options)(function)

    return compiled
