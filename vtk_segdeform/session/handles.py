"""Named handles: sets of vertices that are moved by hand, and where they are to go.

Handles are a mapping from names to vertex numbers (k,), targets one from the same names to
points (k, 3).  Both are read-only: functions return new ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_points, frozen, plain
from ..checks import shown
from ..deformer import FARTHEST_APART, checked_constraints
from ..errors import ConstraintError
from ..mesh import Mesh
from .naming import fault_of
from .state import Pose, State, pieces

Handles = Mapping[str, IntArray]
Targets = Mapping[str, FloatArray]

_FARTHEST = FARTHEST_APART / 2.0  # diagonals of the mesh from its centre


def with_handle(mesh: Mesh, state: State, name: str, vertices: ArrayLike) -> Handles:
    """Return the handles of *state* and *name*, in the place of what had that name before.

    Raises
    ------
    ConstraintError
        If *name* is no name, or *vertices* are none of the mesh, fixed or of another handle.
    """
    _check_name(name)
    others = {other: ids for other, ids in state.handles.items() if other != name}
    _, ids = checked_constraints(mesh, state.fixed, vertices)
    if not len(ids):
        raise ConstraintError("a handle needs one vertex or more; got none: mark some")
    for other, taken in others.items():
        both = np.intersect1d(ids, taken)
        if len(both):
            raise ConstraintError(
                f"{len(both)} vertices (the first is {both[0]}) are in {other!r} already; "
                "take them out of one of the two"
            )
    own = ids.copy()
    own.flags.writeable = False
    return MappingProxyType({**state.handles, name: own})


def without_handle(handles: Handles, name: str) -> Handles:
    """Return all *handles* but one; ConstraintError if there is no such."""
    require_handle(handles, name)
    return MappingProxyType({other: ids for other, ids in handles.items() if other != name})


def renamed(state: State, name: str, new_name: str) -> State:
    """Return *state* with a handle called *new_name*; nothing else changes, not even the order."""
    require_handle(state.handles, name)
    _check_name(new_name)
    if new_name in state.handles and new_name != name:
        raise ConstraintError(f"there is a handle {new_name!r} already; choose another name")

    def call(other: str) -> str:
        return new_name if other == name else other

    handles = MappingProxyType({call(other): ids for other, ids in state.handles.items()})
    if state.pose is None:
        return replace(state, handles=handles)
    targets = {call(other): points for other, points in state.pose.targets.items()}
    pose = Pose(state.pose.cage_vertices, MappingProxyType(targets))
    return replace(state, handles=handles, pose=pose)


def new_name(handles: Handles) -> str:
    """Return the first of "handle 1", "handle 2", ... that is free."""
    numbers = range(1, len(handles) + 2)
    return next(name for n in numbers if (name := f"handle {n}") not in handles)


def require_handle(handles: Handles, name: str) -> None:
    """Raise a ConstraintError that lists the names there are, unless *name* is one."""
    if not isinstance(name, str) or name not in handles:
        there = ", ".join(map(repr, handles)) or "none yet; add one first"
        raise ConstraintError(f"there is no handle {shown(name)}; there are {there}")


def targets_at(handles: Handles, vertices: FloatArray) -> Targets:
    """Return where the handles are among *vertices* (n, 3)."""
    places = {name: vertices[ids] for name, ids in handles.items()}
    for points in places.values():
        frozen(points)
    return MappingProxyType(places)


def carried(pose: Pose, before: Handles, after: Handles, vertices: FloatArray) -> Pose:
    """Return *pose* with targets for the handles *after*.

    Those that were there *before* keep theirs; new ones stay where *vertices* (n, 3) has them.
    """
    here = targets_at(after, vertices)
    kept = {
        name: pose.targets[name] if before.get(name) is ids else here[name]
        for name, ids in after.items()
    }
    return Pose(pose.cage_vertices, MappingProxyType(kept))


def checked_targets(
    mesh: Mesh, handles: Handles, targets: Mapping[str, ArrayLike] | ArrayLike
) -> dict[str, FloatArray]:
    """Return *targets* by name, read-only arrays of their own.

    Parameters
    ----------
    mesh : Mesh
        What is deformed.
    handles : mapping of str to (k,) int
        All there are.
    targets : mapping of str to (k, 3) float, or (k, 3) float
        By name, or for the vertices of all handles, one handle after the other.

    Raises
    ------
    ConstraintError
        If there is no such handle, a shape is wrong, or a target is not finite or too far away.
    """
    if not handles:
        raise ConstraintError("there is no handle to move; add one first")
    if not isinstance(targets, Mapping):
        lengths = [len(ids) for ids in handles.values()]
        points = _checked_points(mesh, targets, sum(lengths), "all handles")
        pairs = zip(handles, pieces(points, lengths), strict=True)
        return {name: _own(piece) for name, piece in pairs}
    for name in targets:
        require_handle(handles, name)
    return {
        name: _own(_checked_points(mesh, points, len(handles[name]), name))
        for name, points in targets.items()
    }


def require_near(mesh: Mesh, points: FloatArray, name: str) -> None:
    """Raise a ConstraintError if some of *points* are senselessly far from *mesh*."""
    if _farthest(points, mesh.vertices[0]) / mesh.diagonal <= _FARTHEST - 1.0:
        return  # surely, without the middle of many vertices: none is a diagonal away from it
    away = _farthest(points, mesh.vertices.mean(axis=0)) / mesh.diagonal
    if not away <= _FARTHEST:
        raise ConstraintError(
            f"{name} are {away:.3g} diagonals of the mesh away; "
            f"at most {_FARTHEST:.0f} are allowed: move less"
        )


def _farthest(points: FloatArray, place: FloatArray) -> float:
    """Return how far points are from a *place* (3,), along x, y or z."""
    return float(np.abs(points - place).max(initial=0.0))


def moved(points: FloatArray, matrix: ArrayLike) -> FloatArray:
    """Return (k, 3) *points* under an affine (4, 4) *matrix*; ConstraintError if it is none."""
    M = plain(matrix, "motion")
    if M.dtype.kind not in "iuf":
        raise ConstraintError(f"motion must hold real numbers; got {M.dtype}")
    if not np.array_equal(M[3], [0.0, 0.0, 0.0, 1.0]):
        raise ConstraintError(f"the last row of motion must be 0 0 0 1; got {M[3]}")
    if not np.isfinite(M).all():
        raise ConstraintError("motion holds NaN or infinite numbers; all must be finite")
    return np.asarray(points @ M[:3, :3].T + M[:3, 3])


def _checked_points(mesh: Mesh, targets: ArrayLike, count: int, name: str) -> FloatArray:
    try:
        points = as_points(targets, f"targets of {name}")
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    if len(points) != count:
        raise ConstraintError(f"targets of {name} must be {count} points; got {len(points)}")
    require_near(mesh, points, f"targets of {name}")
    return points


def _check_name(name: str) -> None:
    fault = fault_of(name)
    if fault:
        raise ConstraintError(f"a handle{fault}")


def _own(points: FloatArray) -> FloatArray:
    own = points.copy()
    own.flags.writeable = False
    return own
