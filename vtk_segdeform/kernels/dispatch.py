"""Choice between compiled kernels and their equivalents in numpy.

    kernels = compiled_kernels()        the module `compiled`, or None
    kernels = compiled_checks(size)     the same for short checks, which are not worth an import
    load_for(n_vertices)                import them now, if they pay for such a mesh
    load_early()                        import them before they are needed
    load_late()                         do without them for small arrays until then
    wait_until_compiled()               use them from now on, even if they must be compiled first

numba is installed with the package on platforms that have wheels of it.  Importing it takes half a
second, so it is imported for the first array that is large enough.  Without it everything works,
but more slowly, and `advice` says so; ``SEGDEFORM_NUMBA=0`` disables it.

As long as the kernels are being compiled (`compilation`), their equivalents serve.  Both agree up
to rounding, not bit for bit, so a process changes over only once, and never within a drag or a
solve: when a mesh is prepared, and in an editor when the hand has rested.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import sys
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import sizes
from ..importing import imported
from . import compilation
from .threads import quick_turns

_LIBRARIES = "numba", "threadpoolctl"  # required for speed only
_checked = [0]  # faces processed so far by equivalents in numpy
_is_late = [False]  # whether small arrays are processed in numpy until the kernels are loaded
_does_without: list[bool | None] = [None]  # whether they are being compiled; None: to be found out


def compiled_kernels(size: int | None = None) -> Any:
    """Return the compiled kernels; None without numba, or if *size* is not worth a call."""
    if size is not None and size < (sizes.COMPILED_LATE if _is_late[0] else sizes.COMPILED):
        return None
    kernels = _kernels()
    if kernels is not None:
        _is_late[0] = False
    return kernels


def compiled_checks(size: int) -> Any:
    """Return the compiled kernels for checks of meshes; None while importing numba does not pay.

    Many programs check a few meshes and need no other kernel.  So numba is imported only after the
    equivalents in numpy have processed so many faces that they have taken as long as the import,
    and after `load_late` not for a small array.  Both give the same results.
    """
    if _is_late[0] and size < sizes.COMPILED_LATE:
        return None
    if f"{__package__}.compiled" not in sys.modules:
        _checked[0] += size
        if _checked[0] < sizes.COMPILED_CHECKS:
            return None
    return _kernels()


def load_for(n_vertices: int) -> None:
    """Load the compiled kernels now if preparing a mesh of so many vertices would use them."""
    _catch_up()
    if n_vertices > sizes.COMPILED_PREPARATION:
        _load()


def load_early() -> bool:
    """Begin to load the compiled kernels in another thread, if they are not loaded yet.

    Until the thread has ended, `compiled_kernels` waits for it, except after `load_late`.  Return
    True if it is too early, because they are being compiled.
    """
    _catch_up()
    if is_compiling():
        return True
    if not _module.cache_info().currsize:
        Thread(target=quick_turns()(_load), name="segdeform kernels").start()
    return False


def load_late() -> None:
    """Process arrays of less than `sizes.COMPILED_LATE` in numpy until the kernels are loaded.

    An editor calls this for its first mesh, `load_for` before work that takes longer than the
    import, and `load_early` after the first drag.
    """
    _is_late[0] = not _module.cache_info().currsize


def is_compiling() -> bool:
    """Tell whether kernels are not used yet because they are being compiled in the background."""
    return _is_enabled() and _waits() and compilation.is_pending()


def wait_until_compiled() -> None:
    """Return when the kernels have been compiled, to be used from now on."""
    if _is_enabled():
        compilation.wait()
        _catch_up()


def _missing() -> list[str]:
    """Return the names of the libraries that make frames faster and are not installed."""
    return [name for name in _LIBRARIES if importlib.util.find_spec(name) is None]


def advice() -> str:
    """Return a sentence about missing libraries that make frames faster; "" if none is missing."""
    missing = _missing()
    if not missing:
        return ""
    times = "3 to 6 times as long" if "numba" in missing else "longer"
    verb = "are" if len(missing) > 1 else "is"
    return (
        f"{' and '.join(missing)} {verb} not installed: frames take {times}. "
        f"pip install {' '.join(missing)}"
    )


def inputs(*arrays: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return *arrays* contiguous and read-only, the only layout that kernels are compiled for."""
    plain = [np.ascontiguousarray(array).view() for array in arrays]
    for array in plain:
        array.setflags(write=False)
    return tuple(plain)


def writable(array: NDArray[Any]) -> NDArray[Any]:
    """Return *array* contiguous and writable; new arrays are returned as they are.

    For microsecond kernels, where the overhead of `inputs` would equal the kernel itself.
    """
    return array if array.flags.carray else np.array(array, order="C")


def _load() -> None:
    try:
        kernels = _kernels()
        if kernels is not None:
            kernels.number_trees(np.arange(1))  # the first call of a kernel sets up the compiler
    finally:
        _is_late[0] = _is_late[0] and bool(_does_without[0])


@functools.cache
def _is_enabled() -> bool:
    return os.environ.get("SEGDEFORM_NUMBA", "1") != "0"


def _waits() -> bool:
    """Return whether this process does without kernels until they have been compiled."""
    without = _does_without[0]
    if without is None:
        compilation.begin()
        without = _does_without[0] = compilation.is_pending()
    return without


def _catch_up() -> None:
    """Use the kernels from now on if they have been compiled since they were needed first."""
    if _does_without[0]:
        _does_without[0] = None


def _kernels() -> Any:
    """Return the compiled kernels; None without numba, or while they are being compiled."""
    return _module() if _is_enabled() and not _waits() else None


@functools.cache
def _module() -> Any:
    try:
        return imported(f"{__package__}.compiled")
    except ImportError:  # numba is missing, or incompatible with this numpy
        return None
