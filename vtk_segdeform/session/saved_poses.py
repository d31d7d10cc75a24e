"""Poses that are kept by name: to return to, and to blend.

A saved pose is the state in which it was saved.  It is applied with the regions, cages and handles
of now: with the same cages the mesh is where it was to the bit, with others as near as they can be.

    blend of two poses at a share t:  handle targets  c_t + R_t ((1 - t) a + t R_1^T b),
    where a, b are the targets relative to their centres, c_t moves from one centre to the other,
    and R_t turns from 1 to the rotation R_1 that takes a closest to b.  The mesh is solved for.

If only pulled points move, they are pulled there one after the other from the nearer of the two
poses, each with the surface around it: what is alike in both poses stays.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray, frozen, is_number
from ..checks import shown
from ..deformer import checked_radius
from ..errors import ArgumentError, ConstraintError
from ..geometry import rigid_fit
from ..mesh import Mesh, SurfacePoint
from ..solver import Solution
from . import pulls, solving
from .handles import targets_of
from .naming import fault_of
from .pose_copies import copied_pose, require_alike
from .poses import Poses
from .state import State, checked_state
from .timeline import Timeline


class Posed(Protocol):
    """A session, whose poses are copied."""

    @property
    def mesh(self) -> Mesh:
        """The mesh at rest."""

    @property
    def state(self) -> State:
        """The current state."""

    @property
    def saved_poses(self) -> SavedPoses:
        """The saved poses by name."""


class SavedPoses(Mapping[str, State]):
    """The saved poses of a session by name, each the state in which it was saved; and edits."""

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses
        self._own = dict(history.state.saved)

    def __getitem__(self, name: str) -> State:
        return self._own[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)

    def __repr__(self) -> str:
        return repr(tuple(self))

    def save(self, name: str | None = None) -> str:
        """Save the current pose, in place of one of the same name, and return its *name*.

        By default "pose 1", "pose 2", ...

        Raises
        ------
        ConstraintError
            If the name is invalid.
        """
        if name is None:
            numbers = range(1, len(self) + 2)
            name = next(new for n in numbers if (new := f"pose {n}") not in self)
        self._history.commit()
        state = self._history.state
        kept = pulls.released(state, self._poses.vertices(state))
        self._step(f"save {_checked(name)}", {**self._own, name: replace(kept, saved=())})
        return name

    def remove(self, name: str) -> None:
        """Forget a saved pose."""
        self._require(name)
        self._step(f"forget {name}", {each: s for each, s in self._own.items() if each != name})

    def rename(self, name: str, new_name: str) -> None:
        """Rename a saved pose; the order does not change."""
        self._require(name)
        if _checked(new_name) in self and new_name != name:
            raise ConstraintError(f"there is already a pose {new_name!r}; choose another name")
        renamed = {new_name if each == name else each: s for each, s in self._own.items()}
        self._step(f"rename {name}", renamed)

    def apply(self, name: str) -> None:
        """Let the mesh have a saved pose, in one undo step."""
        self._history.step(f"go to {name}", self.applied(name))

    def applied(self, name: str | None) -> State:
        """Return the state after `apply`, without changing the session; None is the rest pose.

        If the cages are others than when it was saved, this may bind them, and takes seconds; it
        may run in another thread.
        """
        if name is None:
            return self._history.state.at_rest()
        self._require(name)
        return in_pose(self._poses, self._history.state, self._own[name])

    def has_cages(self, name: str) -> bool:
        """Return whether a pose was saved with the current cages, so that `applied` is quick."""
        self._require(name)
        saved = self._own[name]
        return saved.pose is None or has_cages(self._history.state, saved)

    def copy(self, other: Posed, *names: str) -> tuple[str, ...]:
        """Save poses of another session, of a mesh with the same faces, in one undo step.

        Every part turns and stretches as there, from its own shape; the volume is exact.

        Parameters
        ----------
        other : Session
            Its mesh has other positions, such as the scan of another person.
        *names : str
            Of its saved poses; by default all, or if there are none, its current pose.

        Returns
        -------
        names : tuple of str
            The names of the copies; by default those in the other session, or "pose 1".

        Raises
        ------
        ConstraintError
            If the faces differ, or there is no such pose.
        CageError
            If this session has no cages.
        """
        return self.add(self.copied(other, *names))

    def add(self, poses: Mapping[str, State]) -> tuple[str, ...]:
        """Save what `copied` returns, in one undo step, and return the names."""
        checked = {_checked(name): checked_state(self._poses.mesh, poses[name]) for name in poses}
        label = f"copy {next(iter(poses))}" if len(poses) == 1 else f"copy {len(poses)} poses"
        self._history.commit()
        self._step(label, {**self._own, **checked})
        return tuple(poses)

    def copied(self, other: Posed, *names: str) -> dict[str, State]:
        """Return the poses that `copy` saves, by name, without changing the session.

        Binding may take seconds; this may run in another thread.
        """
        theirs = getattr(other, "saved_poses", None)
        if not isinstance(theirs, SavedPoses):
            raise ArgumentError(f"other must be a Session; got {shown(other)}")
        require_alike(self._poses.mesh, other.mesh)
        for name in names:
            theirs._require(name)
        states = {name: theirs[name] for name in names or theirs} or {"pose 1": other.state}
        mine, after = self._history.state, {}
        for name, state in states.items():
            posed = replace(mine.at_rest(), saved=())
            if state.pose is not None:
                x, y = other.mesh.vertices, theirs._poses.vertices(state)
                posed = replace(posed, pose=copied_pose(self._poses, posed, x, y))
            after[name] = posed
        return after

    def places(self, name: str, vertices: IntArray) -> FloatArray | None:
        """Return the places (k, 3) of some *vertices* (k,) in a saved pose, within milliseconds.

        None if they cannot be known so soon: it was saved with other cages, which are not bound.
        """
        self._require(name)
        saved, pose = self._own[name], self._own[name].pose
        if pose is None:
            return np.asarray(self._poses.mesh.vertices[vertices])
        if pose.finished is not None:
            return np.asarray(pose.finished.vertices[vertices])
        state = self._history.state
        if not (has_cages(state, saved) and self._poses.bindings.is_bound(state)):
            return None
        rows = self._poses.bindings.bind(state).subspace.at(vertices)
        return np.asarray(rows @ np.concatenate(pose.cage_vertices))

    def blend(
        self, first: str | None, second: str | None, share: float, *, max_steps: int | None = None
    ) -> None:
        """Let the mesh have a pose between two, as part of a drag, to be ended by ``commit``.

        Parameters
        ----------
        first, second : str, optional
            Names of saved poses; None is the rest pose.
        share : float
            From 0, the first pose, to 1, the second one.
        max_steps : int, optional
            As in `Session.drag`.

        Raises
        ------
        ConstraintError
            If there is no such pose, *share* is none, or there is no handle: the targets of
            handles are interpolated.
        """
        if not is_number(share, 0.0) or share > 1.0:
            raise ConstraintError(f"share must be from 0 to 1; got {shown(share)}")
        label, history = blend_label(first, second), self._history
        ends = self.applied(first), self.applied(second)
        if share in (0.0, 1.0):
            history.move(ends[int(share)])
            return
        if not history.state.handles:
            raise ConstraintError("poses are blended by their handles; add one first")
        is_going_on = history.drag is None and history.undo_label == label
        start = history.state if is_going_on else ends[round(share)]
        a, b = (targets_of(self._poses.mesh, end) for end in ends)
        targets = {name: between(a[name], b[name], share) for name in a}
        far = {name: float(np.abs(b[name] - a[name]).max()) for name in a}
        moving = sorted((name for name in a if far[name] > 0.0), key=lambda name: far[name])
        if moving and set(moving) <= set(start.pulls):
            state = ends[round(share)]
            for name in moving:  # the farthest last: the finish has room around it
                most = max_steps if name == moving[-1] else None
                state, solution = self._pulled(state, name, targets[name], most)
            assert state.pose is not None
            self._poses.keep_solution(state.pose, solution)
            history.move(state)
            return
        if any(end.fixed_at is not None for end in ends):
            at_rest = self._poses.mesh.vertices[start.fixed]
            c, d = (at_rest if end.fixed_at is None else end.fixed_at for end in ends)
            start = replace(start, fixed_at=frozen((1.0 - share) * c + share * d))
        pose, solution = solving.solve(self._poses, start, targets, max_steps, live=True)
        self._poses.keep_solution(pose, solution)
        history.move(replace(start, pose=pose, locality=None))

    def _pulled(
        self, state: State, name: str, places: FloatArray, max_steps: int | None
    ) -> tuple[State, Solution]:
        """Return *state* with the pulled point *name* at its *places* (k, 3), and the solution."""
        poses, mesh = self._poses, self._poses.mesh
        point = SurfacePoint.at_vertex(pulls.middle_vertex(mesh, state.handles[name]))
        grip = pulls.Grip(point, checked_radius(mesh, None), None, None, 0.0, turns=False)
        here = pulls.grasp(poses.bindings.bind(state), state, poses.vertices(state), grip).state
        assert here.pose is not None
        targets = {**here.pose.targets, name: places}
        pose, solution = solving.solve(poses, here, targets, max_steps, live=True)
        return replace(here, pose=pose), solution

    def _require(self, name: str) -> None:
        if not isinstance(name, str) or name not in self:
            names = ", ".join(map(repr, self))
            advice = f"the poses are {names}" if names else "save one first"
            raise ConstraintError(f"there is no pose {shown(name)}; {advice}")

    def _step(self, label: str, saved: Mapping[str, State]) -> None:
        self._history.step(label, replace(self._history.state, saved=tuple(saved.items())))


def blend_label(first: str | None, second: str | None) -> str:
    """Return the label of an undo step that blends two poses."""
    return f"blend {first or 'rest'} and {second or 'rest'}"


def in_pose(poses: Poses, state: State, saved: State) -> State:
    """Return *state* in the pose of *saved*, another state of the same mesh."""
    if saved.pose is None:
        return state.at_rest()
    x = poses.vertices(replace(saved, options=state.options))
    options = replace(state.options, volumes=saved.options.volumes)
    after = replace(state.at_rest(), options=options)
    if has_cages(state, saved):
        pose = saved.pose
    else:
        pose = solving.free_form(poses, after, solving.carried(poses, after, x))
        x = poses.vertices(replace(after, pose=pose))
    own, known = pose.targets, saved.handles
    targets = {
        name: own[name]
        if name in own and np.array_equal(known.get(name, ()), ids)
        else frozen(x[ids])
        for name, ids in state.handles.items()
    }
    fixed_at = saved.fixed_at
    if not np.array_equal(state.fixed, saved.fixed):
        fixed_at = frozen(x[state.fixed])
    pose = replace(pose, targets=MappingProxyType(targets))
    return replace(after, pose=pose, fixed_at=fixed_at)


def between(a: FloatArray, b: FloatArray, share: float) -> FloatArray:
    """Return the points (k, 3) at *share* of the way from *a* to *b*, turning if they turn."""
    R, _ = rigid_fit(a, b)
    from_, to = a.mean(axis=0), b.mean(axis=0)
    turned = Rotation.from_rotvec(share * Rotation.from_matrix(R).as_rotvec()).as_matrix()
    shape = (1.0 - share) * (a - from_) + share * (b - to) @ R
    return frozen((1.0 - share) * from_ + share * to + shape @ turned.T)


def has_cages(state: State, saved: State) -> bool:
    """Return whether *saved* has the regions and cages of *state*."""
    return state.cages == saved.cages and state.regions is saved.regions


def _checked(name: str) -> str:
    if fault := fault_of(name):
        raise ConstraintError(f"a pose{fault}")
    return name
