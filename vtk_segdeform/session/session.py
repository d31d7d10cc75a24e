"""The session: one mesh with its regions, cages, handles and pose; all edits undoable.

The session is the only object with state.  Widgets and scripts read and edit a `Session`, and
`on_change` notifies them of what to redraw.

    segment, paint_region ...  ->  fit_cages  ->  set_fixed, add_handle  ->  drag ... commit

Each of these calls is one undo step, except that all moves of a drag are one step, ended by
`commit`.

- New regions or cages reset the pose, unless `carried` tells where the cages are.  New regions keep
  the cages if each cage still encloses its region; otherwise all cages are removed.
- New fixed vertices, handles or options keep the pose; the next move starts from it.

A session belongs to one thread.  Only `fitted_cages`, `carried` and `bind` may run in another
thread, while the session is not used in any other way; they do not change its visible state.

Long because it is the interface of one class; the implementation is in the other files.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, frozen, is_whole, plain
from ..cages import Cage, fit_cages, require_cage_vertices, suggested_size
from ..checks import require, require_sequence, shown
from ..deformer import (
    Deformer,
    checked_constraints,
    checked_locality,
    checked_place,
    checked_point,
    checked_radius,
    fault_of_grab,
)
from ..errors import CageError, RegionError, SessionError
from ..geometry import Lids, local_volume_change, rigid_fit
from ..importing import imported
from ..mesh import Mesh, SurfacePoint, require_mesh
from ..progress import Progress, part
from ..regions import Regions, segment
from ..solver import Solution, Status
from . import handles, naming, painting, pulling
from .finishing import Finish, FinishedPose
from .history import Timeline
from .listeners import Change
from .pose_solver import PoseSolver
from .state import Options, Pose, State, checked_state, fitting_cages, label_of_change, of_mesh

if TYPE_CHECKING:
    import pyvista as pv

    from ..io import Surface

_ROUNDING = 1e-9  # diagonals: distance of cage vertices that are in the same place
# Of the progress of a preparation, when it has regions and when it has cages.  Of the time it is a
# quarter and a half for 5,000 vertices, and a tenth and a fifth for 300,000.
_SEGMENTED, _FITTED = 0.15, 0.3


class Effort(NamedTuple):
    """Total effort of solving so far; subtract two values for the effort in between."""

    steps: int
    """Solver steps."""
    seconds: float
    """Elapsed time, including binding where it was not done ahead."""


class Preparation(NamedTuple):
    """What a session needs before its surface can be pulled; made by `Session.preparation`."""

    regions: Regions
    cages: tuple[Cage, ...]
    deformer: Deformer
    """Bound to them."""


class Session(Timeline):
    """An editable deformation of one mesh.

    Parameters
    ----------
    mesh : Mesh or Surface
        n vertices; neither changed nor copied.
    state : State, optional
        Initial state: the `state` of another session of the same mesh.  By default there are no
        regions, cages, handles or fixed vertices.
    history : int
        Maximum number of undo steps.

    Notes
    -----
    A copy, by `copy` or `pickle`, has the mesh, the state, an ongoing drag and the history.  It has
    no listeners, and its next solve starts as after `start_afresh`.

    Raises
    ------
    RegionError, CageError, ConstraintError
        If *state* does not fit *mesh* or is inconsistent.

    Examples
    --------
    >>> import numpy as np
    >>> from vtk_segdeform import models
    >>> session = Session(models.sphere(300))
    >>> session.what_next
    'create regions: segment the mesh or paint them'
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

    def __init__(
        self, mesh: Mesh | Surface, *, state: State | None = None, history: int = 100
    ) -> None:
        self._surface = None if isinstance(mesh, Mesh) else _surface(mesh)
        mesh = mesh if isinstance(mesh, Mesh) else mesh.mesh
        super().__init__(State() if state is None else checked_state(mesh, state), history)
        self._mesh = mesh
        self._pose_solver = PoseSolver(mesh)
        self._solution: tuple[Pose, Solution] | None = None
        self._effort = Effort(0, 0.0)
        # The result of `fitted_cages`, which `set_cages` need not check.
        self._fitted: tuple[Regions | None, Sequence[Cage] | None] = None, None
        # The state before the ongoing pull, and what it has grabbed.
        self._grasp: tuple[State, pulling.Grasp] | None = None
        # A state after a pull, and the same for other drags.
        self._let_go: tuple[State | None, State] = None, State()
        # The last pose of `move_cage`, and the cage vertices before the volume correction.
        self._placed: tuple[Pose | None, list[FloatArray]] = None, []

    # Copying and pickling.

    def __getstate__(self) -> dict[str, Any]:
        return {
            "_mesh": self._mesh,
            "_surface": self._surface,
            "_state": self._state,
            "_drag_start": self._drag_start,
            "_dragged": dict(self._dragged),
            "_history": self._history.copy(),
            "_effort": self._effort,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        Session.__init__(self, state["_mesh"])
        vars(self).update(state)

    # State.

    @property
    def mesh(self) -> Mesh:
        """The mesh at rest."""
        return self._mesh

    @property
    def surface(self) -> Surface | None:
        """The surface of which the session deforms the mesh, if it was made from one."""
        return self._surface

    @property
    def deformed(self) -> pv.PolyData:
        """The surface in the current pose, as it was given apart from coordinates and normals.

        Without a surface, the triangles of the mesh.
        """
        if self._surface is not None:
            return self._surface.moved(self.vertices)
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import to_polydata

        return to_polydata(self.mesh.with_vertices(self.vertices))

    def write_deformed(self, path: str | Path) -> None:
        """Write `deformed` to a mesh file, as `write_mesh` does."""
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import write_mesh

        if self._surface is not None:
            self._surface.write(path, self.vertices)
        else:
            write_mesh(path, self.mesh.with_vertices(self.vertices))

    @property
    def regions(self) -> Regions | None:
        """The regions, or None if there are none yet."""
        return self._state.regions

    @property
    def region_names(self) -> tuple[str, ...]:
        """The names of the regions; unnamed ones are "region 1", "region 2", ... by number."""
        count = 0 if self.regions is None else self.regions.n_regions
        return tuple(self.region_name(region) for region in range(count))

    @property
    def cages(self) -> tuple[Cage, ...]:
        """One cage for each region, at rest; empty if there are no cages yet."""
        return self._state.cages

    @property
    def fixed(self) -> IntArray:
        """(f,) int: vertices that stay where they were when they were fixed."""
        return self._state.fixed

    @property
    def handles(self) -> Mapping[str, IntArray]:
        """For each handle by name, (k,) int: its vertices."""
        return self._state.handles

    @property
    def options(self) -> Options:
        """Options for fitting cages and solving."""
        return self._state.options

    @property
    def targets(self) -> Mapping[str, FloatArray]:
        """For each handle by name, (k, 3) float: the targets of its vertices."""
        pose = self._state.pose
        return self._rest_targets() if pose is None else pose.targets

    @property
    def cage_vertices(self) -> tuple[FloatArray, ...]:
        """One (m_r, 3) float for each cage: its vertices in the current pose."""
        pose = self._state.pose
        return tuple(cage.vertices for cage in self.cages) if pose is None else pose.cage_vertices

    @property
    def vertices(self) -> FloatArray:
        """(n, 3) float: the mesh in the current pose; read-only, one array until the next change.

        If necessary, the cages are bound first, as by `bind`.
        """
        return self._vertices_of(self._state)

    def vertices_at(self, position: int) -> FloatArray | None:
        """Return the vertices (n, 3) of a state of `history`, without changing the session.

        None if its cages are no longer bound, so that it could take seconds; `jump` binds them.
        """
        state = self.state_at(position)
        pose = state.pose
        return self.mesh.vertices if pose is None else self._pose_solver.peek(state, pose)

    def _vertices_of(self, state: State) -> FloatArray:
        pose = state.pose
        return self.mesh.vertices if pose is None else self._pose_solver.vertices(state, pose)

    @property
    def volume_change(self) -> float:
        """Relative volume change (V - V0) / V0 of `vertices`, signed; 0 without a volume."""
        pose = self._state.pose
        return 0.0 if pose is None else self._pose_solver.volume_change(self._state, pose)

    @property
    def volume_summary(self) -> str:
        """Whether the mesh has a volume that is preserved, in one line; see `volume_summary`."""
        options = self._state.options
        preserved = options.preserve_volume or options.preserve_region_volumes
        return self.lids.summary(preserved=preserved)

    @property
    def has_volume(self) -> bool:
        """Whether the mesh encloses a volume, with its lids if it is open."""
        return self.lids.has_volume

    @property
    def lids(self) -> Lids:
        """The lids over the borders of the mesh, with ``options.lids``."""
        return self._pose_solver.lids(self._state)

    @property
    def solution(self) -> Solution | None:
        """The solver's result for the current pose; None at rest, after loading or undo."""
        if self._solution is None or self._solution[0] is not self._state.pose:
            return None
        return self._solution[1]

    @property
    def effort(self) -> Effort:
        """Total effort of `drag`, `move_handle` and `refine` in this session."""
        return self._effort

    @property
    def is_ready(self) -> bool:
        """Whether there are cages and at least one handle, so that `drag` is possible."""
        return bool(self.cages) and bool(self.handles)

    @property
    def is_bound(self) -> bool:
        """Whether the cages are bound, so that the first move of a drag need not wait."""
        return self._pose_solver.is_bound(self._state)

    @property
    def what_next(self) -> str:
        """The next thing to do, as text for a status bar."""
        if self.regions is None:
            return "create regions: segment the mesh or paint them"
        if not self.cages:
            return "fit cages to the regions"
        if not self.handles:
            return "add a handle: a set of vertices to drag"
        if not len(self.fixed):
            return "drag a handle, or set fixed vertices"
        if self.solution is None or self.solution.status is Status.CONVERGED:
            return "drag a handle"
        if self.solution.status is Status.STEP_LIMIT:
            if self.is_unsettled:
                return "not fully converged: keep dragging, or refine the pose"
            return "drag a handle" + (", or finish the pose again" * self.can_finish_further)
        return str(self.solution.status)

    def layers(self) -> dict[str, pv.PolyData]:
        """Return the surface and its cages as PolyData, in the current pose.

        "mesh" is `deformed` with vertices of handles selected, as the array "selection", and the
        region of each vertex as "quality", unless it has a quality.  "local volume change" is the
        same surface with that as its quality, if there is a pose.  "cage 1", "cage 2" ... follow.
        """
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import polydata_of

        mesh = self.deformed.copy(deep=False)
        layers = {"mesh": mesh}
        if self.handles:
            selection = np.zeros(self.mesh.n_vertices, dtype=np.uint8)
            selection[np.concatenate(list(self.handles.values()))] = 1
            mesh.point_data["selection"] = self._at_points(selection)
        if self.regions is not None and "quality" not in mesh.point_data:
            mesh.point_data["quality"] = self._at_points(self.regions.labels.astype(np.float64))
        if self.state.pose is not None:
            change = local_volume_change(self.mesh, self.vertices)
            layers["local volume change"] = self.deformed.copy(deep=False)
            layers["local volume change"].clear_data()
            layers["local volume change"].point_data["quality"] = self._at_points(change)
        for k, (cage, vertices) in enumerate(zip(self.cages, self.cage_vertices, strict=True), 1):
            counts = np.full(cage.n_faces, 3)
            layers[f"cage {k}"] = polydata_of(vertices, counts, cage.faces.ravel())
        return layers

    def _at_points(self, values: Any) -> Any:
        """Return values of vertices at the points of `deformed`."""
        return values if self._surface is None else self._surface.at_points(values)

    # Regions.

    def segment(
        self,
        n_regions: int | None = None,
        *,
        overlap: int | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> None:
        """Segment the mesh automatically; see `vtk_segdeform.segment`."""
        regions = segment(self.mesh, n_regions, overlap=overlap, seed=seed, progress=progress)
        self._set_regions(regions, "segment")

    def set_regions(self, regions: Regions, *, label: str = "set regions") -> None:
        """Set the regions; *label* names the undo step."""
        regions = of_mesh(self.mesh, regions)
        self._set_regions(regions, require(label, str, "label"))

    def paint_region(self, region: int, vertices: ArrayLike, *, subtract: bool = False) -> None:
        """Add vertices to a region, or with *subtract* remove them; see `painting.painted`.

        If *region* equals the number of regions, a new region is added.  If there are no regions
        yet, the first one is created and contains all vertices.
        """
        regions, name = self._some_regions(), self.region_name(region)
        after = painting.painted(regions, region, vertices, subtract=subtract, name=name)
        self._set_regions(after, f"paint {name}", self._state.region_names)

    def merge_regions(self, which: Sequence[int]) -> None:
        """Merge two or more regions into the first of them, which keeps the first name."""
        regions = painting.merged(self._some_regions(), which)
        names = naming.merged(self._state.region_names, [int(region) for region in which])
        self._set_regions(regions, "merge regions", names)

    def split_region(
        self, region: int, vertices: ArrayLike | None = None, *, overlap: int | None = None
    ) -> None:
        """Split *vertices* off a region, by default half of it; see `painting.split`.

        The remaining part keeps the name.  The new region comes last; next to "arm" it is "arm 2".
        """
        regions, name = self._some_regions(), self.region_name(region)
        after = painting.split(regions, region, vertices, overlap=overlap, name=name)
        names = naming.split(self._state.region_names, int(region), regions.n_regions)
        self._set_regions(after, f"split {name}", names)

    def region_name(self, region: int) -> str:
        """Return the name of a region, also of one that does not exist yet."""
        if not is_whole(region, 0):
            raise RegionError(f"region must be a whole number, 0 or more; got {shown(region)}")
        return naming.region_name(self._state.region_names, int(region))

    def rename_region(self, region: int, name: str) -> None:
        """Rename a region; "" removes its name.

        Painting, merging and splitting keep names; `segment` and `set_regions` remove them.

        Raises
        ------
        RegionError
            If there is no such region, *name* is the name of another region, or it is not printable
            text of at most 80 characters.
        """
        count = 0 if self.regions is None else self.regions.n_regions
        if not is_whole(region, 0, count - 1):
            raise RegionError(
                f"there is no region {shown(region)}; there are {count}, numbered from 0"
            )
        names = naming.renamed(self._state.region_names, int(region), name)
        label = f"rename {self.region_name(region)}"
        self._step(label, replace(self._state, region_names=names))

    # Cages.

    def set_cages(
        self,
        cages: Sequence[Cage],
        *,
        label: str = "set cages",
        n_cage_vertices: int | None = None,
        posed: Sequence[FloatArray] | None = None,
    ) -> None:
        """Set the cages, one around each region; CageError if they do not fit.

        *n_cage_vertices*, if given, becomes the option of the same step.  The pose is reset, unless
        the vertices *posed* (m_r, 3) of the cages are given; see `carried`.
        """
        require(label, str, "label")
        options = self._options_with(n_cage_vertices)
        regions, fitted = self._fitted
        if cages is not fitted or self.regions is not regions:
            cages = fitting_cages(self.regions, cages, self._state.region_names)
        if posed is not None:
            require_sequence(posed, "posed")
            if len(posed) != len(cages):
                raise CageError(f"posed must have one array for each cage; got {len(posed)}")
            posed = [
                handles.cage_places(self.mesh, own, cage.n_vertices, "posed vertices")
                for own, cage in zip(posed, cages, strict=True)
            ]
        self._set_cages(tuple(cages), label, options, posed)

    def carried(
        self,
        cages: Sequence[Cage],
        progress: Progress | None = None,
        *,
        n_cage_vertices: int | None = None,
    ) -> tuple[FloatArray, ...] | None:
        """Return the vertices (m_r, 3) that other *cages* have in the current pose; None at rest.

        The mesh is nearly where it is now.  This may run in another thread, as `fitted_cages`; pass
        the result to `set_cages`.
        """
        options = self._options_with(n_cage_vertices)
        if cages is not self._fitted[1] or self.regions is not self._fitted[0]:
            cages = fitting_cages(self.regions, cages, self._state.region_names)
        if self._state.pose is None:
            return None
        state = replace(self._state, cages=tuple(cages), options=options).at_rest()
        return self._pose_solver.carried(state, self.vertices, progress)

    def fitted_cages(
        self, progress: Progress | None = None, *, n_cage_vertices: int | None = None
    ) -> tuple[Cage, ...]:
        """Fit cages to the regions and return them, without changing the session.

        This may run in another thread; pass the result to `set_cages` in the session's thread.
        *n_cage_vertices* is the total of their vertices, by default that of the options; unless
        these have another number than the default one, it follows the number of regions.
        """
        if self.regions is None:
            raise RegionError("there are no regions to fit cages to; segment or paint them first")
        regions, options = self.regions, self._options_with(n_cage_vertices)
        cages = self._cages_around(regions, options, progress)
        self._fitted = regions, cages
        return cages

    def fit_cages(self, progress: Progress | None = None) -> None:
        """Fit cages to the regions; if cancelled, nothing changes."""
        self._set_cages(self.fitted_cages(progress), "fit cages", self.options)

    def bind(self, progress: Progress | None = None) -> None:
        """Bind the cages and constraints in advance, so that the first move does not wait."""
        self._pose_solver.prepare(self._state, progress)

    @property
    def deformer(self) -> Deformer:
        """The deformer of the cages, bound first if necessary, without fixed vertices or handles.

        Its `subspace` is W~ of the mesh.  The session solves with copies, so use it to read only.
        """
        return self._pose_solver.bind(self._state)

    def preparation(self, progress: Progress | None = None) -> Preparation:
        """Return the regions and cages that the session lacks, bound, without changing it.

        This may run in another thread; pass the result to `accept` in the session's thread.
        """
        regions, options = self.regions, self.options
        if regions is None:
            regions = segment(self.mesh, None, progress=part(progress, 0.0, _SEGMENTED))
        cages = self.cages
        if not cages:
            cages = self._cages_around(regions, options, part(progress, _SEGMENTED, _FITTED))
        state = State(regions, cages, options=options)
        deformer = PoseSolver(self.mesh).bind(state, part(progress, _FITTED, 1.0))
        _ = self.mesh.adjacency, self._pose_solver.lids(state)  # the first frame needs them
        return Preparation(regions, cages, deformer)

    def accept(self, preparation: Preparation) -> bool:
        """Use a `preparation`, in all steps of the history; False if the session changed since.

        It is no step: undo does not remove it.
        """
        regions, cages, deformer = require(preparation, Preparation, "preparation")
        has_others = self.regions not in (None, regions) or self.cages not in ((), cages)
        if has_others or deformer.mesh is not self.mesh:
            return False
        self._pose_solver.adopt(State(regions, cages, options=self.options), deformer)
        self._amend(partial(_prepared, regions=regions, cages=cages))
        return True

    # Fixed vertices and handles.

    def set_fixed(self, vertices: ArrayLike) -> None:
        """Fix *vertices* (ids or a mask) at their current positions.

        Vertices that are already fixed keep theirs.
        Without a pose, after `reset_pose` or with new regions or cages, they are fixed at rest.
        """
        fixed, _ = checked_constraints(self.mesh, vertices, self._state.handle)
        if not np.array_equal(fixed, self.fixed):
            own = fixed.copy()
            frozen(own)
            after = replace(self._state, fixed=own, fixed_at=self._places_to_fix(own))
            self._step("set fixed vertices", after)

    def _places_to_fix(self, fixed: IntArray) -> FloatArray | None:
        """Return where the vertices *fixed* (f,) stay, (f, 3); None: at rest."""
        before = self._state
        if before.pose is None:
            return None
        at_rest = self.mesh.vertices[fixed]
        places = self.vertices[fixed]
        _, new, old = np.intersect1d(fixed, before.fixed, return_indices=True)
        kept = self.mesh.vertices[before.fixed] if before.fixed_at is None else before.fixed_at
        places[new] = kept[old]
        if np.array_equal(places, at_rest):
            return None
        frozen(places)
        return places

    def add_handle(self, vertices: ArrayLike, name: str | None = None) -> str:
        """Make *vertices*, ids or a mask, a handle; a handle of the same *name* is replaced.

        Returns
        -------
        name : str
            By default "handle 1", "handle 2", ...
        """
        name = handles.new_name(self.handles) if name is None else name
        after = handles.with_handle(self.mesh, self._state, name, vertices)
        if name not in self.handles or not np.array_equal(after[name], self.handles[name]):
            self._set_handles(after, f"set {name}")
        return name

    def remove_handle(self, *names: str) -> None:
        """Remove one or more handles, in one undo step; the pose does not change."""
        after = self.handles
        for name in names:
            after = handles.without_handle(after, name)
        if names:
            label = names[0] if len(names) == 1 else f"{len(names)} handles"
            self._set_handles(after, f"remove {label}")

    def rename_handle(self, name: str, new_name: str) -> None:
        """Rename a handle."""
        after = handles.renamed(self._state, name, new_name)
        if name != new_name:
            self._step(f"rename {name}", after)

    def pivot(self, name: str) -> FloatArray:
        """Return the point (3,) about which a handle rotates: by default its centre."""
        handles.require_handle(self.handles, name)
        ids, at_rest = self.handles[name], self._state.pivots.get(name)
        if at_rest is None:
            return np.asarray(self.vertices[ids].mean(axis=0))
        R, shift = rigid_fit(self.mesh.vertices[ids], self.targets[name])
        return np.asarray(R @ at_rest + shift)

    def set_pivot(self, name: str, point: ArrayLike | None) -> None:
        """Move the pivot of a handle to *point* (3,), from where it moves with the handle.

        None resets it to the centre of the handle.

        Raises
        ------
        ConstraintError
            If there is no such handle, or *point* is not a point or too far away.
        """
        handles.require_handle(self.handles, name)
        pivots = {other: at for other, at in self._state.pivots.items() if other != name}
        if point is not None:
            place = checked_point(point, "point")
            handles.require_near(self.mesh, place, "coordinates of point")
            ids = self.handles[name]
            R, shift = rigid_fit(self.mesh.vertices[ids], self.targets[name])
            pivots[name] = (place - shift) @ R
            frozen(pivots[name])
        elif name not in self._state.pivots:
            return
        label = f"{'reset' if point is None else 'move'} the pivot of {name}"
        self._step(label, replace(self._state, pivots=MappingProxyType(pivots)))

    # The pose.

    def drag(
        self,
        targets: Mapping[str, ArrayLike] | ArrayLike,
        *,
        max_steps: int | None = None,
    ) -> Solution:
        """Move handles to *targets*, and start a drag unless one is ongoing.

        Parameters
        ----------
        targets : mapping of str to (k, 3) float, or (k, 3) float
            Targets by the name of the handle, where other handles keep theirs; or the targets of
            all handles, concatenated.
        max_steps : int, optional
            Stop after this number of solver steps; the next move, or `refine`, continues.  3 to 8
            are enough for the frames of a drag.

        Returns
        -------
        solution : Solution
            The result, also available as `solution`.

        Raises
        ------
        ConstraintError, CageError
            If there is no such handle, *targets* are not points or too far away, or there are no
            cages.  The pose does not change then.
        """
        wanted = handles.checked_targets(self.mesh, self.handles, targets)
        state = self._released(self._state)
        kept = self._rest_targets() if state.pose is None else state.pose.targets
        return self._drag(state, {**kept, **wanted}, list(wanted), max_steps)

    def pull(
        self,
        vertex: int | ArrayLike | SurfacePoint,
        to: ArrayLike,
        *,
        radius: float | None = None,
        locality: float | None = None,
        max_steps: int | None = None,
    ) -> Solution:
        """Pull one point of the surface, as part of a drag like `drag`; see `pulling`.

        Parameters
        ----------
        vertex : int, (3,) float or SurfacePoint
            The grabbed vertex, or another point of the surface, given at rest: of a position, the
            nearest one.
        to : (3,) or (4, 4) float
            Where it is pulled to; or an affine map of the surface around it since the press, which
            may turn it.
        radius : float, optional
            Of the pulled surface, in the mesh's unit; by default 15 % of the mesh's diagonal.
        locality : float, optional
            1 keeps the surface in place; beyond four radii, of 15 % of the diagonal or more, it
            hardly moves.  With less, more of it follows, above all the ends of limbs; with 0 all is
            free.  By default 0.2; 0 if fixed vertices, pins and handles that were not made by pulls
            are three points or more, and 0.05 if they are fewer.
        max_steps : int, optional
            As in `drag`.

        Raises
        ------
        ConstraintError, CageError
            If there is no such vertex, it is fixed, *to* is too far away, or there are no cages;
            or if the faces at the point are so large that no vertex is within the radius.

        Notes
        -----
        Calls with the same point, radius and locality belong to one pull until `commit`, which
        leaves a handle at the vertex nearest to it.  When the first map follows points, the surface
        around the point keeps its current shape; see `turned`.
        """
        point = checked_place(self.mesh, vertex)
        radius = checked_radius(self.mesh, radius)
        locality = checked_locality(locality)
        motion = pulling.checked_motion(self.mesh, to)
        turns = motion.shape == (4, 4)
        start, grasp = self._grasp or (None, None)
        is_new = start is None or start is not self._drag_start
        if is_new or grasp is None or grasp.grip[:3] != (point, radius, locality):
            self.commit()
            start, grasp = self._state, None
        assert start is not None
        before = grasp
        if grasp is None or (turns and not grasp.grip.turns):
            grip = pulling.Grip(point, radius, locality, turns)
            grasp = pulling.grasp(self.mesh, start, self._vertices_of(start), grip)
            if before is not None:  # the handle becomes a patch, of the shape that it has now
                grasp = pulling.as_it_is(grasp, self.turned(), self.vertices)
        targets = grasp.targets(motion)
        for points in targets.values():
            handles.require_near(self.mesh, points, "the pulled positions (to)")
        state = grasp.state
        assert state.pose is not None
        wanted = {**state.pose.targets, **targets}
        if before is not None:  # go on from the pose so far
            pose = self._state.pose
            assert pose is not None
            if grasp is not before:
                now = handles.targets_at(state.handles, self.vertices)
                pose = replace(state.pose, cage_vertices=pose.cage_vertices, targets=now)
            state = replace(state, pose=pose)
        solution = self._drag(state, wanted, [grasp.name], max_steps)
        self._grasp = start, grasp
        return solution

    def grabbed(
        self, vertex: int | ArrayLike | SurfacePoint, radius: float | None = None
    ) -> str | None:
        """Return the handle that `pull` would move with these arguments; None for a new one."""
        point, radius = checked_place(self.mesh, vertex), checked_radius(self.mesh, radius)
        return pulling.grabbed(self.mesh, self.state, point, radius)

    def can_grab(self, vertex: int | ArrayLike | SurfacePoint, radius: float | None = None) -> bool:
        """Return whether a vertex is so near that `pull` can grab the surface there."""
        point, radius = checked_place(self.mesh, vertex), checked_radius(self.mesh, radius)
        return not fault_of_grab(self.mesh, point, radius)

    @property
    def last_pulled(self) -> str | None:
        """The handle that the last call of `pull` moved, which may have been removed since."""
        return None if self._grasp is None else self._grasp[1].name

    def turned(self) -> FloatArray:
        """Return the rotation (3, 3) of the surface around the pulled vertex since the press.

        A pull to a point also rotates the surface there.  A map with this linear part continues
        such a pull without a jump.  The identity if nothing is being pulled.
        """
        start, grasp = self._grasp or (None, None)
        if start is None or grasp is None or start is not self._drag_start:
            return np.eye(3)
        return pulling.turned(grasp, self.mesh, self._vertices_of(start), self.vertices)

    def pin(self, vertex: int) -> str:
        """Pin a vertex where it is now, and return the name of the pin, a handle.

        Raises
        ------
        ConstraintError
            If there is no such vertex, or it is fixed or in a handle already.
        """
        name, after = pulling.pinned(self.mesh, self._state, vertex)
        self._set_handles(after, "pin")
        return name

    def make_handle(self, name: str, *, radius: float | None = None) -> str:
        """Make a pin or pulled point a handle of the surface around it, and return its new name.

        Unlike a single vertex, the handle can rotate.

        Parameters
        ----------
        name : str
            The pin or pulled point.
        radius : float, optional
            As in `pull`; the handle has the surface within half of it.
        """
        handles.require_handle(self.handles, name)
        radius = checked_radius(self.mesh, radius)
        new, after = pulling.as_handle(self.mesh, self._state, name, radius)
        self._replace_handles(after, f"convert {name} to {new}")
        return new

    def make_pin(self, name: str) -> str:
        """Make a handle a pin at its middle vertex, and return its new name."""
        handles.require_handle(self.handles, name)
        new, after = pulling.as_pin(self.mesh, self._state, name)
        self._replace_handles(after, f"convert {name} to {new}")
        return new

    def move_handle(
        self,
        name: str,
        motion: ArrayLike,
        *,
        max_steps: int | None = None,
    ) -> Solution:
        """Move one handle by a matrix or to targets; otherwise like `drag`.

        Parameters
        ----------
        name : str
            The handle.
        motion : (4, 4) or (k, 3) float
            An affine map of the targets at the start of the drag, so that moving the mouse back
            moves the handle back.  A handle turns the shorter way from where it is: to wind the
            body up by 270 degrees, turn it by 90 and by 180 before.  Or a target for each vertex of
            the handle.
        max_steps : int, optional
            As in `drag`.
        """
        handles.require_handle(self.handles, name)
        matrix = plain(motion, "motion")
        if matrix.shape != (4, 4):
            return self.drag({name: matrix}, max_steps=max_steps)
        pose = self._released(self._drag_start or self._state).pose
        start = self._rest_targets() if pose is None else pose.targets
        targets = {name: handles.moved(start[name], matrix)}
        return self.drag(targets, max_steps=max_steps)

    def move_cage(self, region: int, vertices: ArrayLike) -> None:
        """Move the vertices of one cage to *vertices* (m_r, 3); the mesh follows, x = W~ p.

        This is part of a drag, like `drag`, but nothing is solved, and handles move with the mesh.
        If the options preserve volume, all cages are corrected for it.  The correction starts from
        the vertices passed, not from corrected ones, so that moving the mouse back undoes it.
        """
        if not is_whole(region, 0, len(self.cages) - 1):
            raise CageError(
                f"region must be the number of one of {len(self.cages)} cages; got {shown(region)}"
            )
        region = int(region)
        continues = self.is_dragging and self._placed[0] is self._state.pose
        places = list(self._placed[1] if continues else self.cage_vertices)
        count = len(places[region])
        places[region] = handles.cage_places(self.mesh, vertices, count, "vertices")
        pose = self._pose_solver.free_form(self._state, places)
        self._placed = pose, places
        self._move(replace(self._state, pose=pose), f"the cage of {self.region_name(region)}")

    def carry(self, points: ArrayLike) -> FloatArray:
        """Return *points* (k, 3), given at rest, moved along with the mesh to the current pose."""
        return self._pose_solver.bind(self._state).passengers(points).moved(self.cage_vertices)

    def refine(
        self,
        *,
        max_steps: int | None = None,
        progress: Progress | None = None,
    ) -> Solution:
        """Continue solving for the current targets, for example after a drag with *max_steps*.

        *progress* is called before every step and may cancel; then nothing changes.

        Adds no undo step: the result becomes part of the ongoing drag, or else of the last step.
        """
        is_passing = self.is_dragging
        pose, solution = self._solve(
            self._state, self.targets, max_steps, is_passing=is_passing, progress=progress
        )
        here = self._state.pose
        # Converged already: keep the same pose object.  But even without a step, the final pose can
        # have other weights of handles than the one before.
        if solution.steps == 0 and (here is None or self._is_same_place(here, pose)):
            if self.solution is None or not self.solution.is_finished:  # of which it tells nothing
                self._solution = None if here is None else (here, solution)
            return solution
        self._solution = pose, solution
        self._set_state(replace(self._state, pose=pose), Change(0))
        return solution

    def finish(self, *, progress: Progress | None = None) -> Solution:
        """Finish the pose on the mesh itself, as `Deformer.finish` does.

        Triangles are less distorted, joints bend in less space, and handles and fixed vertices are
        exact.  The next drag continues from the finished pose.  The pose of a pull is finished
        within its reach.  A finished pose is finished further.

        Adds no undo step: the result becomes part of the ongoing drag, or else of the last step.

        Parameters
        ----------
        progress : Progress, optional
            May cancel; then nothing changes, except that the pose may have converged.

        Raises
        ------
        SessionError
            If there is no pose, or nothing is fixed or in a handle.
        """
        begun = 0.0
        if self.is_unsettled:
            begun = 0.5
            self.refine(progress=part(progress, 0.0, begun))
        result = self.finishing()(part(progress, begun, 1.0))
        self.accept_finish(result)
        return result.solution

    @property
    def can_finish(self) -> bool:
        """Whether there is a pose that `finish` can finish, and it is not finished yet."""
        return not self._reason_not_to_finish() and not self.is_finished

    @property
    def can_finish_further(self) -> bool:
        """Whether the pose was finished, but not to its end, and is not that of a pull."""
        return self._is_on_its_way(finished=True) and self._state.locality is None

    @property
    def is_finished(self) -> bool:
        """Whether the pose was finished on the mesh, and not moved since then."""
        return self._state.pose is not None and self._state.pose.is_finished

    @property
    def is_unsettled(self) -> bool:
        """Whether the cages of the pose have not converged, so that `refine` would move it."""
        return self._is_on_its_way(finished=False)

    def _is_on_its_way(self, *, finished: bool) -> bool:
        solution = self.solution
        if solution is None or solution.is_finished != finished:
            return False
        return solution.status is Status.STEP_LIMIT

    def finishing(self) -> Finish:
        """Return a function that finishes the current pose, ``finishing(progress)``.

        It does not use the session, so another thread may call it while the session is edited; pass
        its result to `accept_finish` in the session's thread.  Raises like `finish`.
        """
        reason = self._reason_not_to_finish()
        if reason:
            raise SessionError(reason)
        assert self._state.pose is not None
        return self._pose_solver.finish(self._state, self._state.pose)

    def accept_finish(self, result: FinishedPose) -> bool:
        """Use the result of `finishing`; False if the pose has changed since."""
        before, pose, solution = require(result, FinishedPose, "result")
        if self._state.pose is not before:
            return False
        self._pose_solver.accept(before, pose)
        known = None if solution.is_finished else self.solution  # it was not changed
        self._solution = pose, known or solution
        self._set_state(replace(self._state, pose=pose), Change(0))
        return True

    def _reason_not_to_finish(self) -> str:
        """Return why the pose cannot be finished, or ""."""
        state = self._state
        if state.pose is None:
            return "there is no pose to finish; move a handle first"
        if not (state.handles or len(state.fixed)):
            return "there are no handles or fixed vertices to finish the pose for; add a handle"
        return ""

    def start_afresh(self) -> None:
        """Make the next solve bitwise reproducible, as in a session that was just loaded.

        Otherwise, the solver reuses information from previous solves.
        """
        self._pose_solver.forget()

    def reset_pose(self) -> None:
        """Reset the pose to rest; an ongoing drag is committed first."""
        self._step("reset pose", self._state.at_rest())

    def change_options(self, **changes: float | bool | None) -> None:
        """Change some of the `Options` by name; call `refine` to apply them to the pose."""
        unknown = sorted(changes.keys() - vars(self.options).keys())
        if unknown:
            known = ", ".join(vars(self.options))
            raise SessionError(f"there is no option {', '.join(unknown)}; there are {known}")
        options = replace(self.options, **changes)  # type: ignore[arg-type]  # `Options` checks them
        self._step(label_of_change(self.options, options), replace(self._state, options=options))

    def _released(self, state: State) -> State:
        """Return `pulling.released` of *state*; the last one is kept."""
        if state.locality is None:
            return state
        if self._let_go[0] is not state:
            self._let_go = state, pulling.released(state, self._vertices_of(state))
        return self._let_go[1]

    def _drag(
        self,
        state: State,
        targets: Mapping[str, FloatArray],
        moved: list[str],
        max_steps: int | None,
    ) -> Solution:
        """Solve from *state* for *targets*, as part of a drag of the handles *moved*."""
        pose, solution = self._solve(state, targets, max_steps, is_passing=True)
        self._solution = pose, solution
        self._move(replace(state, pose=pose), *moved)
        return solution

    def _solve(
        self,
        state: State,
        targets: Mapping[str, FloatArray],
        max_steps: int | None,
        *,
        is_passing: bool = False,
        progress: Progress | None = None,
    ) -> tuple[Pose, Solution]:
        began = time.perf_counter()
        wanted = MappingProxyType({**targets})
        pose, solution = self._pose_solver.solve(
            state, wanted, max_steps, is_passing=is_passing, progress=progress
        )
        steps, seconds = self._effort
        self._effort = Effort(steps + solution.steps, seconds + time.perf_counter() - began)
        return pose, solution

    def _end_drag(self, label: str | None) -> str | None:
        self._pose_solver.settle()
        return super()._end_drag(label)

    def _is_same_place(self, a: Pose, b: Pose) -> bool:
        """Tell whether the cages of two poses differ by rounding only."""
        p, q = np.concatenate(a.cage_vertices), np.concatenate(b.cage_vertices)
        return bool(np.abs(p - q).max() <= _ROUNDING * self.mesh.diagonal)

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
        after = replace(self._state, regions=regions, cages=cages, region_names=names)
        self._step(label, after.at_rest())

    def _options_with(self, n_cage_vertices: int | None) -> Options:
        if n_cage_vertices is None:
            return self.options
        return replace(self.options, n_cage_vertices=n_cage_vertices)

    def _cages_around(
        self, regions: Regions, options: Options, progress: Progress | None
    ) -> tuple[Cage, ...]:
        wanted, offset = options.n_cage_vertices, options.offset
        size = suggested_size(regions) if wanted == Options().n_cage_vertices else wanted
        require_cage_vertices(size, regions.n_regions, "n_cage_vertices")
        return fit_cages(
            self.mesh, regions, size, fixed=self.fixed, offset=offset, progress=progress
        )

    def _set_cages(
        self,
        cages: tuple[Cage, ...],
        label: str,
        options: Options,
        posed: Sequence[FloatArray] | None = None,
    ) -> None:
        after = replace(self._state, cages=cages, options=options).at_rest()
        if posed is not None:
            local = self._state.locality
            after = replace(after, fixed_at=self._state.fixed_at)
            pose = self._pose_solver.free_form(after, posed)
            if local is not None:
                local = replace(local, cage_vertices=pose.cage_vertices)
            after = replace(after, pose=pose, locality=local)
        self._step(label, after)

    def _set_handles(self, after: Mapping[str, IntArray], label: str) -> None:
        pivots = self._state.pivots
        if pivots.keys() - after.keys():
            pivots = MappingProxyType({name: pivots[name] for name in pivots if name in after})
        self._replace_handles(replace(self._state, handles=after, pivots=pivots), label)

    def _replace_handles(self, after: State, label: str) -> None:
        """Record a step to *after* with targets for its handles; the mesh does not move."""
        pose = self._state.pose
        if pose is not None:
            pose = handles.with_handles(pose, self.handles, after.handles, self.vertices)
        self._step(label, replace(after, pose=pose))


def _prepared(state: State, *, regions: Regions, cages: tuple[Cage, ...]) -> State:
    """Return *state* with regions and cages, if it has none yet."""
    if state.regions not in (None, regions) or state.cages:
        return state
    return replace(state, regions=regions, cages=cages)


def _still_fit(old: Regions, new: Regions, cages: Sequence[Cage]) -> bool:
    """Return whether *cages*, which enclose the *old* regions, also enclose the *new* ones."""
    if new.n_regions != old.n_regions:
        return False
    added = new.membership & ~old.membership
    vertices = new.mesh.vertices
    return all(
        bool(cage.contains(vertices[more]).all())
        for cage, more in zip(cages, added, strict=False)
        if more.any()
    )


def _surface(surface: Any) -> Surface:
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import Surface

    if not isinstance(surface, Surface):
        require_mesh(surface)
    return surface  # type: ignore[no-any-return]
