"""Named handles and their targets.

Handles are a mapping from names to vertex ids (k,), and targets a mapping from the same names to
points (k, 3).  Both are read-only; the functions return new mappings.
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
from ..errors import CageError, ConstraintError
from ..mesh import Mesh
from .naming import fault_of
from .state import State, split_rows

Handles = Mapping[str, IntArray]
Targets = Mapping[str, FloatArray]

_FARTHEST = FARTHEST_APART / 2.0  # mesh diagonals from the centre


def with_handle(mesh: Mesh, state: State, name: str, vertices: ArrayLike) -> Handles:
    """Return the handles of *state* with handle *name* added or replaced.

    Raises
    ------
    ConstraintError
        If *name* is invalid, or *vertices* are not vertices of the mesh, fixed, or in another
        handle.
    """
    _check_name(name)
    others = {other: ids for other, ids in state.handles.items() if other != name}
    _, ids = checked_constraints(mesh, state.fixed, vertices)
    if not len(ids):
        raise ConstraintError("a handle requires at least one vertex; got none")
    for other, taken in others.items():
        both = np.intersect1d(ids, taken)
        if len(both):
            raise ConstraintError(
                f"{len(both)} vertices (the first is {both[0]}) are already in {other!r}; "
                "remove them from one of the two handles"
            )
    return MappingProxyType({**state.handles, name: frozen(ids.copy())})


def with_fixed(mesh: Mesh, state: State, fixed: IntArray, vertices: FloatArray) -> State:
    """Return *state* with other *fixed* vertices (f,), at their places among *vertices* (n, 3).

    Vertices that are already fixed keep theirs.  Without a pose they are fixed at rest.
    """
    own = frozen(fixed.copy())
    if state.pose is None:
        return replace(state, fixed=own, fixed_at=None)
    places = vertices[own]
    _, new, old = np.intersect1d(own, state.fixed, return_indices=True)
    kept = mesh.vertices[state.fixed] if state.fixed_at is None else state.fixed_at
    places[new] = kept[old]
    at_rest = np.array_equal(places, mesh.vertices[own])
    return replace(state, fixed=own, fixed_at=None if at_rest else frozen(places))


def renamed(state: State, name: str, new_name: str) -> State:
    """Return *state* with handle *name* renamed; the order of handles does not change."""
    require_handle(state.handles, name)
    _check_name(new_name)
    if new_name in state.handles and new_name != name:
        raise ConstraintError(f"there is already a handle {new_name!r}; choose another name")

    def name_after(other: str) -> str:
        return new_name if other == name else other

    handles = MappingProxyType({name_after(other): ids for other, ids in state.handles.items()})
    if state.pivots:
        pivots = {name_after(other): point for other, point in state.pivots.items()}
        state = replace(state, pivots=MappingProxyType(pivots))
    if state.pose is None:
        return replace(state, handles=handles)
    targets = {name_after(other): points for other, points in state.pose.targets.items()}
    pose = replace(state.pose, targets=MappingProxyType(targets))
    return replace(state, handles=handles, pose=pose)


def new_name(handles: Handles) -> str:
    """Return the first unused name of "handle 1", "handle 2", ..."""
    numbers = range(1, len(handles) + 2)
    return next(name for n in numbers if (name := f"handle {n}") not in handles)


def require_handle(handles: Handles, name: str) -> None:
    """Raise a ConstraintError that lists the handles, unless *name* is one of them."""
    if not isinstance(name, str) or name not in handles:
        names = ", ".join(map(repr, handles))
        advice = f"the handles are {names}" if handles else "add a handle first"
        raise ConstraintError(f"there is no handle {shown(name)}; {advice}")


def targets_at(handles: Handles, vertices: FloatArray) -> Targets:
    """Return the positions of the handles among *vertices* (n, 3)."""
    return MappingProxyType({name: frozen(vertices[ids]) for name, ids in handles.items()})


def stacked(targets: Targets) -> FloatArray:
    """Return the targets of all handles, concatenated, (k, 3)."""
    return np.concatenate([np.empty((0, 3)), *targets.values()])


def targets_of(mesh: Mesh, state: State) -> Targets:
    """Return the targets of all handles of *state*: of its pose, or at rest."""
    pose = state.pose
    return targets_at(state.handles, mesh.vertices) if pose is None else pose.targets


def checked_targets(
    mesh: Mesh, handles: Handles, targets: Mapping[str, ArrayLike] | ArrayLike
) -> dict[str, FloatArray]:
    """Return *targets* by name, as read-only copies.

    Parameters
    ----------
    mesh : Mesh
        The mesh at rest.
    handles : mapping of str to (k,) int
        All handles.
    targets : mapping of str to (k, 3) float, or (k, 3) float
        Targets by name, or the targets of all handles, concatenated.

    Raises
    ------
    ConstraintError
        If there is no such handle, a shape is wrong, or a target is not finite or too far away.
    """
    if not handles:
        raise ConstraintError("there is no handle to move; add a handle first")
    if not isinstance(targets, Mapping):
        lengths = [len(ids) for ids in handles.values()]
        points = _checked_points(mesh, targets, sum(lengths), "all handles")
        pairs = zip(handles, split_rows(points, lengths), strict=True)
        return {name: frozen(piece.copy()) for name, piece in pairs}
    for name in targets:
        require_handle(handles, name)
    return {
        name: frozen(_checked_points(mesh, points, len(handles[name]), name).copy())
        for name, points in targets.items()
    }


def cage_places(mesh: Mesh, vertices: ArrayLike, count: int, name: str) -> FloatArray:
    """Return a copy of the *vertices* (m, 3) of a moved cage, checked as *name*.

    Raises
    ------
    CageError
        If they are not *count* points.
    ConstraintError
        If they are too far from *mesh*.
    """
    try:
        points = as_points(vertices, name).copy()
    except ValueError as fault:
        raise CageError(str(fault)) from None
    if len(points) != count:
        raise CageError(f"{name} must be {count} points; got {len(points)}")
    require_near(mesh, points, name)
    return points


def require_near(mesh: Mesh, points: FloatArray, name: str) -> None:
    """Raise a ConstraintError if *points* are unreasonably far from *mesh*."""
    if not is_near(mesh, points):
        raise ConstraintError(
            f"{name} are more than {_FARTHEST:.0f} mesh diagonals away from the mesh; move less"
        )


def is_near(mesh: Mesh, points: FloatArray) -> bool:
    """Return whether *points* (k, 3) are near enough to *mesh* for `require_near`."""
    if _farthest(points, mesh.vertices[0]) / mesh.diagonal <= _FARTHEST - 1.0:
        return True  # sufficient, and faster: the centre is within a diagonal of every vertex
    return _farthest(points, mesh.vertices.mean(axis=0)) / mesh.diagonal <= _FARTHEST


def _farthest(points: FloatArray, place: FloatArray) -> float:
    """Return the largest distance of *points* from *place* (3,) along x, y or z."""
    return float(np.abs(points - place).max(initial=0.0))


def moved(points: FloatArray, matrix: ArrayLike, name: str = "motion") -> FloatArray:
    """Return *points* (k, 3) transformed by an affine (4, 4) *matrix*, checked as *name*."""
    M = plain(matrix, name)
    if M.dtype.kind not in "iuf":
        raise ConstraintError(f"{name} must contain real numbers; got {M.dtype}")
    if not np.array_equal(M[3], [0.0, 0.0, 0.0, 1.0]):
        raise ConstraintError(f"the last row of {name} must be 0 0 0 1; got {M[3]}")
    if not np.isfinite(M).all():
        raise ConstraintError(f"{name} must be finite; it contains NaN or infinite numbers")
    return np.asarray(points @ M[:3, :3].T + M[:3, 3])


def _checked_points(mesh: Mesh, targets: ArrayLike, count: int, name: str) -> FloatArray:
    try:
        points = as_points(targets, f"targets of {name}")
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    if len(points) != count:
        raise ConstraintError(
            f"targets of {name} must be {count} points, one per vertex; got {len(points)}"
        )
    require_near(mesh, points, f"targets of {name}")
    return points


def _check_name(name: str) -> None:
    if fault := fault_of(name):
        raise ConstraintError(f"a handle{fault}")
