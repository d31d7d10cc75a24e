"""Pulling: one point of the surface is grabbed, and the surface around it follows.

A pull moves exactly the grabbed point, in a face or at a vertex.  It makes the nearest vertex a
handle, "pull 1", which stays where it was left; so the next pull adds to it.  Near it no second one
is made: grabbing the surface there moves the same handle.  Other pulled points within the radius
are carried along, the farther away the less.  At the press nothing moves: all handles stay where
they are, whether or not the solver had put them into their places.

A pin is a handle of one vertex that stays in its place, "pin 1".  Both are handles like any other:
they can be moved, named, and removed.  `as_handle` makes one a patch that can be rotated, and
`as_pin` makes a handle a pin.

The surface beyond the reach is kept where it was at the press, softly; see `Deformer.local`.  The
more local a pull, the shorter its reach.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import deformer
from ..arrays import FloatArray, IntArray, plain
from ..deformer import (
    SPREAD,
    Deformer,
    checked_place,
    checked_point,
    checked_radius,
    checked_vertex,
    fault_of_grab,
)
from ..errors import ConstraintError
from ..geometry import rigid_fit
from ..mesh import Mesh, SurfacePoint
from .handles import (
    Targets,
    moved,
    new_name,
    renamed,
    require_near,
    targets_at,
    with_handle,
)
from .state import Locality, Pose, State


class Grip(NamedTuple):
    """Where and how the surface is grabbed."""

    point: SurfacePoint
    radius: float
    """Of the pulled surface, in the mesh's unit."""
    locality: float | None
    """0 to 1; None is `locality_of`."""
    limb: int | None
    """The number of the limb that is pulled; see `Deformer.reach_of_pull`."""
    hinge: float
    """0 to 1: where the limb bends; see `Deformer.local`."""
    turns: bool
    """Whether a patch around the point turns with the motion, which a single vertex cannot."""


@dataclass(frozen=True, eq=False)
class Grasp:
    """The grabbed point at the press, and what follows it.

    Parameters
    ----------
    grip : Grip
        With which the pull began.
    state : State
        The state at the press, with the handle of the pull.
    name : str
        The handle of the pull.
    point : (3,) float
        The grabbed point at the press.
    carried : mapping of str to float
        For other pulled points, the share of the motion that they follow.
    """

    grip: Grip
    state: State
    name: str
    point: FloatArray
    carried: Mapping[str, float]

    def targets(self, to: FloatArray) -> Targets:
        """Return the targets of the moved handles for *to*, a point (3,) or a matrix (4, 4)."""
        assert self.state.pose is not None
        start = self.state.pose.targets
        if to.shape == (3,):
            shift, own = to - self.point, start[self.name] + (to - self.point)
            more = {name: start[name] + share * shift for name, share in self.carried.items()}
        else:
            own, more = moved(start[self.name], to, "to"), {}
            for name, share in self.carried.items():
                there = moved(start[name], to, "to")
                shift = (there - start[name]).mean(axis=0)
                more[name] = there if share == 1.0 else start[name] + share * shift
        return MappingProxyType({self.name: own, **more})


def locality_of(state: State, locality: float | None = None) -> float:
    """Return *locality*, or for None that by fixed vertices, pins and other handles."""
    if locality is not None:
        return locality
    others = (ids for name, ids in state.handles.items() if name not in state.pulls)
    return deformer.automatic_locality(len(state.fixed) + sum(map(len, others)))


def grabbed(
    mesh: Mesh, state: State, vertex: int | ArrayLike | SurfacePoint, radius: float | None = None
) -> str | None:
    """Return the handle that `Session.pull` of a point would move; None if it makes a new one.

    It has the vertex of that point, or else is the nearest pulled point within a quarter of the
    *radius*.
    """
    point, radius = checked_place(mesh, vertex), checked_radius(mesh, radius)
    x = mesh.vertices
    near = []
    for name, ids in state.handles.items():
        away = float(np.linalg.norm(x[ids] - point.at(x), axis=1).min())
        if away == 0.0 or point.vertex in ids:
            return name
        if name in state.pulls and away < 0.25 * radius:
            near.append((away, name))
    return min(near, key=lambda each: each[0])[1] if near else None


def can_grab(
    mesh: Mesh, vertex: int | ArrayLike | SurfacePoint, radius: float | None = None
) -> bool:
    """Return whether a vertex is so near that `Session.pull` can grab the surface there."""
    return not fault_of_grab(mesh, checked_place(mesh, vertex), checked_radius(mesh, radius))


def grasp(bound: Deformer, state: State, vertices: FloatArray, grip: Grip) -> Grasp:
    """Grab the pose *vertices* (n, 3) of *state*, whose cages are *bound*.

    ConstraintError if the point is fixed, or no vertex is near it.
    """
    mesh, (point, radius, locality, limb, hinge, turns) = bound.mesh, grip
    if np.isin(point.vertex, state.fixed):
        raise ConstraintError("this point is fixed; grab another one, or erase the fixed vertices")
    if fault := fault_of_grab(mesh, point, radius):
        raise ConstraintError(fault)
    x = mesh.vertices
    pulls = tuple(name for name in state.pulls if name in state.handles)
    away = {
        name: float(np.linalg.norm(x[ids] - point.at(x), axis=1).min())
        for name, ids in state.handles.items()
    }
    name = grabbed(mesh, state, point, radius)
    locality = locality_of(state, locality)
    handles = state.handles
    if name is None:
        name = _new_name(state, "pull")
        handles = with_handle(mesh, state, name, [point.vertex])
        pulls = (*pulls, name)
    elif name in pulls and len(handles[name]) == 1 and not point.is_vertex:
        handles = with_handle(mesh, state, name, [point.vertex])  # so that it moves this point
    others = [each for each in pulls if each != name and away.get(each, np.inf) < radius]
    inner = SPREAD if turns else 0.0  # what is inside moves with the patch
    beyond = {each: max(0.0, away[each] / radius - inner) / (1.0 - inner) for each in others}
    carried = {each: (1.0 - share**2) ** 2 for each, share in beyond.items()}
    if turns and len(handles[name]) == 1:
        along = [each for each in others if carried[each] == 1.0]
        patch = _free_patch(mesh, replace(state, handles=handles), name, SPREAD * radius, along)
        handles = with_handle(mesh, state, name, patch)
    places = tuple(cage.vertices for cage in state.cages)
    before = None if state.pose is None else state.pose.on(state.stiffness)
    places = places if before is None else before.cage_vertices
    finished = None if before is None else before.finished
    if finished is not None:  # handles stay where they are, also for the cages
        kept = np.isin(finished.held, state.fixed)
        finished = replace(finished, held=finished.held[kept], shifts=finished.shifts[kept])
    pose = Pose(places, targets_at(handles, vertices), finished, state.stiffness)
    reach, follows, depth = bound.reach_of_pull(point, radius, locality, limb)
    if len(handles[name]) > 1:  # which moves as a whole
        point = SurfacePoint.at_vertex(point.vertex)
    local = Locality(point, reach, SPREAD * radius, follows, pose.cage_vertices, depth, hinge)
    after = replace(state, handles=handles, pulls=pulls, pose=pose, locality=local)
    return Grasp(grip, after, name, grip.point.at(vertices), MappingProxyType(carried))


def released(state: State, vertices: FloatArray) -> State:
    """Return *state* as it is for other drags than the last pull, with the mesh at *vertices*.

    A pull moves a point of a face, and the vertex of its handle only by about as much.
    """
    pose, locality = state.pose, state.locality
    if pose is None or locality is None:
        return state
    vertex = locality.point.vertex
    own = {
        name: targets_at({name: ids}, vertices)[name]
        for name, ids in state.handles.items()
        if not locality.point.is_vertex and np.array_equal(ids, [vertex])
    }
    pose = replace(pose, targets=MappingProxyType({**pose.targets, **own})) if own else pose
    return replace(state, pose=pose, locality=None)


def kept(state: State, vertices: FloatArray) -> State:
    """Return *state*, with the mesh at *vertices*, for changes of volumes: nothing else moves it.

    All changes of volumes since the pull start from the same pose, so their order does not matter.
    """
    pose, locality = state.pose, state.locality
    if pose is None or locality is None or not locality.reach:
        return state
    here = replace(locality, reach=0.0, depth=0.0, hinge=0.0, cage_vertices=pose.cage_vertices)
    return replace(released(state, vertices), locality=here)


def last_pulled(mesh: Mesh, state: State) -> str | None:
    """Return the handle of the last pull; None if the pose does not come from a pull."""
    locality = state.locality
    if locality is None:
        return None
    return grabbed(mesh, state, locality.point, locality.spread / SPREAD)


def turned(grasp: Grasp, mesh: Mesh, before: FloatArray, now: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) of the surface around the grabbed point since the press.

    *before* and *now* are the poses at the press and at present, (n, 3).
    """
    vertex = grasp.grip.point.vertex
    patch = _patch(mesh, vertex, SPREAD * grasp.grip.radius)
    patch = np.union1d(patch, mesh.adjacency[[vertex]].indices)
    return rigid_fit(before[patch], now[patch])[0]


def as_it_is(grasp: Grasp, rotation: FloatArray, now: FloatArray) -> Grasp:
    """Return *grasp* with its patch in the shape that it has in the current pose *now*, (n, 3).

    *rotation* (3, 3) is that of the patch since the press; turned by it, the patch does not move.
    """
    assert grasp.state.pose is not None
    patch = grasp.state.handles[grasp.name]
    shape = grasp.point + (now[patch] - grasp.grip.point.at(now)) @ rotation
    targets = MappingProxyType({**grasp.state.pose.targets, grasp.name: shape})
    pose = replace(grasp.state.pose, targets=targets)
    return replace(grasp, state=replace(grasp.state, pose=pose))


def localised(constrained: Deformer, locality: Locality, x: FloatArray) -> Deformer:
    """Return a copy of a *constrained* deformer for a pull: local, in the pose at its press.

    *x* (n, 3) is the mesh with its cages in that pose.
    """
    other, rest = constrained.copy(), (cage.vertices for cage in constrained.cages)
    if all(map(np.array_equal, locality.cage_vertices, rest)):
        other.reset()  # to the shape that has the volumes which are set
    else:
        other.resume(locality.cage_vertices, x[other.handle])
    return other.local(
        locality.point,
        locality.reach,
        locality.spread,
        follows=locality.follows,
        depth=locality.depth,
        hinge=locality.hinge,
    )


def pinned(mesh: Mesh, state: State, vertex: int) -> tuple[str, Mapping[str, IntArray]]:
    """Return the name of a new pin at *vertex*, and the handles of *state* with it."""
    name = _new_name(state, "pin")
    return name, with_handle(mesh, state, name, [checked_vertex(mesh, vertex)])


def as_handle(mesh: Mesh, state: State, name: str, radius: float) -> tuple[str, State]:
    """Return a new name, and *state* with the pin or pulled point *name* as a handle of that name.

    The handle has the surface within half of *radius*, which can rotate, and at least the vertices
    beside it.  The pose in the returned state still has the targets of before.
    """
    new = new_name(state.handles)
    after = renamed(state, name, new)
    after = replace(after, pulls=tuple(other for other in state.pulls if other != name))
    if len(after.handles[new]) == 1:
        patch = _free_patch(mesh, after, new, SPREAD * radius)
        after = replace(after, handles=with_handle(mesh, after, new, patch))
    return new, after


def as_pin(mesh: Mesh, state: State, name: str) -> tuple[str, State]:
    """Return a new name, and *state* with the handle *name* as a pin: its middle vertex."""
    new = _new_name(state, "pin")
    after = renamed(state, name, new)
    after = replace(after, pulls=tuple(other for other in state.pulls if other != name))
    return new, replace(
        after, handles=with_handle(mesh, after, new, [middle_vertex(mesh, after.handles[new])])
    )


def middle_vertex(mesh: Mesh, ids: IntArray) -> int:
    """Return the vertex among *ids* (k,) that is nearest to their centre at rest."""
    x = mesh.vertices[ids]
    return int(ids[np.linalg.norm(x - x.mean(axis=0), axis=1).argmin()])


def checked_motion(mesh: Mesh, to: ArrayLike) -> FloatArray:
    """Return *to* as a point (3,) or a matrix (4, 4); ConstraintError if it is neither."""
    array = plain(to, "to")
    if array.shape == (4, 4):
        return np.asarray(array, dtype=np.float64)
    if array.ndim == 2:
        raise ConstraintError(f"to must be a point (3,) or a matrix (4, 4); got {array.shape}")
    point = checked_point(array)
    require_near(mesh, point, "the pulled positions (to)")
    return point


def _new_name(state: State, kind: str) -> str:
    numbers = range(1, len(state.handles) + 2)
    return next(name for n in numbers if (name := f"{kind} {n}") not in state.handles)


def _free_patch(
    mesh: Mesh, state: State, name: str, radius: float, along: Collection[str] = ()
) -> IntArray:
    """Return the patch around the handle *name*, of one vertex, that is free for it, (k,).

    Its radius is at most half the distance to fixed vertices and to handles that are not *along*
    with it, so that there is room to deform between them.
    """
    (vertex,) = state.handles[name]
    others = {other: ids for other, ids in state.handles.items() if other != name}
    staying = [ids for other, ids in others.items() if other not in along]
    ids = np.concatenate([state.fixed, *staying])
    away = np.linalg.norm(mesh.vertices[ids] - mesh.vertices[vertex], axis=1)
    radius = min(radius, 0.5 * float(away.min(initial=np.inf)))
    patch = np.union1d(_patch(mesh, vertex, radius), mesh.adjacency[[vertex]].indices)
    return np.setdiff1d(patch, np.concatenate([state.fixed, *others.values()]))


def _patch(mesh: Mesh, vertex: int, radius: float) -> IntArray:
    """Return the vertices within *radius* of *vertex* that edges within it reach, (k,)."""
    away = np.linalg.norm(mesh.vertices - mesh.vertices[vertex], axis=1)
    inside = away <= radius
    found, front = np.array([vertex]), np.array([vertex])
    while len(front):
        near = np.unique(mesh.adjacency[front].indices)
        front = np.setdiff1d(near[inside[near]], found, assume_unique=True)
        found = np.concatenate([found, front])
    return np.sort(found)
