"""Edits of a session by subject: its handles and its regions, each edit one undo step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray
from ..deformer import checked_radius
from ..geometry import rigid_fit
from ..regions import Regions
from . import handles, naming, painting, pulls
from .poses import Poses
from .state import State
from .timeline import Timeline


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
            self._step(f"set {name}", replace(state, handles=after))
        return name

    def remove(self, *names: str) -> None:
        """Remove one or more handles, in one undo step."""
        after = self._state
        for name in names:
            after = handles.without_handle(after, name)
        if names:
            label = names[0] if len(names) == 1 else f"{len(names)} handles"
            self._step(f"remove {label}", after)

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
        at = handles.targets_of(self._poses.mesh, state)
        R, shift = rigid_fit(self._poses.mesh.vertices[ids], at[name])
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
        after = handles.with_pivot(self._poses.mesh, self._state, name, point)
        label = f"{'reset' if point is None else 'move'} the pivot of {name}"
        self._history.step(label, after)

    @property
    def _state(self) -> State:
        return self._history.state

    @property
    def _vertices(self) -> FloatArray:
        return self._poses.vertices(self._state, live=self._history.drag is not None)

    def _step(self, label: str, after: State) -> None:
        """Record a step to *after* with targets for its handles; the mesh does not move."""
        if after.pose is not None:
            after = handles.with_targets(self._state, after, self._vertices)
        self._history.step(label, after)


class Painting:
    """Edits of the regions of a session, which keep their names.

    The pose is reset, and the cages are kept if each still encloses its region.
    """

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses

    def paint(self, region: int, vertices: ArrayLike, *, subtract: bool = False) -> None:
        """Add vertices to a region, or with *subtract* remove them; see `painting.painted`.

        If *region* equals the number of regions, a new region is added.  If there are no regions
        yet, the first one is created and contains all vertices.
        """
        names, name = self._state.region_names, naming.region_name(self._state.region_names, region)
        after = painting.painted(self._regions, region, vertices, subtract=subtract, name=name)
        self._history.step(f"paint {name}", painting.with_regions(self._state, after, names))

    def merge(self, which: Sequence[int]) -> None:
        """Merge two or more regions into the first of them, which keeps the first name."""
        after = painting.merged(self._regions, which)
        names = naming.merged(self._state.region_names, [int(region) for region in which])
        self._history.step("merge regions", painting.with_regions(self._state, after, names))

    def split(
        self, region: int, vertices: ArrayLike | None = None, *, overlap: int | None = None
    ) -> None:
        """Split *vertices* off a region, by default half of it; see `painting.split`.

        The remaining part keeps the name.  The new region comes last; next to "arm" it is "arm 2".
        """
        regions, name = self._regions, naming.region_name(self._state.region_names, region)
        after = painting.split(regions, region, vertices, overlap=overlap, name=name)
        names = naming.split(self._state.region_names, int(region), regions.n_regions)
        self._history.step(f"split {name}", painting.with_regions(self._state, after, names))

    def rename(self, region: int, name: str) -> None:
        """Rename a region; "" removes its name.

        Painting, merging and splitting keep names; `segment` and `set_regions` remove them.

        Raises
        ------
        RegionError
            If there is no such region, *name* is the name of another region, or it is not printable
            text of at most 80 characters.
        """
        label, after = painting.renamed(self._state, region, name)
        self._history.step(label, after)

    @property
    def _state(self) -> State:
        return self._history.state

    @property
    def _regions(self) -> Regions:
        return self._state.regions or Regions.single(self._poses.mesh)
