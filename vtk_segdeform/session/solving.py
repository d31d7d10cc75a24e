"""The next pose of a state: solved for, or with cages that were moved by hand.

Poses dragged on from a finished one are solved for as in `finishing`: the cages for the places of
handles and fixed vertices less the shifts in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np

from .. import sizes
from ..arrays import FloatArray, frozen
from ..errors import ConstraintError
from ..geometry import volume_gradient
from ..progress import Progress
from ..solver import Solution
from . import pulls
from .finishing import errors, moved_on
from .handles import is_near, require_near, stacked, targets_at, targets_of
from .poses import Aim, Path, Poses, Shown
from .state import Cages, Pose, State

_REGULAR = 1e-6  # relative weight of cages at rest among those nearest to a surface, at least
_MARGIN = 1.1  # by which they may be farther away, for the volume that is to be restored
_SAMPLED = 200  # vertices that hold a region in its place, at most about twice as many


def solve(
    poses: Poses,
    state: State,
    targets: Mapping[str, FloatArray],
    max_steps: int | None = None,
    *,
    live: bool = False,
    progress: Progress | None = None,
) -> tuple[Pose, Solution]:
    """Solve for *targets* (k, 3) of every handle, starting from the pose of *state*.

    If *live*, `Poses.shown` of a large mesh may be the vertices of the solution.

    Raises
    ------
    CageError
        If *state* has no cages, or they do not fit.
    ConstraintError
        If no finite pose is found.
    Cancelled
        If *progress* raised it.
    """
    if state.pose is not None:
        state = replace(state, pose=state.pose.on(state.stiffness))
    held, deformer, aim = poses.path(state)
    deformer = deformer.copy()
    before, shift, wanted = state.pose, poses.shift(state), stacked(targets)
    for _ in range(1 if shift is None or max_steps is not None else Aim.TURNS):
        places = wanted
        if shift is not None:
            own = shift[deformer.handle]
            if aim is None or not deformer.has_arrived:
                aim = Aim(wanted, own)
            else:
                aim = aim.turned(wanted, own)
            places = wanted - aim.shift
        solution = deformer.solve(places, max_steps=max_steps, progress=progress)
        if not np.isfinite(solution.vertices).all():
            raise ConstraintError("no finite pose for these targets; move the handles less")
        cages, finished = solution.cage_vertices, None if before is None else before.finished
        for vertices in cages:
            frozen(vertices)
        if before is not None and all(map(np.array_equal, cages, before.cage_vertices)):
            cages = before.cage_vertices  # so that their vertices are known
        elif finished is not None:
            finished = moved_on(poses, state, cages)
        if shift is None or finished is None:
            break
        # The offset of a handle may have turned with it: then its cages have another target.
        last, shift = shift, finished.shifted(poses.surface(state, cages))
        if np.array_equal(shift[deformer.handle], last[deformer.handle]):
            break
    pose = Pose(cages, MappingProxyType({**targets}), finished, state.stiffness)
    after = replace(state, pose=pose)
    is_large = poses.mesh.n_vertices > sizes.SCALED_VOLUME
    if live and is_large and finished is None and cages is solution.cage_vertices:
        frozen(solution.vertices)
        poses.keep_live(after, Shown(solution.vertices, cache(solution.volume)))
    x, change = poses.shown(after, live=live)
    poses.keep_path(pose, Path(held, deformer, aim))
    solution = replace(solution, vertices=x, volume=change)
    if shift is not None:
        solution = replace(solution, errors=errors(poses, state, deformer, wanted))
    return pose, solution


def settled(poses: Poses, state: State, progress: Progress | None = None) -> State:
    """Return *state* in the pose for its targets, as `solve` finds it; also in another thread."""
    pose, _ = solve(poses, state, targets_of(poses.mesh, state), progress=progress)
    return replace(state, pose=pose)


def with_region_at_rest(
    poses: Poses, state: State, region: int, progress: Progress | None = None
) -> State:
    """Return *state* with the vertices of a region where they were at rest; the others follow.

    Its handles, pins and pulled points go back to rest as well; later drags may move it again.
    It may run in another thread.
    """
    regions, rest = state.regions, poses.mesh.vertices
    if state.pose is None or regions is None:
        return state
    state = pulls.released(state, poses.vertices(state))
    own = np.flatnonzero(regions.labels == region)
    inside = [name for name, ids in state.handles.items() if np.isin(ids, own).mean() > 0.5]
    free = np.setdiff1d(own, np.concatenate([state.fixed, state.handle]))
    held = {"": frozen(free[:: 1 + len(free) // _SAMPLED])} if len(free) else {}  # for this solve
    assert state.pose is not None
    targets = {**state.pose.targets, **{name: rest[ids] for name, ids in held.items()}}
    targets |= {name: frozen(rest[state.handles[name]]) for name in inside}
    handles = MappingProxyType({**state.handles, **held})
    pose = replace(state.pose, targets=targets_at(handles, poses.vertices(state)))
    here = replace(state, handles=handles, pose=pose)
    pose, _ = solve(poses, here, targets, progress=progress)
    kept = {name: points for name, points in pose.targets.items() if name in state.handles}
    return replace(state, pose=replace(pose, targets=MappingProxyType(kept)))


def free_form(poses: Poses, state: State, cage_vertices: Sequence[FloatArray]) -> Pose:
    """Return the pose with the given *cage_vertices* (m_r, 3), corrected to preserve volume.

    If the options preserve volume, all cages move along the gradients of their own volumes until
    the mesh has its rest volume.  The targets of handles become their positions.

    Raises
    ------
    ConstraintError
        If the correction moves the cages too far away.
    """
    p, before = tuple(cage_vertices), state.pose
    if state.options.preserve_volume or state.options.preserve_region_volumes:
        p = _with_rest_volume(poses, state, p)
    for vertices in p:
        frozen(vertices)
    has_finished = before is not None and before.finished is not None
    finished = moved_on(poses, state, p) if has_finished else None
    pose = Pose(p, MappingProxyType({}), finished, state.stiffness)
    x = poses.vertices(replace(state, pose=pose))
    return replace(pose, targets=targets_at(state.handles, x))


def _with_rest_volume(poses: Poses, state: State, cage_vertices: Cages) -> Cages:
    _, volume = poses.enclosed(state)
    if not volume.has_volume:
        return cage_vertices
    pairs = zip(cage_vertices, state.cages, strict=True)
    outward = np.concatenate([volume_gradient(p, cage.faces) for p, cage in pairs])
    outward /= max(np.abs(outward).max(), np.finfo(float).tiny)
    deformer = poses.bindings.bind(state)
    path = np.hstack([deformer.surface(cage_vertices), deformer.subspace.map(outward)])
    p = np.concatenate(cage_vertices) + volume.exact_step(path) * outward
    require_near(poses.mesh, p, "cage vertices that preserve the volume")
    return tuple(p[columns] for columns in deformer.subspace.columns)


def carried(poses: Poses, state: State, x: FloatArray, progress: Progress | None = None) -> Cages:
    """Return the cage vertices (m_r, 3) of *state* whose mesh is nearest to *x* (n, 3).

    In the sense of least squares over some thousand vertices, of which fixed ones and handles count
    most, and among cages as near to the mesh as `require_near` asks for.  It binds *state*, and may
    run in another thread, as `Poses.bind`.
    """
    deformer, mesh = poses.bindings.bind(state, progress), poses.mesh
    held = np.concatenate([state.fixed, state.handle])
    every = np.arange(mesh.n_vertices)
    some = [each[:: max(1, len(each) // 4000)] for each in (every, held)]
    ids, counts = np.concatenate(some), [len(each) for each in some]
    weights = np.repeat([1.0, 30.0], counts)[:, None]
    rows = weights * deformer.subspace.at(ids)
    moved = rows.T @ (weights * (x - mesh.vertices)[ids])
    normal = rows.T @ rows
    rest = np.concatenate([cage.vertices for cage in state.cages])
    added, shift = _REGULAR * np.trace(normal) / len(normal), np.full_like(rest, np.inf)
    while not is_near(mesh, rest + _MARGIN * shift):
        shift = np.linalg.solve(normal + added * np.eye(len(normal)), moved)
        added *= 2.0
    p = rest + shift
    return tuple(p[columns] for columns in deformer.subspace.columns)
