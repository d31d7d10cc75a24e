"""One mesh being deformed: its regions, cages, handles and pose, every step undoable.

The only object with state.  Everything that shows or edits a deformation asks a `Session`, and
hears from `on_change` what to draw again.

    segment, paint_region ...  ->  fit_cages  ->  set_fixed, add_handle  ->  drag ... commit

Each is one step of `history`, undone by `undo`; only moves of a drag wait for `commit`.

- Other regions or cages put the pose to rest.  Cages stay while each encloses its region; else
  all are dropped.
- Other fixed vertices, handles or options keep the pose; the next move starts from it.

A session belongs to one thread, but for `fitted_cages` and `bind`, which change nothing that can
be seen: another thread may run them, while nothing else is asked of the session.

Long because it is one class, and the one that every widget speaks to; how things are done is told
in other files.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_points, frozen, is_whole, plain
from ..cages import Cage, fit_cages
from ..checks import require, shown
from ..deformer import checked_constraints
from ..errors import CageError, RegionError, SessionError
from ..mesh import Mesh, require_mesh
from ..progress import Progress
from ..regions import Regions, segment
from ..solver import Solution, Status
from . import handles, naming, painting
from .history import Timeline
from .listeners import Change
from .posing import Posing
from .state import Options, Pose, State, checked_state, fitting_cages, of_mesh


class Effort(NamedTuple):
    """What solving has taken so far; the difference of two is what something took."""

    steps: int
    """Of the solver."""
    seconds: float
    """On the clock, binding included where it was not done before."""


class Session(Timeline):
    """A deformation in the making.

    Parameters
    ----------
    mesh : Mesh
        n vertices; never changed or copied.
    state : State, optional
        Where to begin, another session's `state` of the same mesh; by default with nothing.
    history : int
        Steps that can be undone; older ones are forgotten.

    Notes
    -----
    A copy, by `copy` or `pickle`, has the mesh, the state, an ongoing drag and the history.  It has
    no listeners, and its next solve starts as after `start_afresh`.

    Raises
    ------
    RegionError, CageError, ConstraintError
        If *state* does not fit *mesh* or itself.

    Examples
    --------
    >>> import numpy as np
    >>> from vtk_segdeform import models
    >>> session = Session(models.sphere(300))
    >>> session.what_next
    'make regions: segment the mesh, or paint them'
    >>> session.set_regions(Regions.single(session.mesh))
    >>> session.change_options(n_cage_vertices=30)
    >>> session.fit_cages()
    >>> session.set_fixed(session.mesh.vertices[:, 2] < -0.8)
    >>> session.add_handle(session.mesh.vertices[:, 2] > 0.8)
    'handle 1'
    >>> up = np.eye(4)
    >>> up[2, 3] = 0.3
    >>> solution = session.move_handle("handle 1", up)
    >>> session.commit(), abs(session.volume_change) < 1e-12
    ('drag handle 1', True)
    >>> session.undo(), bool((session.vertices == session.mesh.vertices).all())
    ('drag handle 1', True)
    """

    def __init__(self, mesh: Mesh, *, state: State | None = None, history: int = 100) -> None:
        require_mesh(mesh)
        super().__init__(State() if state is None else checked_state(mesh, state), history)
        self._mesh = mesh
        self._posing = Posing(mesh)
        self._solution: tuple[Pose, Solution] | None = None
        self._effort = Effort(0, 0.0)
        self._fitted: tuple[Regions | None, Sequence[Cage] | None] = None, None  # and fit, for sure
        self._put: tuple[Pose | None, list[FloatArray]] = None, []  # where `move_cage` put cages

    # Copies, by `copy` or `pickle`, contain the mesh, the state, an ongoing drag and the history.
    # They bind again when needed, solve as after `start_afresh`, and have no listeners.

    def __getstate__(self) -> dict[str, Any]:
        return {
            "_mesh": self._mesh,
            "_state": self._state,
            "_before": self._before,
            "_dragged": dict(self._dragged),
            "_history": self._history.copy(),
            "_effort": self._effort,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        Session.__init__(self, state["_mesh"])
        vars(self).update(state)

    # What there is.

    @property
    def mesh(self) -> Mesh:
        """The mesh at rest."""
        return self._mesh

    @property
    def regions(self) -> Regions | None:
        """The regions, or None before there are any."""
        return self._state.regions

    @property
    def region_names(self) -> tuple[str, ...]:
        """What the regions are called; by its place, "region 1", ..., one without a name."""
        count = 0 if self.regions is None else self.regions.n_regions
        return tuple(self.region_name(region) for region in range(count))

    @property
    def cages(self) -> tuple[Cage, ...]:
        """One cage for each region, at rest; or none."""
        return self._state.cages

    @property
    def fixed(self) -> IntArray:
        """(f,) int: vertices held where they are at rest."""
        return self._state.fixed

    @property
    def handles(self) -> Mapping[str, IntArray]:
        """By name, (k,) int: the vertices of each handle."""
        return self._state.handles

    @property
    def options(self) -> Options:
        """How cages are fitted and poses solved for."""
        return self._state.options

    @property
    def targets(self) -> Mapping[str, FloatArray]:
        """By name, (k, 3) float: where the vertices of each handle are to be."""
        pose = self._state.pose
        return self._rest_targets() if pose is None else pose.targets

    @property
    def cage_vertices(self) -> tuple[FloatArray, ...]:
        """One (m_r, 3) float for each cage: where its vertices are in this pose."""
        pose = self._state.pose
        return tuple(cage.vertices for cage in self.cages) if pose is None else pose.cage_vertices

    @property
    def vertices(self) -> FloatArray:
        """(n, 3) float: the mesh in this pose; read-only, the same array until the next change.

        May have to bind the cages first, as `bind` does.
        """
        pose = self._state.pose
        return self.mesh.vertices if pose is None else self._posing.vertices(self._state, pose)

    @property
    def volume_change(self) -> float:
        """(V - V0) / V0 of `vertices`, signed."""
        pose = self._state.pose
        return 0.0 if pose is None else self._posing.volume_change(self._state, pose)

    @property
    def solution(self) -> Solution | None:
        """How the solver came to this very pose; None at rest, after loading, in older poses."""
        if self._solution is None or self._solution[0] is not self._state.pose:
            return None
        return self._solution[1]

    @property
    def effort(self) -> Effort:
        """What `drag`, `move_handle` and `refine` have taken since the session was made."""
        return self._effort

    @property
    def is_ready(self) -> bool:
        """Whether there is a handle to drag, and cages to drag it with."""
        return bool(self.cages) and bool(self.handles)

    @property
    def is_bound(self) -> bool:
        """Whether `bind` is done, so that the first move of a drag is no slower than the rest."""
        return self._posing.is_bound(self._state)

    @property
    def what_next(self) -> str:
        """What to do next, in a sentence for a status line."""
        if self.regions is None:
            return "make regions: segment the mesh, or paint them"
        if not self.cages:
            return "fit cages to the regions"
        if not self.handles:
            return "mark a handle: some vertices to drag"
        if not len(self.fixed):
            return "drag a handle, or mark what is to stay fixed"
        if self.solution is None or self.solution.status is Status.CONVERGED:
            return "drag a handle"
        if self.solution.status is Status.STEP_LIMIT:
            return "drag on, or refine the pose"
        return str(self.solution.status)

    # Regions.

    def segment(
        self,
        n_regions: int | None = None,
        *,
        overlap: int | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> None:
        """Make regions automatically, as `segmentation.segment` does."""
        regions = segment(self.mesh, n_regions, overlap=overlap, seed=seed, progress=progress)
        self._set_regions(regions, "segment")

    def set_regions(self, regions: Regions, *, label: str = "set regions") -> None:
        """Take *regions* of this mesh; *label* is what `undo_label` calls it."""
        regions = of_mesh(self.mesh, regions)
        self._set_regions(regions, require(label, str, "label"))

    def paint_region(self, region: int, vertices: ArrayLike, *, subtract: bool = False) -> None:
        """Add vertices, ids or a mask, to a region, or take them out; see `painting.painted`.

        The number after the last region's is a new region.  Where there are no regions yet, one
        that holds everything is the first.
        """
        regions, name = self._some_regions(), self.region_name(region)
        after = painting.painted(regions, region, vertices, subtract=subtract, name=name)
        self._set_regions(after, f"paint {name}", self._state.region_names)

    def merge_regions(self, which: Sequence[int]) -> None:
        """Make two regions or more one, in the place of the first; it keeps their first name."""
        regions = painting.merged(self._some_regions(), which)
        names = naming.merged(self._state.region_names, [int(region) for region in which])
        self._set_regions(regions, "merge regions", names)

    def split_region(
        self, region: int, vertices: ArrayLike | None = None, *, overlap: int | None = None
    ) -> None:
        """Cut a region in two, *vertices* of it, or its far half, apart; see `painting.split`.

        The part that stays keeps the name, the other one, "arm 2" beside "arm", comes last.
        """
        regions, name = self._some_regions(), self.region_name(region)
        after = painting.split(regions, region, vertices, overlap=overlap, name=name)
        names = naming.split(self._state.region_names, int(region), regions.n_regions)
        self._set_regions(after, f"split {name}", names)

    def region_name(self, region: int) -> str:
        """Return what a region is called, or is going to be: number 0 is "region 1" at first."""
        if not is_whole(region, 0):
            raise RegionError(f"region must be a whole number, 0 or more; got {shown(region)}")
        return naming.called(self._state.region_names, int(region))

    def rename_region(self, region: int, name: str) -> None:
        """Call a region something else; "" calls it by its place again.

        Names go with their regions through painting, merging and splitting; other regions, set
        or found, have none.

        Raises
        ------
        RegionError
            If there is no such region, or *name* is another one's or no printable text of at most
            80 letters.
        """
        count = 0 if self.regions is None else self.regions.n_regions
        if not is_whole(region, 0, count - 1):
            raise RegionError(
                f"there is no region {shown(region)} to name; there are {count}, from 0"
            )
        names = naming.renamed(self._state.region_names, int(region), name)
        label = f"rename {self.region_name(region)}"
        self._step(label, replace(self._state, region_names=names))

    # Cages.

    def set_cages(self, cages: Sequence[Cage], *, label: str = "set cages") -> None:
        """Take *cages*, one around each region; CageError if they do not fit."""
        require(label, str, "label")
        regions, fitted = self._fitted
        if cages is not fitted or self.regions is not regions:  # else they do
            cages = fitting_cages(self.regions, cages, self._state.region_names)
        self._set_cages(tuple(cages), label)

    def fitted_cages(self, progress: Progress | None = None) -> tuple[Cage, ...]:
        """Return cages for the regions, by the options, and change nothing.

        For another thread: `set_cages` takes them, in the session's own.
        """
        if self.regions is None:
            raise RegionError("there are no regions to fit cages to; segment or paint them first")
        number, offset = self.options.n_cage_vertices, self.options.offset
        regions = self.regions
        cages = fit_cages(self.mesh, regions, number, offset=offset, progress=progress)
        self._fitted = regions, cages
        return cages

    def fit_cages(self, progress: Progress | None = None) -> None:
        """Take cages as `fitted_cages` makes them; cancelled, everything is as it was."""
        self._set_cages(self.fitted_cages(progress), "fit cages")

    def bind(self, progress: Progress | None = None) -> None:
        """Do ahead of time what the first move would have to wait for; see `is_bound`."""
        self._posing.prepare(self._state, progress)

    # Fixed vertices and handles.

    def set_fixed(self, vertices: ArrayLike) -> None:
        """Hold *vertices*, ids or a mask, where they are at rest."""
        fixed, _ = checked_constraints(self.mesh, vertices, self._state.handle)
        if not np.array_equal(fixed, self.fixed):
            own = fixed.copy()
            frozen(own)
            self._step("set fixed", replace(self._state, fixed=own))

    def add_handle(self, vertices: ArrayLike, name: str | None = None) -> str:
        """Make *vertices*, ids or a mask, a handle, instead of what had the *name* before.

        Returns
        -------
        name : str
            "handle 1", "handle 2", ... if none is given.
        """
        name = handles.new_name(self.handles) if name is None else name
        after = handles.with_handle(self.mesh, self._state, name, vertices)
        if name not in self.handles or not np.array_equal(after[name], self.handles[name]):
            self._set_handles(after, f"mark {name}")
        return name

    def remove_handle(self, name: str) -> None:
        """Let go of a handle; the pose stays as it is."""
        self._set_handles(handles.without_handle(self.handles, name), f"remove {name}")

    def rename_handle(self, name: str, new_name: str) -> None:
        """Call a handle something else."""
        after = handles.renamed(self._state, name, new_name)
        if name != new_name:
            self._step(f"rename {name}", after)

    # The pose.

    def drag(
        self, targets: Mapping[str, ArrayLike] | ArrayLike, *, max_steps: int | None = None
    ) -> Solution:
        """Move handles to *targets*, as part of the drag in hand or as its beginning.

        Parameters
        ----------
        targets : mapping of str to (k, 3) float, or (k, 3) float
            By the name of the handle, those not named keep theirs; or for the vertices of all
            handles, one handle after the other.
        max_steps : int, optional
            Stop after as many steps of the solver; the next move, or `refine`, goes on.

        Returns
        -------
        solution : Solution
            Of the pose, also as `solution`.

        Raises
        ------
        ConstraintError, CageError
            If there is no such handle, *targets* are not points or too far away, or there are no
            cages.  The pose is then as it was.
        """
        wanted = handles.checked_targets(self.mesh, self.handles, targets)
        pose, solution = self._solve({**self.targets, **wanted}, max_steps)
        self._solution = pose, solution
        self._move(replace(self._state, pose=pose), *wanted)
        return solution

    def move_handle(
        self, name: str, motion: ArrayLike, *, max_steps: int | None = None
    ) -> Solution:
        """Move one handle, by a matrix or to targets; otherwise as `drag`.

        Parameters
        ----------
        name : str
            Which handle.
        motion : (4, 4) or (k, 3) float
            An affine map, from the targets that the handle had when the drag began, so that a
            mouse that goes back takes it back; or a target for each of its vertices.
        max_steps : int, optional
            As in `drag`.
        """
        handles.require_handle(self.handles, name)
        matrix = plain(motion, "motion")
        if matrix.shape != (4, 4):
            return self.drag({name: matrix}, max_steps=max_steps)
        pose = (self._before or self._state).pose
        start = self._rest_targets() if pose is None else pose.targets
        return self.drag({name: handles.moved(start[name], matrix)}, max_steps=max_steps)

    def move_cage(self, region: int, vertices: ArrayLike) -> None:
        """Put the vertices of one cage elsewhere, (m_r, 3); the mesh follows, x = W~ p.

        Part of the drag in hand, as `drag` is, but free: nothing is solved for, handles follow.
        The volume is kept if the options say so, for which all cages move a little more: by what
        it takes from where they were put, so that a mouse that goes back takes that back as well.
        """
        if not is_whole(region, 0, len(self.cages) - 1):
            raise CageError(
                f"region must be that of one of the {len(self.cages)} cages; got {shown(region)}"
            )
        region = int(region)
        going_on = self.is_dragging and self._put[0] is self._state.pose
        places = list(self._put[1] if going_on else self.cage_vertices)
        try:
            points = as_points(vertices, "vertices").copy()
        except ValueError as fault:
            raise CageError(str(fault)) from None
        if points.shape != places[region].shape:
            raise CageError(f"vertices must be {len(places[region])} points; got {len(points)}")
        handles.require_near(self.mesh, points, "vertices")
        places[region] = points
        pose = self._posing.free_form(self._state, places)
        self._put = pose, places
        self._move(replace(self._state, pose=pose), f"the cage of {self.region_name(region)}")

    def carry(self, points: ArrayLike) -> FloatArray:
        """Return where other points (k, 3), given at rest, are in the present pose."""
        return self._posing.bind(self._state).passengers(points).moved(self.cage_vertices)

    def refine(self, *, max_steps: int | None = None) -> Solution:
        """Go on solving for the present targets, as when a drag was stopped early.

        No step of its own: it belongs to the drag in hand, or else to the last step.
        """
        pose, solution = self._solve(self.targets, max_steps)
        if solution.steps == 0:  # there already: the pose stays the very same
            here = self._state.pose
            self._solution = None if here is None else (here, solution)
            return solution
        self._solution = pose, solution
        self._go(replace(self._state, pose=pose), Change(0))
        return solution

    def start_afresh(self) -> None:
        """Let the next solve do what it would in a session just loaded, to the last bit.

        The solver else remembers a little of how it got to the present pose.
        """
        self._posing.forget()

    def reset_pose(self) -> None:
        """Go back to rest; what is dragged is let go."""
        self._step("reset pose", replace(self._state, pose=None))

    def change_options(self, **changes: float | bool | None) -> None:
        """Change some of the `Options`, by name; `refine` then brings the pose up to them."""
        unknown = sorted(changes.keys() - vars(self.options).keys())
        if unknown:
            known = ", ".join(vars(self.options))
            raise SessionError(f"there is no option {', '.join(unknown)}; there are {known}")
        options = replace(self.options, **changes)  # type: ignore[arg-type]  # it checks them
        self._step("change options", replace(self._state, options=options))

    def _solve(
        self, targets: Mapping[str, FloatArray], max_steps: int | None
    ) -> tuple[Pose, Solution]:
        began = time.perf_counter()
        pose, solution = self._posing.solve(self._state, MappingProxyType({**targets}), max_steps)
        steps, seconds = self._effort
        self._effort = Effort(steps + solution.steps, seconds + time.perf_counter() - began)
        return pose, solution

    def _rest_targets(self) -> Mapping[str, FloatArray]:
        return handles.targets_at(self.handles, self.mesh.vertices)

    def _some_regions(self) -> Regions:
        return self.regions or Regions.single(self.mesh)

    def _set_regions(self, regions: Regions, label: str, names: naming.Names = ()) -> None:
        old = self.regions
        cages: tuple[Cage, ...] = ()
        if old is not None:
            same = np.array_equal(old.membership, regions.membership)
            if same and old.smoothness == regions.smoothness:
                return
            cages = self.cages if _still_fit(old, regions, self.cages) else ()
        after = replace(self._state, regions=regions, cages=cages, pose=None, region_names=names)
        self._step(label, after)

    def _set_cages(self, cages: tuple[Cage, ...], label: str) -> None:
        self._step(label, replace(self._state, cages=cages, pose=None))

    def _set_handles(self, after: Mapping[str, IntArray], label: str) -> None:
        pose = self._state.pose
        if pose is not None:
            pose = handles.carried(pose, self.handles, after, self.vertices)
        self._step(label, replace(self._state, handles=after, pose=pose))


def _still_fit(old: Regions, new: Regions, cages: Sequence[Cage]) -> bool:
    """Tell whether *cages*, which enclose *old* regions, enclose *new* ones as well."""
    if new.n_regions != old.n_regions:
        return False
    added = new.membership & ~old.membership
    vertices = new.mesh.vertices
    return all(
        bool(cage.contains(vertices[more]).all())
        for cage, more in zip(cages, added, strict=False)
        if more.any()
    )
