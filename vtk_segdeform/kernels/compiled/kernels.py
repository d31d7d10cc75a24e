"""Compilation of the kernels by numba: without the GIL, and cached on disk where possible.

numba caches compiled code in ``NUMBA_CACHE_DIR``, beside the source or, if that is read-only, in
the user's cache folder.  Without any writable folder numba raises an error; the kernels are then
compiled again in every process.

numba cannot be interrupted while it compiles or loads a kernel: its tables would stay incomplete.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import numba
from numba import types

from ...importing import completed

_ARGUMENT = re.compile(r"(const )?(\w+)(\[[:,]+\])?")

KERNELS: list[tuple[Any, list[tuple[Any, ...]]]] = []
"""Each kernel that is called from Python, and the types that it is called with."""


def kernel(**options: Any) -> Any:
    """Return a decorator for kernels that numba compiles with these *options*.

    The decorator takes the types of the arguments, one string for each combination, such as
    ``"const f8[:,:], i8[:], f8"``; ``const`` for an array from `dispatch.inputs`.  `compile_for`
    compiles these in advance.  Others are compiled when they occur, and so are kernels without
    types, which other kernels call.
    """
    # Nothing calls a kernel from C, and an entry for that is a fifteenth of the compilation.
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}

    def compiled(*combinations: str) -> Any:
        def made(function: Any) -> Any:
            try:
                made = numba.njit(cache=True, **options)(function)
            except RuntimeError:  # no writable cache folder
                made = numba.njit(**options)(function)
            compile_for = made._compile_for_args  # called for each new list of types
            made._compile_for_args = lambda *args: completed(partial(compile_for, *args))
            if combinations:
                KERNELS.append((made, [_types(each) for each in combinations]))
            return made

        return made

    return compiled


def _types(combination: str) -> tuple[Any, ...]:
    """Return numba's types for a string such as ``"const f8[:,:], i8[:], f8"``."""
    found = []
    for const, name, dimensions in _ARGUMENT.findall(combination):
        kind = getattr(types, name)
        if dimensions:
            kind = types.Array(kind, dimensions.count(":"), "C", readonly=bool(const))
        found.append(kind)
    return tuple(found)
