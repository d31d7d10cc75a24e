"""Immutable states of a session.

A `State` is frozen and its arrays are read-only, so that successive states share unchanged parts.
An undo step therefore stores only its changes: one mask per region for painting, the cage vertices
(m, 3) and handle targets (k, 3) for a drag.  States contain neither the mesh nor the vertices of a
pose, unless it is finished.

Long because each part of a state is checked here, where it enters.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import (
    FloatArray,
    IntArray,
    as_ids,
    as_numbers,
    as_points,
    frozen,
    is_number,
    is_whole,
)
from ..cages import Cage, require_enclosed
from ..checks import Described, all_of, require, require_sequence, shown
from ..deformer import (
    Slide,
    Stiffness,
    checked_constraints,
    checked_goals,
    checked_hinge,
    checked_place,
    checked_slides,
)
from ..errors import (
    ArgumentError,
    CageError,
    ConstraintError,
    MeshError,
    RegionError,
    SessionError,
)
from ..files import replacing
from ..freezing import Frozen
from ..geometry import FREE, checked_attach
from ..landmarks import Follower
from ..mesh import Mesh, SurfacePoint
from ..regions import Regions
from .listeners import Change
from .naming import Names, checked_names, fault_of, region_name

Attachments: TypeAlias = tuple[tuple[int, int | str], ...]
"""Components and their carriers; see `Options`."""
Parts: TypeAlias = tuple[tuple[str, IntArray], ...]
"""Names and vertices (k,) of parts of the surface; see `Deformer`."""
Cages: TypeAlias = tuple[FloatArray, ...]
"""One (m_r, 3) float per region: the vertices of the cages in a pose."""

_NO_PIVOTS: Mapping[str, FloatArray] = MappingProxyType({})
_TINY = float(np.finfo(np.float64).tiny)
_FARTHEST = 1e6  # mesh diagonals; poses farther away are damaged, since no drag reaches so far


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options for fitting cages and solving.

    Parameters
    ----------
    n_cage_vertices : int
        Total cage vertices, used at the next fit; the default follows the number of regions, as
        `suggested_size`.
    offset : float, optional
        Cage offset from the surface, in the unit of the mesh, used at the next fit; by default
        chosen automatically.
    preserve_volume, preserve_region_volumes : bool
        Preserve the enclosed volume exactly; preserve the volume of every region as well.
    lids : bool, optional
        Whether an open surface encloses a volume under lids over its borders; None decides it for
        each connected part, as `Deformer` does.
    volumes : mapping of str to str or float
        Goals by the names of volumes, as `Deformer` takes them; kept as pairs.
    symmetry : str, optional
        Mirror motions about a plane: "x", "y", "z" or "auto", as `Deformer` does.
    stretch : float
        Stretch resistance relative to detail preservation; 0 is the paper's energy.
    rotation_groups : int
        Number of rotation clusters.
    avoid_contact : bool
        Keep parts of the surface from crossing each other, as `Deformer` does.
    attach : mapping of int to int or "free"
        The components that others follow, as of `segment`, used at the next segmentation; kept as
        sorted pairs.

    Raises
    ------
    SessionError
        If a value has the wrong type or is out of range.
    """

    n_cage_vertices: int = 155
    offset: float | None = None
    preserve_volume: bool = True
    preserve_region_volumes: bool = False
    lids: bool | None = None
    stretch: float = 1.0
    rotation_groups: int = 300
    avoid_contact: bool = False
    attach: Attachments = ()
    volumes: tuple[tuple[str, str | float], ...] = ()
    symmetry: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "volumes", _pairs(self.volumes))
        for each in fields(self):
            value = getattr(self, each.name)
            if each.type == "bool" and not isinstance(value, bool):
                raise SessionError(f"{each.name} must be True or False; got {shown(value)}")
        object.__setattr__(self, "attach", _checked_attach(self.attach))
        if self.lids is not None and not isinstance(self.lids, bool):
            raise SessionError(f"lids must be True, False or None; got {shown(self.lids)}")
        is_axis = isinstance(self.symmetry, str) and self.symmetry in ("x", "y", "z", "auto")
        if not (self.symmetry is None or is_axis):
            raise SessionError(
                f"symmetry must be x, y, z, auto or None; got {shown(self.symmetry)}"
            )
        _require_number("n_cage_vertices", self.n_cage_vertices, 8, whole=True)
        _require_number("stretch", self.stretch, 0.0)
        if self.offset is not None:
            _require_number("offset", self.offset, _TINY)
        _require_number("rotation_groups", self.rotation_groups, 1, whole=True)


def _checked_attach(attach: Any) -> Attachments:
    """Return *attach*, a mapping or pairs, as sorted pairs; SessionError if it is neither."""
    try:
        pairs = dict(attach)
        return tuple(sorted(checked_attach(pairs, 1 + max(_numbers(pairs), default=0)).items()))
    except (ArgumentError, TypeError, ValueError, RuntimeError):
        raise SessionError(
            f"attach must map components to others or {FREE!r}; got {shown(attach)}"
        ) from None


def _numbers(pairs: Mapping[Any, Any]) -> list[int]:
    return [each for pair in pairs.items() for each in pair if is_whole(each, 0)]


def _pairs(volumes: object) -> tuple[tuple[str, str | float], ...]:
    try:
        goals = dict(volumes)  # type: ignore[call-overload]
        checked_goals(goals)
    except (TypeError, ValueError, RuntimeError) as fault:
        text = str(fault) if isinstance(fault, ConstraintError) else f"got {shown(volumes)}"
        raise SessionError(f"volumes must be goals by name: {text}") from None
    return tuple(goals.items())


@dataclass(frozen=True, eq=False, repr=False)
class Finished(Frozen):
    """The mesh in a pose that was finished, or dragged on from one that was; see `finishing`."""

    vertices: FloatArray
    """(n, 3) float."""
    held: IntArray
    """(h,) int: the vertices that were fixed or in handles at the finish, or since."""
    shifts: FloatArray
    """(h, 3) float: their positions minus the targets of the cages; nonzero only for vertices that
    were fixed, or made handles, in a finished pose."""
    cage_vertices: Cages
    """Of the pose that was finished."""
    offset: FloatArray
    """(n, 3) float: the finished mesh then, less that of the cages."""

    def shifted(self, x: FloatArray) -> FloatArray:
        """Return for every vertex its place, less that of the cages, whose mesh is *x* (n, 3)."""
        shift = self.vertices - x
        shift[self.held] = self.shifts
        return shift


@dataclass(frozen=True, eq=False, repr=False)
class Pose(Frozen):
    """A deformation of the cages, and the targets it was solved for; read-only arrays."""

    cage_vertices: Cages
    targets: Mapping[str, FloatArray]
    """For each handle by name, (k, 3) float: the targets of its vertices."""
    finished: Finished | None = None
    """The mesh, unless it is that of the cages, W~ p."""
    stiffness: FloatArray | None = None
    """(n,) float: that of its solve; W~ depends on where it is infinite."""

    @property
    def is_finished(self) -> bool:
        """Whether the mesh was finished with these cages, which were not moved since then."""
        return self.finished is not None and self.finished.cage_vertices is self.cage_vertices

    def on(self, stiffness: FloatArray | None) -> Pose:
        """Return the pose whose cages move the mesh as with another *stiffness*."""
        one, other = (_rigid(each) for each in (self.stiffness, stiffness))
        if np.array_equal(one, other):
            return self
        cages = (*self.cage_vertices,)  # caches tell them apart
        return replace(self, cage_vertices=cages, stiffness=stiffness)


@dataclass(frozen=True, eq=False, repr=False)
class Locality(Frozen):
    """The part of the surface that the last pull deforms; see `Deformer.local`."""

    point: SurfacePoint
    """The grabbed point."""
    reach: float
    """In the mesh's unit; infinite if all of the surface is free, 0 if only volumes move it."""
    spread: float
    """In the mesh's unit."""
    follows: float
    """0 to 1."""
    cage_vertices: Cages
    """At the press; the rest stays in this pose."""
    depth: float = 0.0
    """Of the joint of the pulled limb, in the mesh's unit; 0 without one."""
    hinge: float = 0.0
    """0 to 1: where this limb bends."""


@dataclass(frozen=True, eq=False, repr=False)
class LandmarkSet(Frozen):
    """k named landmarks, of the mesh at rest, and where each is to be; read-only arrays."""

    names: tuple[str, ...] = ()
    source: FloatArray = field(default_factory=lambda: frozen(np.empty((0, 3))))
    """(k, 3) float; NaN where a landmark has a target only."""
    target: FloatArray = field(default_factory=lambda: frozen(np.empty((0, 3))))
    """(k, 3) float; NaN in the rows of those without one."""
    uncertainty: FloatArray = field(default_factory=lambda: frozen(np.empty(0)))
    """(k,) float: standard deviation of each coordinate; NaN where none is given, which is 0."""


_NO_LANDMARKS = LandmarkSet()


@dataclass(frozen=True, eq=False, repr=False)
class CarriedFile:
    """A file whose points follow the mesh; see `SessionCarried`.

    Raises
    ------
    MeshError
        If *name* is not that of a file.
    """

    name: str
    """With its suffix, without a folder."""
    content: bytes

    def __post_init__(self) -> None:
        is_name = isinstance(self.name, str) and self.name.isprintable()
        if not is_name or not self.name.strip(". ") or set(self.name) & set("/\\:"):
            raise MeshError(f"{shown(self.name)} is not the name of a file")

    @cached_property
    def follower(self) -> Follower:
        """What it has; a MeshError if it cannot be read."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"file{Path(self.name).suffix}"
            with replacing(path) as draft:
                draft.write_bytes(self.content)
            try:
                return Follower.read(path)
            except MeshError as fault:
                raise MeshError(str(fault).replace(str(path), self.name)) from None


@dataclass(frozen=True, eq=False, repr=False)
class State(Described, Frozen):
    """Everything in a session except its mesh; immutable."""

    regions: Regions | None = None
    cages: tuple[Cage, ...] = ()
    """At rest; one for each region, or none."""
    fixed: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """(f,) int."""
    handles: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """(k,) int by name."""
    pose: Pose | None = None
    """None at rest."""
    options: Options = field(default_factory=Options)
    region_names: Names = ()
    """Names of the regions, as in `naming`."""
    pulls: tuple[str, ...] = ()
    """Names of handles made by pulls; those of no handle do not count."""
    locality: Locality | None = None
    """Of the last pull, if the pose comes from a pull."""
    pivots: Mapping[str, FloatArray] = field(default_factory=lambda: _NO_PIVOTS)
    """For handles by name, (3,): the point about which they rotate, at rest, if it was moved."""
    fixed_at: FloatArray | None = None
    """(f, 3) float: where the fixed vertices stay, if they were fixed in a pose; None: at rest."""
    stiffness: FloatArray | None = None
    """(n,) float: as `Deformer` takes it."""
    slides: tuple[Slide, ...] = ()
    """As `Deformer` takes them, with read-only arrays."""
    parts: Parts = ()
    """Parts of the surface that have volumes under lids, with read-only arrays."""
    saved: tuple[tuple[str, State], ...] = ()
    """Saved poses by name, as in `SavedPoses`; these states have none themselves."""
    landmarks: LandmarkSet = _NO_LANDMARKS
    carried: tuple[CarriedFile, ...] = ()

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        pose = self.pose
        return {
            "regions": "none" if self.regions is None else f"{self.regions.n_regions:,}",
            "cage vertices": f"{sum(cage.n_vertices for cage in self.cages):,}",
            "fixed": f"{len(self.fixed):,}",
            "handles": f"{len(self.handles):,}",
            "pose": "at rest" if pose is None else "finished" if pose.is_finished else "deformed",
        }

    @property
    def is_ready(self) -> bool:
        """Whether there are cages and at least one handle, so that a drag is possible."""
        return bool(self.cages) and bool(self.handles)

    @property
    def cage_vertices(self) -> Cages:
        """The vertices of the cages in the pose."""
        pose = self.pose
        return tuple(cage.vertices for cage in self.cages) if pose is None else pose.cage_vertices

    @property
    def handle(self) -> IntArray:
        """(k,) int: the vertices of all handles, concatenated."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.handles.values()])

    def at_rest(self) -> State:
        """Return the state without its pose and goals for volumes."""
        options = replace(self.options, volumes=())
        return replace(self, pose=None, locality=None, fixed_at=None, options=options)

    def changes(self, other: State) -> Change:
        """Return the parts in which *other* differs."""
        pairs = (
            (Change.REGIONS, self.regions is other.regions),
            (Change.NAMES, self.region_names == other.region_names),
            (Change.CAGES, self.cages == other.cages),  # cages are equal only if identical
            (
                Change.CONSTRAINTS,
                self.fixed is other.fixed
                and self.handles is other.handles
                and self.fixed_at is other.fixed_at
                and self.stiffness is other.stiffness
                and self.slides is other.slides
                and self.parts is other.parts,
            ),
            (Change.PIVOTS, self.pivots is other.pivots),
            (Change.POSE, self.pose is other.pose),
            (Change.OPTIONS, self.options == other.options),
            (Change.SAVED_POSES, self.saved is other.saved),
            (Change.LANDMARKS, self.landmarks is other.landmarks),
            (Change.CARRIED, self.carried == other.carried),  # equal only if identical
        )
        changed = Change(0)
        for change, same in pairs:
            changed |= Change(0) if same else change
        return changed


def checked_state(mesh: Mesh, state: State) -> State:
    """Return a checked copy of *state*.

    Raises
    ------
    RegionError
        If the regions belong to another mesh, or a name is invalid or used twice.
    CageError
        If there is not one cage per region, a cage does not enclose its region, or the pose has
        other cages or unreasonable coordinates.
    ConstraintError
        If fixed vertices or handles are not vertices of *mesh* or overlap, or the targets of the
        pose do not match the handles.
    """
    require(state, State, "state")
    require(state.handles, Mapping, "state.handles")
    require(state.options, Options, "state.options")
    regions = None if state.regions is None else of_mesh(mesh, state.regions)
    names = checked_names(state.region_names, regions.n_regions if regions else 0)
    cages = all_of(state.cages, Cage, "state.cages")
    cages = fitting_cages(regions, cages, names) if cages else ()
    handles = {}
    for name, ids in state.handles.items():
        if fault := fault_of(name):
            raise ConstraintError(f"a handle{fault}")
        _, handles[name] = checked_constraints(mesh, (), ids)
    every = np.concatenate([np.empty(0, dtype=np.int64), *handles.values()])
    fixed, _ = checked_constraints(mesh, state.fixed, every)
    lengths = [len(ids) for ids in handles.values()]
    if not all(lengths):
        raise ConstraintError("each handle must have at least one vertex; remove empty handles")
    pose = None
    if state.pose is not None:
        pose = _checked_pose(cages, lengths, list(handles), require(state.pose, Pose, "state.pose"))
        pose = replace(
            pose,
            finished=_checked_finished(mesh, cages, state.pose.finished),
            stiffness=checked_stiffness(mesh, state.pose.stiffness),
        )
        _require_plausible(mesh, pose)
    pulls, locality = all_of(state.pulls, str, "state.pulls"), state.locality
    if locality is not None:
        locality = _checked_locality(mesh, cages, require(locality, Locality, "state.locality"))
    pivots = _checked_pivots(mesh, handles, require(state.pivots, Mapping, "state.pivots"))
    owned = MappingProxyType({name: frozen(ids.copy()) for name, ids in handles.items()})
    constraints = frozen(fixed.copy()), owned
    places = None if pose is None else _checked_places(mesh, fixed, state)
    return State(
        regions, cages, *constraints, pose, state.options, names, pulls, locality, pivots, places,
        checked_stiffness(mesh, state.stiffness), owned_slides(mesh, state.slides),
        owned_parts(mesh, state.parts), _checked_saved(mesh, state.saved),
        owned_landmarks(mesh, state.landmarks), all_of(state.carried, CarriedFile, "state.carried"),
    )  # fmt: skip


def _rigid(stiffness: FloatArray | None) -> IntArray:
    """Return the vertices (k,) that are rigid."""
    return np.flatnonzero(np.isinf(() if stiffness is None else stiffness))


def checked_stiffness(mesh: Mesh, stiffness: ArrayLike | None) -> FloatArray | None:
    """Return a read-only copy of *stiffness* (n,); ConstraintError if it is none."""
    if stiffness is None:
        return None
    Stiffness.of(mesh, stiffness)
    return frozen(np.array(stiffness, dtype=np.float64))


def owned_slides(mesh: Mesh, slides: Iterable[Slide]) -> tuple[Slide, ...]:
    """Return checked *slides* with read-only arrays; ConstraintError if they are none."""
    try:
        checked = checked_slides(mesh, slides)
    except (TypeError, RuntimeError):
        raise ConstraintError(f"slides must be some Slide; got {shown(slides)}") from None
    for each in checked:
        frozen(np.asarray(each.vertices))
    return checked


def _checked_saved(
    mesh: Mesh, saved: tuple[tuple[str, State], ...]
) -> tuple[tuple[str, State], ...]:
    try:
        names = [name for name, each in saved if require(each, State, "state.saved")]
    except (TypeError, ValueError, RuntimeError):
        raise ConstraintError(f"saved must be names and states; got {shown(saved)}") from None
    if len(set(names)) != len(names):
        raise ConstraintError("two saved poses have the same name")
    for name in names:
        if fault := fault_of(name):
            raise ConstraintError(f"a pose{fault}")
    return tuple((name, checked_state(mesh, replace(each, saved=()))) for name, each in saved)


def owned_parts(mesh: Mesh, parts: Sequence[tuple[str, ArrayLike]]) -> Parts:
    """Return checked *parts* with read-only arrays; ConstraintError if they are none."""
    require_sequence(parts, "parts")
    try:
        pairs = [(name, ids) for name, ids in parts]
    except (TypeError, ValueError, RuntimeError):
        raise ConstraintError(f"parts must be names and vertices; got {shown(parts)}") from None
    found = []
    for name, ids in pairs:
        if fault := fault_of(name):
            raise ConstraintError(f"a part{fault}")
        try:
            own = as_ids(ids, mesh.n_vertices, "vertices")
        except ValueError as fault:
            raise ConstraintError(f"the part {name!r}: {fault}") from None
        found.append((name, frozen(own)))
    return tuple(found)


def owned_landmarks(mesh: Mesh, landmarks: LandmarkSet) -> LandmarkSet:
    """Return checked *landmarks* with read-only arrays; ConstraintError if they are none."""
    if landmarks is _NO_LANDMARKS:
        return landmarks
    names = all_of(require(landmarks, LandmarkSet, "landmarks").names, str, "landmarks.names")
    if len(set(names)) != len(names):
        raise ConstraintError("two landmarks have the same name")
    for name in names:
        if fault := fault_of(name):
            raise ConstraintError(f"a landmark{fault}")
    places = []
    for points in (landmarks.source, landmarks.target):
        known = np.isfinite(as_numbers(points, "landmarks")).all(axis=-1, keepdims=True)
        filled = as_points(np.where(known, points, mesh.vertices[0]), "landmarks", len(names))
        _require_near(mesh, filled, "a landmark is")
        places.append(frozen(np.where(known, filled, np.nan)))
    sigma = np.array(as_numbers(landmarks.uncertainty, "uncertainty"))
    if sigma.shape != (len(names),) or (sigma < 0.0).any() or np.isinf(sigma).any():
        raise ConstraintError("the uncertainty of landmarks must be one number each, 0 or more")
    return LandmarkSet(names, places[0], places[1], frozen(sigma))


def of_mesh(mesh: Mesh, regions: Regions) -> Regions:
    """Return *regions* as regions of *mesh*; RegionError if they belong to another mesh."""
    if require(regions, Regions, "regions").mesh is mesh:
        return regions
    for mine, theirs in ((mesh.vertices, regions.mesh.vertices), (mesh.faces, regions.mesh.faces)):
        if not np.array_equal(mine, theirs):
            raise RegionError("these regions belong to another mesh; create them on this mesh")
    return Regions(mesh, regions.membership, regions.smoothness, regions.carrier, regions.leader)


def fitting_cages(
    regions: Regions | None, cages: Sequence[Cage], names: Names = ()
) -> tuple[Cage, ...]:
    """Return *cages* as a tuple; CageError unless there is one around each region.

    The message contains the *names* of regions.
    """
    if regions is None:
        raise CageError("cages require regions; create regions first")
    cages = all_of(cages, Cage, "cages")
    if len(cages) != regions.n_regions:
        raise CageError(f"{regions.n_regions} regions need as many cages; got {len(cages)}")
    for r, cage in enumerate(cages):
        require_enclosed(cage, regions, r, region_name(names, r))
    return cages


def split_rows(array: Any, lengths: Sequence[int]) -> list[Any]:
    """Split *array* into consecutive parts with the given numbers of rows."""
    ends = np.cumsum([0, *lengths])
    return [array[a:b] for a, b in itertools.pairwise(ends)]


def _require_number(name: str, value: float, least: float, *, whole: bool = False) -> None:
    if not is_number(value, least) or (whole and not isinstance(value, int | np.integer)):
        kind = "a whole number" if whole else "a number"
        bound = "above 0" if least == _TINY else f"of at least {least:g}"
        raise SessionError(f"{name} must be {kind} {bound}; got {shown(value)}")


def _checked_pose(
    cages: Sequence[Cage], lengths: Sequence[int], names: Sequence[str], pose: Pose
) -> Pose:
    require(pose.targets, Mapping, "state.pose.targets")
    require_sequence(pose.cage_vertices, "state.pose.cage_vertices")
    places = [as_points(points, "cage_vertices") for points in pose.cage_vertices]
    expected, got = [cage.n_vertices for cage in cages], [len(points) for points in places]
    if not cages or got != expected:
        raise CageError(f"the cages of the pose must have {expected} vertices; got {got}")
    if list(pose.targets) != list(names):
        raise ConstraintError(
            f"the pose must have targets for {list(names)}; got {list(pose.targets)}"
        )
    targets = {name: as_points(points, "targets") for name, points in pose.targets.items()}
    if [len(points) for points in targets.values()] != list(lengths):
        raise ConstraintError("the pose must have one target for each vertex of each handle")
    owned = MappingProxyType({name: frozen(points.copy()) for name, points in targets.items()})
    return Pose(tuple(frozen(points.copy()) for points in places), owned)


def _checked_finished(
    mesh: Mesh, cages: Sequence[Cage], finished: Finished | None
) -> Finished | None:
    if finished is None:
        return None
    require(finished, Finished, "state.pose.finished")
    vertices = as_points(finished.vertices, "state.pose.finished.vertices")
    offset = as_points(finished.offset, "state.pose.finished.offset")
    for points in (vertices, offset):
        if len(points) != mesh.n_vertices:
            raise CageError(
                f"the finished pose must have {mesh.n_vertices} vertices; got {len(points)}"
            )
    held, _ = checked_constraints(mesh, finished.held, ())
    shifts = as_points(finished.shifts, "state.pose.finished.shifts")
    if len(shifts) != len(held) or not np.array_equal(held, finished.held):
        raise ConstraintError("the finished pose must have a shift for each held vertex")
    then = _checked_pose(cages, [], [], Pose(finished.cage_vertices, {}))
    _require_plausible(mesh, then)
    return Finished(
        frozen(vertices.copy()),
        frozen(held.copy()),
        frozen(shifts.copy()),
        then.cage_vertices,
        frozen(offset.copy()),
    )


def _checked_locality(mesh: Mesh, cages: Sequence[Cage], locality: Locality) -> Locality:
    start = _checked_pose(cages, [], [], Pose(locality.cage_vertices, {}))
    _require_plausible(mesh, start)
    point = checked_place(mesh, require(locality.point, SurfacePoint, "state.locality.point"))
    reach = locality.reach
    is_infinite = isinstance(reach, float) and reach == np.inf
    if not (is_number(locality.spread, _TINY) and (is_infinite or is_number(reach, 0.0))):
        lengths = shown(locality.spread), shown(reach)
        raise ConstraintError(f"the radius of a pull must be positive; got {', '.join(lengths)}")
    if not (is_number(locality.follows, 0.0) and locality.follows <= 1.0):
        raise ConstraintError(f"follows must be from 0 to 1; got {shown(locality.follows)}")
    if not is_number(locality.depth, 0.0):
        raise ConstraintError(f"depth must be 0 or positive; got {shown(locality.depth)}")
    checked_hinge(locality.hinge)
    return replace(locality, point=point, cage_vertices=start.cage_vertices)


def _checked_places(mesh: Mesh, fixed: IntArray, state: State) -> FloatArray | None:
    """Return the places of fixed vertices; ConstraintError unless they are points near *mesh*."""
    if state.fixed_at is None:
        return None
    places = as_points(state.fixed_at, "state.fixed_at")
    if len(places) != len(fixed) or not np.array_equal(fixed, state.fixed):
        raise ConstraintError(
            "state.fixed_at must have a place for each of state.fixed, as numbers"
        )
    _require_near(mesh, places, "the fixed vertices are")
    return frozen(places.copy())


def _checked_pivots(
    mesh: Mesh, handles: Mapping[str, IntArray], pivots: Mapping[str, FloatArray]
) -> Mapping[str, FloatArray]:
    """Return the pivots of *handles*; ConstraintError unless they are points near *mesh*."""
    if not pivots.keys() & handles.keys():
        return _NO_PIVOTS
    found = {}
    for name in pivots.keys() & handles.keys():
        (point,) = as_points([pivots[name]], f"pivot of {name}")
        _require_near(mesh, point, f"the pivot of {name} is")
        found[name] = frozen(point.copy())
    return MappingProxyType(found)


def _require_plausible(mesh: Mesh, pose: Pose) -> None:
    """Raise a ConstraintError if *pose* is so far away that vertices could overflow."""
    own = [] if pose.finished is None else [pose.finished.vertices]
    every = np.concatenate([*pose.cage_vertices, *pose.targets.values(), *own])
    _require_near(mesh, every, "the pose is damaged: it is")


def _require_near(mesh: Mesh, points: FloatArray, what: str) -> None:
    away = np.abs(points - mesh.vertices.mean(axis=0)).max(initial=0.0) / mesh.diagonal
    if not away <= _FARTHEST:
        raise ConstraintError(f"{what} {away:.0e} mesh diagonals away from the mesh")
