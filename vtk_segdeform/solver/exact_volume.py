"""The last operation of a solve: the mesh itself comes onto its own volume, exactly.

    along    x + t W~ z      t the root of a cubic; for every mesh, and for volumes of regions
    scaled   c + s (x - c)   s^3 = V_0 / V; for large meshes, where only x itself is then mapped

The steps before have taken the volume over a stand-in (`coarse_volume`), so a little is missing.
Mean value coordinates follow scaling: the cages are scaled alike, and x = W~ p still.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..arrays import FloatArray
from ..kernels import in_parallel
from ..subspace import DeviceError, DeviceSurface, Patches, Subspace, gpu_arrays
from .volume_constraints import VolumeConstraint, moved, restore

_log = logging.getLogger(__name__)
_CACHED = 1 << 14  # vertices at a time
_SHARES = 4  # that threads are handed: to wake for each piece would take as long


def along(
    constraints: Sequence[VolumeConstraint], paths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return steps (c,) along c directions, and the vertices (n, 3) after them.

    *paths* (n, 3 + 3 c) has the vertices and their directions side by side.
    """
    steps = restore(constraints, paths)
    return steps, moved(paths, steps)


def scaled(constraint: VolumeConstraint, x: FloatArray, centre: FloatArray) -> float:
    """Scale *x* (n, 3) in place about *centre* (3,) onto the volume; return by how much.

    Where the surface is inside-out, so that no size would do, nothing is scaled.
    """
    ratio = constraint.relative(x)
    if not ratio > -1.0:
        return 1.0
    scale = float(np.cbrt(1.0 / (1.0 + ratio)))

    offsets, flat = np.tile((1.0 - scale) * centre, _CACHED), x.reshape(-1)

    def work(first: int, last: int) -> None:
        for start in range(first, last, len(offsets)):
            piece = flat[start : min(start + len(offsets), last)]
            piece *= scale
            piece += offsets[: len(piece)]

    share = -(-len(flat) // (_SHARES * len(offsets)))
    in_parallel(work, len(flat), share * len(offsets))
    return scale


class LargeSurface:
    """A large mesh as it moves by its cages, landed by its size: on a GPU where there is one.

    Parameters
    ----------
    subspace : Subspace
        W~.
    mapping : Subspace or Patches
        W~ as it is mapped by where there is no GPU.
    rest, start : (n, 3) float
        Where the mesh is while no cage vertex has moved; and that as *mapping* begins with it.
    constraint : VolumeConstraint
        The total volume, kept.
    """

    def __init__(
        self,
        subspace: Subspace,
        mapping: Subspace | Patches,
        rest: FloatArray,
        constraint: VolumeConstraint,
        *,
        start: FloatArray,
    ) -> None:
        self._subspace, self._mapping = subspace, mapping
        self._rest, self._start, self._constraint = rest, start, constraint

    def landed(self, moves: FloatArray, centre: FloatArray) -> tuple[FloatArray, float]:
        """Return the mesh (n, 3) for *moves* (m, 3) of the cages, and the scale about *centre*."""
        if self._device is not None:
            try:
                there = self._device.map(moves)
                scale = self._device.scaled(there, self._constraint.target, centre)
                return self._device.host(there), scale
            except DeviceError as fault:
                self._give_up(fault)
        x = self._mapping.map(moves, self._start)
        return x, scaled(self._constraint, x, centre)

    @cached_property
    def _device(self) -> DeviceSurface | None:
        arrays = gpu_arrays()
        if arrays is None:
            return None
        try:
            return DeviceSurface(self._subspace, self._rest, self._constraint.faces, arrays)
        except DeviceError as fault:
            self._give_up(fault)
            return None

    def _give_up(self, fault: DeviceError) -> None:
        _log.info("going on without the GPU: %s", fault)
        self._device = None
