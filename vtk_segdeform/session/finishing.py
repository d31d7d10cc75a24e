"""Poses finished on the mesh itself: the finish, and poses dragged on from a finished one.

    finish                        x = the finish of W~ p             `Deformer.finish`
    drag on, with cages p'        x' = W~ p' + f R' R^T (x - W~ p)   then the exact volume again

R and R' are the rotations of the surface near each vertex with cages p and p',
`Deformer.rotations`, so that the offset x - W~ p turns with the limbs.  An offset belongs to one
way of bending: when the pose is bent back it would bend the surface the other way.  So its share f
follows from how the surface bends along its edges ij,

    k_ij = axial(R_i^T R_j),    f = clip(<k, k'> / <k, k>, 0, 1) smoothstep(cos(k, k'))

1 when the pose moves rigidly or is bent further, 0 when it is back at rest or bent otherwise.  The
cages are solved for as if nothing had been finished, so the next move of a handle continues from
where the cages are, and nothing jumps.  The volume is restored along the normals of the free
vertices.  If too few are free for that, handles are moved as well, and finally fixed vertices: as
in the solve for the cages, the volume takes precedence.

The finish of a pull starts from the mesh that is shown, because it keeps the surface beyond the
reach, and so does that of a pose that is finished further; any other starts from W~ p, so that the
way to it makes no difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray, frozen
from ..deformer import Deformer, on_volumes
from ..errors import SessionError
from ..geometry import turned_over
from ..mesh import Mesh, new_crossings
from ..progress import Progress
from ..solver import Solution, Status, Together, errors_at
from .handles import stacked
from .poses import VOLUME_TOLERANCE, Poses
from .pulls import localised
from .state import Cages, Finished, Pose, State

_ALIKE = 0.6, 0.85  # cosines between ways of bending for f = 0 and 1
_GIVES = 0.02  # mesh sizes by which the correction of the volume moves vertices, at most
_TURNED = 3e-5  # mesh sizes by which shifts must turn before the targets of the cages follow


class FinishedPose(NamedTuple):
    """The result of `finish`, for `Session.accept_finish`."""

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
        return FinishedPose(pose, replace(pose, finished=finished), solution)


def finish(poses: Poses, state: State) -> Finish:
    """Return the finish of the pose of *state*, which any thread may call.

    Raises
    ------
    SessionError
        If there is no pose, or nothing is fixed, in a handle or a volume that is set.
    """
    if reason := reason_not_to_finish(state):
        raise SessionError(reason)
    pose, locality, shift = state.pose, state.locality, poses.shift(state)
    assert pose is not None
    is_shifted = shift is not None and bool(shift[state.fixed].any())
    deformer = poses.held(state, state.fixed_at) if is_shifted else poses.constrained(state)
    is_further = pose.is_finished and locality is None
    of_cages = poses.surface(state, pose.cage_vertices)
    x = poses.vertices(state) if is_further or locality is not None else of_cages
    wanted, (_, volume) = stacked(pose.targets), poses.enclosed(state)
    aims = np.array(wanted)
    if locality is not None:
        at_press = poses.surface(state, locality.cage_vertices)
        deformer = localised(deformer, locality, at_press)
        beside = _beside(poses, state)
        if beside is not None:  # where the deformer differs
            point = locality.point
            own = point.at(at_press) - at_press[point.vertex]
            aims[deformer.handle == point.vertex] += beside - own
    rest, faces = poses.mesh.vertices, poses.mesh.faces
    start = Solution(
        vertices=x,
        cage_vertices=pose.cage_vertices,
        steps=0,
        status=Status.STEP_LIMIT if is_further else Status.CONVERGED,
        merits=(),
        errors=errors(poses, state, deformer, wanted),
        volume=partial(volume.relative, x),
        region_volumes=lambda _: np.empty(0),
        crossed=partial(new_crossings, rest=rest, faces=faces),
        folded=partial(turned_over, rest=rest, faces=faces),
        unfinished=of_cages if is_further else None,
    )
    return Finish(deformer.copy(), pose, aims, shift, start)


def reason_not_to_finish(state: State) -> str:
    """Return why the pose of *state* cannot be finished, or ""."""
    if state.pose is None:
        return "there is no pose to finish; move a handle first"
    if not (state.handles or len(state.fixed) or state.options.volumes):
        return "no handle, fixed vertex or volume to finish the pose for; add a handle"
    return ""


def errors(
    poses: Poses, state: State, deformer: Deformer, wanted: FloatArray
) -> Callable[[FloatArray], tuple[float, ...]]:
    """Return `Solution.errors`: how far a mesh (n, 3) is from *wanted* (k, 3) and fixed places."""
    beside, locality, fixed_at = _beside(poses, state), state.locality, poses.fixed_places(state)
    ids, diagonal = (deformer.handle, deformer.fixed), poses.mesh.diagonal

    def errors_of(x: FloatArray) -> tuple[float, ...]:
        places = np.array(wanted)
        if locality is not None and beside is not None:
            point = locality.point
            places[ids[0] == point.vertex] += x[point.vertex] + beside - point.at(x)
        return errors_at(ids, (places, fixed_at), diagonal, x)

    return errors_of


def _beside(poses: Poses, state: State) -> FloatArray | None:
    """Return where the pulled point was at the press, from its handle's vertex, (3,).

    On the mesh that was shown.  None if no point of a face is pulled.
    """
    pose, locality = state.pose, state.locality
    if pose is None or locality is None or locality.point.is_vertex:
        return None

    def beside() -> FloatArray:
        cages, point = locality.cage_vertices, locality.point
        if pose.finished is None:
            x = poses.surface(state, cages)
        elif pose.cage_vertices is cages:
            x = pose.finished.vertices
        else:
            x = moved_on(poses, state, cages).vertices
        return np.asarray(point.at(x) - x[point.vertex])

    return poses.memo.get("beside", (locality,), beside)


def moved_on(poses: Poses, state: State, after: Cages) -> Finished:
    """Return the finished mesh in the pose of *state*, for the cages *after*.

    Fixed and handle vertices do not follow when the volumes are restored, if the others suffice.
    """
    assert state.pose is not None
    assert state.pose.finished is not None
    before, finished, fixed = state.pose.cage_vertices, state.pose.finished, state.fixed
    held = np.concatenate([fixed, state.handle])
    known = np.union1d(finished.held, held)
    shifts = finished.shifted(poses.surface(state, before))[known]
    shifted = shifts.any(axis=1)
    fades = not shifted[np.isin(known, fixed)].any()  # what is fixed keeps its offset
    offset = _offset(poses, state, after, fades=fades)
    x = poses.surface(state, after)
    moved = x + offset
    if shifted.any():
        change = offset - _offset(poses, state, before, fades=fades)
        changed = shifts + np.where(shifted[:, None], change[known], 0.0)
        if np.abs(changed - shifts).max() > _TURNED * np.ptp(x, axis=0).max():
            shifts = changed  # else the targets of the cages stay, so that they converge
    preserved = Together(poses.constrained(state).preserved_volumes)
    off = preserved.missed(moved)
    constraints = Together(
        each
        for each, by in zip(preserved, off, strict=True)
        if not each.bound or by > VOLUME_TOLERANCE
    )
    if constraints:
        tried, exact = [], []
        for stays in (held, fixed, held[:0]):
            tried.append(on_volumes(moved, constraints, stays))
            if constraints.missed(tried[-1]).max() <= VOLUME_TOLERANCE:
                exact.append(tried[-1])
                if np.abs(exact[-1] - moved).max() <= _GIVES * np.ptp(moved, axis=0).max():
                    exact = exact[-1:]
                    break
        moved = (exact or tried)[0]
    for array in (moved, known, shifts):
        frozen(array)
    return replace(finished, vertices=moved, held=known, shifts=shifts)


def _offset(poses: Poses, state: State, cages: Cages, *, fades: bool) -> FloatArray:
    """Return f R' R^T (x - W~ p) with the given *cages*, (n, 3)."""
    assert state.pose is not None
    assert state.pose.finished is not None
    finished = state.pose.finished
    then, now = poses.rotations(state, finished.cage_vertices), poses.rotations(state, cages)
    offset = (now @ (np.swapaxes(then, 1, 2) @ finished.offset[:, :, None]))[:, :, 0]
    if fades:
        edges = _some_edges(poses.mesh)
        offset *= _share(*(_bending(each, edges) for each in (then, now)))
    offset[state.fixed] = finished.offset[state.fixed]
    return np.asarray(offset)


def _some_edges(mesh: Mesh) -> IntArray:
    """Return edges (k, 2) all over *mesh*."""
    graph = mesh.adjacency
    some = np.arange(0, graph.nnz, 1 + graph.nnz // 20_000)
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
