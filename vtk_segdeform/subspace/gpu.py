"""Operations on the whole mesh on a GPU: the map and the exact volume.

    arrays = gpu_arrays()             cupy, or else torch, if a GPU works with it; or None

    x = rest + W~ moves               `GPUSurface.map`               x stays on the GPU
    V(x)                              `GPUSurface.volume`            as `volume.signed_volume`
    c + s (x - c)                     `GPUSurface.scale_to_volume`   as in `exact_volume`

Each pass is written once, with functions that numpy, cupy and torch share, so that the tests run
the lines that a GPU runs: with numpy, with torch on the processor where it is installed, and on a
GPU where there is one.  All numbers are in double precision, and no two threads add to one number,
so results agree with those of the processor to rounding and are the same every time.

Both libraries are optional; ``pip install 'vtk-segdeform[gpu]'`` installs cupy.  The driver is
queried first: without a GPU neither library is imported, which would take seconds, and nothing is
logged.  ``SEGDEFORM_GPU=0`` turns the GPU off.

For n vertices, m faces and N numbers in the blocks of W~ the GPU stores 8 N + 24 n + 24 m bytes.
`GPUSurface.map` takes 80 n bytes, its result included, and `GPUSurface.volume` 8 m and at most 300
megabytes.  W~ is in double precision on the GPU even where `subspace` has it in single precision:
converting it in every frame would take longer than reading it.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import logging
import os
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..errors import SegDeformError
from ..importing import imported
from .subspace import Subspace, row_pieces

GPUArray = Any  # of cupy, torch or numpy

_FACES_AT_ONCE = 1 << 20  # whose corners are gathered
_SUMMED_NUMBERS = 4096  # to a partial sum of a volume

_log = logging.getLogger(__name__)


class GPUError(SegDeformError, RuntimeError):
    """The GPU has too little memory or has failed; its work is done by the processor instead."""


@contextlib.contextmanager
def _faults_named() -> Iterator[None]:
    try:
        yield
    except GPUError:
        raise
    except (MemoryError, RuntimeError) as fault:  # raised by cupy and torch
        raise GPUError(f"GPU computation failed: {fault}") from fault


class GPUSurface:
    """A mesh and its W~, stored on a GPU.

    Parameters
    ----------
    subspace : Subspace
        W~ of n vertices and m cage vertices.
    rest_vertices : (n, 3) float
        The mesh at rest.
    faces : (k, 3) int
        Closed and outward oriented.
    arrays : module or TorchArrays
        The array library: `gpu_arrays`, or numpy for comparison.
    extension : (n + c, n) sparse, optional
        With it, faces are over the vertices and c centres of lids, ``extension @ x``.  These faces
        are few, and the processor computes their volume.

    Raises
    ------
    GPUError
        Here and in every method, if the GPU has too little memory or has failed.
    """

    def __init__(
        self,
        subspace: Subspace,
        rest_vertices: FloatArray,
        faces: IntArray,
        arrays: Any,
        extension: sparse.csr_array | None = None,
    ) -> None:
        self._lids: tuple[IntArray, sparse.csr_array, IntArray] | None = None
        if extension is not None:
            in_lid = (faces >= len(rest_vertices)).any(axis=1)
            ends, lids = np.unique(faces[in_lid], return_inverse=True)
            border = np.unique(extension[ends].indices)
            rows = sparse.csr_array(extension[ends][:, border])
            self._lids = np.asarray(lids.reshape(-1, 3), np.int64), rows, border.astype(np.int64)
            faces = faces[~in_lid]
        self._arrays, self._host_faces, self._columns = arrays, faces, subspace.columns
        with _faults_named():
            self._rest = arrays.asarray(np.asarray(rest_vertices, dtype=np.float64))
            self._corners = [self._ids(corner) for corner in faces.T]
            self._rows = [self._ids(rows) for rows in subspace.rows]
            self._blocks = [self._widened(np.asarray(block)) for block in subspace.blocks]

    @_faults_named()
    def map(self, moves: FloatArray) -> GPUArray:
        """Return x = rest + W~ moves, (n, 3) on the GPU, for *moves* (m, 3) of the cages."""
        moves = self._arrays.asarray(np.asarray(moves, dtype=np.float64))
        x = self._rest + 0.0
        for rows, block, columns in zip(self._rows, self._blocks, self._columns, strict=True):
            x[rows] += block @ moves[columns]  # no row is there twice
        return x

    @_faults_named()
    def volume(self, x: GPUArray) -> float:
        """Return the enclosed volume of *x* (n, 3), with its first vertex as the origin."""
        n_sums = -(-len(self._host_faces) // _SUMMED_NUMBERS)
        determinants = self._arrays.zeros((n_sums * _SUMMED_NUMBERS,))
        for piece, a, e, f in self._corners_and_edges(x):
            determinants[piece] = ((a - x[0]) * self._arrays.cross(e, f)).sum(1)
        of_mesh = float(self.host(determinants.reshape(n_sums, _SUMMED_NUMBERS).sum(1)).sum() / 6.0)
        return of_mesh + self._volume_of_lids(x)

    def _volume_of_lids(self, x: GPUArray) -> float:
        """Return the volume between the lids and the first vertex."""
        if self._lids is None:
            return 0.0
        lids, ends, border = self._lids
        near = self._arrays.take(x, self._ids(border), axis=0) - x[0]
        a, b, c = (ends @ self.host(near))[lids.T]
        return float(np.einsum("ij,ij", a, np.cross(b - a, c - a)) / 6.0)

    @_faults_named()
    def scale_to_volume(self, x: GPUArray, target: float, centre: ArrayLike) -> float:
        """Scale *x* (n, 3) in place about *centre* (3,) to the volume *target*; return the factor.

        A surface that is inside out has no such factor: it stays as it is, and 1 is returned.
        """
        ratio = (self.volume(x) - target) / target
        if not ratio > -1.0:
            return 1.0
        scale = float(np.cbrt(1.0 / (1.0 + ratio)))
        x *= scale
        x += self._arrays.asarray((1.0 - scale) * np.asarray(centre, dtype=np.float64))
        return scale

    @_faults_named()
    def host(self, x: GPUArray) -> Any:
        """Return *x* as a numpy array, once the GPU has computed it."""
        return x if isinstance(x, np.ndarray) else self._arrays.asnumpy(x)

    def _corners_and_edges(
        self, x: GPUArray
    ) -> Iterator[tuple[slice, GPUArray, GPUArray, GPUArray]]:
        """Yield faces piece by piece: their first corners a, b - a and c - a, (k, 3) each."""
        for start in range(0, len(self._host_faces), _FACES_AT_ONCE):
            piece = slice(start, min(start + _FACES_AT_ONCE, len(self._host_faces)))
            a, b, c = (self._arrays.take(x, corner[piece], axis=0) for corner in self._corners)
            yield piece, a, b - a, c - a

    def _ids(self, ids: IntArray) -> GPUArray:
        return self._arrays.asarray(np.ascontiguousarray(ids, dtype=np.int64))

    def _widened(self, block: FloatArray) -> GPUArray:
        wide = self._arrays.empty(block.shape)
        for piece in row_pieces(*block.shape):
            wide[piece] = self._arrays.asarray(block[piece])
        return wide


class TorchArrays:
    """*torch* with the names of numpy that `GPUSurface` uses; *device* is "cuda" or "cpu"."""

    def __init__(self, torch: Any, device: str) -> None:
        self.asarray = functools.partial(torch.tensor, device=device)
        self.empty = functools.partial(torch.empty, dtype=torch.float64, device=device)
        self.zeros = functools.partial(torch.zeros, dtype=torch.float64, device=device)
        self.cross = torch.linalg.cross
        self._index_select = torch.index_select

    def take(self, x: GPUArray, ids: GPUArray, axis: int) -> GPUArray:
        """Return the entries *ids* of *x* along an *axis*."""
        return self._index_select(x, axis, ids)

    def asnumpy(self, x: GPUArray) -> Any:
        """Return *x* as a numpy array."""
        return x.cpu().numpy()


def gpu_arrays() -> Any:
    """Return the module cupy, or a `TorchArrays`, if a GPU works with it here; else None.

    The first call searches for a GPU and tests it, which can take seconds; its answer is kept.
    """
    return None if os.environ.get("SEGDEFORM_GPU", "1") == "0" else _found()


@functools.cache
def _found() -> Any:
    if not _driver_has_a_gpu():
        return None
    for load in (_cupy, _torch):
        try:
            arrays = load()
            _test(arrays)
        except _faults() as fault:
            _log.info("GPU not used: %s", fault)
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
    return imported("cupy")


def _torch() -> Any:
    torch: Any = imported("torch")
    if not torch.cuda.is_available():
        raise GPUError("this torch has no CUDA")
    return TorchArrays(torch, "cuda")


def _test(arrays: Any) -> None:
    """Run every pass with *arrays* on a tetrahedron, and raise a GPUError if a result is wrong."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    subspace = Subspace(4, (np.arange(4),), (np.eye(4, dtype=np.float32),))
    surface = GPUSurface(subspace, corners, faces, arrays)
    x = surface.map(corners)  # twice the size
    surface.scale_to_volume(x, 1.0 / 6.0, np.zeros(3))
    if not abs(surface.volume(x) - 1.0 / 6.0) < 1e-15:
        raise GPUError("it computes wrong results")


def _faults() -> tuple[type[Exception], ...]:
    """Return the exceptions of libraries that find no GPU, or cannot use it."""
    compiler = sys.modules.get("cupy.cuda.compiler")
    own = (compiler.CompileException,) if compiler else ()
    return ImportError, OSError, MemoryError, RuntimeError, *own
