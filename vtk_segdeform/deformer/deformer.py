"""The whole method bound to one mesh: from targets to a pose.

    x = W~ p                                      mesh vertices from cage vertices      (2), (3)
    minimise  E(p) + sum_i omega_i |x_i - u_i|^2                                        (20)
    subject to  V(x) = V_0, or the same for every region                                (8), (9)

    mesh, regions, cages  ->  W~, E             `problem.Problem`, once
    fixed, handle         ->  H = L L^T         `constraints.Constraints`, once per set of handles
    targets               ->  p                 `path.Path`, at every motion of the mouse

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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_points, is_number, largest_length
from ..cages import Cage
from ..checks import (
    all_of,
    as_callable,
    as_flag,
    as_path,
    as_text,
    require,
    shown,
)
from ..errors import ArgumentError, ConstraintError
from ..geometry import turned_over
from ..kernels import compiled_kernels, load_for, one_blas_thread
from ..mesh import Mesh, SurfacePoint, new_crossings, require_mesh
from ..progress import Progress, part, tell
from ..regions import Regions, require_regions
from ..solver import CONVERGED, Bodies, Solution, SolverOptions, Status, VolumeConstraint
from ..subspace import Passengers, Subspace
from .arguments import (
    LOCALITY,
    SPREAD,
    as_lids,
    check_distance,
    check_options,
    checked_hinge,
    checked_limb,
    checked_locality,
    checked_parts,
    checked_place,
    checked_radius,
    checked_targets,
    require_together,
    stacked_cages,
)
from .as_printed import PaperDeformer
from .constraints import Constraints, HoldOptions
from .derivatives import Gradient, Linearised
from .enclosed_volume import EnclosedVolume
from .finishing import VOLUME_MET, finish_of
from .limbs import Limb
from .local import near_point
from .locality import Reach
from .path import Path, Pose
from .problem import Problem
from .slides import Slide, checked_slides
from .stiffness import Stiffness
from .symmetry import Mirror, Symmetry
from .volume_goals import OTHER_MEASURE, Goals, checked_goals

_FRAME = 1e-5  # tolerance of the first solve for targets of a drag, which go on
_SIZES, _MOTIONS = 2.0, 1.5  # a pose moves at most so many mesh sizes and motions of targets
_SEEN = 10_000  # vertices, of which this is checked
_MET = 1e-3  # position error, in diagonals, below which a target or a place is met
_BENT = 5e-3  # the same of a rigid part or a slide in the cages' own pose, which bends both a bit
_SAME = 1e-9  # mesh sizes, within which cages are those of a solution
_TRIAL_MOTION = 1e-4  # mesh sizes
_SHARE_LEFT = 0.97  # of the progress bar, after each step
_BOUND = 0.95  # of the progress bar, before the trial step


class Deformer:
    """Deform one mesh by its handles, again and again, each time from the last solution.

    Pickled, it takes some 3 megabytes for 5,000 vertices; W~ is computed again when it is read, in
    0.1 s, with the same bits on the same machine.

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
    volumes : mapping of str to str or float, optional
        Goals by the names of volumes, as ``{"cavity": "-40%", "whole": "keep", "body 1": 2.5}``;
        see `volume_goals` and `volume_names`.  They take precedence over what is preserved by
        default.  A body gains or loses what its parts and regions are set to, unless "whole"
        is kept; bounds, such as "at least 5", let the rest of it make room.
    parts : mapping of str to (k,) int or (n,) bool, optional
        Vertices by the names of parts of the surface, whose volumes are those under a lid over
        their borders; for *volumes*.
    stiffness : (n,) float, optional
        How stiff the surface is at each vertex, relative to elsewhere; infinite where it is rigid.
        See `stiffness`.
    slides : sequence of Slide, optional
        Vertices that move along a plane, a line or the surface at rest only; see `slides`.
    symmetry : str or pair of (3,) float, optional
        Mirror all motions on one side of a plane on the other side: "x", "y" or "z", the normal of
        the plane, whose place is found; "auto", which finds the plane; or a point of it and its
        normal.  See `symmetry`.
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
        volumes: Goals | None = None,
        parts: Mapping[str, ArrayLike] | None = None,
        stiffness: ArrayLike | None = None,
        slides: Iterable[Slide] = (),
        symmetry: Symmetry = None,
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
        self._limits = SolverOptions(tolerance, max_steps)
        mirror = Mirror.of(mesh, symmetry)
        self._options = HoldOptions(
            preserve_volume=as_flag(preserve_volume, "preserve_volume"),
            preserve_region_volumes=as_flag(preserve_region_volumes, "preserve_region_volumes"),
            avoid_contact=as_flag(avoid_contact, "avoid_contact"),
            lids=as_lids(lids),
            goals=checked_goals(volumes),
            parts=checked_parts(mesh, parts),
            slides=checked_slides(mesh, slides),
            mirror=mirror,
        )
        self.mesh, self.regions, self.cages = mesh, regions, cages
        self._problem = Problem.of(
            mesh,
            regions,
            cages,
            stretch=stretch,
            rotation_groups=rotation_groups,
            stiffness=Stiffness.of(mesh, stiffness, mirror),
            cache=None if cache is None else as_path(cache, "cache"),
            progress=part(progress, 0.0, _BOUND),
        )
        self._stiffness = None if stiffness is None else np.array(stiffness)
        self._enclosed = EnclosedVolume.under(self._problem, self._options.lids)
        self._hold(Constraints.of(self._enclosed, self._options, fixed=fixed, handle=handle))
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
        volumes: Goals | None = None,
        parts: Mapping[str, ArrayLike] | None = None,
        slides: Iterable[Slide] | None = None,
        symmetry: Symmetry | EllipsisType = ...,
        avoid_contact: bool | None = None,
    ) -> Deformer:
        """Return a deformer at rest with other constraints, which shares the binding of this one.

        None, or for *lids* and *symmetry* ``...``, are the values of this deformer.  The fixed
        vertices stay at *fixed_at* (f, 3), in the order that they are given in, by default at rest.
        """
        flags = {
            "preserve_volume": preserve_volume,
            "preserve_region_volumes": preserve_region_volumes,
            "avoid_contact": avoid_contact,
        }
        given: dict[str, Any] = {
            name: as_flag(flag, name) for name, flag in flags.items() if flag is not None
        }
        if volumes is not None:
            given["goals"] = checked_goals(volumes)
        if parts is not None:
            given["parts"] = checked_parts(self.mesh, parts)
        if symmetry is not ...:
            given["mirror"] = Mirror.of(self.mesh, symmetry)
        if slides is not None:
            given["slides"] = checked_slides(self.mesh, slides)
        options = replace(self._options, **given)
        other = self._shared()
        if lids is not ... and as_lids(lids) is not options.lids:
            options = replace(options, lids=as_lids(lids))
            other._enclosed = EnclosedVolume.under(self._problem, options.lids)
        other._options = options
        if symmetry is not ... and self._stiffness is not None:
            other._stiffen(self._stiffness)
        other._hold(
            Constraints.of(other._enclosed, options, fixed=fixed, handle=handle, places=fixed_at)
        )
        return other

    @one_blas_thread()
    def stiffened(self, stiffness: ArrayLike | None) -> Deformer:
        """Return a deformer at rest without constraints, with another *stiffness* (n,).

        It has the options of this one and shares its subspace, which takes most of the time.
        """
        other = self._shared()
        other._stiffen(stiffness)
        other._hold(Constraints.of(other._enclosed, self._options, fixed=(), handle=()))
        return other

    def _stiffen(self, stiffness: ArrayLike | None) -> None:
        self._problem = self._problem.stiffened(
            Stiffness.of(self.mesh, stiffness, self._options.mirror)
        )
        self._stiffness = None if stiffness is None else np.array(stiffness)
        self._enclosed = EnclosedVolume.under(self._problem, self._options.lids)

    @one_blas_thread()
    def local(
        self,
        vertex: int | SurfacePoint,
        reach: float,
        spread: float,
        *,
        follows: float = 0.0,
        depth: float = 0.0,
        hinge: float = 0.0,
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
            moves.  Infinite: all of it is free.  0: all of it is held, so softly that it follows
            volumes that are changed.
        spread : float
            Distance from a handle of one vertex within which a finish leaves the surface as the
            cages have it.
        follows : float
            0 to 1: parts of the surface beyond the reach, such as the hand if the elbow is grabbed,
            follow if their area is less than this share of the largest such part.
        depth : float
            Of the joint of the limb that is pulled, see `limbs`: it is free, and the reach begins
            at its joint.  0: it begins at the point.
        hinge : float
            0 to 1: where that limb bends, with 0 along its length, with 1 at its joint only.
        """
        point = checked_place(self.mesh, vertex)
        is_infinite = isinstance(reach, float) and reach == np.inf
        if not (is_infinite or is_number(reach, 0.0)):
            raise ConstraintError(f"reach must be 0 or a positive number; got {shown(reach)}")
        if not (is_number(spread) and spread > 0.0):
            raise ConstraintError(f"spread must be a positive number; got {shown(spread)}")
        if not (is_number(follows, 0.0) and follows <= 1.0):
            raise ConstraintError(f"follows must be a number from 0 to 1; got {shown(follows)}")
        if not is_number(depth, 0.0):
            raise ConstraintError(f"depth must be 0 or a positive number; got {shown(depth)}")
        path = self._path
        if not path.is_solved:
            path = path.copy()
            path.solve(path.targets, self._limits)
        lengths = {"reach": float(reach), "spread": float(spread), "depth": float(depth)}
        shares = {"follows": float(follows), "hinge": checked_hinge(hinge)}
        near = near_point(path, point, **shares, **lengths)
        other = self._shared()
        other._path = Path.begin(near, path.p, path.targets)
        return other

    def limbs(self, vertex: int | SurfacePoint) -> tuple[Limb, ...]:
        """Return the limbs on which *vertex*, or another point, is: finger, hand, arm, body.

        The last one is the whole body, and each of the others ends where the surface widens into a
        larger part of it; see `limbs`.  None on a body without any limb there.
        """
        found = self._problem.samples.limbs(checked_place(self.mesh, vertex))
        return (*map(self._at_vertices, found), self._whole) if found else ()

    def limb_of_pull(
        self, vertex: int | SurfacePoint, radius: float, locality: float, limb: int | None = None
    ) -> Limb | None:
        """Return the limb that a pull moves; None if it has none.  See `reach_of_pull`."""
        found = self._limb_of_pull(checked_place(self.mesh, vertex), radius, locality, limb)
        return found if found is None or found.is_whole else self._at_vertices(found)

    def reach_of_pull(
        self, vertex: int | SurfacePoint, radius: float, locality: float, limb: int | None = None
    ) -> Reach:
        """Return *reach*, *follows* and *depth* of `local` for a pull of *vertex*, or a point.

        The reach is ``radius / sqrt(locality)``, with a *locality* from 0 to 1.  From the default
        locality on it is the smallest limb of the point that is longer than the spread, if its
        joint is within that reach.  *limb* is the number of another one of `limbs`, or of the last
        one if it is larger.
        """
        point, share = checked_place(self.mesh, vertex), checked_locality(locality) or 0.0
        found = self._limb_of_pull(point, radius, share, limb)
        if found is not None and found.is_whole:
            return Reach(math.inf, 1.0, 0.0)
        if found is not None:
            size = self._problem.frame.size
            return Reach(size * found.length, 1.0 - (share or LOCALITY), size * found.depth)
        radius = checked_radius(self.mesh, radius)
        return Reach(radius / math.sqrt(share) if share else math.inf, 1.0 - share, 0.0)

    def _limb_of_pull(
        self, point: SurfacePoint, radius: float, locality: float, limb: int | None
    ) -> Limb | None:
        """Return the limb that a pull moves, in the frame and with shares of samples."""
        radius = checked_radius(self.mesh, radius) / self._problem.frame.size
        share = checked_locality(locality) or 0.0
        if checked_limb(limb) is None and share < LOCALITY:
            return None
        found = self._problem.samples.limbs(point)
        if limb is not None:
            return (*found, self._whole)[min(limb, len(found))] if found else None
        first = next((each for each in found if each.length >= SPREAD * radius), None)
        is_near = first is not None and first.depth <= radius / math.sqrt(share)
        return first if is_near else None

    def _at_vertices(self, limb: Limb) -> Limb:
        """Return *limb* in the mesh's unit, with shares of the vertices."""
        size, samples = self._problem.frame.size, self._problem.samples
        share = samples.smooth_at_vertices(limb.share)
        return Limb(size * limb.depth, size * limb.length, share)

    @property
    def _whole(self) -> Limb:
        return Limb(math.inf, math.inf, np.ones(self.mesh.n_vertices))

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

    def _shared(self) -> Deformer:
        """Return another deformer that shares all parts with this one."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @property
    def _constraints(self) -> Constraints:
        return self._path.constraints

    @property
    def has_arrived(self) -> bool:
        """Whether the last solve came to its targets; with *max_steps* it may end on its way."""
        return not self._path.way

    @property
    def fixed(self) -> IntArray:
        """Vertices that stay in place, (f,)."""
        return self._constraints.fixed

    @property
    def handle(self) -> IntArray:
        """Vertices that follow targets, (k,); without the mates of a symmetric deformer."""
        return self._constraints.handle[: self._constraints.n_given]

    @property
    def subspace(self) -> Subspace:
        """W~; ``subspace.map`` computes mesh vertices from stacked cage vertices."""
        return self._problem.subspace

    @property
    def has_volume(self) -> bool:
        """Whether the mesh encloses a volume, with its lids if it is open."""
        return self._enclosed.total.has_volume

    @property
    def volume_names(self) -> tuple[str, ...]:
        """The names of volumes, for *volumes*.

        "whole"; "body 0", "body 1" ..., if there are several; of hollow bodies "cavity 0" ..., or
        "cavity" and "wall" if there is one only; "component 0" ... of `Mesh.components`, if they
        are several; "region 0" ... of the regions that enclose some; and the *parts*.
        """
        return (*self._enclosed.volume_names, *self._options.parts)

    @property
    def bodies(self) -> Bodies:
        """The bodies of the mesh, "body 0" ... of `volume_names`."""
        return self._enclosed.bodies

    @one_blas_thread()
    def volumes(self, vertices: ArrayLike | None = None) -> dict[str, float]:
        """Return all volumes by name, in the mesh's unit cubed, at *vertices* (n, 3) or at rest."""
        rest = self.mesh.vertices
        x = rest if vertices is None else as_points(vertices, "vertices", len(rest))
        x = self._problem.frame.about_origin(x)
        return self._enclosed.volumes(x, self._options.parts)

    @one_blas_thread()
    def volume(self, name: str, vertices: ArrayLike | None = None) -> tuple[float, float]:
        """Return one of `volumes`, and (V - V0) / V0, at *vertices* (n, 3) or at rest.

        Or an area, or a coordinate of a centroid and its motion in diagonals of the mesh.

        Raises
        ------
        ConstraintError
            If there is no volume called *name*.
        """
        rest, known = self.mesh.vertices, self.volume_names
        if as_text(name, "name") not in known and not OTHER_MEASURE.fullmatch(name):
            raise ConstraintError(f"name must be one of {', '.join(known)}; got {shown(name)}")
        x = rest if vertices is None else as_points(vertices, "vertices", len(rest))
        x = self._problem.frame.about_origin(x)
        return self._enclosed.volume(name, x, self._options.parts)

    @property
    def mirror(self) -> Mirror | None:
        """The plane of symmetry, with its error and the mates of the vertices."""
        return self._constraints.mirror

    @property
    def preserved_volumes(self) -> tuple[VolumeConstraint, ...]:
        """The volumes that every pose preserves: of each body, or of each region."""
        return self._constraints.preserved.constraints

    @one_blas_thread()
    def passengers(self, points: ArrayLike, *, progress: Progress | None = None) -> Passengers:
        """Bind other points (k, 3) to the cages, to be moved with them; see `passengers`."""
        return self._problem.passengers(points, progress=progress)

    @one_blas_thread()
    def carry(self, points: ArrayLike) -> FloatArray:
        """Return the positions of other points (k, 3), given at rest, in the last pose.

        For many poses keep the `passengers`: most of the time is spent on binding the points.
        """
        return self.passengers(points).moved(self._problem.cages_in_scene(self._path.p))

    @one_blas_thread()
    def surface(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return the mesh (n, 3) with its cages at *cage_vertices*, (m_r, 3) each: x = W~ p."""
        return self._problem.frame.in_scene(self._problem.map(self._inward(cage_vertices)))

    @one_blas_thread()
    def rotations(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return how the mesh with these cages has rotated near each vertex since rest, (n, 3, 3).

        These are the rotations of the shape energy, blended smoothly.
        """
        return self._problem.energy.vertex_rotations(self._inward(cage_vertices))

    def reset(self) -> None:
        """Return to rest: the next solve starts from there."""
        self._hold(self._constraints)

    def resume(self, cage_vertices: Sequence[ArrayLike], targets: ArrayLike) -> None:
        """Continue from an earlier pose: its `Solution.cage_vertices` and its targets."""
        goal = self._constraints.goal(checked_targets(targets, len(self.handle)))
        self._path = Path.begin(self._constraints, self._inward(cage_vertices), goal)

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
            Instead of the deformer's own limit, which counts from the last waypoint on.  A drag may
            stop early, also on its way, and the next solve, for the same targets or others, goes on
            from there.
        progress : Progress, optional
            Called before every step; may raise `Cancelled`.  Then, as after any other exception in
            it, the deformer is as it was before the call.

        Raises
        ------
        ConstraintError
            If *targets* has the wrong shape, holds NaN or infinite coordinates, or is so far away,
            from the mesh or from the fixed vertices, that it must be in another unit.
        """
        goal = self._constraints.goal(checked_targets(targets, len(self.handle)))
        check_distance(goal)
        require_together(self._problem.rest, goal, self._constraints.fixed_box)
        before = self._path.copy()
        with nullcontext() if progress is None else self.restoring():
            solution = self._solve(goal, max_steps, _counting(progress))
        if self._is_plausible(solution.vertices, goal, before.p):
            return solution
        self._path = before
        before.missed = goal
        return self._far(solution)

    @one_blas_thread()
    def jvp(
        self,
        solution: Solution,
        targets: ArrayLike | None = None,
        *,
        volumes: Mapping[str, float] | None = None,
        stiffness: ArrayLike | None = None,
    ) -> FloatArray:
        """Return how the vertices of *solution* move, (n, 3), with a motion of what it depends on.

        Exact to first order; see `derivatives`.

        Parameters
        ----------
        solution : Solution
            That of the last solve, converged.
        targets : (k, 3) float, optional
            Motion of the targets.
        volumes : mapping of str to float, optional
            Changes of goals of `volumes` that are equal to a volume, in the mesh's unit cubed; of
            centroids in its unit.
        stiffness : (n,) float, optional
            Change of the stiffness.

        Raises
        ------
        ArgumentError
            If *solution* is finished or has not converged; if contact is avoided and active,
            vertices slide along a surface, or an area is kept: there is no derivative then.  If a
            goal, or the pull of a `local` deformer, is asked for whose volume is not set.
        """
        pose = self._linearised(solution)
        return pose.motion(
            None if targets is None else as_points(targets, "targets", len(self.handle)),
            volumes={} if volumes is None else volumes,
            stiffness=stiffness,
            now=self._stiffness,
        )

    @one_blas_thread()
    def vjp(
        self,
        solution: Solution,
        cotangent: ArrayLike,
        *,
        volumes: Sequence[str] = (),
        stiffness: bool = False,
    ) -> Gradient:
        """Return the gradient of a function of the vertices of *solution*; see `jvp`.

        *cotangent* (n, 3) is its gradient by the vertices.  Returned are that by the targets, that
        by the goals of *volumes* with these names, and, with *stiffness*, that by the stiffness of
        every vertex, (n,): 0 where the vertex is rigid, or a hundred times as stiff as the median
        or more, or less than a hundredth.  There is none by the stiffness while volumes are set.
        """
        require(stiffness, bool, "stiffness")
        return self._linearised(solution).gradient(
            as_points(cotangent, "cotangent", self.mesh.n_vertices),
            volumes=volumes,
            stiffness=stiffness,
            now=self._stiffness,
        )

    def _linearised(self, solution: Solution) -> Linearised:
        """Return the pose of *solution* to first order, which has to be that of the last solve."""
        self._require_last(solution)
        return Linearised.of(solution, self._path, self._enclosed, self._options)

    def _require_last(self, solution: Solution) -> None:
        require(solution, Solution, "solution")
        frame, cages = self._problem.frame, [each.shape for each in solution.cage_vertices]
        if cages != [cage.vertices.shape for cage in self.cages] or not (
            largest_length(np.concatenate(solution.cage_vertices) - frame.outward(self._path.p))
            <= _SAME * frame.size
        ):
            raise ArgumentError("solution is not the pose of the last solve; resume it first")

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
        self._require_last(solution)
        frame = self._problem.frame
        unfinished = solution.vertices if solution.unfinished is None else solution.unfinished
        pose = start = frame.about_origin(unfinished)
        if solution.is_finished:
            start = frame.about_origin(solution.vertices)
        found = finish_of(self._path, pose, start, progress)
        is_start = found.vertices is start
        if is_start and not solution.is_finished:
            return solution
        finished = replace(
            solution,
            vertices=solution.vertices if is_start else frame.in_scene(found.vertices),
            steps=solution.steps + found.steps,
            merits=found.merits,
            errors=partial(self._constraints.errors, self._path.asked),
            volume=partial(self._enclosed.total.relative, found.vertices),
            region_volumes=self._enclosed.changes_of_regions,
            held_volumes=self._constraints.held_volumes,
            shape_errors=self._constraints.shape_errors,
            remaining=found.remaining / self.mesh.diagonal,
            unfinished=unfinished,
            unmoved=self._constraints.unmoved,
        )
        return replace(finished, status=self._missed(finished) or found.status)

    def _inward(self, cage_vertices: Sequence[ArrayLike]) -> FloatArray:
        """Return the *cage_vertices* of all cages in the coordinates of the solver, (m, 3)."""
        return self._problem.frame.inward(stacked_cages(self.cages, cage_vertices))

    def _hold(self, constraints: Constraints) -> None:
        """Begin at rest, held by *constraints*."""
        rest = self._problem.rest.vertices[constraints.handle]
        self._path = Path.begin(constraints, constraints.rest_cages, rest)

    def _take_trial_step(self) -> None:
        """Compile the kernels, or load them, before the first frame needs them."""
        handle = [0]
        targets = self.mesh.vertices[handle] + _TRIAL_MOTION * self._problem.frame.size
        other = self.hold(handle=handle)
        other.solve(targets, max_steps=1)
        other._path.remaining()  # with the Hessian, which a step may not need

    def _solve(
        self, goal: FloatArray, max_steps: int | None, progress: Progress | None
    ) -> Solution:
        limit = self._limits.max_steps if max_steps is None else max_steps
        options = replace(self._limits, max_steps=limit, progress=progress)
        path, is_live = self._path, max_steps is not None
        is_frame = is_live and not np.array_equal(goal, path.targets)
        if is_frame:
            options = replace(options, tolerance=max(options.tolerance, _FRAME))
        pose = path.solve(goal, options, is_live=is_live)
        if is_frame and pose.result.status is Status.CONVERGED:
            result = replace(pose.result, status=Status.STEP_LIMIT)
            pose = pose._replace(result=result)
        solution = self._solution(pose)
        return solution if is_live else self._with_remaining(solution)

    def _solution(self, pose: Pose) -> Solution:
        x = self._problem.frame.in_scene(pose.x)
        rest, faces, status = self.mesh.vertices, self.mesh.faces, pose.result.status
        solution = Solution(
            vertices=x,
            cage_vertices=self._problem.cages_in_scene(self._path.p),
            steps=pose.steps,
            status=status,
            merits=pose.result.merits,
            errors=partial(self._constraints.errors, self._path.targets),
            volume=partial(self._enclosed.total.relative, x),
            region_volumes=self._enclosed.changes_of_regions,
            held_volumes=self._constraints.held_volumes,
            shape_errors=self._constraints.shape_errors,
            crossed=partial(new_crossings, rest=rest, faces=faces),
            folded=partial(turned_over, rest=rest, faces=faces),
            remaining=0.0 if status is Status.CONVERGED else np.inf,
            unmoved=self._constraints.unmoved,
        )
        return replace(solution, status=self._or_missed(status, solution))

    def _with_remaining(self, solution: Solution) -> Solution:
        """Return the *solution* with its estimate, and the status by that."""
        if solution.status is Status.STEP_LIMIT:
            return solution
        remaining = self._path.remaining() * self._problem.frame.size / self.mesh.diagonal
        is_final = solution.status in (Status.STALLED, Status.VOLUME_MISSED)
        status = solution.status if is_final else Status.STEP_LIMIT
        if remaining <= CONVERGED:
            status = self._or_missed(Status.CONVERGED, solution)
        return replace(solution, remaining=remaining, status=status)

    def _is_plausible(self, x: FloatArray, goal: FloatArray, before: FloatArray) -> bool:
        """Tell whether no vertex of *x* (n, 3) is farther away than a motion to *goal* explains.

        Nor than in the pose with cages *before*, wherever it is.
        """
        problem, some = self._problem, slice(None, None, 1 + len(x) // _SEEN)
        rest = self.mesh.vertices[some]
        moved = largest_length(goal - problem.rest.vertices[self._constraints.handle])
        limit = problem.frame.size * (_SIZES + _MOTIONS * moved)
        if largest_length(x[some] - rest) <= limit:
            return True
        at = problem.frame.in_scene(problem.map(before))
        return largest_length(x[some] - rest) <= largest_length(at[some] - rest)

    def _far(self, solution: Solution) -> Solution:
        """Return the current pose instead of *solution*, which is far from every reasonable one."""
        x = self._problem.frame.in_scene(self._problem.map(self._path.p))
        return replace(
            solution,
            vertices=x,
            cage_vertices=self._problem.cages_in_scene(self._path.p),
            status=Status.MISSED,
            errors=partial(self._constraints.errors, self._path.asked),
            volume=partial(self._enclosed.total.relative, x),
            remaining=np.inf,
        )

    def _or_missed(self, status: Status, solution: Solution) -> Status:
        """Return *status*, or what a converged *solution* misses, or a stalled one of volumes."""
        missed = None
        if status in (Status.CONVERGED, Status.STALLED):
            missed = self._missed(solution)
        if status is Status.STALLED and missed is not Status.VOLUME_MISSED:
            return status
        return missed or status

    def _missed(self, solution: Solution) -> Status | None:
        """Return the status of a *solution* with a handle, a volume or a contact that is off."""
        if max(solution.handle_error, solution.fixed_error) > _MET:
            is_free = len(self.handle) + len(self.fixed) < self.mesh.n_vertices
            return Status.MISSED if is_free else Status.ALL_HELD
        is_off = self._constraints.has_goals and solution.volume_error > VOLUME_MET
        if is_off:
            return Status.VOLUME_MISSED
        bent = max(solution.rigid_error, solution.slide_error)
        if bent > (_MET if solution.is_finished else _BENT):
            return Status.RIGID_MISSED
        has_contact = self._constraints.contact is not None
        return Status.CROSSED if has_contact and len(solution.crossings()) else None


def _counting(progress: Progress | None) -> Progress | None:
    """Return a progress callback for steps whose number is not known in advance."""
    if progress is None:
        return None
    as_callable(progress, "progress")
    steps = itertools.count()

    def report(_: float, message: str) -> None:
        progress(1.0 - _SHARE_LEFT ** next(steps), message)

    return report
