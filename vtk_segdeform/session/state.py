"""What a session is at one moment.

A `State` is frozen and its arrays are never written to, so that states share whatever did not
change between them.  A step of history costs what it changed: a painted region one mask per
region, a drag the vertices of the cages (m, 3) and the targets of the handles (k, 3).  The mesh,
and the vertices of a pose, are in no state.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray, as_points, frozen, is_number
from ..cages import Cage
from ..checks import all_of, require, require_sequence, shown
from ..deformer import checked_constraints
from ..errors import CageError, ConstraintError, RegionError, SessionError
from ..freezing import Frozen
from ..mesh import Mesh
from ..regions import Regions
from .listeners import Change
from .naming import Names, called, checked_names, fault_of

_TINY = float(np.finfo(np.float64).tiny)
_WRECKED = 1e6  # diagonals from the mesh that no drag gets to


@dataclass(frozen=True, kw_only=True)
class Options:
    """How cages are fitted and poses solved for.

    Parameters
    ----------
    n_cage_vertices : int
        Of all cages together, for the next time they are fitted.
    offset : float, optional
        How far cages stay from the skin, in the mesh's unit; None chooses.  Likewise.
    preserve_volume, preserve_region_volumes : bool
        Hold the enclosed volume exactly; hold that of every region as well.
    stretch : float
        Strength of the stretch term relative to the detail term; 0 is the paper's energy.
    rotation_groups : int, optional
        How many rotations the detail turns by; None is one per vertex.

    Raises
    ------
    SessionError
        If a value is of the wrong kind or out of range.
    """

    n_cage_vertices: int = 155
    offset: float | None = None
    preserve_volume: bool = True
    preserve_region_volumes: bool = False
    stretch: float = 10.0
    rotation_groups: int | None = 300

    def __post_init__(self) -> None:
        for name in ("preserve_volume", "preserve_region_volumes"):
            value = getattr(self, name)
            if not isinstance(value, bool):
                raise SessionError(f"{name} must be True or False; got {shown(value)}")
        _require_number("n_cage_vertices", self.n_cage_vertices, 8, whole=True)
        _require_number("stretch", self.stretch, 0.0)
        if self.offset is not None:
            _require_number("offset", self.offset, _TINY)
        if self.rotation_groups is not None:
            _require_number("rotation_groups", self.rotation_groups, 1, whole=True)


@dataclass(frozen=True, eq=False)
class Pose(Frozen):
    """Where the cages are, from which all else follows, and what for; read-only arrays."""

    cage_vertices: tuple[FloatArray, ...]
    """One (m_r, 3) float per region."""
    targets: Mapping[str, FloatArray]
    """For each handle (k, 3) float: where its vertices were to go."""


@dataclass(frozen=True, eq=False)
class State(Frozen):
    """All that a session holds besides its mesh of n vertices; shared, never changed in place."""

    regions: Regions | None = None
    cages: tuple[Cage, ...] = ()
    """At rest, one for each region, or none."""
    fixed: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """(f,) int."""
    handles: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """(k,) int by name."""
    pose: Pose | None = None
    """None is rest."""
    options: Options = field(default_factory=Options)
    region_names: Names = ()
    """What `naming` makes of the names that regions were given."""

    @property
    def handle(self) -> IntArray:
        """(k,) int: the vertices of all handles, one handle after the other."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.handles.values()])

    def changes(self, other: State) -> Change:
        """Tell in what *other* is another state."""
        pairs = (
            (Change.REGIONS, self.regions is other.regions),
            (Change.NAMES, self.region_names == other.region_names),
            (Change.CAGES, self.cages == other.cages),  # the very same ones
            (Change.CONSTRAINTS, self.fixed is other.fixed and self.handles is other.handles),
            (Change.POSE, self.pose is other.pose),
            (Change.OPTIONS, self.options == other.options),
        )
        changed = Change(0)
        for change, same in pairs:
            changed |= Change(0) if same else change
        return changed


def checked_state(mesh: Mesh, state: State) -> State:
    """Return *state* with arrays of its own, or raise an error that says what does not fit.

    Raises
    ------
    RegionError
        If the regions are of another mesh, or a name cannot be one or is there twice.
    CageError
        If there is not one cage per region, a cage leaves out part of its region, or the pose has
        other cages or numbers beyond all sense.
    ConstraintError
        If fixed vertices or handles are no vertices of *mesh* or share one, or the targets of the
        pose are not theirs.
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
        raise ConstraintError("each handle must have a vertex or more; leave out empty ones")
    pose = None
    if state.pose is not None:
        pose = _checked_pose(cages, lengths, list(handles), require(state.pose, Pose, "state.pose"))
        _require_no_wreck(mesh, pose)
    owned = MappingProxyType({name: _own(ids) for name, ids in handles.items()})
    return State(regions, cages, _own(fixed), owned, pose, state.options, names)


def of_mesh(mesh: Mesh, regions: Regions) -> Regions:
    """Return *regions*, or a RegionError if they are of another mesh."""
    if require(regions, Regions, "regions").mesh is mesh:
        return regions
    for mine, theirs in ((mesh.vertices, regions.mesh.vertices), (mesh.faces, regions.mesh.faces)):
        if not np.array_equal(mine, theirs):
            raise RegionError("these regions are of another mesh; make them anew on this one")
    return Regions(mesh, regions.membership, regions.smoothness)


def fitting_cages(
    regions: Regions | None, cages: Sequence[Cage], names: Names = ()
) -> tuple[Cage, ...]:
    """Return *cages* as a tuple, or a CageError unless there is one around each region.

    The error calls regions by their *names*.
    """
    if regions is None:
        raise CageError("there are no regions to put cages around; make regions first")
    cages = all_of(cages, Cage, "cages")
    if len(cages) != regions.n_regions:
        raise CageError(f"{regions.n_regions} regions need as many cages; got {len(cages)}")
    for r, cage in enumerate(cages):
        members = regions.mesh.vertices[regions.membership[r]]
        cage.require_encloses(members, f"vertices of {called(names, r)}")
    return cages


def pieces(array: Any, lengths: Sequence[int]) -> list[Any]:
    """Return *array* in pieces of as many rows, one after the other."""
    ends = np.cumsum([0, *lengths])
    return [array[a:b] for a, b in itertools.pairwise(ends)]


def _require_number(name: str, value: float, least: float, *, whole: bool = False) -> None:
    if not is_number(value, least) or (whole and not isinstance(value, int | np.integer)):
        kind = "a whole number" if whole else "a number"
        bound = "above 0" if least == _TINY else f"from {least:g} up"
        raise SessionError(f"{name} must be {kind} {bound}; got {shown(value)}")


def _checked_pose(
    cages: Sequence[Cage], lengths: Sequence[int], names: Sequence[str], pose: Pose
) -> Pose:
    require(pose.targets, Mapping, "state.pose.targets")
    require_sequence(pose.cage_vertices, "state.pose.cage_vertices")
    places = [as_points(points, "cage_vertices") for points in pose.cage_vertices]
    expected, got = [cage.n_vertices for cage in cages], [len(points) for points in places]
    if not cages or got != expected:
        raise CageError(f"the pose must hold {expected} points, cage by cage; got {got}")
    if list(pose.targets) != list(names):
        raise ConstraintError(f"the pose has targets for {list(pose.targets)}, not {list(names)}")
    targets = {name: as_points(points, "targets") for name, points in pose.targets.items()}
    if [len(points) for points in targets.values()] != list(lengths):
        raise ConstraintError("the pose must have one target for each vertex of each handle")
    owned = MappingProxyType({name: _own(points) for name, points in targets.items()})
    return Pose(tuple(_own(points) for points in places), owned)


def _require_no_wreck(mesh: Mesh, pose: Pose) -> None:
    """Raise a CageError if numbers of *pose* are so far off that vertices could overflow."""
    every = np.concatenate([*pose.cage_vertices, *pose.targets.values()])
    away = np.abs(every - mesh.vertices.mean(axis=0)).max(initial=0.0) / mesh.diagonal
    if not away <= _WRECKED:
        raise CageError(f"the pose reaches {away:.0e} diagonals of the mesh away; it is damaged")


def _own(array: Any) -> Any:
    return frozen(array.copy())
