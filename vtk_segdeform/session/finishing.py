"""Poses finished on the mesh itself: the finish, and poses dragged on from a finished one.

    finish                        x = the finish of W~ p             `Deformer.finish`
    drag on, with cages p'        x' = W~ p' + f R' R^T (x - W~ p)   then the exact volume again

R and R' are the rotations of the surface near each vertex with cages p and p',
`Deformer.rotations`, so that the offset x - W~ p turns with the limbs.  An offset belongs to one
way of bending: when the pose is bent back it would bend the surface the other way.  So its share f
follows from how the surface bends along its edges ij,

    k_ij = axial(R_i^T R_j),    f = clip(<k, k'> / <k, k>, 0, 1) smoothstep(cos(k, k'))

1 when the pose moves rigidly or is bent further, 0 when it is back at rest or bent otherwise.  A
hand finished at -40 degrees and bent to +40 has distortion 0.118, as without an offset, which alone
makes it 0.148; bent back by half it has 0.034 instead of 0.043.  The cages are solved for as
if nothing had been finished, so the next move of a handle continues from where the cages are, and
nothing jumps.  The volume is restored along the normals of the free vertices, by far less than the
offset.  If too few vertices are free for that, handles are moved as well, and finally fixed
vertices: as in the solve for the cages, the volume takes precedence.

The finish of a pull starts from the mesh that is shown, because it keeps the surface beyond the
reach, and so does that of a pose that is finished further; any other starts from W~ p, so that the
way to it makes no difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from ..arrays import FloatArray, IntArray, frozen
from ..deformer import Deformer
from ..mesh import Mesh
from ..progress import Progress
from ..solver import Solution, VolumeConstraint, moved_along, steps_to_volume
from .state import Finished, Pose

Cages: TypeAlias = tuple[FloatArray, ...]

_EDGES = 20_000  # along which bending is compared, at most
_ALIKE = 0.6, 0.85  # cosines between ways of bending for f = 0 and 1
_GIVES = 0.02  # mesh sizes by which the correction of the volume moves vertices, at most
_VOLUME_KEPT = 1e-9  # relative
_TURNED = 3e-5  # mesh sizes by which shifts must turn before the targets of the cages follow


class FinishedPose(NamedTuple):
    """The result of `Session.finishing`."""

    before: Pose
    """The pose that was finished."""
    pose: Pose
    solution: Solution


@dataclass(frozen=True, eq=False)
class Finish:
    """A pose to finish, and its own deformer; another thread may call ``finish(progress)``."""

    deformer: Deformer
    pose: Pose
    targets: FloatArray
    """(k, 3) float, of all handles."""
    shifts: FloatArray | None
    """(n, 3) float, as `Finished.shifted`, if the pose was finished before."""
    start: Solution
    """The pose as it is, with the mesh that the finish starts from."""

    def __call__(self, progress: Progress | None = None, /) -> FinishedPose:
        """Finish the pose."""
        deformer, pose = self.deformer, self.pose
        deformer.resume(pose.cage_vertices, self.targets)
        solution = deformer.finish(self.start, progress=progress)
        held = np.union1d(deformer.fixed, deformer.handle)
        shifts = np.zeros((len(held), 3)) if self.shifts is None else self.shifts[held]
        vertices = np.array(solution.vertices)
        offset = vertices - deformer.surface(pose.cage_vertices)
        for array in (vertices, held, shifts, offset):
            frozen(array)
        finished = Finished(vertices, held, shifts, pose.cage_vertices, offset)
        return FinishedPose(pose, Pose(pose.cage_vertices, pose.targets, finished), solution)


class Surfaces(NamedTuple):
    """A session's surface with any cages."""

    mesh: Mesh
    at: Callable[[Cages], FloatArray]
    """Returns W~ p, (n, 3)."""
    rotations: Callable[[Cages], FloatArray]
    """Returns R, (n, 3, 3)."""


def moved_on(
    finished: Finished,
    before: Cages,
    after: Cages,
    surfaces: Surfaces,
    *,
    fixed: IntArray,
    handle: IntArray,
    constraints: tuple[VolumeConstraint, ...],
) -> Finished:
    """Return *finished*, a pose with the cages *before*, for those *after*.

    Fixed and handle vertices do not follow when the volumes are restored, if the others suffice.
    """
    held = np.concatenate([fixed, handle])
    known = np.union1d(finished.held, held)
    shifts = finished.shifted(surfaces.at(before))[known]
    shifted = shifts.any(axis=1)
    fades = not shifted[np.isin(known, fixed)].any()  # what is fixed keeps its offset
    offset = _offset(finished, after, surfaces, fixed, fades=fades)
    x = surfaces.at(after)
    moved = x + offset
    if shifted.any():
        change = offset - _offset(finished, before, surfaces, fixed, fades=fades)
        changed = shifts + np.where(shifted[:, None], change[known], 0.0)
        if np.abs(changed - shifts).max() > _TURNED * np.ptp(x, axis=0).max():
            shifts = changed  # else the targets of the cages stay, so that they converge
    if constraints:
        tried, exact = [], []
        for stays in (held, fixed, held[:0]):
            tried.append(_on_volumes(moved, constraints, stays))
            if max(abs(each.relative(tried[-1])) for each in constraints) <= _VOLUME_KEPT:
                exact.append(tried[-1])
                if np.abs(exact[-1] - moved).max() <= _GIVES * np.ptp(moved, axis=0).max():
                    exact = exact[-1:]
                    break
        moved = (exact or tried)[0]
    for array in (moved, known, shifts):
        frozen(array)
    return replace(finished, vertices=moved, held=known, shifts=shifts)


def _on_volumes(
    x: FloatArray, constraints: tuple[VolumeConstraint, ...], stays: IntArray
) -> FloatArray:
    """Return *x* (n, 3) moved along its normals onto the volumes, but for the vertices *stays*."""
    centre = x.mean(axis=0)
    moved, directions = x - centre, []
    for constraint in constraints:
        normals = constraint.gradient(moved)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals /= np.where(lengths > 0.0, lengths, 1.0)
        normals[stays] = 0.0
        directions.append(normals)
    paths = np.hstack([moved, *directions])
    return np.asarray(moved_along(paths, steps_to_volume(constraints, paths)) + centre)


def _offset(
    finished: Finished, cages: Cages, surfaces: Surfaces, fixed: IntArray, *, fades: bool
) -> FloatArray:
    """Return f R' R^T (x - W~ p) with the given *cages*, (n, 3)."""
    then, now = surfaces.rotations(finished.cage_vertices), surfaces.rotations(cages)
    offset = (now @ (np.swapaxes(then, 1, 2) @ finished.offset[:, :, None]))[:, :, 0]
    if fades:
        edges = _some_edges(surfaces.mesh)
        offset *= _share(*(_bending(each, edges) for each in (then, now)))
    offset[fixed] = finished.offset[fixed]
    return np.asarray(offset)


def _some_edges(mesh: Mesh) -> IntArray:
    """Return edges (k, 2) all over *mesh*."""
    graph = mesh.adjacency
    some = np.arange(0, graph.nnz, 1 + graph.nnz // _EDGES)
    rows = np.searchsorted(graph.indptr, some, side="right") - 1
    return np.asarray(np.stack([rows, graph.indices[some]], axis=1), dtype=np.int64)


def _bending(rotations: FloatArray, edges: IntArray) -> FloatArray:
    """Return the axial vectors of the rotations along *edges*, (k, 3), in the frame at rest."""
    along = np.swapaxes(rotations[edges[:, 0]], 1, 2) @ rotations[edges[:, 1]]
    axial = [along[:, i - 1, i - 2] - along[:, i - 2, i - 1] for i in range(3)]
    return np.asarray(0.5 * np.stack(axial, axis=1))


def _share(then: FloatArray, now: FloatArray) -> float:
    """Return f for the bending *then* and *now*, (k, 3) each."""
    size, other, common = (float(np.vdot(a, b)) for a, b in ((then, then), (now, now), (then, now)))
    if not (size > 0.0 and other > 0.0):
        return float(size == 0.0)
    low, high = _ALIKE
    alike = min(max((common / math.sqrt(size * other) - low) / (high - low), 0.0), 1.0)
    return min(max(common / size, 0.0), 1.0) * alike * alike * (3.0 - 2.0 * alike)
