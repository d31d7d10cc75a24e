"""The session: one mesh with its regions, cages, handles and pose; all edits undoable.

The session is the only object with state.  Widgets and scripts read and edit a `Session`, and
`on_change` notifies them of what to redraw.

    segment, painting.paint ...  ->  fit_cages  ->  set_fixed, handles.add  ->  drag ... commit

Each of these calls is one undo step, except that all moves of a drag are one step, ended by
`commit`, and that settings are none; see `Session.change_options`.

    state      a frozen `State`, the value of the session
    history    `Timeline`: the states before and after it
    poses      `Poses`: everything that is computed from states
    handles    the handles and their edits              painting    edits of the regions
    saved_poses                                         poses by name, applied and blended
    landmarks                                           points with targets, and the fit to them
    carried                                             other files whose points follow the mesh

- New regions or cages reset the pose, unless `set_cages` gets the cages in the pose.  New regions
  keep the cages if each cage still encloses its region; otherwise all cages are removed.
- New fixed vertices, handles or options keep the pose; the next move starts from it.

A session belongs to one thread.  Only `bind` and the functions of `preparing`, `separating` and
`solving` may run in another thread, while the session is not used in any other way; they do not
change its visible state.

Long because it is the interface of one class; the implementation is in the other files.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, is_whole, plain
from ..cages import Cage
from ..checks import Described, as_flag, as_text, require, require_sequence, shown
from ..deformer import (
    Deformer,
    Slide,
    checked_constraints,
    checked_hinge,
    checked_limb,
    checked_locality,
    checked_place,
    checked_radius,
)
from ..errors import CageError, ConstraintError, RegionError, SessionError
from ..geometry import Attach, Lids
from ..importing import imported
from ..mesh import Mesh, SurfacePoint, require_mesh
from ..progress import Progress, part
from ..regions import Regions, segment
from ..solver import Bodies, Solution, Status
from . import finishing, handles, naming, output, painting, preparing, pulls, separating, solving
from .carried import SessionCarried
from .finishing import FinishedPose
from .handle_edits import Handles
from .landmark_edits import SessionLandmarks
from .listeners import Listener
from .painting import Painting
from .poses import Poses
from .preparing import Preparation
from .saved_poses import SavedPoses
from .separating import apart, with_fixed, with_goals
from .state import (
    Cages,
    Options,
    Pose,
    State,
    checked_state,
    checked_stiffness,
    fitting_cages,
    of_mesh,
    owned_parts,
    owned_slides,
)
from .timeline import Timeline

if TYPE_CHECKING:
    import pyvista as pv

    from ..io import Surface

# The options that a step changes, and its label; the others are settings.
_STEPS = {
    "volumes": "change volumes",
    "attach": "change attached components",
    "symmetry": "change symmetry",
}
_ROUNDING = 1e-9  # diagonals: distance of cage vertices that are in the same place


class _Placed(NamedTuple):
    """A pose of `Session.move_cage`, and the cage vertices before the volume correction."""

    pose: Pose
    places: Cages


class Session(Described):
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
    no listeners, and its next solve starts as in a session that was just loaded.

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
    >>> session.handles.add(session.mesh.vertices[:, 2] > 0.8)
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
        self.poses = Poses(mesh)
        """What is computed from states, cached."""
        self.history = Timeline(State() if state is None else checked_state(mesh, state), history)
        """The states to undo and redo."""

    def __getstate__(self) -> dict[str, Any]:
        return {"mesh": self.mesh, "surface": self._surface, "history": copy.copy(self.history)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._surface, self.history = state["surface"], state["history"]
        self.poses = Poses(state["mesh"])

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        steps = f"{self.history.position} of {len(self.history.labels) - 1}"
        return self.mesh.facts() | self.state.facts() | {"step": steps, "next": self.what_next}

    # State.

    @property
    def mesh(self) -> Mesh:
        """The mesh at rest."""
        return self.poses.mesh

    @property
    def state(self) -> State:
        """The current state, including an ongoing drag; immutable."""
        return self.history.state

    @property
    def is_dragging(self) -> bool:
        """Whether there is an ongoing drag, to be ended by `commit` or `revert`."""
        return self.history.drag is not None

    @property
    def handles(self) -> Handles:
        """For each handle by name, (k,) int: its vertices; and edits of handles."""
        return Handles(self.history, self.poses)

    @property
    def saved_poses(self) -> SavedPoses:
        """The saved poses by name; and edits of them."""
        return SavedPoses(self.history, self.poses)

    @property
    def landmarks(self) -> SessionLandmarks:
        """The landmarks by name; and edits of them, and the fit of the mesh to their targets."""
        return SessionLandmarks(self.history, self.poses)

    @property
    def carried(self) -> SessionCarried:
        """The files whose points follow the mesh, by name; and edits of them."""
        return SessionCarried(self.history, self.poses)

    @property
    def painting(self) -> Painting:
        """Edits of the regions."""
        return Painting(self.history, self.poses)

    @property
    def surface(self) -> Surface | None:
        """The surface of which the session deforms the mesh, if it was made from one."""
        return self._surface

    @property
    def deformed(self) -> pv.PolyData:
        """The surface in the current pose, as it was given apart from coordinates and normals.

        Without a surface, the triangles of the mesh.
        """
        return output.deformed(self.mesh, self.surface, self.vertices)

    def write_deformed(self, path: str | Path, *, displacement: str | None = None) -> None:
        """Write `deformed` to a mesh file, as `write_mesh` does.

        *displacement* is the name of a point array to add: how far each point has moved, (p, 3).
        """
        parts = self.mesh, self.surface, self.vertices
        output.write_deformed(path, *parts, displacement=displacement)

    def layers(self) -> dict[str, pv.PolyData]:
        """Return the surface and its cages in the current pose; see `output.layers`."""
        return output.layers(self.mesh, self.surface, self.state, self.vertices)

    @property
    def regions(self) -> Regions | None:
        """The regions, or None if there are none yet."""
        return self.state.regions

    @property
    def cages(self) -> tuple[Cage, ...]:
        """One cage for each region, at rest; empty if there are no cages yet."""
        return self.state.cages

    @property
    def fixed(self) -> IntArray:
        """(f,) int: vertices that stay where they were when they were fixed."""
        return self.state.fixed

    @property
    def options(self) -> Options:
        """Options for fitting cages and solving."""
        return self.state.options

    @property
    def targets(self) -> Mapping[str, FloatArray]:
        """For each handle by name, (k, 3) float: the targets of its vertices."""
        return handles.targets_of(self.mesh, self.state)

    @property
    def cage_vertices(self) -> Cages:
        """One (m_r, 3) float for each cage: its vertices in the current pose."""
        return self.state.cage_vertices

    @property
    def vertices(self) -> FloatArray:
        """(n, 3) float: the mesh in the current pose; read-only, one array until the next change.

        If necessary, the cages are bound first, as by `bind`.
        """
        return self.poses.vertices(self.state, live=self.is_dragging)

    @property
    def volume_change(self) -> float:
        """Relative volume change (V - V0) / V0 of `vertices`, signed; 0 without a volume."""
        return self.poses.shown(self.state, live=self.is_dragging).volume_change()

    @property
    def volume_summary(self) -> str:
        """Whether the mesh has a volume that is preserved, in one line; see `volume_summary`."""
        options = self.state.options
        preserved = options.preserve_volume or options.preserve_region_volumes
        return self.lids.summary(preserved=preserved)

    @property
    def has_volume(self) -> bool:
        """Whether the mesh encloses a volume, with its lids if it is open."""
        return self.lids.has_volume

    @property
    def lids(self) -> Lids:
        """The lids over the borders of the mesh, with ``options.lids``."""
        return self.poses.lids(self.state)

    @property
    def solution(self) -> Solution | None:
        """The solver's result for the current pose; None at rest, after loading or undo."""
        return self.poses.solution(self.state)

    @property
    def is_bound(self) -> bool:
        """Whether the cages are bound, so that the first move of a drag need not wait."""
        return self.poses.bindings.is_bound(self.state)

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
        follows = preparing.following(self.mesh, self.state)
        regions = segment(
            self.mesh, n_regions, overlap=overlap, seed=seed, progress=progress, **follows
        )
        self.history.step("segment", painting.with_regions(self.state, regions))

    def set_regions(self, regions: Regions, *, label: str = "set regions") -> None:
        """Set the regions; *label* names the undo step."""
        after = painting.with_regions(self.state, of_mesh(self.mesh, regions))
        self.history.step(require(label, str, "label"), after)

    def attach(self, attach: Mapping[int, int | str]) -> None:
        """Let components follow others at once, by the option *attach* of `Options`.

        Components that follow another one now, or no longer, get other regions and cages; the other
        regions remain, and so does the pose, nearly.
        """
        after = separating.attached(self.poses, self.state, attach)
        self.history.step("change attached components", after)

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
        the vertices *posed* (m_r, 3) of the cages are given; see `solving.carried`.
        """
        require(label, str, "label")
        state = preparing.sized(self.state, n_cage_vertices)
        cages = fitting_cages(self.regions, cages, self.state.region_names)
        if posed is not None:
            require_sequence(posed, "posed")
            if len(posed) != len(cages):
                raise CageError(f"posed must have one array for each cage; got {len(posed)}")
            posed = [
                handles.cage_places(self.mesh, own, cage.n_vertices, "posed vertices")
                for own, cage in zip(posed, cages, strict=True)
            ]
        after = replace(state, cages=cages).at_rest()
        if posed is not None:
            local = self.state.locality
            after = replace(after, fixed_at=self.state.fixed_at)
            pose = solving.free_form(self.poses, after, posed)
            if local is not None:
                local = replace(local, cage_vertices=pose.cage_vertices)
            after = replace(after, pose=pose, locality=local)
        self.history.step(label, after)

    def fit_cages(self, progress: Progress | None = None) -> None:
        """Fit cages to the regions; if cancelled, nothing changes."""
        self.set_cages(preparing.fitted(self.mesh, self.state, progress), label="fit cages")

    def bind(self, progress: Progress | None = None) -> None:
        """Bind the cages and constraints in advance, so that the first move does not wait."""
        self.poses.prepare(self.state, progress)

    @property
    def deformer(self) -> Deformer:
        """The deformer of the cages, bound first if necessary, without fixed vertices or handles.

        Its `subspace` is W~ of the mesh.  The session solves with copies, so use it to read only.
        """
        return self.poses.bindings.bind(self.state)

    def preparation(self, progress: Progress | None = None) -> Preparation:
        """Return the regions and cages that the session lacks, bound, without changing it.

        This may run in another thread; pass the result to `accept` in the session's thread.
        """
        return preparing.preparation(self.poses, self.state, progress)

    def accept(self, preparation: Preparation) -> bool:
        """Use a `preparation`, in all steps of the history; False if the session changed since.

        It is no step: undo does not remove it.
        """
        require(preparation, Preparation, "preparation")
        if not preparing.fits(self.mesh, self.state, preparation):
            return False
        preparing.adopt(self.poses, self.options, preparation)
        self.history.amend(partial(preparing.prepared, preparation))
        return True

    # Fixed vertices and handles.

    def set_fixed(self, vertices: ArrayLike) -> None:
        """Fix *vertices* (ids or a mask) at their current positions.

        Vertices that are already fixed keep theirs.
        Without a pose, after `reset_pose` or with new regions or cages, they are fixed at rest.
        """
        fixed, _ = checked_constraints(self.mesh, vertices, self.state.handle)
        if not np.array_equal(fixed, self.fixed):
            self.history.step("set fixed vertices", with_fixed(self.poses, self.state, fixed))

    # The pose.

    def set_stiffness(self, stiffness: ArrayLike | None) -> None:
        """Let the surface have a *stiffness* (n,), as `Deformer` takes it; None: the same all over.

        The pose stays; call `refine` to apply it.
        """
        checked, before = checked_stiffness(self.mesh, stiffness), self.state.stiffness
        if checked is not None and before is not None and np.array_equal(checked, before):
            return
        self.history.step("set stiffness", replace(self.state, stiffness=checked))

    def set_slides(self, slides: Iterable[Slide]) -> None:
        """Let vertices slide along planes, lines or the surface at rest only; see `Slide`.

        The pose stays; call `refine` to apply them.
        """
        owned = owned_slides(self.mesh, slides)
        self.history.step("set slides", replace(self.state, slides=owned))

    def slide_fixed(self, slides: bool) -> None:
        """Let the fixed vertices slide in their best-fit plane, or fix the sliding ones again."""
        if as_flag(slides, "slides"):
            own = [Slide(self.fixed)] if len(self.fixed) else []
            fixed: ArrayLike = ()
        else:
            own, ids = [], [np.asarray(each.vertices) for each in self.state.slides]
            fixed = np.setdiff1d(np.concatenate([self.fixed, *ids]), self.state.handle)
        label = "let fixed vertices slide" if slides else "fix sliding vertices"
        after = replace(self.state, slides=owned_slides(self.mesh, own))
        places, _ = checked_constraints(self.mesh, fixed, self.state.handle)
        self.history.step(label, with_fixed(self.poses, after, places))

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
            Stop after this number of solver steps; the next move, or `refine`, continues.  8 are
            enough for the frames of a drag.

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
        wanted = handles.checked_targets(self.mesh, self.state.handles, targets)
        state = self._released(self.state)
        kept = handles.targets_of(self.mesh, state)
        return self._drag(state, {**kept, **wanted}, list(wanted), max_steps)

    def pull(
        self,
        vertex: int | ArrayLike | SurfacePoint,
        to: ArrayLike,
        *,
        radius: float | None = None,
        locality: float | None = None,
        limb: int | None = None,
        hinge: float = 0.0,
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
            hardly moves.  With less, more of it follows, above all the ends of limbs; with less
            than 0.2 also the body that the pulled limb is on; with 0 all is free.  By default 0.2;
            0 if fixed vertices, pins and handles that were not made by pulls are three points or
            more, and 0.05 if they are fewer.
        limb : int, optional
            The limb that moves, up to its joint, by its number in `Deformer.limbs`: 0 is the
            smallest one of the point, and beyond the last one is the whole body.  By default the
            first one that is longer than half the radius.
        hinge : float
            0 to 1: where that limb bends, with 0 along its length, with 1 at its joint only.
        max_steps : int, optional
            As in `drag`.

        Raises
        ------
        ConstraintError, CageError
            If there is no such vertex, it is fixed, *to* is too far away, or there are no cages;
            or if the faces at the point are so large that no vertex is within the radius.

        Notes
        -----
        Calls with the same point and options belong to one pull until `commit`.  It leaves a handle
        at the vertex nearest to it.  When the first map follows points, the surface around the
        point keeps its current shape; see `turned`.
        """
        point = checked_place(self.mesh, vertex)
        radius = checked_radius(self.mesh, radius)
        locality, limb = checked_locality(locality), checked_limb(limb)
        hinge = checked_hinge(hinge)
        motion = pulls.checked_motion(self.mesh, to)
        turns = motion.shape == (4, 4)
        before = self._grasp
        if before is None or before.grip[:5] != (point, radius, locality, limb, hinge):
            self.commit()
            before = None
        start = self.state if self.history.drag is None else self.history.drag.start
        grasp = before
        if grasp is None or (turns and not grasp.grip.turns):
            grip = pulls.Grip(point, radius, locality, limb, hinge, turns)
            bound = self.poses.bindings.bind(start)
            grasp = pulls.grasp(bound, start, self.poses.vertices(start), grip)
            if before is not None:  # the handle becomes a patch, of the shape that it has now
                grasp = pulls.as_it_is(grasp, self.turned(), self.vertices)
        targets = grasp.targets(motion)
        for points in targets.values():
            handles.require_near(self.mesh, points, "the pulled positions (to)")
        state = grasp.state
        assert state.pose is not None
        wanted = {**state.pose.targets, **targets}
        if before is not None:  # go on from the pose so far
            pose = self.state.pose
            assert pose is not None
            if grasp is not before:
                now = handles.targets_at(state.handles, self.vertices)
                pose = replace(state.pose, cage_vertices=pose.cage_vertices, targets=now)
            state = replace(state, pose=pose)
        return self._drag(state, wanted, [grasp.name], max_steps, grip=grasp)

    @property
    def _grasp(self) -> pulls.Grasp | None:
        """What the ongoing pull has grabbed."""
        grip = None if self.history.drag is None else self.history.drag.grip
        return grip if isinstance(grip, pulls.Grasp) else None

    def turned(self) -> FloatArray:
        """Return the rotation (3, 3) of the surface around the pulled vertex since the press.

        A pull to a point also rotates the surface there.  A map with this linear part continues
        such a pull without a jump.  The identity if nothing is being pulled.
        """
        drag, grasp = self.history.drag, self._grasp
        if drag is None or grasp is None:
            return np.eye(3)
        return pulls.turned(grasp, self.mesh, self.poses.vertices(drag.start), self.vertices)

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
        handles.require_handle(self.state.handles, name)
        matrix = plain(motion, "motion")
        if matrix.shape != (4, 4):
            return self.drag({name: matrix}, max_steps=max_steps)
        drag = self.history.drag
        if drag is not None and name not in drag.start.handles:
            self.commit()  # the pull that made it
            drag = None
        start = self._released(self.state if drag is None else drag.start)
        places = handles.targets_of(self.mesh, start)[name]
        return self.drag({name: handles.moved(places, matrix)}, max_steps=max_steps)

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
        before = None if self.history.drag is None else self.history.drag.grip
        places = list(self.cage_vertices)
        if isinstance(before, _Placed) and before.pose is self.state.pose:
            places = list(before.places)
        count = len(places[region])
        places[region] = handles.cage_places(self.mesh, vertices, count, "vertices")
        pose = solving.free_form(self.poses, self.state, places)
        name = f"the cage of {self.painting.name(region)}"
        grip = _Placed(pose, tuple(places))
        self.history.move(replace(self.state, pose=pose), name, grip=grip)

    @property
    def volume_names(self) -> tuple[str, ...]:
        """The names of `volumes`; none before the cages are bound."""
        enclosing = self.poses.bindings.enclosing_now(self.state)
        return () if enclosing is None else enclosing.volume_names

    @property
    def bodies(self) -> Bodies | None:
        """The bodies of the mesh; None before the cages are bound."""
        enclosing = self.poses.bindings.enclosing_now(self.state)
        return None if enclosing is None else enclosing.bodies

    def volumes(self) -> dict[str, float]:
        """Return all volumes of the pose by name, in the mesh's unit cubed; see `Deformer`."""
        return self.poses.bindings.enclosing(self.state).volumes(self.vertices)

    def volume(self, name: str) -> tuple[float, float]:
        """Return one of `volumes`, and (V - V0) / V0."""
        return self.poses.bindings.enclosing(self.state).volume(name, self.vertices)

    def set_part(self, name: str, vertices: ArrayLike | None) -> None:
        """Let the part *vertices* of the surface have a volume called *name*, under a lid.

        As the *parts* of `Deformer`; with None it has none any more, nor a goal.

        Raises
        ------
        ConstraintError
            If it encloses nothing, or another volume has this name.
        """
        as_text(name, "name")
        others = tuple(pair for pair in self.state.parts if pair[0] != name)
        after = replace(self.state, parts=others)
        if vertices is None:
            goals = tuple(pair for pair in self.options.volumes if pair[0] != name)
            after = replace(after, options=replace(self.options, volumes=goals))
            self.history.step(f"remove the volume of {name}", after)
            return
        if name in self.poses.bindings.bind(after).volume_names:
            raise ConstraintError(f"there is a volume {name!r} already; choose another name")
        after = replace(after, parts=(*others, *owned_parts(self.mesh, ((name, vertices),))))
        try:
            self.poses.bindings.bind(after).volume(name)
        except ConstraintError as fault:
            raise ConstraintError(f"vertices: {fault}") from None
        self.history.step(f"add the volume of {name}", after)

    def forget_volume(self, name: str) -> None:
        """Let the volume called *name* have no goal of its own; call `refine` to apply it."""
        as_text(name, "name")
        goals = {own: goal for own, goal in self.options.volumes if own != name}
        options = replace(self.options, volumes=tuple(goals.items()))
        label = f"forget the volume of {naming.volume_label(self.state.region_names, name)}"
        self.history.step(label, replace(self.state, options=options))

    def set_volume(self, name: str, goal: str | float, *, max_steps: int | None = None) -> Solution:
        """Change the volume called *name*, as part of a drag, like `drag`.

        After a pull nothing moves but what the volume moves.

        Parameters
        ----------
        name : str
            One of `Deformer.volume_names`, as of `deformer`.
        goal : str or float
            As "keep", "free", "-40%", "at most 2.5" or 2.5; see `Deformer`.
        max_steps : int, optional
            As in `drag`.

        Raises
        ------
        SessionError, ConstraintError
            If it is no goal, there is no such volume, or it contradicts others that are set.
        """
        goals = {**dict(self.options.volumes), as_text(name, "name"): goal}
        goals = dict(replace(self.options, volumes=tuple(goals.items())).volumes)  # checked
        state = with_goals(self.poses, self.state, goals)
        places = handles.targets_of(self.mesh, state)
        moved = f"the volume of {naming.volume_label(self.state.region_names, name)}"
        return self._drag(state, places, [moved], max_steps)

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
        state = self.state
        pose, solution = solving.solve(
            self.poses, state, self.targets, max_steps, live=self.is_dragging, progress=progress
        )
        # Converged already: keep the same pose object.  But even without a step, the final pose can
        # have other weights of handles than the one before.
        here = state.pose
        if solution.steps == 0 and (here is None or self._is_same_place(here, pose)):
            known = self.solution
            if here is not None and (known is None or not known.is_finished):
                self.poses.keep_solution(here, solution)
            return solution
        self.poses.keep_solution(pose, solution)
        self.history.update(replace(state, pose=pose))
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
        result = finishing.finish(self.poses, self.state)(part(progress, begun, 1.0))
        self.accept_finish(result)
        return result.solution

    @property
    def can_finish(self) -> bool:
        """Whether there is a pose that `finish` can finish, and it is not finished yet."""
        pose = self.state.pose
        is_finished = pose is not None and pose.is_finished
        return not is_finished and not finishing.reason_not_to_finish(self.state)

    @property
    def can_finish_further(self) -> bool:
        """Whether the pose was finished, but not to its end, and is not that of a pull."""
        return self._is_on_its_way(finished=True) and self.state.locality is None

    @property
    def is_unsettled(self) -> bool:
        """Whether the cages of the pose have not converged, so that `refine` would move it."""
        return self._is_on_its_way(finished=False)

    def _is_on_its_way(self, *, finished: bool) -> bool:
        solution = self.solution
        if solution is None or solution.is_finished != finished:
            return False
        return solution.status is Status.STEP_LIMIT

    def accept_finish(self, result: FinishedPose) -> bool:
        """Use the result of `finishing.finish`; False if the pose has changed since."""
        before, pose, solution = require(result, FinishedPose, "result")
        if self.state.pose is not before:
            return False
        self.poses.continue_from(pose, self.state)
        known = None if solution.is_finished else self.solution  # it was not changed
        self.poses.keep_solution(pose, known or solution)
        self.history.update(replace(self.state, pose=pose))
        return True

    def reset_pose(self) -> None:
        """Reset the pose to rest; an ongoing drag is committed first."""
        self.history.step("reset pose", self.state.at_rest())

    def reset_region(self, region: int) -> None:
        """Move the vertices of a region, and its handles, back to rest; the others follow.

        Nothing holds the region there in later drags but its handles.

        Raises
        ------
        RegionError
            If there is no such region.
        """
        count = len(self.painting.names)
        if not is_whole(region, 0, count - 1):
            raise RegionError(f"region must be the number of one of {count}; got {shown(region)}")
        self.commit()
        after = solving.with_region_at_rest(self.poses, self.state, int(region))
        self.history.step(f"reset {self.painting.name(int(region))}", after)

    def change_options(
        self, **changes: float | bool | Attach | Mapping[str, str | float] | None
    ) -> None:
        """Change some of the `Options` by name; call `refine` to apply them to the pose.

        Options are settings: changing them is no undo step, drops nothing that can be redone, and
        undo and redo leave them as they are.  Only *volumes* and *attach*, on which regions and
        cages depend, and *symmetry*, on which handles do, are changed by a step.  An ongoing drag
        is committed first.
        """
        unknown = sorted(changes.keys() - vars(self.options).keys())
        if unknown:
            known = ", ".join(vars(self.options))
            raise SessionError(f"there is no option {', '.join(unknown)}; there are {known}")
        options = replace(self.options, **changes)  # type: ignore[arg-type]  # `Options` checks them
        if options == self.options:
            return
        if options.symmetry != self.options.symmetry:
            self.poses.mirror(replace(self.state, options=options))  # raises if it is not symmetric
        after = apart(self.poses, self.state, dict(options.volumes))
        self.commit()
        settings = {name: getattr(options, name) for name in changes.keys() - _STEPS.keys()}
        self.history.amend(partial(_with_settings, settings))
        label = next((_STEPS[name] for name in _STEPS if name in changes), "fit cages")
        if options != self.options or after.regions is not self.regions:
            self.history.step(label, replace(after, options=options))

    # Undo and redo.

    def undo(self) -> str | None:
        """Undo the last step; return its label, or None if there is none."""
        return self.history.undo()

    def redo(self) -> str | None:
        """Redo the last step undone; return its label, or None if there is none."""
        return self.history.redo()

    def commit(self, label: str | None = None, *, join: bool = False) -> str | None:
        """End the drag as one step, and return its label; see `Timeline.commit`."""
        return self.history.commit(label, join=as_flag(join, "join"))

    def revert(self) -> None:
        """Cancel the drag and restore the state before it."""
        self.history.revert()

    def on_change(self, listener: Listener) -> Callable[[], None]:
        """Call *listener* with each `Change`, until the returned call; see `Timeline.on_change`."""
        return self.history.on_change(listener)

    def _released(self, state: State) -> State:
        """Return *state* as it is for other drags than the last pull."""
        if state.locality is None:
            return state
        released = partial(pulls.released, state, self.poses.vertices(state))
        return self.poses.memo.get("released", (state,), released)

    def _drag(
        self,
        state: State,
        targets: Mapping[str, FloatArray],
        moved: list[str],
        max_steps: int | None,
        *,
        grip: object = None,
    ) -> Solution:
        """Solve from *state* for *targets*, as part of a drag of the handles *moved*."""
        pose, solution = solving.solve(self.poses, state, targets, max_steps, live=True)
        self.poses.keep_solution(pose, solution)
        self.history.move(replace(state, pose=pose), *moved, grip=grip)
        return solution

    def _is_same_place(self, a: Pose, b: Pose) -> bool:
        """Tell whether the cages of two poses differ by rounding only."""
        p, q = np.concatenate(a.cage_vertices), np.concatenate(b.cage_vertices)
        return bool(np.abs(p - q).max() <= _ROUNDING * self.mesh.diagonal)


def _with_settings(settings: Mapping[str, Any], state: State) -> State:
    return replace(state, options=replace(state.options, **settings))


def _surface(surface: Any) -> Surface:
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import Surface

    if not isinstance(surface, Surface):
        require_mesh(surface)
    return surface  # type: ignore[no-any-return]
