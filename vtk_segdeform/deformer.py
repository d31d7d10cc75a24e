"""The main algorithm, bound to one mesh: cages, subspace, energy, solver.

    mesh, regions, cages  ->  W~            `subspace.bind`, once
                          ->  E(p)          `energy.shape_energy`, once
    fixed, handle         ->  H = L L^T     `solver.GaussNewton`, once
    targets               ->  p, x = W~ p   `Deformer.solve`, at every move of the mouse

All of it happens in a frame of the mesh's own, its vertices centred in a ball of diameter 1, so
that neither the unit of the scene nor its place matters, nor, as with a box, how it is turned.

Long because every option of the method meets here, and each is told in the docstring.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from .arrays import FloatArray, as_numbers, as_points, is_number, is_whole
from .binding import Binder
from .cages import Cage
from .checks import all_of, as_callable, as_flag, as_path, require_sequence, shown
from .constraints import VolumeConstraint, Volumes, region_volumes, total_volume
from .errors import ArgumentError, CageError, Cancelled, ConstraintError
from .fast import compiled
from .freezing import read_only
from .iteration import Iteration, SolverOptions
from .landing import LargeSurface, along
from .mesh import Mesh, require_mesh
from .passengers import Passengers, board
from .positions import (
    checked_constraints,
    checked_targets,
    connected_sets,
    errors_at,
    position_term,
    require_together,
)
from .progress import Progress, tell
from .regions import Regions, require_regions
from .solution import Solution, Status
from .solver import GaussNewton
from .stiffening import Ladder
from .subspace import Subspace
from .targets import waypoints
from .threads import one_blas_thread

_LEG_TOLERANCE, _LEG_STEPS = 1e-3, 12  # for the targets on the way to a far one
_POSITION_WEIGHT = 90.0  # times the shape energy's scale, divided among each handle's vertices
_FAR = 1e3  # mesh sizes
_NONE, _NO_POINTS = np.zeros(0, dtype=np.int64), np.empty((0, 3))
_WIDE = 20_000  # vertices beyond which mapping directions too is what takes long
_LANDINGS, _NEAR, _SAME = 4, 3e-5, 1e-7  # times it is gone on to that scale; and one of rounding
_LEFT = 0.97  # share of the progress bar that each step leaves
_TRIAL = 1e-4  # mesh sizes
_MET = 1e-3  # diagonals within which a vertex counts as in its place


class Deformer:
    """Deform one mesh by its handles, again and again; warm-started from the last solution.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    regions : Regions
        r overlapping regions of *mesh*.
    cages : sequence of r Cage
        One around each region.
    fixed, handle : (k,) int or (n,) bool
        Vertices held in place, and vertices that follow *targets*.  Sets of handle vertices not
        joined by an edge are handles of their own, moved and turned independently.
    preserve_volume : bool
        Hold the enclosed volume exactly, eq. (9).
    preserve_region_volumes : bool
        Hold the volume of every region as well.
    stretch : float
        Strength of the stretch term relative to the detail term; 0 is the paper's energy.
    rotation_groups : int or None
        How many rotations the detail turns by; None is one per vertex, as in the paper.
    tolerance, max_steps : float, int
        When to stop: the surface moves less than this in a step, root mean square, as a share of
        the mesh's size (the diameter of a ball about its centre that holds it).
    window : int
        Steps the acceleration remembers; 0 is the paper's plain iteration, rotations taken for
        given.
    exact_volume : bool
        False leaves the paper's linearised multiplier, for comparison.
    hold_tolerance : float
        Share of the mesh's size by which a handle or fixed vertex may miss its place before its
        weight is raised.
    blend : (r, n) float, optional
        Blend weights instead of ``regions.weights``, for comparison; `cage_distance_weights` gives
        those of eq. (4) as printed.
    cache : path, optional
        A folder where what is bound is kept, and found the next time; see `binding`.
    progress : Progress, optional
        Called while binding; may cancel.

    Raises
    ------
    ConstraintError
        If fixed or handle name no vertex of the mesh, or share one.
    CageError
        If there is not one cage per region, or a cage leaves out part of its region.
    RegionError
        If *regions* belong to another mesh, or *blend* is no partition of unity over them.
    """

    _ladder: Ladder
    _p: FloatArray  # (m, 3), the cages of the last pose, in the frame of the mesh's own
    _targets: FloatArray  # (k, 3), what it was for

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
        stretch: float = 10.0,
        rotation_groups: int | None = 300,
        tolerance: float = 1e-7,
        max_steps: int = 500,
        window: int = 5,
        exact_volume: bool = True,
        hold_tolerance: float = 5e-4,
        blend: ArrayLike | None = None,
        cache: str | os.PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> None:
        require_mesh(mesh)
        require_regions(regions, mesh)
        cages = all_of(cages, Cage, "cages")
        as_flag(preserve_volume, "preserve_volume")
        as_flag(preserve_region_volumes, "preserve_region_volumes")
        self.mesh, self.regions, self.cages = mesh, regions, cages
        self._centre = mesh.vertices.mean(axis=0)
        self._size = 2.0 * float(np.linalg.norm(mesh.vertices - self._centre, axis=1).max())
        self._rest = mesh.with_vertices(self._inward(mesh.vertices))
        # Poses are taken about here, so that far from the origin they keep their digits.
        is_far = float(np.linalg.norm(self._centre)) > self._size
        self._origin = self._centre if is_far else np.zeros(3)
        self._here = mesh.with_vertices(mesh.vertices - self._origin) if is_far else mesh
        if not is_number(hold_tolerance, 0.0):
            raise ArgumentError(f"hold_tolerance must be 0 or more; got {shown(hold_tolerance)}")
        if not is_number(stretch, 0.0):
            raise ArgumentError(f"stretch must be a number, 0 or more; got {shown(stretch)}")
        if rotation_groups is not None and not is_whole(rotation_groups, 1):
            raise ArgumentError(
                f"rotation_groups must be a whole number, 1 or more; got {shown(rotation_groups)}"
            )
        self._hold_tolerance = hold_tolerance
        self._options = SolverOptions(tolerance, max_steps, window, exact_volume)

        self._rest_cages = np.concatenate([_NO_POINTS, *(self._inward(c.vertices) for c in cages)])
        own = None if blend is None else as_numbers(blend, "blend")
        what = self._rest, regions, self.cages, self._rest_cages, own
        cache = None if cache is None else as_path(cache, "cache")
        binding = Binder(*what, stretch, rotation_groups).bound(cache, progress)
        self._own_blend, self._energy, self._stand_in = own, binding.energy, binding.stand_in
        self._mapping = binding.mapping
        self._total_volume = total_volume(self._here)
        here = self._here.vertices
        self._start = self._mapping.start(here)
        self._large = LargeSurface(
            self.subspace, self._mapping, here, self._total_volume, start=self._start
        )
        self._keep(preserve_volume, preserve_region_volumes)
        self._take_hold(fixed, handle)
        if compiled(mesh.n_vertices):
            tell(progress, 0.99, "trying a step")
            self._try_a_step()
        tell(progress, 1.0, "ready")

    @one_blas_thread()
    def hold(
        self,
        *,
        fixed: ArrayLike = (),
        handle: ArrayLike = (),
        preserve_volume: bool | None = None,
        preserve_region_volumes: bool | None = None,
    ) -> Deformer:
        """Return a deformer at rest that holds other vertices or volumes; cages stay bound.

        None keeps the volumes that this one keeps.
        """
        if preserve_volume is not None:
            as_flag(preserve_volume, "preserve_volume")
        if preserve_region_volumes is not None:
            as_flag(preserve_region_volumes, "preserve_region_volumes")
        other = self._shared()
        before = other._keeps
        other._keep(
            before[0] if preserve_volume is None else preserve_volume,
            before[1] if preserve_region_volumes is None else preserve_region_volumes,
        )
        other._take_hold(fixed, handle)
        return other

    def copy(self) -> Deformer:
        """Return a deformer in the same pose that goes on from there by itself."""
        other = self._shared()
        other._at_rest, other._ladder = self._at_rest.copy(), self._ladder.copy()
        return other

    __copy__ = copy

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {name: read_only(state[name]) for name in ("fixed", "handle")})

    def _shared(self) -> Deformer:
        """Return another deformer that shares all parts with this one."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @property
    def subspace(self) -> Subspace:
        """W~, from which ``subspace.map`` makes mesh vertices of stacked cage vertices."""
        return self._energy.subspace

    @property
    def step_volumes(self) -> Volumes:
        """What the solver's steps hold: the volumes, and the surface they are taken over."""
        return self._volumes

    @one_blas_thread()
    def passengers(self, points: ArrayLike, *, progress: Progress | None = None) -> Passengers:
        """Bind other points (k, 3) to the cages, to be moved with them; see `passengers`."""
        blend = self.regions.weights if self._own_blend is None else self._own_blend
        return board(self.mesh, blend, self.cages, points, progress=progress)

    @one_blas_thread()
    def carry(self, points: ArrayLike) -> FloatArray:
        """Return where other points (k, 3), given at rest, are in the last pose.

        For many poses keep the `passengers`: binding is what takes long.
        """
        p = self._outward(self._p)
        return self.passengers(points).moved([p[columns] for columns in self.subspace.columns])

    @one_blas_thread()
    def surface(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return the mesh (n, 3) with its cages at *cage_vertices*, (m_r, 3) each: x = W~ p."""
        return self._placed(self._surface(self._stacked(cage_vertices) - self._centre))

    def reset(self) -> None:
        """Forget the last pose: the next solve starts from rest."""
        self._begin(self._rest_cages, self._rest.vertices[self.handle])

    def resume(self, cage_vertices: Sequence[ArrayLike], targets: ArrayLike) -> None:
        """Go on from an earlier pose: a `Solution.cage_vertices`, and the targets it was for."""
        p = self._inward(self._stacked(cage_vertices))
        self._begin(p, self._inward(checked_targets(targets, len(self.handle))))

    @one_blas_thread()
    def solve(
        self,
        targets: ArrayLike,
        *,
        max_steps: int | None = None,
        progress: Progress | None = None,
    ) -> Solution:
        """Return the pose whose handle vertices are at *targets*.

        Parameters
        ----------
        targets : (k, 3) float
            One for each vertex of `handle`, in its order.  A far jump goes through targets in
            between, so that nothing folds over.
        max_steps : int, optional
            Instead of the deformer's own limit, for the last leg: a drag may stop early and go
            on with the next event.
        progress : Progress, optional
            Called before every step; may cancel, which restores the pose before the call.

        Raises
        ------
        ConstraintError
            If *targets* has the wrong shape, holds NaN or infinite coordinates, or is so far away,
            from the mesh or from what is fixed, that it must be in another unit.
        """
        goal = self._inward(checked_targets(targets, len(self.handle)))
        if max(goal.max(initial=0.0), -goal.min(initial=0.0)) > _FAR:
            raise ConstraintError(
                f"a target is {np.abs(goal).max():.0e} times the mesh's size away from it; "
                "are both in the same unit?"
            )
        require_together(self._rest, goal, self._ends_of_fixed)
        before = self._p, self._targets
        try:
            return self._solve(goal, max_steps, _counting(progress))
        except Cancelled:
            self._begin(*before)
            raise

    def _solve(
        self, goal: FloatArray, max_steps: int | None, progress: Progress | None
    ) -> Solution:
        limit = self._options.max_steps if max_steps is None else max_steps
        options = replace(self._options, max_steps=limit, progress=progress)
        *way, _ = waypoints(self._targets, goal, self._handles)
        on_the_way = replace(options, tolerance=_LEG_TOLERANCE, max_steps=_LEG_STEPS)
        steps = sum(self._ladder.hurry(self._places(leg), on_the_way).steps for leg in way)
        can_hurry = max_steps is not None and self._ladder.is_climbed
        is_in_haste = can_hurry and not np.array_equal(goal, self._targets)
        move = self._ladder.hurry if is_in_haste else self._ladder.move
        result = move(self._places(goal), options)
        self._targets = goal
        steps += result.steps
        x, missed = self._landed(result)
        for _ in range(_LANDINGS):
            if missed <= _NEAR or result.status is Status.STEP_LIMIT:
                break
            result = self._ladder.move(self._places(goal), options)
            steps += result.steps
            x, missed = self._landed(result)
        return self._solution(result, x, steps)

    def _try_a_step(self) -> None:
        """Load the kernels, or compile them at their very first use, before the first frame."""
        handle = [0]
        targets = self.mesh.vertices[handle] + _TRIAL * self._size
        self.hold(handle=handle).solve(targets, max_steps=1)

    def _stacked(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        require_sequence(cage_vertices, "cage_vertices")
        poses = [as_points(vertices, "cage_vertices") for vertices in cage_vertices]
        expected, got = [cage.n_vertices for cage in self.cages], [len(pose) for pose in poses]
        if got != expected:
            raise CageError(f"cage_vertices must hold {expected} points, cage by cage; got {got}")
        return np.concatenate(poses)

    def _keep(self, volume: bool, of_regions: bool) -> None:
        self._keeps = volume, of_regions
        self._constraints: tuple[VolumeConstraint, ...] = ()
        if of_regions:
            self._constraints = self._region_volumes
        elif volume:
            self._constraints = (self._total_volume,)

    @cached_property
    def _region_volumes(self) -> tuple[VolumeConstraint, ...]:
        return region_volumes(self._here, self.regions.labels)

    def _region_volume_changes(self, x: FloatArray) -> FloatArray:
        return np.array([each.relative(x) for each in self._region_volumes])

    def _take_hold(self, fixed: ArrayLike, handle: ArrayLike) -> None:
        mesh = self.mesh
        self.fixed, self.handle = map(read_only, checked_constraints(mesh, fixed, handle))
        self._handles = connected_sets(mesh, self.handle)
        patches = connected_sets(mesh, self.fixed)
        # Sets lie side by side here, and their vertices in them as in `handle` and `fixed`.
        ids = np.concatenate([self.handle, self.fixed])
        order = [*self._handles, *(len(self.handle) + patch for patch in patches)]
        in_order = sparse.eye_array(len(ids)).tocsr()[np.concatenate([_NONE, *order])]
        weight = _POSITION_WEIGHT * self._energy.scale
        positions = position_term(
            self.subspace, self._rest, [ids[places] for places in order], weight
        )
        gathered = in_order if positions.mean is None else positions.mean @ in_order
        self._rest_of_fixed = mesh.vertices[self.fixed]
        self._to_places = gathered[:, : len(self.handle)].tocsr()
        self._fixed_places = gathered[:, len(self.handle) :] @ self._rest.vertices[self.fixed]
        self._volumes = self._stand_in.volumes(self._constraints, self._rest.vertices)
        self._at_rest = GaussNewton(self._energy, positions, self._volumes)
        one = len(self._constraints) == 1 and self._keeps == (True, False)
        self._is_wide = one and self._stand_in.cells is not None and mesh.n_vertices > _WIDE
        held = self._rest.vertices[self.fixed] if len(self.fixed) else np.zeros((1, 3))
        self._ends_of_fixed = np.stack([held.min(axis=0), held.max(axis=0)])[: 2 * len(self.fixed)]
        self._anchor = held.mean(axis=0) * self._size  # stays where it is when the mesh is scaled
        self.reset()

    def _begin(self, p: FloatArray, targets: FloatArray) -> None:
        self._at_rest.volumes = self._volumes
        self._ladder = Ladder(self._at_rest, p, self._hold_tolerance)
        self._p, self._targets = p, targets
        if self._is_wide and p is not self._rest_cages:
            self._ladder.go_on_from(p)

    def _places(self, targets: FloatArray) -> FloatArray:
        """Return the places for *targets* (k, 3) of the handle."""
        return np.asarray(self._to_places @ targets + self._fixed_places)

    def _landed(self, result: Iteration) -> tuple[FloatArray, float]:
        """Take the mesh onto the volume held; return its vertices, and by how much it was off.

        That is as a scale; where it went along the solver's own directions, 0.
        """
        self._p, directions = result.p, result.directions
        if not directions or not self._options.exact_volume:
            return self._surface(self._p * self._size), 0.0
        if self._is_wide:
            moves = (self._p - self._rest_cages) * self._size
            x, scale = self._large.landed(moves, self._centre - self._origin + self._anchor)
            anchor = self._anchor / self._size
            self._p = anchor + scale * (self._p - anchor)
            missed = abs(scale - 1.0)
            if missed > _SAME:
                self._ladder.go_on_from(self._p)
            return x, missed
        paths = self._surface(self._p * self._size, [z * self._size for z in directions])
        steps, x = along(self._constraints, paths)
        self._p = self._p + sum(tk * z for tk, z in zip(steps, directions, strict=True))
        return x, 0.0

    def _surface(self, p: FloatArray, directions: Sequence[FloatArray] = ()) -> FloatArray:
        """Return x for cages at *p* (m, 3), about the centre; and W~ z for *directions* z beside.

        x is rest + W~ (p - rest), which is W~ p: the rest shape keeps its last digit however W~
        is rounded.
        """
        moves = p - self._rest_cages * self._size
        return self._mapping.map(np.hstack([moves, *directions]), self._start)

    def _placed(self, x: FloatArray) -> FloatArray:
        return x + self._origin if self._origin.any() else x

    def _solution(self, result: Iteration, x: FloatArray, steps: int) -> Solution:
        p = self._p * self._size
        x = self._placed(x)
        errors = partial(self._errors, self._targets)
        status = result.status
        if status is Status.CONVERGED and max(errors(x)) > _MET:
            status = Status.MISSED
        return Solution(
            vertices=x,
            cage_vertices=tuple(p[columns] + self._centre for columns in self.subspace.columns),
            steps=steps,
            status=status,
            merits=result.merits,
            errors=errors,
            volume=partial(self._total_volume.relative, x),
            region_volumes=self._region_volume_changes,
        )

    def _errors(self, targets: FloatArray, x: FloatArray) -> tuple[float, ...]:
        places = self._outward(targets), self._rest_of_fixed
        return errors_at((self.handle, self.fixed), places, self.mesh.diagonal, x)

    def _inward(self, points: FloatArray) -> FloatArray:
        inside: FloatArray = points - self._centre
        inside /= self._size
        return inside

    def _outward(self, points: FloatArray) -> FloatArray:
        outside: FloatArray = points * self._size
        outside += self._centre
        return outside


def _counting(progress: Progress | None) -> Progress | None:
    """Return a progress callback for steps whose number is not known in advance."""
    if progress is None:
        return None
    as_callable(progress, "progress")
    steps = itertools.count()

    def report(_: float, message: str) -> None:
        progress(1.0 - _LEFT ** next(steps), message)

    return report
