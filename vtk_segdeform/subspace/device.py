"""The passes over a whole mesh on a GPU, where there is one: the map, the volume and the normals.

    x = rest + W~ moves        `DeviceSurface.map`       x stays on the device
    V(x)                       `DeviceSurface.volume`    as `volume.signed_volume`
    c + s (x - c)              `DeviceSurface.scaled`    as `exact_volume.scaled`
    n(x)                       `DeviceSurface.normals`

Each is said once, in the few words that numpy, cupy and torch have in common, so that a test runs
the very lines that a GPU runs; `gpu` finds the library.  All numbers are in double precision, and
no two threads add to one number, so results are those of the processor to rounding and the same
every time.

For n vertices, m faces and N numbers in the blocks of W~ there lie on the device 8 N + 24 n + 24 m
bytes, and 60 m more once normals are asked for.  A call takes, its result included,

    map 80 n        volume 8 m + 300 MB at most        normals 100 m + 300 MB at most

which with a million vertices and 155 cage vertices makes 1.1 gigabytes in all.  W~ is in
double precision there even where `subspace` has it in single: to widen it in every frame would
take longer than to read it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray
from ..errors import SegDeformError
from .products import pieces
from .subspace import Subspace

DeviceArray = Any  # of whatever library

_FACES = 1 << 20  # whose corners are looked up at a time
_SUMMED = 4096  # numbers to a sum of a volume


class DeviceError(SegDeformError, RuntimeError):
    """The GPU has too little memory or has failed; what it was asked for is done without it."""


@contextlib.contextmanager
def _faults_named() -> Iterator[None]:
    try:
        yield
    except DeviceError:
        raise
    except (MemoryError, RuntimeError) as fault:  # what cupy and torch raise of a device
        raise DeviceError(f"the GPU gave up: {fault}") from fault


class DeviceSurface:
    """A mesh and its W~, kept on a device.

    Parameters
    ----------
    subspace : Subspace
        W~ of n vertices and m cage vertices.
    rest_vertices : (n, 3) float
        Where the mesh is while no cage vertex has moved.
    faces : (k, 3) int
        Closed and outward oriented.
    arrays : module or TorchArrays
        Whose arrays are used: of `gpu.gpu_arrays`, or for comparison numpy.

    Raises
    ------
    DeviceError
        From here, and from every method, if the device has too little memory or has failed.
    """

    def __init__(
        self, subspace: Subspace, rest_vertices: FloatArray, faces: IntArray, arrays: Any
    ) -> None:
        self._arrays, self._host_faces, self._columns = arrays, faces, subspace.columns
        with _faults_named():
            self._rest = arrays.asarray(np.asarray(rest_vertices, dtype=np.float64))
            self._corners = [self._ids(corner) for corner in faces.T]
            self._rows = [self._ids(rows) for rows in subspace.rows]
            self._blocks = [self._widened(block) for block in subspace.blocks]

    @_faults_named()
    def map(self, moves: FloatArray) -> DeviceArray:
        """Return x = rest + W~ moves, (n, 3) on the device, for *moves* (m, 3) of the cages."""
        moves = self._arrays.asarray(np.asarray(moves, dtype=np.float64))
        x = self._rest + 0.0
        for rows, block, columns in zip(self._rows, self._blocks, self._columns, strict=True):
            x[rows] += block @ moves[columns]  # each row is there once
        return x

    @_faults_named()
    def volume(self, x: DeviceArray) -> float:
        """Return the enclosed volume of *x* (n, 3), summed about one of its vertices."""
        n_sums = -(-len(self._host_faces) // _SUMMED)
        determinants = self._arrays.zeros((n_sums * _SUMMED,))
        for piece, a, e, f in self._corners_and_edges(x):
            determinants[piece] = ((a - x[0]) * self._arrays.cross(e, f)).sum(1)
        return float(self.host(determinants.reshape(n_sums, _SUMMED).sum(1)).sum() / 6.0)

    @_faults_named()
    def scaled(self, x: DeviceArray, target: float, centre: ArrayLike) -> float:
        """Scale *x* (n, 3) in place about *centre* (3,) to the volume *target*; return by how much.

        Where the surface is inside-out, so that no size would do, nothing is scaled.
        """
        ratio = (self.volume(x) - target) / target
        if not ratio > -1.0:
            return 1.0
        scale = float(np.cbrt(1.0 / (1.0 + ratio)))
        x *= scale
        x += self._arrays.asarray((1.0 - scale) * np.asarray(centre, dtype=np.float64))
        return scale

    @_faults_named()
    def normals(self, x: DeviceArray) -> DeviceArray:
        """Return the unit normals (n, 3) of *x* (n, 3), on the device.

        Each is the sum of the cross products of the faces around a vertex: a face counts by its
        area.  Where that is nothing, as in a fan that has shrunk to a point, so is the normal.
        """
        rounds, owners, places = self._fans
        sums = self._arrays.empty((len(self._host_faces), 3))
        for piece, _, e, f in self._corners_and_edges(x):
            sums[piece] = self._arrays.cross(e, f)
        for kept, added in rounds:
            longer, sums = sums, self._arrays.take(sums, kept, axis=0)
            sums[: len(added)] += self._arrays.take(longer, added, axis=0)
        normals = self._arrays.zeros(tuple(x.shape))
        normals[owners] = self._arrays.take(sums, places, axis=0)
        largest = self._arrays.amax(abs(normals), 1)  # first to size 1, whatever the unit
        normals /= (largest + (largest == 0.0))[:, None]
        normals /= ((normals * normals).sum(1) + (largest == 0.0))[:, None] ** 0.5
        return normals

    @_faults_named()
    def host(self, x: DeviceArray) -> Any:
        """Return *x* as an array of numpy's, once the device is done with it."""
        return x if isinstance(x, np.ndarray) else self._arrays.asnumpy(x)

    def _corners_and_edges(
        self, x: DeviceArray
    ) -> Iterator[tuple[slice, DeviceArray, DeviceArray, DeviceArray]]:
        """Yield faces, a piece at a time: a corner a of each, b - a and c - a, (k, 3) each."""
        for start in range(0, len(self._host_faces), _FACES):
            piece = slice(start, min(start + _FACES, len(self._host_faces)))
            a, b, c = (self._arrays.take(x, corner[piece], axis=0) for corner in self._corners)
            yield piece, a, b - a, c - a

    def _ids(self, ids: IntArray) -> DeviceArray:
        return self._arrays.asarray(np.ascontiguousarray(ids, dtype=np.int64))

    def _widened(self, block: FloatArray) -> DeviceArray:
        wide = self._arrays.empty(block.shape)
        for piece in pieces(*block.shape):
            wide[piece] = self._arrays.asarray(block[piece])
        return wide

    @cached_property
    def _fans(self) -> tuple[list[tuple[DeviceArray, DeviceArray]], DeviceArray, DeviceArray]:
        rounds, owners, places = _pairwise(self._host_faces)
        there = [(self._ids(kept), self._ids(added)) for kept, added in rounds]
        return there, self._ids(owners), self._ids(places)


def _pairwise(faces: IntArray) -> tuple[list[tuple[IntArray, IntArray]], IntArray, IntArray]:
    """Return how to sum, pair by pair, what *faces* (m, 3) have over those around each vertex.

    Of every list of numbers those *kept* make the next one, and those *added* are added to the
    first of them: as many rounds as the largest fan can be halved.  What is in the end at *places*
    belongs to the vertices *owners*.
    """
    order = np.argsort(faces, axis=None, kind="stable")
    owners, places = faces.ravel()[order], order // 3
    rounds: list[tuple[IntArray, IntArray]] = []
    while True:
        here = np.arange(len(owners))
        begins = np.diff(owners, prepend=-1) != 0
        is_added = (here - np.maximum.accumulate(np.where(begins, here, 0))) % 2 == 1
        if not is_added.any():
            return rounds, owners, places
        is_added_to = np.append(is_added[1:], False)
        is_alone = ~is_added & ~is_added_to
        kept = np.concatenate([np.flatnonzero(is_added_to), np.flatnonzero(is_alone)])
        rounds.append((places[kept], places[is_added]))
        places = np.argsort(kept, kind="stable")  # by vertex again
        owners = owners[kept][places]
