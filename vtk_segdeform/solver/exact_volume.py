"""Exact volume: restore the volumes of a pose, to rounding.

    along directions    x + sum_k t_k z_k     the root of a cubic; Newton's method for several
    by scaling          c + s (x - c)         s^3 = V_0 / V; for large meshes, whose map takes long

The first is the last operation of every step of the solver, and of a solve; the second, for one
volume of a large mesh, is the last of a solve only: its steps take the volume over a coarse surface
(`coarse_volume`), which leaves a small error.  Mean value coordinates scale with the cages, so the
caller scales these alike, and x = W~ p still holds.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..arrays import FloatArray
from ..kernels import in_parallel
from ..subspace import GPUError, GPUSurface, Subspace, gpu_arrays
from .volume_constraints import VolumeConstraint

_log = logging.getLogger(__name__)
_NEWTON_STEPS = 6
_CACHED = 1 << 14  # vertices moved together
_SHARES = 4  # of a mesh that threads scale; smaller ones take less time than waking a thread


def steps_to_volume(constraints: Sequence[VolumeConstraint], paths: FloatArray) -> FloatArray:
    """Return the step t (c,) along each of c directions that meets all constraints.

    *paths* (n, 3 + 3 c) has the vertices and their c directions side by side.  One constraint:
    the exact root of its cubic.  Several: Newton's method on t.
    """
    if len(constraints) == 1:
        return np.array([constraints[0].exact_step(paths)])
    x, *directions = np.split(paths, len(constraints) + 1, axis=1)
    t = np.zeros(len(constraints))
    here = x
    for _ in range(_NEWTON_STEPS):
        g = np.array([c.violation(here) for c in constraints])
        gradients = [c.gradient(here) for c in constraints]
        jacobian = np.array([[np.vdot(j, d) for d in directions] for j in gradients])
        step = np.linalg.lstsq(jacobian, -g, rcond=1e-12)[0]
        t += step
        here = x + sum(tk * d for tk, d in zip(t, directions, strict=True))
        if np.abs(g).max() <= 1e-15 * sum(abs(c.target) for c in constraints):
            break
    return t


def moved_along(paths: FloatArray, t: FloatArray) -> FloatArray:
    """Return the vertices of *paths* (n, 3 + 3 c) after the step *t* (c,) along its directions."""
    x = np.empty((len(paths), 3))

    def work(start: int, stop: int) -> None:
        piece = paths[start:stop]
        x[start:stop] = piece[:, :3]
        for k, tk in enumerate(t, start=1):
            x[start:stop] += tk * piece[:, 3 * k : 3 * k + 3]

    in_parallel(work, len(paths), _CACHED)
    return x


def scale_to_volume(constraint: VolumeConstraint, x: FloatArray, centre: FloatArray) -> float:
    """Scale *x* (n, 3) in place about *centre* (3,) onto the volume; return the factor.

    A surface that is inside out has no such factor: it stays as it is, and 1 is returned.
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


class ScaledSurface:
    """A large mesh moved by its cages and scaled to its exact volume; on a GPU if there is one.

    The path on a GPU is untested there; see `subspace.gpu`.

    Parameters
    ----------
    subspace : Subspace
        W~.
    rest : (n, 3) float
        The mesh at rest.
    constraint : VolumeConstraint
        The total volume.
    """

    def __init__(self, subspace: Subspace, rest: FloatArray, constraint: VolumeConstraint) -> None:
        self._subspace, self._rest, self._constraint = subspace, rest, constraint

    def scaled(self, moves: FloatArray, centre: FloatArray) -> tuple[FloatArray, float]:
        """Return the mesh (n, 3) for *moves* (m, 3) of the cages, and its factor about *centre*."""
        if self._gpu is not None:
            try:
                x = self._gpu.map(moves)
                scale = self._gpu.scale_to_volume(x, self._constraint.target, centre)
                return self._gpu.host(x), scale
            except GPUError as fault:
                self._turn_off_gpu(fault)
        x = self._subspace.map(moves, self._rest)
        return x, scale_to_volume(self._constraint, x, centre)

    @cached_property
    def _gpu(self) -> GPUSurface | None:
        arrays = gpu_arrays()
        if arrays is None:
            return None
        try:
            closed = self._constraint.faces, arrays, self._constraint.extension
            return GPUSurface(self._subspace, self._rest, *closed)
        except GPUError as fault:
            self._turn_off_gpu(fault)
            return None

    def _turn_off_gpu(self, fault: GPUError) -> None:
        _log.info("continuing without the GPU: %s", fault)
        self._gpu = None
