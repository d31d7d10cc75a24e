"""Exact volume: restore the volumes of a pose, to rounding.

    along directions    x + sum_k t_k z_k     the root of a cubic; Newton's method for several
    by scaling          c + s (x - c)         s^3 = V_0 / V; for large meshes, whose map takes long

The first is the last operation of every step of the solver, and of a solve; the second, for the
bodies of a large mesh, is the last of a solve only: its steps take the volume over a coarse surface
(`coarse_volume`), which leaves a small error.  Mean value coordinates scale with the cages, so the
caller scales these alike, and x = W~ p still holds; for several bodies, only if no cage moves two.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..arrays import FloatArray, IntArray
from ..kernels import compiled_kernels, in_parallel, inputs
from ..subspace import GPUError, GPUSurface, Subspace, gpu_arrays
from .volume_constraints import VolumeConstraint
from .volumes import together, values_along, violations

_log = logging.getLogger(__name__)
_NEWTON_STEPS = 8
_EXACT = 1e-15  # error of a volume, as a share of all
_MET = 1e-13  # the same, for telling whether the directions were good enough
_ROUNDING = 1e-12  # response of a volume to its direction, relative to the largest
_RISE = 8.0  # of the rate at which errors fall: twice, with one Jacobian and quadratic terms alone
_SMALL = 1e-6  # error below which the derivatives of the last step are near enough
_CACHED = 1 << 14  # vertices moved together
_SHARES = 4  # of a mesh that threads scale; smaller ones take less time than waking a thread


def steps_to_volume(constraints: Sequence[VolumeConstraint], paths: FloatArray) -> FloatArray:
    """Return the step t (c,) along each of c directions that meets all constraints.

    *paths* (n, 3 + 3 c) has the vertices and their c directions side by side.  One constraint:
    the exact root of its cubic.  Several: Newton's method on t.
    """
    if len(constraints) == 1 and constraints[0].is_cubic:
        return np.array([constraints[0].exact_step(paths)])
    constraints, t = together(constraints), np.zeros(len(constraints))
    units = _units(constraints)
    here, before, inverse = paths[:, :3], np.inf, None
    best, least = t.copy(), np.inf  # areas and centroids that cannot be met lead far away
    for _ in range(_NEWTON_STEPS):
        if inverse is None:
            g, jacobian = values_along(constraints, paths)
        else:
            g = violations(constraints, here)
        error = float(np.abs(g / units).max())
        if error < least:
            best, least = t.copy(), error
        if error <= _EXACT or (error <= _SMALL and error > 0.5 * before):
            break
        if inverse is None or error > _SMALL:
            if inverse is not None:
                _, jacobian = values_along(constraints, np.hstack([here, paths[:, 3:]]))
            # A small or firmly held body hardly responds; scaled, all have ones on the diagonal.
            # One with a few coarse points may not respond at all but for rounding, and does not
            # take part.
            scale = np.sqrt(np.abs(np.diag(jacobian)))
            scale[scale <= _ROUNDING * scale.max()] = scale.max() or 1.0
            both = scale[:, None] * scale
            inverse = np.linalg.pinv(jacobian / both, rcond=1e-12) / both
        t -= inverse @ g
        if before < np.inf and _RISE * error * error <= _EXACT * before:
            best = t  # the next error is less than that
            break
        here, before = moved_along(paths, t), error
    return best


def are_met(constraints: Sequence[VolumeConstraint], x: FloatArray) -> bool:
    """Return whether the vertices *x* (n, 3) meet all constraints, up to a few roundings."""
    return bool((np.abs(violations(constraints, x)) <= _MET * _units(constraints)).all())


def _units(constraints: Sequence[VolumeConstraint]) -> FloatArray:
    """Return what the error of each is relative to, (c,): of volumes the sum of all."""
    every = sum(abs(each.target) for each in constraints if each.is_cubic)
    units = [every if each.is_cubic else abs(each.size) for each in constraints]
    return np.maximum(units, np.finfo(float).tiny)


def moved_along(paths: FloatArray, t: FloatArray) -> FloatArray:
    """Return the vertices of *paths* (n, 3 + 3 c) after the step *t* (c,) along its directions."""
    kernels, x = compiled_kernels(len(paths)), np.empty((len(paths), 3))
    (read,), t = inputs(paths), np.asarray(t, dtype=np.float64)

    def work(start: int, stop: int) -> None:
        if kernels:
            kernels.move_along(read, t, x, start, stop)
            return
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


def scale_bodies(
    constraints: Sequence[VolumeConstraint], x: FloatArray, body: IntArray, centres: FloatArray
) -> FloatArray:
    """Do the same for each *body* (n,) of *x* about its own of *centres* (c, 3); return (c,)."""
    ratios = together(constraints).relative(x)
    scales = np.cbrt(1.0 / (1.0 + np.where(ratios > -1.0, ratios, 0.0)))
    shifts = (1.0 - scales)[:, None] * centres

    def work(start: int, stop: int) -> None:
        own = body[start:stop]
        piece = x[start:stop]
        piece *= scales[own, None]
        piece += shifts[own]

    in_parallel(work, len(x), _CACHED)
    return np.asarray(scales)


class ScaledSurface:
    """A large mesh moved by its cages and scaled to its exact volume; on a GPU if there is one.

    For the path on a GPU see `subspace.gpu`.  Several bodies are scaled one by one, on the
    processor.

    Parameters
    ----------
    subspace : Subspace
        W~.
    rest : (n, 3) float
        The mesh at rest.
    constraints : sequence of VolumeConstraint
        The volume of each body.
    body : (n,) int
        The body of each vertex.
    body_of_column : (m,) int
        The body that each cage vertex moves.
    """

    def __init__(
        self,
        subspace: Subspace,
        rest: FloatArray,
        constraints: Sequence[VolumeConstraint],
        body: IntArray,
        body_of_column: IntArray,
    ) -> None:
        self._subspace, self._rest, self._constraints = subspace, rest, constraints
        self.body, self.body_of_column = body, body_of_column

    @classmethod
    def of(
        cls,
        subspace: Subspace,
        rest: FloatArray,
        constraints: Sequence[VolumeConstraint],
        body: IntArray,
    ) -> ScaledSurface | None:
        """Return the surface; None if a cage moves two bodies, which then cannot be scaled."""
        owners = []
        for rows, block in zip(subspace.rows, subspace.blocks, strict=True):
            own = body[rows]
            first = own[0] if len(own) else 0
            if (own != first).any():
                return None
            owners.append(np.full(block.shape[1], first))
        return cls(subspace, rest, constraints, body, np.concatenate(owners))

    @cached_property
    def middles(self) -> FloatArray:
        """The mean vertex of each body at rest, (c, 3)."""
        sizes = np.bincount(self.body)
        sums = [np.bincount(self.body, axis) for axis in self._rest.T]
        return np.stack(sums, axis=1) / sizes[:, None]

    def scaled(self, moves: FloatArray, centres: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mesh (n, 3) for *moves* (m, 3) of the cages, and the factors (c,) of bodies.

        The body k is scaled about ``centres[k]`` (3,).
        """
        if len(self._constraints) > 1:
            x = self._subspace.map(moves, self._rest)
            return x, scale_bodies(self._constraints, x, self.body, centres)
        (constraint,), (centre,) = self._constraints, centres
        if self._gpu is not None:
            try:
                x = self._gpu.map(moves)
                scale = self._gpu.scale_to_volume(x, constraint.target, centre)
                return self._gpu.host(x), np.array([scale])
            except GPUError as fault:
                self._turn_off_gpu(fault)
        x = self._subspace.map(moves, self._rest)
        return x, np.array([scale_to_volume(constraint, x, centre)])

    @cached_property
    def _gpu(self) -> GPUSurface | None:
        arrays = gpu_arrays()
        if arrays is None:
            return None
        try:
            (constraint,) = self._constraints
            closed = constraint.faces, arrays, constraint.extension
            return GPUSurface(self._subspace, self._rest, *closed)
        except GPUError as fault:
            self._turn_off_gpu(fault)
            return None

    def _turn_off_gpu(self, fault: GPUError) -> None:
        _log.info("continuing without the GPU: %s", fault)
        self._gpu = None
