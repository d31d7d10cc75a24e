"""Which library has a GPU for us: cupy, or else torch, or none.

    arrays = gpu_arrays()        for `device.DeviceSurface`, or None

Both are optional; ``pip install 'vtk-segdeform[gpu]'`` brings cupy.  The driver is asked first, so
where there is no GPU nothing is imported, which would take seconds, and nothing is said.
``SEGDEFORM_GPU=0`` does without.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
import logging
import os
import sys
from typing import Any

import numpy as np

from .device import DeviceArray, DeviceError, DeviceSurface
from .subspace import Subspace

_log = logging.getLogger(__name__)


class TorchArrays:
    """*torch* in the words of numpy, as many as `device` speaks; *device* is "cuda" or "cpu"."""

    def __init__(self, torch: Any, device: str) -> None:
        self.asarray = functools.partial(torch.tensor, device=device)
        self.empty = functools.partial(torch.empty, dtype=torch.float64, device=device)
        self.zeros = functools.partial(torch.zeros, dtype=torch.float64, device=device)
        self.cross, self.amax = torch.linalg.cross, torch.amax
        self._index_select = torch.index_select

    def take(self, x: DeviceArray, ids: DeviceArray, axis: int) -> DeviceArray:
        """Return the entries *ids* of *x* along an *axis*."""
        return self._index_select(x, axis, ids)

    def asnumpy(self, x: DeviceArray) -> Any:
        """Return *x* as an array of numpy's."""
        return x.cpu().numpy()


def gpu_arrays() -> Any:
    """Return the module cupy, or a `TorchArrays`, if a GPU works with it here; else None.

    What is found the first time is what there is; it is tried out then, which can take seconds.
    """
    return None if os.environ.get("SEGDEFORM_GPU", "1") == "0" else _found()


@functools.cache
def _found() -> Any:
    if not _driver_has_a_gpu():
        return None
    for made in (_cupy, _torch):
        try:
            arrays = made()
            _try_out(arrays)
        except _faults() as fault:
            _log.info("a GPU is not used: %s", fault)
        else:
            return arrays
    return None


def _driver_has_a_gpu() -> bool:
    count = ctypes.c_int()
    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    failed = driver.cuInit(0) or driver.cuDeviceGetCount(ctypes.byref(count))
    return not failed and count.value > 0


def _cupy() -> Any:
    return importlib.import_module("cupy")


def _torch() -> Any:
    torch = importlib.import_module("torch")
    if not torch.cuda.is_available():
        raise DeviceError("torch is one without CUDA")
    return TorchArrays(torch, "cuda")


def _try_out(arrays: Any) -> None:
    """Do with *arrays* all that `device` does, on a tetrahedron."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    subspace = Subspace(4, (np.arange(4),), (np.eye(4, dtype=np.float32),))
    surface = DeviceSurface(subspace, corners, faces, arrays)
    x = surface.map(corners)  # twice as large
    surface.scaled(x, 1.0 / 6.0, np.zeros(3))
    normal = surface.host(surface.normals(x))[0]
    if not (abs(surface.volume(x) - 1.0 / 6.0) < 1e-15 and np.ptp(normal) < 1e-15 > normal.max()):
        raise DeviceError("it does not count right")


def _faults() -> tuple[type[Exception], ...]:
    """Return what libraries raise that find no GPU, or no way to use it."""
    compiler = sys.modules.get("cupy.cuda.compiler")
    own = (compiler.CompileException,) if compiler else ()
    return ImportError, OSError, MemoryError, RuntimeError, *own
