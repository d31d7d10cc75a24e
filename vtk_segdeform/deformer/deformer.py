"""The whole method bound to one mesh: from targets to a pose.

    x = W~ p                                      mesh vertices from cage vertices      (2), (3)
    minimise  E(p) + sum_i omega_i |x_i - u_i|^2                                        (20)
    subject to  V(x) = V_0, or the same for every region                                (8), (9)

    mesh, regions, cages  ->  W~, E             `binding.Binding`, once
    fixed, handle         ->  H = L L^T         `gauss_newton.GaussNewton`, once per set of handles
    targets               ->  p                 `Deformer.solve`, at every motion of the mouse

A solve does the following; `gauss_newton` has the steps.

1. Divide a far motion of the handles into short ones (`waypoints`).
2. For each of them take the steps (21) to the minimum, starting from the last p.
3. Map the cages to the mesh, x = W~ p, and restore its exact volume (`exact_volume`).  A small mesh
   moves along Z, as in the steps.  For a large one the steps preserved the volume of a coarse
   surface only, so the mesh is scaled to V_0; if by more than 3e-5, step 2 is repeated with the
   coarse volumes of the scaled mesh as targets, at most 4 times.

Positions are in the coordinates of the solver, where the mesh has size 1; see `frame`.

Long because every option of the method is explained in the docstring of `Deformer`.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cached_property, partial
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray, is_number
from ..cages import Cage
from ..checks import all_of, as_callable, as_flag, as_path, require, shown
from ..energy import Energy, with_rotating_rows
from ..errors import ArgumentError, ConstraintError
from ..finish import CellEnergy, Finisher
from ..freezing import read_only
from ..geometry import Lids, lids_of, turned_over
from ..kernels import compiled_kernels, load_for, one_blas_thread
from ..mesh import Mesh, SurfacePoint, connected, new_crossings, require_mesh
from ..progress import Progress, part, tell
from ..regions import Regions, require_regions
from ..solver import (
    CONVERGED,
    LONGEST_MOVE,
    Anchors,
    Bodies,
    Contact,
    GaussNewton,
    ScaledSurface,
    Solution,
    SolverOptions,
    SolverResult,
    Status,
    Term,
    VolumeConstraint,
    Volumes,
    are_met,
    connected_sets,
    errors_at,
    moved_along,
    position_term,
    region_volumes,
    steps_to_volume,
    total_volume,
    waypoints,
)
from ..subspace import Passengers, Subspace, bind_passengers
from .arguments import (
    as_lids,
    check_distance,
    check_options,
    checked_constraints,
    checked_place,
    checked_targets,
    require_together,
    stacked_cages,
)
from .as_printed import PaperDeformer
from .binding import BindingInputs
from .binding_cache import cached_binding
from .constraints import Constraints, HandlePoint, Preserved, PulledPoints
from .frame import Frame
from .locality import Ring, SurfaceSamples
from .path import Path

_POSITION_WEIGHT = 15_000.0  # of a handle or fixed patch, times the scale of the shape energy
_ANCHOR_WEIGHT = 90.0  # kappa of a local deformer, times the same scale; see `locality`
_WAYPOINT_TOLERANCE, _WAYPOINT_STEPS = 1e-3, 12
_SOLVES_PER_SCALING = 4  # at most
_FRAME = 1e-5  # tolerance of the first solve for targets of a drag, which go on
_SPIKE, _FAR_PULL = 0.05, 0.3  # edges: higher spikes are resisted, of a pull by 0.3 diagonals
_VANISHED = 1e-12  # length of a direction of a volume, relative to the longest, that is rounding
_SIZES, _MOTIONS = 2.0, 1.5  # a pose moves at most so many mesh sizes and motions of targets
_SEEN = 10_000  # vertices, of which this is checked
_SCALED = 3e-5  # relative scale from which another solve follows
_ROUNDING = 1e-7  # relative scale that counts as rounding
_VOLUME_KEPT = 1e-9  # relative; a finish with a larger error is not used
_MET = 1e-3  # position error, in diagonals, below which a target is met
_SAME = 1e-9  # mesh sizes, within which cages are those of a solution
_CLEARANCE = 0.1  # mesh sizes: farther parts are not looked for
_LOOSE = 1e-4  # weight of the anchors of a loose component, in traces of the energy of its region
_FIRM = 0.02  # least curvature at the press of a pull under a load, times the scale of the energy
_BALANCED = 1e-9  # a load smaller than this, times the same, is rounding
_CONTACT_TOLERANCE, _CONTACT_STEPS = 1e-5, 300  # of a solve with active contacts
_TRIAL_MOTION = 1e-4  # mesh sizes
_SHARE_LEFT = 0.97  # of the progress bar, after each step
_BOUND = 0.95  # of the progress bar, before the trial step
# l of the finish, in spacings of the cages.  With 1, the worst 1 % of distortion in 24 poses of
# four bodies is 1.5 times that of as-rigid-as-possible, with 2, 1.3 times; poses of a dog are 2 %
# farther from the true ones.
_SPACINGS = 2.0
_STAYS = 0.1  # weight of `locality` from which a finish moves nothing: at 1.15 times the reach
_NONE, _NO_POINTS = np.zeros(0, dtype=np.int64), np.empty((0, 3))


class Deformer:
    """Deform one mesh by its handles, again and again, each time from the last solution.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    regions : Regions
        r overlapping regions of *mesh*.
    cages : sequence of r Cage
        One around each region.
    fixed, handle : (k,) int or (n,) bool
        Vertices that stay in place, and vertices that follow *targets*.  Sets of handle vertices
        that no edge connects are separate handles, moved and rotated independently.
    preserve_volume : bool
        Preserve the enclosed volume exactly, eq. (9); of several bodies, that of each.
    preserve_region_volumes : bool
        Preserve the volume of every region as well.
    lids : bool or None
        Whether an open surface encloses a volume, under lids over its borders.  None decides it for
        each connected part: a bottle does, a sheet does not (`geometry.lids`).  True: all do.
        False: only closed ones do.  Without any volume, as `has_volume` tells, nothing is
        preserved and volume changes are 0.
    stretch : float
        Strength of the stretch term relative to the detail term; 0 is the paper's energy.  A
        larger value distorts triangles slightly less, but changes the angles between them more.
    rotation_groups : int
        Number of rotation clusters.  In the paper each vertex has its own rotation.
    tolerance, max_steps : float, int
        The solver stops when a step moves the surface by less, root mean square, as a share of
        the mesh's size (the diameter of a ball about its centre that contains it); or after so
        many steps.
    avoid_contact : bool
        Keep parts of the surface that are not near each other at rest from crossing; see
        `solver.contact`.  Handles take precedence: if their targets, or fixed vertices, force a
        crossing, the solution crosses or its status is MISSED.  `Solution.crossings` tells.
    cache : path, optional
        A folder in which bindings are kept and found again; see `binding_cache`.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text, while binding.  It cancels by raising
        `Cancelled`.

    Raises
    ------
    ConstraintError
        If *fixed* or *handle* is no set of vertices of the mesh, or they share a vertex.
    CageError
        If there is not one cage per region, or a cage does not enclose its region.
    RegionError
        If *regions* belong to another mesh.
    Cancelled
        If *progress* raised it.
    """

    _lids: Lids
    _total_volume: VolumeConstraint
    _bodies: Bodies
    _known_volumes: dict[bytes | bool, Preserved]
    _constraints: Constraints
    _path: Path

    @one_blas_thread()
    def __init__(
        self,
        mesh: Mesh,
        regions: Regions,
        cages: Sequence[Cage],
        *,
        fixed: ArrayLike = (),
        handle: ArrayLike = (),
        preserve_volume: bool = True,
        preserve_region_volumes: bool = False,
        lids: bool | None = None,
        stretch: float = 1.0,
        rotation_groups: int = 300,
        tolerance: float = 1e-7,
        max_steps: int = 500,
        avoid_contact: bool = False,
        cache: str | os.PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> None:
        require_mesh(mesh)
        require_regions(regions, mesh)
        cages = all_of(cages, Cage, "cages")
        check_options(stretch, rotation_groups)
        load_for(mesh.n_vertices)
        self._options = SolverOptions(tolerance, max_steps)
        self._preserve_volume = as_flag(preserve_volume, "preserve_volume")
        self._preserve_region_volumes = as_flag(preserve_region_volumes, "preserve_region_volumes")
        self._avoid_contact = as_flag(avoid_contact, "avoid_contact")
        self._lids_option = as_lids(lids)
        folder = None if cache is None else as_path(cache, "cache")

        self.mesh, self.regions, self.cages = mesh, regions, cages
        self._frame = Frame.of(mesh.vertices)
        self._rest = mesh.with_vertices(self._frame.inward(mesh.vertices))
        inside = [self._frame.inward(cage.vertices) for cage in cages]
        self._rest_cages = np.concatenate([_NO_POINTS, *inside])
        inputs = BindingInputs(
            self._rest, regions, cages, self._rest_cages, stretch, rotation_groups
        )
        self._binding = cached_binding(inputs, folder, part(progress, 0.0, _BOUND))

        at_origin = self._frame.about_origin(mesh.vertices)
        self._rest_pose = mesh.with_vertices(at_origin) if self._frame.is_far else mesh
        self._enclose()
        of_component, _ = self._linked_parts
        self._samples = SurfaceSamples.of(self._rest, self._binding.coarse_volume, of_component)
        self._constrain(fixed, handle)
        if compiled_kernels(mesh.n_vertices):
            tell(progress, _BOUND, "taking a trial step")
            self._take_trial_step()
        tell(progress, 1.0, "ready")

    @staticmethod
    def as_printed(
        mesh: Mesh,
        regions: Regions,
        cages: Sequence[Cage | Mesh],
        *,
        fixed: ArrayLike,
        handle: ArrayLike,
    ) -> PaperDeformer:
        """Return the paper's method as printed, for comparison; see `deformer.as_printed`."""
        return PaperDeformer(mesh, regions, cages, fixed=fixed, handle=handle)

    @one_blas_thread()
    def hold(
        self,
        *,
        fixed: ArrayLike = (),
        handle: ArrayLike = (),
        fixed_at: ArrayLike | None = None,
        preserve_volume: bool | None = None,
        preserve_region_volumes: bool | None = None,
        lids: bool | EllipsisType | None = ...,
        avoid_contact: bool | None = None,
    ) -> Deformer:
        """Return a deformer at rest with other constraints, which shares the binding of this one.

        ``preserve_volume=None``, ``preserve_region_volumes=None``, ``lids=...`` and
        ``avoid_contact=None`` are the values of this deformer.  The fixed vertices stay at
        *fixed_at* (f, 3), in the order of the attribute `fixed`, by default at rest.
        """
        other = self._shared()
        if preserve_volume is not None:
            other._preserve_volume = as_flag(preserve_volume, "preserve_volume")
        if preserve_region_volumes is not None:
            other._preserve_region_volumes = as_flag(
                preserve_region_volumes, "preserve_region_volumes"
            )
        if avoid_contact is not None:
            other._avoid_contact = as_flag(avoid_contact, "avoid_contact")
        if lids is not ... and as_lids(lids) is not self._lids_option:
            other._lids_option = as_lids(lids)
            other._enclose()
        other._constrain(fixed, handle, fixed_at)
        return other

    @one_blas_thread()
    def local(
        self, vertex: int | SurfacePoint, reach: float, spread: float, *, follows: float = 0.0
    ) -> Deformer:
        """Return a deformer in the same pose that deforms the surface near *vertex* only.

        Solves keep the rest of the surface where it is now, softly; see `locality`.  Nothing moves
        before a handle does: forces that are not in balance at this pose, because another part of
        the surface or other vertices were held before, remain as a constant load.  A limb under a
        load can be like a weight on a tip, so all of the surface is then held where it is, just
        firmly enough that the pose is stable.

        Parameters
        ----------
        vertex : int or SurfacePoint
            The grabbed vertex, or another point of the surface.  If its `SurfacePoint.vertex` is
            in a handle, the target of that vertex moves the point: by as much as the vertex would
            move from where it is now.
        reach : float
            Distance along the surface, in the mesh's unit, up to which the surface is free.  Beyond
            it the surface is held the more, the farther away; from 4 times this distance it hardly
            moves.  Infinite: all of it is free.
        spread : float
            Distance from a handle of one vertex within which a finish leaves the surface as the
            cages have it.
        follows : float
            0 to 1: parts of the surface beyond the reach, such as the hand if the elbow is grabbed,
            follow if their area is less than this share of the largest such part.
        """
        point = checked_place(self.mesh, vertex)
        is_infinite = isinstance(reach, float) and reach == np.inf
        if not (is_infinite or (is_number(reach) and reach > 0.0)):
            raise ConstraintError(f"reach must be a positive number; got {shown(reach)}")
        if not (is_number(spread) and spread > 0.0):
            raise ConstraintError(f"spread must be a positive number; got {shown(spread)}")
        if not (is_number(follows, 0.0) and follows <= 1.0):
            raise ConstraintError(f"follows must be a number from 0 to 1; got {shown(follows)}")
        near = point, float(reach) / self._frame.size, follows
        weight = _ANCHOR_WEIGHT * self._binding.energy.scale
        quadratic = weight * self._samples.quadratic(*near) + self._of_loose_parts()
        before, p = self._constraints.solver, self._path.p
        anchors = Anchors(quadratic, p, np.zeros_like(p))
        handles = self._points_of_handles(point)
        own_rows = np.array([self._row_of(each.point) for each in handles])
        own_rows = own_rows.reshape(-1, self.subspace.n_columns)
        targets = np.array([each.target for each in handles], dtype=np.int64)
        pulled = PulledPoints(
            places=np.array([each.place for each in handles], dtype=np.int64),
            targets=targets,
            points=tuple(each.point for each in handles),
            levers=(own_rows - self.subspace.at(self.handle[targets])) @ p,
            spread=spread,
        )
        rows = before.positions.rows.copy()
        rows[pulled.places] = own_rows
        positions = before.positions.local(rows, anchors)
        solver = replace(before, positions=positions)
        energy = self._with_rings(pulled, own_rows, solver)
        solver = replace(solver, energy=energy)
        load = solver.unbalanced(p, pulled.moved(self._constraints.places(self._path.targets)))
        least = _FIRM * energy.scale
        is_loaded = float(np.abs(load).max()) > _BALANCED * energy.scale
        steady = solver.steadying(p, least) if is_loaded else 0.0
        anchors = Anchors(quadratic + steady * energy.mass, p, load)
        solver = replace(solver, positions=positions.local(rows, anchors))
        other = self._shared()
        keeps = self._samples.weights(*near)
        for each in pulled.points:
            keeps[self._samples.distances(each) < spread / self._frame.size] = np.inf
        other._constraints = replace(self._constraints, solver=solver, pulled=pulled, keeps=keeps)
        other._begin(p, self._path.targets)
        return other

    def _points_of_handles(self, point: SurfacePoint) -> list[HandlePoint]:
        """Return the points that handles of one vertex move, and *point* if its vertex is alone."""
        found, set_of = [], self._constraints.solver.positions.set_of
        for number, ids in enumerate(self._constraints.handles):
            places = np.flatnonzero(set_of == number)
            for place, target in zip(places, ids, strict=False):
                vertex = int(self.handle[target])
                is_grabbed = vertex == point.vertex and len(places) == len(ids)
                own = point if is_grabbed else SurfacePoint.at_vertex(vertex)
                if len(ids) == 1 or not own.is_vertex:
                    found.append(HandlePoint(int(place), int(target), own))
        return found

    def _row_of(self, point: SurfacePoint) -> FloatArray:
        """Return the row of W~ of *point*, (m,)."""
        return np.asarray(np.array(point.shares) @ self.subspace.at(np.array(point.corners)))

    def _with_rings(
        self, pulled: PulledPoints, own_rows: FloatArray, solver: GaussNewton
    ) -> Energy:
        """Return the energy of *solver* with the rings of points that it would pull as spikes.

        *own_rows* (q, m) are those of the points; see `locality`.
        """
        energy = self._binding.energy
        held = np.concatenate([self.fixed, self.handle])
        solver = replace(solver, energy=energy)
        far = _FAR_PULL * self.mesh.diagonal / self._frame.size
        most = _ANCHOR_WEIGHT * energy.scale
        for point, row in zip(pulled.points, own_rows, strict=True):
            ring = Ring.around(self.mesh, self._rest.vertices, point)
            if ring is None or np.isin(ring.vertices, held[held != point.vertex]).any():
                continue
            rows = ring.combinations @ self.subspace.at(ring.vertices)
            (own, both), (_, offset) = solver.compliance(np.stack([row, rows[0]]))
            excess = far / ring.edge * abs(both) / own / _SPIKE - 1.0  # to first order
            if excess > 0.0:
                strength = most * excess / max(excess, most * (offset - both * both / own))
                energy = with_rotating_rows(energy, rows, ring.offsets, strength * ring.weights)
        return energy

    def copy(self) -> Deformer:
        """Return a deformer in the same pose that continues independently."""
        other = self._shared()
        other._path = self._path.copy()
        return other

    __copy__ = copy

    @contextmanager
    def restoring(self) -> Iterator[None]:
        """Return to the present state, bit for bit, if the ``with`` block raises."""
        before = self.copy()
        try:
            yield
        except BaseException:
            vars(self).update(vars(before))
            raise

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {name: read_only(state[name]) for name in ("fixed", "handle")})

    def _shared(self) -> Deformer:
        """Return another deformer that shares all parts with this one."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @property
    def subspace(self) -> Subspace:
        """W~; ``subspace.map`` computes mesh vertices from stacked cage vertices."""
        return self._binding.energy.subspace

    @property
    def has_volume(self) -> bool:
        """Whether the mesh encloses a volume, with its lids if it is open."""
        return self._total_volume.has_volume

    @property
    def preserved_volumes(self) -> tuple[VolumeConstraint, ...]:
        """The volumes that every pose preserves: of each body, or of each region."""
        return self._constraints.preserved.constraints

    @property
    def step_volumes(self) -> Volumes:
        """The volumes that the solver's steps preserve, and the surface they are computed on."""
        return self._constraints.preserved.volumes

    @one_blas_thread()
    def passengers(self, points: ArrayLike, *, progress: Progress | None = None) -> Passengers:
        """Bind other points (k, 3) to the cages, to be moved with them; see `passengers`."""
        weights = self.regions.weights
        return bind_passengers(self.mesh, weights, self.cages, points, progress=progress)

    @one_blas_thread()
    def carry(self, points: ArrayLike) -> FloatArray:
        """Return the positions of other points (k, 3), given at rest, in the last pose.

        For many poses keep the `passengers`: most of the time is spent on binding the points.
        """
        p = self._frame.outward(self._path.p)
        return self.passengers(points).moved([p[columns] for columns in self.subspace.columns])

    @one_blas_thread()
    def surface(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return the mesh (n, 3) with its cages at *cage_vertices*, (m_r, 3) each: x = W~ p."""
        offsets = stacked_cages(self.cages, cage_vertices) - self._frame.centre
        return self._frame.in_scene(self._map(offsets))

    @one_blas_thread()
    def rotations(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return how the mesh with these cages has rotated near each vertex since rest, (n, 3, 3).

        These are the rotations of the shape energy, blended smoothly.
        """
        p = stacked_cages(self.cages, cage_vertices) - self._frame.centre
        return self._binding.energy.vertex_rotations(p / self._frame.size)

    def reset(self) -> None:
        """Return to rest: the next solve starts from there."""
        self._begin(self._rest_cages, self._rest.vertices[self.handle])

    def resume(self, cage_vertices: Sequence[ArrayLike], targets: ArrayLike) -> None:
        """Continue from an earlier pose: its `Solution.cage_vertices` and its targets."""
        p = self._frame.inward(stacked_cages(self.cages, cage_vertices))
        self._begin(p, self._frame.inward(checked_targets(targets, len(self.handle))))

    @one_blas_thread()
    def solve(
        self,
        targets: ArrayLike,
        *,
        max_steps: int | None = None,
        progress: Progress | None = None,
    ) -> Solution:
        """Return the pose with the handle vertices at *targets*.

        Parameters
        ----------
        targets : (k, 3) float
            One for each vertex of `handle`, in its order.  A far motion goes through waypoints, so
            that the mesh does not fold.  Each handle turns the shorter way from its targets of the
            last solve.  So the body is wound up by half a turn or more if it is solved for targets
            on the way, each less than half a turn from the last ones.
        max_steps : int, optional
            Instead of the deformer's own limit, from the last waypoint on: a drag may stop early
            and continue with the next event.
        progress : Progress, optional
            Called before every step; may raise `Cancelled`.  Then, as after any other exception in
            it, the deformer is as it was before the call.

        Raises
        ------
        ConstraintError
            If *targets* has the wrong shape, holds NaN or infinite coordinates, or is so far away,
            from the mesh or from the fixed vertices, that it must be in another unit.
        """
        goal = self._frame.inward(checked_targets(targets, len(self.handle)))
        check_distance(goal)
        require_together(self._rest, goal, self._constraints.fixed_box)
        before = self._path.copy()
        with nullcontext() if progress is None else self.restoring():
            solution = self._solve(goal, max_steps, _counting(progress))
        if self._is_plausible(solution.vertices, goal, before.p):
            return solution
        self._path = before
        return self._missed(goal, solution)

    @one_blas_thread()
    def finish(self, solution: Solution, *, progress: Progress | None = None) -> Solution:
        """Return the pose of the last solve, finished on the mesh itself; see `finish`.

        As rigid as possible within two spacings of the cages, and where these are beyond it.  This
        takes as long as 5 to 50 iterations of as-rigid-as-possible: triangles are less distorted,
        and the handles and fixed vertices are exact.  The volume is preserved as before.  The next
        solve starts from the cages, as if the pose had not been finished.  Of a deformer made by
        `local` only the surface within the reach is finished: it stays from 1.15 times the reach
        on, and around a handle of one vertex, which would become a bump.  A pose that would lose
        its volume, because hardly a vertex is free, is returned unchanged.

        A deformer that avoids contact separates parts that cross, and keeps others from crossing.

        Parameters
        ----------
        solution : Solution
            That of the last solve, or a finished one, which is finished further, near the same pose
            of the cages.
        progress : Progress, optional
            Called before every step; may raise `Cancelled`.

        Returns
        -------
        Solution
            With the finished `vertices`; ``cage_vertices`` are those of *solution*, and ``merits``
            those of the last steps.  The status is measured on the finished mesh: it is STEP_LIMIT
            where finishing it again would still move it.

        Raises
        ------
        ArgumentError
            If *solution* is not a pose of the last solve.
        """
        require(solution, Solution, "solution")
        frame, cages = self._frame, [each.shape for each in solution.cage_vertices]
        if cages != [cage.vertices.shape for cage in self.cages] or not (
            _largest(np.concatenate(solution.cage_vertices) - frame.outward(self._path.p))
            <= _SAME * frame.size
        ):
            raise ArgumentError("solution is not the pose of the last solve; resume it first")
        held = np.zeros(self.mesh.n_vertices, dtype=bool)
        held[self.fixed] = held[self.handle] = True
        in_faces = [each for each in self._constraints.pulled.points if not each.is_vertex]
        held[[each.vertex for each in in_faces]] = False
        places = np.array(self._rest_pose.vertices)
        places[self.fixed] = frame.about_origin(self._constraints.fixed_at)
        places[self.handle] = frame.about_origin(frame.outward(self._path.targets))
        unfinished = solution.vertices if solution.unfinished is None else solution.unfinished
        pose = start = frame.about_origin(unfinished)
        if solution.is_finished:
            start = frame.about_origin(solution.vertices)
        keeps = self._constraints.keeps
        if keeps is not None:
            away = self._samples.smooth_at_vertices(np.minimum(np.sqrt(keeps / _STAYS), 1.0))
            stays = ((away == 1.0) | self._is_near_pulled_points()) & ~held
            places[stays] = pose[stays]
            held |= stays
            self._place_points(places, stays)
        given = self._rest_pose, self._cell_energy, held, self.preserved_volumes
        finisher = Finisher(*given, self._cage_weights, progress, avoid_contact=self._avoid_contact)
        found = finisher.run(pose, places[held], progress, start=start)
        # Without enough free vertices exact handles and exact volumes exclude each other.
        off = [abs(each.relative(found.vertices)) for each in self.preserved_volumes]
        if max(off, default=0.0) > _VOLUME_KEPT:
            found = replace(found, vertices=start)
        is_start = found.vertices is start
        if is_start and not solution.is_finished:
            return solution
        remaining = found.remaining / self.mesh.diagonal
        finished = replace(
            solution,
            vertices=solution.vertices if is_start else frame.in_scene(found.vertices),
            steps=solution.steps + found.steps,
            merits=found.merits,
            errors=partial(self._errors, self._path.targets),
            volume=partial(self._total_volume.relative, found.vertices),
            region_volumes=self._region_volume_changes,
            remaining=remaining,
            unfinished=unfinished,
            unmoved=self._constraints.unmoved,
        )
        return replace(finished, status=self._missed_status if _is_off(finished) else found.status)

    def _is_near_pulled_points(self) -> BoolArray:
        """Return which vertices are within the spread of pulled points, or next to these, (n,).

        Triangles resist no bending, so the finish would concentrate the load of a pulled point in a
        crease around it.  The cages distribute it, so their pose is kept here.
        """
        x, pulled = self._rest_pose.vertices, self._constraints.pulled
        near = np.zeros(len(x), dtype=bool)
        for each in pulled.points:
            near |= np.linalg.norm(x - each.at(x), axis=1) <= pulled.spread
            corners = list(each.corners)
            near[corners] = near[self.mesh.adjacency[corners].indices] = True
        return near

    def _place_points(self, places: FloatArray, stays: BoolArray) -> None:
        """Move corners that stay at *places* (n, 3) so that pulled points are at their targets."""
        pulled, frame = self._constraints.pulled, self._frame
        goals = frame.outward(self._path.targets[pulled.targets] + pulled.levers)
        for point, goal in zip(pulled.points, frame.about_origin(goals), strict=True):
            if not point.is_vertex:
                corners, shares = np.array(point.corners), np.array(point.shares)
                free = stays[corners]
                places[corners[free]] += (goal - point.at(places)) / shares[free].sum()

    @cached_property
    def _cage_weights(self) -> FloatArray:
        """Weights w (n,) of `finish.finisher`: 1 / 4 of a cage vertex, over its region by area."""
        own = self.regions.weights * self.mesh.vertex_areas
        counts = np.array([len(cage.vertices) for cage in self.cages])
        areas = own.sum(axis=1)
        density = np.divide(counts, areas, where=areas > 0.0, out=np.zeros(len(areas)))
        return np.asarray(density @ own) / _SPACINGS**2

    @cached_property
    def _cell_energy(self) -> CellEnergy:
        return CellEnergy.of(self._rest_pose, self.mesh.n_vertices / len(self._rest_cages))

    def _is_plausible(self, x: FloatArray, goal: FloatArray, before: FloatArray) -> bool:
        """Tell whether no vertex of *x* (n, 3) is farther away than a motion to *goal* explains.

        Nor than in the pose with cages *before*, wherever it is.
        """
        some, size = slice(None, None, 1 + len(x) // _SEEN), self._frame.size
        rest = self.mesh.vertices[some]
        moved = _largest(goal - self._rest.vertices[self.handle])
        limit = size * (_SIZES + _MOTIONS * moved)
        if _largest(x[some] - rest) <= limit:
            return True
        at = self._frame.in_scene(self._map(before * size))
        return _largest(x[some] - rest) <= _largest(at[some] - rest)

    def _missed(self, goal: FloatArray, solution: Solution) -> Solution:
        """Return the current pose instead of *solution*, which is far from every reasonable one."""
        p = self._path.p * self._frame.size
        x = self._frame.in_scene(self._map(p))
        return replace(
            solution,
            vertices=x,
            cage_vertices=tuple(p[own] + self._frame.centre for own in self.subspace.columns),
            status=Status.MISSED,
            errors=partial(self._errors, goal),
            volume=partial(self._total_volume.relative, x),
            remaining=np.inf,
        )

    def _solve(
        self, goal: FloatArray, max_steps: int | None, progress: Progress | None
    ) -> Solution:
        limit = self._options.max_steps if max_steps is None else max_steps
        options = replace(self._options, max_steps=limit, progress=progress)
        path, is_live = self._path, max_steps is not None
        is_frame = is_live and not np.array_equal(goal, path.targets)
        if is_frame:
            options = replace(options, tolerance=max(options.tolerance, _FRAME))
        steps = self._follow_waypoints(goal, options)
        path.targets = goal
        result, x, more = self._solve_once(goal, options)
        if is_frame and result.status is Status.CONVERGED:
            result = replace(result, status=Status.STEP_LIMIT)
        solution = self._solution(result, x, steps + more)
        return solution if is_live else self._with_remaining(solution, goal)

    def _with_remaining(self, solution: Solution, goal: FloatArray) -> Solution:
        """Return the *solution* for *goal* (k, 3) with its estimate, and the status by that."""
        solver, p = self._path.solver, self._path.end
        if solution.status is Status.STEP_LIMIT:
            return solution
        remaining = solver.remaining(p, self._places(goal)) * self._frame.size / self.mesh.diagonal
        is_stalled = solution.status is Status.STALLED
        status = Status.STALLED if is_stalled else Status.STEP_LIMIT
        if remaining <= CONVERGED:
            status = self._or_missed(Status.CONVERGED, solution)
        return replace(solution, remaining=remaining, status=status)

    def _solve_once(
        self, goal: FloatArray, options: SolverOptions
    ) -> tuple[SolverResult, FloatArray, int]:
        """Solve for *goal* (k, 3) with exact volume; return the mesh and the steps as well."""
        contact = self._constraints.contact
        if contact is not None and contact.is_active(self._path.end):
            tolerance = max(options.tolerance, _CONTACT_TOLERANCE)
            steps = min(options.max_steps, _CONTACT_STEPS)
            options = replace(options, tolerance=tolerance, max_steps=steps)
        result = self._path.solve(self._places(goal), options)
        steps = result.steps
        x, scaled_by = self._with_exact_volume(result)
        for _ in range(_SOLVES_PER_SCALING):
            if scaled_by <= _SCALED or result.status is Status.STEP_LIMIT:
                break
            result = self._path.solve(self._places(goal), options)
            steps += result.steps
            x, scaled_by = self._with_exact_volume(result)
        return result, x, steps

    def _places(self, targets: FloatArray) -> FloatArray:
        """Return the places (s, 3) of all sets for *targets* (k, 3), pulled points included."""
        return self._constraints.pulled.moved(self._constraints.places(targets))

    def _follow_waypoints(self, goal: FloatArray, options: SolverOptions) -> int:
        """Move through the waypoints before *goal*; return the number of steps."""
        options = replace(options, tolerance=_WAYPOINT_TOLERANCE, max_steps=_WAYPOINT_STEPS)
        steps = 0
        for targets in self._way_to(goal):
            steps += self._path.solve(self._places(targets), options).steps
        return steps

    def _way_to(self, goal: FloatArray) -> Iterator[FloatArray]:
        """Yield the waypoints (k, 3) before *goal*; near a contact they are close together."""
        handles, start = self._constraints.handles, self._path.targets
        shortest = self._longest_leg(0.0)
        if _largest(goal - start) <= shortest * LONGEST_MOVE:
            shortest = 1.0
        way = [start, *waypoints(start, goal, handles, shortest)]
        done, last, most = 0, len(way) - 1, round(1.0 / shortest)
        while done + 1 < last:
            ahead = min(most, last - done)
            if ahead > 1 and most > 1:
                length = self._longest_leg(_CLEARANCE)
                while ahead > 1 and _largest(way[done + ahead] - way[done]) > length * LONGEST_MOVE:
                    ahead -= 1
            done += ahead
            if done < last:
                yield way[done]

    def _longest_leg(self, most: float) -> float:
        """Return how far apart waypoints may be at this pose, as a share of the usual distance.

        With contacts it is little more than the clearance between parts, which is looked for up to
        *most*: a part that has crossed another by less is pushed back.
        """
        contact = self._constraints.contact
        if contact is None or 0.0 < most <= contact.surface.spacing:
            return 1.0
        clearance = contact.clearance(self._path.end, most) if most else 0.0
        spacing = contact.surface.spacing
        return min(1.0, max(clearance + 0.5 * spacing, spacing) / LONGEST_MOVE)

    def _with_exact_volume(self, result: SolverResult) -> tuple[FloatArray, float]:
        """Restore the exact volumes; return the mesh and by how much it was scaled.

        The latter is 0 if the mesh was moved along the directions of the solver instead.
        """
        p, directions, size = result.p, result.directions, self._frame.size
        if not directions:
            return self._map(p * size), 0.0
        preserved, _, scaled = self._constraints.preserved
        if scaled is not None:
            return self._scaled(scaled)
        lengths = np.array([np.abs(each).max() for each in directions])
        if lengths.min() > _VANISHED * lengths.max():
            x = self._moved_to_volume(preserved, directions)
        else:
            x = self._map(p * size)
        if len(preserved) > 1 and not are_met(preserved, x):
            # Of small bodies the coarse volumes, and so these directions, may vanish.
            gradients = self.subspace.adjoints([each.gradient(x) / size for each in preserved])
            x = self._moved_to_volume(preserved, self._path.solver.directions(gradients))
        return x, 0.0

    def _moved_to_volume(
        self, preserved: Sequence[VolumeConstraint], directions: Sequence[FloatArray]
    ) -> FloatArray:
        """Move the cages along *directions* (m, 3) to the exact volumes; return the mesh."""
        size = self._frame.size
        path = self._path
        paths = self._map(path.p * size, [z * size for z in directions])
        steps = steps_to_volume(preserved, paths)
        path.p = path.p + sum(tk * z for tk, z in zip(steps, directions, strict=True))
        return moved_along(paths, steps)

    def _scaled(self, surface: ScaledSurface) -> tuple[FloatArray, float]:
        """Scale the mesh and its cages to the exact volume; return the mesh and by how much."""
        frame, anchors = self._frame, self._constraints.anchors
        p = self._path.p
        moves = (p - self._rest_cages) * frame.size
        x, scales = surface.scaled(moves, frame.centre - frame.origin + anchors)
        inside = (anchors / frame.size)[surface.body_of_column]
        p = self._path.p = inside + scales[surface.body_of_column, None] * (p - inside)
        scaled_by = float(np.abs(scales - 1.0).max())
        if scaled_by > _ROUNDING:
            self._path.continue_from(p)
        return x, scaled_by

    def _map(self, offsets: FloatArray, directions: Sequence[FloatArray] = ()) -> FloatArray:
        """Return x for cages at *offsets* (m, 3) from the centre; and W~ z of *directions* beside.

        x is rest + W~ (p - rest), which is W~ p, but at rest exact however W~ is rounded.
        """
        moves = offsets - self._rest_cages * self._frame.size
        return self.subspace.map(np.hstack([moves, *directions]), self._rest_pose.vertices)

    def _preserved_volumes(self) -> Preserved:
        """Return the volumes to preserve for the current handle."""
        regions = self.has_volume and self._preserve_region_volumes
        is_whole = self.has_volume and self._preserve_volume and not regions
        numbers = self._bodies.numbers(self.handle) if is_whole else _NONE
        key = numbers.tobytes() if is_whole else regions
        if (found := self._known_volumes.get(key)) is None:
            preserved = self._region_volumes if regions else ()
            if is_whole:
                preserved = self._bodies.constraints(numbers)
            coarse, scaled = self._binding.coarse_volume, None
            volumes = coarse.volumes(preserved, self._rest.vertices)
            is_large = self.mesh.n_vertices > sizes.SCALED_VOLUME and coarse.cells is not None
            if is_whole and is_large:
                body, rest = numbers[self.mesh.components], self._rest_pose.vertices
                scaled = ScaledSurface.of(self.subspace, rest, preserved, body)
            found = self._known_volumes[key] = Preserved(preserved, volumes, scaled)
        return found

    @cached_property
    def _region_volumes(self) -> tuple[VolumeConstraint, ...]:
        return region_volumes(self._rest_pose, self.regions.labels, self._lids)

    def _enclose(self) -> None:
        """Compute the volume enclosed under the current lids."""
        vars(self).pop("_region_volumes", None)
        self._known_volumes = {}
        self._lids = lids_of(self._rest_pose, self._lids_option)
        self._total_volume = total_volume(self._rest_pose, self._lids)
        self._bodies = Bodies(self._rest_pose, self._total_volume, self._lids)

    def _region_volume_changes(self, x: FloatArray) -> FloatArray:
        return np.array([each.relative(x) for each in self._region_volumes])

    def _constrain(
        self, fixed: ArrayLike, handle: ArrayLike, places: ArrayLike | None = None
    ) -> None:
        """Set fixed vertices and handles, factor their problem and return to rest.

        Fixed vertices stay at their *places* (f, 3), by default at rest.
        """
        mesh, rest, binding = self.mesh, self._rest.vertices, self._binding
        self.fixed, self.handle = map(read_only, checked_constraints(mesh, fixed, handle))
        handles = connected_sets(mesh, self.handle)
        patches = connected_sets(mesh, self.fixed)
        # The sets one after the other, each in the order of `handle` or `fixed`.
        ids = np.concatenate([self.handle, self.fixed])
        order = [*handles, *(len(self.handle) + patch for patch in patches)]
        in_order = sparse.eye_array(len(ids)).tocsr()[np.concatenate([_NONE, *order])]
        weight = _POSITION_WEIGHT * binding.energy.scale
        positions = position_term(
            self.subspace, self._rest, [ids[places] for places in order], weight
        )
        if (loose := self._of_loose_parts()).any():
            start = self._rest_cages
            anchors = Anchors(loose, start, np.zeros_like(start))
            positions = positions.local(positions.rows, anchors)
        gathered = in_order if positions.mean is None else positions.mean @ in_order
        preserved = self._preserved_volumes()
        contact = self._contact_of()
        terms: tuple[Term, ...] = () if contact is None else (contact,)
        fixed_in_scene, inside = mesh.vertices[self.fixed], rest[self.fixed]
        if places is not None:
            fixed_in_scene = checked_targets(places, len(self.fixed), "fixed_at", "fixed")
            inside = self._frame.inward(fixed_in_scene)
            check_distance(inside)
        fixed_at = inside if len(self.fixed) else np.zeros((1, 3))
        box = np.stack([fixed_at.min(axis=0), fixed_at.max(axis=0)])
        self._constraints = Constraints(
            fixed_at=fixed_in_scene,
            handles=handles,
            places_of_targets=gathered[:, : len(self.handle)].tocsr(),
            places_of_fixed=gathered[:, len(self.handle) :] @ inside,
            fixed_box=box[: 2 * len(self.fixed)],
            anchors=self._anchors(preserved.scaled, inside),
            preserved=preserved,
            solver=GaussNewton(binding.energy, positions, preserved.volumes, terms=terms),
            contact=contact,
            pulled=PulledPoints(),
            unmoved=self._unmoved_parts(),
        )
        self.reset()

    def _of_loose_parts(self) -> FloatArray:
        """Return the quadratic (m, m) of anchors for components without fixed vertices and handles.

        Nothing determines where they are.  Those that share no region with other components stay.
        The others follow these; the anchors are so weak, compared with the energy of the least
        region that they are in, that they only prevent drifting.
        """
        component, samples, energy = self.mesh.components, self._samples, self._binding.energy
        ids, inside = np.concatenate([self.handle, self.fixed]), self.regions.components
        if not len(ids) or inside.shape[1] == 1:
            return np.zeros_like(energy.quadratic)
        of_component, of_region = self._linked_parts
        has_ids = np.zeros(len(of_component), dtype=bool)
        has_ids[component[ids]] = True
        stays = ~np.isin(of_region, of_component[has_ids])
        own = [len(cage.vertices) for cage in self.cages]
        quadratic = np.diag(np.where(np.repeat(stays, own), energy.scale, 0.0))
        least = np.where(inside, self._traces[:, None], np.inf).min(axis=0)
        of_sample = np.empty(len(samples.points), dtype=np.int64)
        of_sample[samples.cells] = component
        loose = ~has_ids[of_sample]
        weight = _LOOSE * (least / np.bincount(of_sample, minlength=len(least)))[of_sample[loose]]
        rows = samples.rows[loose]
        return np.asarray(quadratic + (rows.T * weight) @ rows)

    def _unmoved_parts(self) -> IntArray:
        """Return `Solution.unmoved`."""
        ids = np.concatenate([self.handle, self.fixed])
        if not len(ids):
            return _NONE
        of_component, _ = self._linked_parts
        return np.flatnonzero(~np.isin(of_component, of_component[self.mesh.components[ids]]))

    @cached_property
    def _linked_parts(self) -> tuple[IntArray, IntArray]:
        """The part of each component of the mesh (c,) and each region (r,), linked by sharing."""
        region, component = np.nonzero(self.regions.components)
        n_regions, count = self.regions.components.shape
        part = connected(count + n_regions, component, count + region)
        return part[:count], part[count:]

    @property
    def _traces(self) -> FloatArray:
        """The trace of the energy in the cage vertices of each region, (r,)."""
        starts = np.cumsum([0, *(len(cage.vertices) for cage in self.cages[:-1])])
        return np.add.reduceat(np.diag(self._binding.energy.quadratic), starts)

    def _anchors(self, surface: ScaledSurface | None, fixed_at: FloatArray) -> FloatArray:
        """Return the centres (c, 3) about which bodies are scaled: means of fixed vertices, if any.

        From the centre of the frame, in scene units; *fixed_at* (k, 3) in solver coordinates.
        """
        if surface is None:
            return np.zeros((1, 3))
        if len(surface.middles) == 1:
            centres = np.zeros((1, 3))
        else:
            centres = surface.middles - (self._frame.centre - self._frame.origin)
        body = surface.body[self.fixed]
        for k in np.unique(body):
            centres[k] = fixed_at[body == k].mean(axis=0) * self._frame.size
        return centres

    def _contact_of(self) -> Contact | None:
        """Return the term that keeps parts of the surface apart, if they are to be."""
        if not self._avoid_contact:
            return None
        held = np.zeros(self.mesh.n_vertices)
        held[self.fixed] = held[self.handle] = 1.0
        cells = self._samples.cells
        is_held = np.bincount(cells, held) >= 0.5 * np.bincount(cells)
        surface, scale = self._samples.contact_surface, self._binding.energy.scale
        return Contact.of(surface, is_held, scale)

    def _begin(self, p: FloatArray, targets: FloatArray) -> None:
        """Begin at cages *p* (m, 3), which are a pose for *targets* (k, 3)."""
        constraints = self._constraints
        self._path = Path(constraints.solver.fresh(), p, p, targets)
        if constraints.preserved.scaled is not None and p is not self._rest_cages:
            self._path.continue_from(p)

    def _take_trial_step(self) -> None:
        """Compile the kernels, or load them, before the first frame needs them."""
        handle = [0]
        targets = self.mesh.vertices[handle] + _TRIAL_MOTION * self._frame.size
        self.hold(handle=handle).solve(targets, max_steps=1)

    def _solution(self, result: SolverResult, x: FloatArray, steps: int) -> Solution:
        p = self._path.p * self._frame.size
        x = self._frame.in_scene(x)
        rest, faces = self.mesh.vertices, self.mesh.faces
        solution = Solution(
            vertices=x,
            cage_vertices=tuple(p[own] + self._frame.centre for own in self.subspace.columns),
            steps=steps,
            status=result.status,
            merits=result.merits,
            errors=partial(self._errors, self._path.targets),
            volume=partial(self._total_volume.relative, x),
            region_volumes=self._region_volume_changes,
            crossed=partial(new_crossings, rest=rest, faces=faces),
            folded=partial(turned_over, rest=rest, faces=faces),
            remaining=0.0 if result.status is Status.CONVERGED else np.inf,
            unmoved=self._constraints.unmoved,
        )
        return replace(solution, status=self._or_missed(result.status, solution))

    def _or_missed(self, status: Status, solution: Solution) -> Status:
        """Return *status*, but that handles are off if a converged *solution* misses its places."""
        return self._missed_status if status is Status.CONVERGED and _is_off(solution) else status

    @property
    def _missed_status(self) -> Status:
        is_free = len(self.handle) + len(self.fixed) < self.mesh.n_vertices
        return Status.MISSED if is_free else Status.ALL_HELD

    def _errors(self, targets: FloatArray, x: FloatArray) -> tuple[float, ...]:
        """Return `Solution.handle_error`, that of the pulled points included, and `fixed_error`."""
        places, pulled = self._frame.outward(targets), self._constraints.pulled
        own = self.handle[pulled.targets]
        places[pulled.targets] += x[own] + self._frame.size * pulled.levers - pulled.at(x)
        at = places, self._constraints.fixed_at
        return errors_at((self.handle, self.fixed), at, self.mesh.diagonal, x)


def _is_off(solution: Solution) -> bool:
    """Return whether handles or fixed vertices of *solution* are off their places."""
    return max(solution.handle_error, solution.fixed_error) > _MET


def _largest(vectors: FloatArray) -> float:
    """Return the largest length of *vectors* (k, 3); 0 if there are none."""
    return math.sqrt(float(np.einsum("ij,ij->i", vectors, vectors).max(initial=0.0)))


def _counting(progress: Progress | None) -> Progress | None:
    """Return a progress callback for steps whose number is not known in advance."""
    if progress is None:
        return None
    as_callable(progress, "progress")
    steps = itertools.count()

    def report(_: float, message: str) -> None:
        progress(1.0 - _SHARE_LEFT ** next(steps), message)

    return report
