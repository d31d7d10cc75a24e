"""Edits of the handles of a session, each one undo step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, frozen
from ..deformer import checked_point, checked_radius
from ..geometry import rigid_fit
from . import handles, pulls
from .poses import Poses
from .separating import separated
from .state import State
from .timeline import Timeline

_T = TypeVar("_T")


class Handles(Mapping[str, IntArray]):
    """The handles of a session by name, (k,) int each: its vertices; and edits of them.

    Edits do not move the mesh, and another access to `Session.handles` returns their result.
    """

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses
        self._own = history.state.handles

    def __getitem__(self, name: str) -> IntArray:
        return self._own[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)

    def __repr__(self) -> str:
        return f"{{{', '.join(f'{name!r}: {len(ids)} vertices' for name, ids in self.items())}}}"

    def add(self, vertices: ArrayLike, name: str | None = None) -> str:
        """Make *vertices*, ids or a mask, a handle; a handle of the same *name* is replaced.

        Returns
        -------
        name : str
            By default "handle 1", "handle 2", ...

        Raises
        ------
        ConstraintError
            If *name* is invalid, or *vertices* are not vertices of the mesh, fixed, or in another
            handle.
        """
        state = self._state
        name = handles.new_name(state.handles) if name is None else name
        after = handles.with_handle(self._poses.mesh, state, name, vertices)
        known = state.handles.get(name)
        if known is None or not np.array_equal(after[name], known):
            self._step(f"set {name}", separated(self._poses, replace(state, handles=after)))
        return name

    def remove(self, *names: str) -> None:
        """Remove one or more handles, in one undo step."""
        state = self._state
        for name in names:
            handles.require_handle(state.handles, name)
            state = replace(
                state, handles=_without(state.handles, name), pivots=_without(state.pivots, name)
            )
        if names:
            label = names[0] if len(names) == 1 else f"{len(names)} handles"
            self._step(f"remove {label}", state)

    def rename(self, name: str, new_name: str) -> None:
        """Rename a handle."""
        after = handles.renamed(self._state, name, new_name)
        if name != new_name:
            self._history.step(f"rename {name}", after)

    def pin(self, vertex: int) -> str:
        """Pin a vertex where it is now, and return the name of the pin, a handle.

        Raises
        ------
        ConstraintError
            If there is no such vertex, or it is fixed or in a handle already.
        """
        name, after = pulls.pinned(self._poses.mesh, self._state, vertex)
        self._step("pin", replace(self._state, handles=after))
        return name

    def to_patch(self, name: str, *, radius: float | None = None) -> str:
        """Make a pin or pulled point a handle of the surface around it, and return its new name.

        Unlike a single vertex, the handle can rotate.

        Parameters
        ----------
        name : str
            The pin or pulled point.
        radius : float, optional
            As in `Session.pull`; the handle has the surface within half of it.
        """
        mesh, state = self._poses.mesh, self._state
        handles.require_handle(state.handles, name)
        new, after = pulls.as_handle(mesh, state, name, checked_radius(mesh, radius))
        self._step(f"convert {name} to {new}", after)
        return new

    def to_pin(self, name: str) -> str:
        """Make a handle a pin at its middle vertex, and return its new name."""
        handles.require_handle(self._state.handles, name)
        new, after = pulls.as_pin(self._poses.mesh, self._state, name)
        self._step(f"convert {name} to {new}", after)
        return new

    def pivot(self, name: str) -> FloatArray:
        """Return the point (3,) about which a handle rotates: by default its centre."""
        state = self._state
        handles.require_handle(state.handles, name)
        ids, at_rest = state.handles[name], state.pivots.get(name)
        if at_rest is None:
            return np.asarray(self._vertices[ids].mean(axis=0))
        R, shift = self._motion(name)
        return np.asarray(R @ at_rest + shift)

    def set_pivot(self, name: str, point: ArrayLike | None) -> None:
        """Move the pivot of a handle to *point* (3,), from where it moves with the handle.

        None resets it to the centre of the handle.

        Raises
        ------
        ConstraintError
            If there is no such handle, or *point* is not a point or too far away.
        """
        if point is None and name in self._state.handles and name not in self._state.pivots:
            return
        handles.require_handle(self._state.handles, name)
        pivots = dict(self._state.pivots)
        if point is None:
            del pivots[name]
        else:
            place = checked_point(point, "point")
            handles.require_near(self._poses.mesh, place, "coordinates of point")
            R, shift = self._motion(name)
            pivots[name] = frozen((place - shift) @ R)
        label = f"{'reset' if point is None else 'move'} the pivot of {name}"
        self._history.step(label, replace(self._state, pivots=MappingProxyType(pivots)))

    def _motion(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return the rotation (3, 3) and the shift (3,) of a handle's targets since rest."""
        mesh, state = self._poses.mesh, self._state
        return rigid_fit(mesh.vertices[state.handles[name]], handles.targets_of(mesh, state)[name])

    @property
    def _state(self) -> State:
        return self._history.state

    @property
    def _vertices(self) -> FloatArray:
        return self._poses.vertices(self._state, live=self._history.drag is not None)

    def _step(self, label: str, after: State) -> None:
        """Record a step to *after*; the mesh does not move.

        Handles that were there keep their targets; those of others are where they are now.
        """
        if after.pose is not None:
            own, kept = self._state.handles, after.pose.targets
            here = handles.targets_at(after.handles, self._vertices)
            targets = {
                name: kept[name] if own.get(name) is ids else here[name]
                for name, ids in after.handles.items()
            }
            pose = replace(after.pose, targets=MappingProxyType(targets))
            after = replace(after, pose=pose)
        self._history.step(label, after)


def _without(mapping: Mapping[str, _T], name: str) -> Mapping[str, _T]:
    if name not in mapping:
        return mapping
    return MappingProxyType({other: each for other, each in mapping.items() if other != name})
