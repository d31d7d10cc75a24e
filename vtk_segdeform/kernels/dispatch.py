"""Whether the compiled kernels are at hand; every one has a twin in numpy that does as well.

    kernels = compiled_kernels()        the module `compiled`, or None

numba is installed with the package wherever it has wheels.  Importing it takes half a second, so it
is imported with the first array that is large enough to make up for that.  Without it everything
works, more slowly, and `advice` says so; ``SEGDEFORM_NUMBA=0`` disables it.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import sizes

_LIBRARIES = "numba", "threadpoolctl"  # required for speed only


def compiled_kernels(size: int | None = None) -> Any:
    """Return the compiled kernels; None without numba, or if *size* is not worth a call."""
    return _kernels() if size is None or size >= sizes.COMPILED else None


def advice() -> str:
    """Return a sentence on what to install for fast frames; "" if nothing is missing."""
    missing = [name for name in _LIBRARIES if importlib.util.find_spec(name) is None]
    if not missing:
        return ""
    times = "3 to 6 times as long" if "numba" in missing else "longer"
    verb = "are" if len(missing) > 1 else "is"
    return (
        f"{' and '.join(missing)} {verb} not installed: frames take {times}. "
        f"pip install {' '.join(missing)}"
    )


def inputs(*arrays: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return *arrays* in the one form that kernels are compiled for: contiguous and read-only."""
    plain = [np.ascontiguousarray(array).view() for array in arrays]
    for array in plain:
        array.setflags(write=False)
    return tuple(plain)


def writable(array: NDArray[Any]) -> NDArray[Any]:
    """Return *array*, contiguous and writable: as new ones are, which are handed over as they are.

    For kernels of some microseconds: after each has gone over what does not fit in a cache, Python
    starts cold, and `inputs` takes as long as they do.
    """
    return array if array.flags.carray else np.array(array, order="C")


@functools.cache
def _kernels() -> Any:
    if os.environ.get("SEGDEFORM_NUMBA", "1") == "0":
        return None
    try:
        return importlib.import_module(".compiled", __package__)
    except ImportError:  # no numba, or one that does not fit this numpy
        return None
