"""Search for the faults that prevent triangles from being a `Mesh`, and for borders and the like.

The checks run in this order: coordinates, indices, single faces, edges, vertices, and last the
orientation of shells.  Each check skips everything that earlier ones rejected, so that a fault is
reported once and under its own name.

Long because all checks are beside each other, so that none repeats the work of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, bounds_of, plain
from ..errors import ArgumentError
from .edges import repeats_vertex
from .grouping import connected, first_equal_row, first_members
from .report import Fault, Id, Kind, MeshReport, counted
from .shells import closed_shells, shell_depths, shell_faults
from .topology import HalfEdges
from .triangles import flat_faces

UNREPAIRABLE = (
    Kind.EMPTY, Kind.BAD_INDEX, Kind.TOO_LARGE, Kind.TOO_SMALL, Kind.OUTLYING, Kind.FLAT,
)  # fmt: skip
_EXAMPLES = 4
_FEW = 100  # faces or points that usually answer a question about all
_LARGEST, _SMALLEST = 1e70, 1e-70  # fourth powers of lengths must neither overflow nor vanish
_OUTLYING = 1e13  # half widths of most of the mesh: its vertices differ by rounding errors only
_SOME = 1000  # vertices whose median is close to that of all


def find_faults(vertices: ArrayLike, faces: ArrayLike) -> MeshReport:
    """Return every fault of the triangles *faces* over *vertices*, with counts and examples.

    Degenerate and duplicate faces are reported and then ignored by the later checks, so that each
    fault is reported once.  Only closed, consistently oriented shells are checked for facing
    outward.

    Parameters
    ----------
    vertices : (n, 3) float
        NaN and infinite coordinates are reported as a fault.
    faces : (m, 3) int
        Indices out of range are reported as a fault.

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.

    Examples
    --------
    A tetrahedron without one of its faces:

    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> report = find_faults(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> report.ok, report.is_closed, report.count(Kind.OPEN_EDGE), report.count(Kind.HOLE)
    (True, False, 3, 1)
    >>> print(report.notes[0])
    3 open edges (1-2, 1-3, 2-3)
    """
    return Search(*as_soup(vertices, faces)).report


@dataclass(frozen=True, eq=False)
class Search:
    """The search for faults of *triangles* (m, 3) over *points* (n, 3), arrays as of `as_soup`."""

    points: FloatArray
    triangles: IntArray

    @classmethod
    def known(
        cls,
        points: FloatArray,
        half_edges: HalfEdges,
        depth: IntArray | None = None,
    ) -> Search:
        """Return the search of the faces of *half_edges*, none degenerate or duplicate.

        All *points* are in faces; *depth* is the number of shells around each closed one, if known.
        """
        search, none = cls(points, half_edges.faces), np.zeros(len(half_edges.faces), dtype=bool)
        search.__dict__["_corners"] = np.ones(len(points), dtype=bool), 0
        search.__dict__["_distinct"] = none, none, half_edges
        if depth is not None:
            search.__dict__["depth"] = depth
        return search

    def at(self, points: FloatArray) -> Search:
        """Return the search of the same triangles over other *points* (n, 3)."""
        search = Search(points, self.triangles)
        search.__dict__["_corners"] = self._corners
        return search

    @cached_property
    def depth(self) -> IntArray:
        """`shell_depths` of the closed shells of `half_edges`."""
        return shell_depths(self.points, self.half_edges, closed_shells(self.half_edges))

    @cached_property
    def _corners(self) -> tuple[BoolArray, int | None]:
        used, faces = np.zeros(len(self.points), dtype=bool), self.triangles
        if not len(faces) or (faces.min() >= 0 and faces.max() < len(used)):
            used[faces] = True
            return used, int(np.count_nonzero(repeats_vertex(faces)))
        used[faces[((faces >= 0) & (faces < len(used))).all(axis=1)]] = True
        return used, None

    @property
    def used(self) -> BoolArray:
        """(n,) bool: which points are in a face whose vertex indices are all in range."""
        return self._corners[0]

    @property
    def n_repeating(self) -> int | None:
        """Number of faces that contain a vertex twice; None if an index is out of range."""
        return self._corners[1]

    @cached_property
    def extent(self) -> float:
        """Largest side of the box around the points in faces, which are finite."""
        points = self.points if self.used.all() else self.points[self.used]
        if not len(points):
            return 0.0
        low, high = bounds_of(points)
        with np.errstate(over="ignore"):
            return float((high - low).max())

    @cached_property
    def number_faults(self) -> tuple[Fault, ...]:
        """Faults of coordinates and indices; nothing else is computed if some are unrepairable."""
        return tuple(_number_faults(self))

    @cached_property
    def degenerate(self) -> BoolArray:
        """(m,) bool: which faces contain a vertex twice."""
        return self._distinct[0]

    @cached_property
    def duplicate(self) -> BoolArray:
        """(m,) bool: which faces have the vertices of an earlier face."""
        return self._distinct[1]

    @cached_property
    def half_edges(self) -> HalfEdges:
        """Half-edges of the faces that are neither degenerate nor duplicate."""
        return self._distinct[2]

    @cached_property
    def _distinct(self) -> tuple[BoolArray, BoolArray, HalfEdges]:
        if self.n_repeating == 0:
            none = np.zeros(len(self.triangles), dtype=bool)
            return _without_repeated(none, HalfEdges(self.triangles, len(self.points)))
        return distinct_faces(self.triangles, len(self.points))

    @cached_property
    def flat(self) -> IntArray:
        """(k,) int: the faces without area."""
        return flat_faces(self.points, self.triangles)

    @cached_property
    def all_flat(self) -> bool:
        """Whether no face has an area."""
        few = self.triangles[:_FEW]  # usually enough
        return len(flat_faces(self.points, few)) == len(few) and (
            len(self.flat) == len(self.triangles)
        )

    @cached_property
    def first_at(self) -> IntArray:
        """(n,) int: the first vertex at the position of each vertex."""
        return first_equal_row(self.points)

    @property
    def _unrepairable(self) -> bool:
        return any(fault.kind in UNREPAIRABLE for fault in self.number_faults)

    @cached_property
    def n_components(self) -> int:
        """Number of shells; 0 if a fault cannot be repaired."""
        return 0 if self._unrepairable else int(self.half_edges.shells.max(initial=-1)) + 1

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """What prevents the triangles from being a `Mesh`."""
        found = list(self.number_faults)
        if not self._unrepairable:
            found += _some(Kind.DEGENERATE, np.flatnonzero(self.degenerate))
            found += _some(Kind.DUPLICATE_FACE, np.flatnonzero(self.duplicate))
            if self.all_flat and not self.degenerate.all():
                found.append(Fault(Kind.FLAT, 1))
            found += _turned_edges(self.half_edges)
            found += _some(Kind.INWARD, self._inward_and_flat_shells[0])
        return tuple(found)

    @cached_property
    def notes(self) -> tuple[Fault, ...]:
        """What else is worth knowing."""
        found: list[Fault] = []
        if not self._unrepairable:
            found += _some(Kind.ZERO_AREA, self.flat[~self.degenerate[self.flat]])
            found += _edge_notes(self.half_edges)
            found += _some(Kind.NO_VOLUME, self._inward_and_flat_shells[1])
            coincident = self.first_at != np.arange(len(self.points))
            found += _some(Kind.COINCIDENT, np.flatnonzero(coincident))
            if self.n_components > 1:
                found.append(Fault(Kind.COMPONENTS, self.n_components))
        return tuple(found)

    @cached_property
    def _inward_and_flat_shells(self) -> tuple[IntArray, IntArray]:
        has_others = any(fault.kind is Kind.NON_FINITE for fault in self.number_faults)
        return _inward_and_flat_shells(self, _finite(self.points) if has_others else None)

    @property
    def is_two_manifold(self) -> bool:
        """`MeshReport.is_two_manifold`, without the other notes."""
        return not self.faults and self.half_edges.all_twins and not len(self.half_edges.pinched)

    @property
    def is_closed(self) -> bool:
        """`MeshReport.is_closed`, without the other notes."""
        return self.is_two_manifold and not len(self._inward_and_flat_shells[1])

    @cached_property
    def report(self) -> MeshReport:
        """All faults and notes."""
        n_vertices, n_faces = len(self.points), len(self.triangles)
        return MeshReport(n_vertices, n_faces, self.n_components, self.faults, self.notes)


def as_soup(vertices: ArrayLike, faces: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Return (n, 3) float and (m, 3) int arrays; only shapes and types are checked."""
    points, triangles = plain(vertices, "vertices"), plain(faces, "faces")
    if points.size == 0:
        points = np.empty((0, 3))
    if triangles.size == 0:
        triangles = np.empty((0, 3), np.int64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ArgumentError(f"vertices must have shape (n, 3); got {points.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ArgumentError(f"faces must have shape (m, 3), triangles; got {triangles.shape}")
    if points.dtype.kind not in "iuf":
        raise ArgumentError(f"vertices must contain numbers; got {points.dtype}")
    if triangles.dtype.kind not in "iu":
        raise ArgumentError(f"faces must contain integers; got {triangles.dtype}")
    return (
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.int64),
    )


def connectivity_faults(n_points: int, faces: IntArray) -> list[str]:
    """Return one sentence per fault of the connectivity of a cage, *faces* (m, 3); [] if none.

    Shorter than `find_faults`, since a faulty cage is rejected and not repaired.
    """
    if len(faces) < 4:
        return [f"a closed surface needs at least 4 faces; got {len(faces)}"]
    if repeated := int(np.count_nonzero(repeats_vertex(faces))):
        return [f"{counted(repeated, 'face repeats', 'faces repeat')} a vertex"]
    half_edges = HalfEdges(faces, n_points)
    faults = []
    if len(half_edges.boundary):
        border = counted(len(half_edges.boundary), "edge borders", "edges border")
        faults.append(f"{border} only one face: the cage is open")
    if len(half_edges.branching):
        edges = counted(len(half_edges.branching), "edge borders", "edges border")
        faults.append(f"{edges} three or more faces")
    if len(half_edges.turned):
        edges = counted(len(half_edges.turned), "edge has", "edges have")
        faults.append(f"{edges} faces of opposite orientation")
    unused = n_points - len(np.unique(faces))
    if unused:
        faults.append(f"{counted(unused, 'vertex is', 'vertices are')} in no face")
    if not faults and len(half_edges.pinched):
        vertices = counted(len(half_edges.pinched), "vertex joins", "vertices join")
        faults.append(f"{vertices} several surfaces at one point")
    return faults


def _number_faults(search: Search) -> Iterator[Fault]:
    points, faces = search.points, search.triangles
    if not len(faces):
        yield Fault(Kind.EMPTY, 1)
    finite, far = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    if points.size and not -_LARGEST <= points.min() <= points.max() <= _LARGEST:
        finite = _finite(points)
        far[:] = (np.isfinite(points) & (np.abs(points) > _LARGEST)).any(axis=1)
    yield from _some(Kind.NON_FINITE, np.flatnonzero(~finite))
    if search.n_repeating is None:
        bad = ((faces < 0) | (faces >= len(points))).any(axis=1)
        yield from _some(Kind.BAD_INDEX, np.flatnonzero(bad))
    yield from _some(Kind.TOO_LARGE, np.flatnonzero(far))
    if finite.any() and not far.any() and _too_small(points if finite.all() else points[finite]):
        yield Fault(Kind.TOO_SMALL, 1)
    if finite.all() and not far.any():
        yield from _some(Kind.OUTLYING, _outlying(points, search.used))
    yield from _some(Kind.UNREFERENCED, np.flatnonzero(~search.used))


def _too_small(points: FloatArray) -> bool:
    few = points[:_FEW]  # usually enough
    if (np.abs(few - few[0]) >= _SMALLEST).any():
        return False
    return bool(0.0 < max(np.ptp(column) for column in points.T) < _SMALLEST)


def _outlying(points: FloatArray, used: BoolArray) -> IntArray:
    """Return the points (k,) in faces that are too far from most of the others."""
    ids = np.flatnonzero(used)
    if not len(ids):
        return ids
    some = points[ids[:: len(ids) // _SOME + 1]]
    centre = np.median(some, axis=0)
    reach = _OUTLYING * float(np.median(np.abs(some - centre).max(axis=1)))
    low, high = centre - reach, centre + reach
    lowest, highest = bounds_of(points)
    if reach == 0.0 or ((low <= lowest).all() and (highest <= high).all()):
        return ids[:0]
    return np.flatnonzero(((points < low) | (points > high)).any(axis=1) & used)


def _finite(points: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(points).all(axis=1))


def distinct_faces(faces: IntArray, n_vertices: int) -> tuple[BoolArray, BoolArray, HalfEdges]:
    """Return which faces are degenerate, which repeat an earlier one, and the others' half-edges.

    No face is both.
    """
    degenerate = repeats_vertex(faces)
    left = faces[~degenerate] if degenerate.any() else faces
    return _without_repeated(degenerate, HalfEdges(left, n_vertices))


def _without_repeated(
    degenerate: BoolArray, half_edges: HalfEdges
) -> tuple[BoolArray, BoolArray, HalfEdges]:
    """Return `distinct_faces`, of the *half_edges* of the faces that are not *degenerate*."""
    duplicate = np.zeros(len(degenerate), dtype=bool)
    repeated = half_edges.repeated
    if repeated.any():
        duplicate[~degenerate] = repeated
        half_edges = HalfEdges(half_edges.faces[~repeated], half_edges.n_vertices)
    return degenerate, duplicate, half_edges


def _edge_notes(half_edges: HalfEdges) -> Iterator[Fault]:
    boundary = half_edges.boundary
    yield from _some(Kind.OPEN_EDGE, boundary, half_edges)
    ends = np.stack([half_edges.tail[boundary], half_edges.head_of(boundary)], axis=1)
    corners, ends = np.unique(ends, return_inverse=True)
    hole = first_members(connected(len(corners), *ends.reshape(-1, 2).T))
    yield from _some(Kind.HOLE, corners[hole])
    yield from _some(Kind.NON_MANIFOLD_EDGE, half_edges.branching, half_edges)
    yield from _some(Kind.NON_MANIFOLD_VERTEX, half_edges.pinched)
    if not half_edges.is_oriented:
        first = first_members(half_edges.shells)
        yield from _some(Kind.ONE_SIDED, half_edges.faces[first[half_edges.one_sided], 0])


def _turned_edges(half_edges: HalfEdges) -> Iterator[Fault]:
    turned = half_edges.turned
    if len(turned):
        turned = turned[~half_edges.one_sided[half_edges.shells[turned // 3]]]
        yield from _some(Kind.TURNED_EDGE, turned, half_edges)


def _inward_and_flat_shells(search: Search, finite: BoolArray | None) -> tuple[IntArray, IntArray]:
    """Return a vertex of each shell that is inside-out, and of each that encloses no volume.

    Only shells that are closed and consistently oriented; others may be around them.  *finite* (n,)
    says which points are, if not all.
    """
    half_edges = search.half_edges
    if finite is not None:
        valid = finite[half_edges.faces].all(axis=1)
        half_edges = HalfEdges(half_edges.faces[valid], len(search.points))
    closed = closed_shells(half_edges)
    if not closed.any():
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    depth = search.depth if finite is None else None
    wrong, flat = shell_faults(search.points, half_edges, closed, depth)
    first = half_edges.faces[first_members(half_edges.shells), 0]
    return first[wrong & ~flat], first[flat]


def _some(kind: Kind, where: IntArray, edges_of: HalfEdges | None = None) -> Iterator[Fault]:
    """Yield the fault if it occurs, at vertices or faces, or at half-edges of *edges_of*."""
    if len(where):
        few = where[:_EXAMPLES]
        examples: tuple[Id, ...] = tuple(few.tolist())
        if edges_of is not None:
            ends = np.stack([edges_of.tail[few], edges_of.head_of(few)], axis=1)
            examples = tuple((a, b) for a, b in np.sort(ends, axis=1).tolist())
        yield Fault(kind, len(where), examples)
