"""Search for the faults that prevent triangles from being a `Mesh`, and for borders and the like.

The checks run in this order: coordinates, indices, single faces, edges, vertices, and last the
orientation of shells.  Each check skips everything that earlier ones rejected, so that a fault is
reported once and under its own name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, plain
from ..errors import ArgumentError
from ..kernels import in_parallel
from .grouping import connected, first_equal_row
from .report import Fault, Id, Kind, MeshReport, counted
from .shells import closed_shells, shell_faults
from .topology import HalfEdges, repeats_vertex
from .triangles import corner_columns, cross, norm

UNREPAIRABLE = (Kind.EMPTY, Kind.BAD_INDEX, Kind.TOO_LARGE, Kind.TOO_SMALL, Kind.FLAT)
_EXAMPLES = 4
_PIECE = 10_000  # faces per task; their data fit into the cache
_LARGEST, _SMALLEST = 1e70, 1e-70  # fourth powers of lengths must neither overflow nor vanish
_FLAT = 1e-12  # height over longest edge; a flatter face counts as one without area


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
    def known(cls, points: FloatArray, half_edges: HalfEdges) -> Search:
        """Return the search of the faces of *half_edges*, none degenerate or duplicate."""
        search, none = cls(points, half_edges.faces), np.zeros(len(half_edges.faces), dtype=bool)
        search.__dict__["_distinct"] = none, none, half_edges
        return search

    @cached_property
    def number_faults(self) -> tuple[Fault, ...]:
        """Faults of coordinates and indices; nothing else is computed if some are unrepairable."""
        return tuple(_number_faults(self.points, self.triangles))

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
        return distinct_faces(self.triangles, len(self.points))

    @cached_property
    def flat(self) -> IntArray:
        """(k,) int: the faces without area."""
        return _flat_faces(self.points, self.triangles)

    @property
    def all_flat(self) -> bool:
        """Whether no face has an area."""
        return len(self.flat) == len(self.triangles)

    @cached_property
    def first_at(self) -> IntArray:
        """(n,) int: the first vertex at the position of each vertex."""
        return first_equal_row(self.points)

    @cached_property
    def report(self) -> MeshReport:
        """All faults and notes."""
        n_components = 0
        found = list(self.number_faults)
        if not any(fault.kind in UNREPAIRABLE for fault in found):
            n_components = int(self.half_edges.shells.max(initial=-1)) + 1
            found += _some(Kind.DEGENERATE, np.flatnonzero(self.degenerate))
            found += _some(Kind.DUPLICATE_FACE, np.flatnonzero(self.duplicate))
            if self.all_flat and not self.degenerate.all():
                found.append(Fault(Kind.FLAT, 1))
            found += _some(Kind.ZERO_AREA, self.flat[~self.degenerate[self.flat]])
            found += _edge_faults(self.half_edges)
            found += _inward_shells(self.points, self.half_edges)
            coincident = self.first_at != np.arange(len(self.points))
            found += _some(Kind.COINCIDENT, np.flatnonzero(coincident))
            if n_components > 1:
                found.append(Fault(Kind.COMPONENTS, n_components))
        return MeshReport(
            n_vertices=len(self.points),
            n_faces=len(self.triangles),
            n_components=n_components,
            faults=tuple(fault for fault in found if fault.kind.fatal),
            notes=tuple(fault for fault in found if not fault.kind.fatal),
        )


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
    a, b, c = faces.T
    repeated = np.count_nonzero((a == b) | (b == c) | (c == a))
    if repeated:
        return [f"{counted(int(repeated), 'face repeats', 'faces repeat')} a vertex"]
    half_edges = HalfEdges(faces, n_points)
    faults = []
    if len(half_edges.boundary):
        border = counted(len(half_edges.boundary), "edge borders", "edges border")
        faults.append(f"{border} only one face: the cage is open")
    if len(half_edges.non_manifold):
        edges = counted(len(half_edges.non_manifold), "edge borders", "edges border")
        faults.append(f"{edges} three or more faces")
    inconsistent = int(np.count_nonzero(half_edges.inconsistent))
    if inconsistent:
        edges = counted(inconsistent, "edge has", "edges have")
        faults.append(f"{edges} faces of opposite orientation")
    unused = n_points - len(np.unique(faces))
    if unused:
        faults.append(f"{counted(unused, 'vertex is', 'vertices are')} in no face")
    if not faults:
        fans = half_edges.fans(half_edges.pairs)
        pinched = len(np.unique(fans)) - n_points
        if pinched:
            vertices = counted(pinched, "vertex joins", "vertices join")
            faults.append(f"{vertices} several surfaces at one point")
    return faults


def _number_faults(points: FloatArray, faces: IntArray) -> Iterator[Fault]:
    if not len(faces):
        yield Fault(Kind.EMPTY, 1)
    finite, far = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    if not (np.abs(points) <= _LARGEST).all():  # one cheap test before several
        finite = _finite(points)
        far[:] = (np.isfinite(points) & (np.abs(points) > _LARGEST)).any(axis=1)
    yield from _some(Kind.NON_FINITE, np.flatnonzero(~finite))
    bad = np.zeros(len(faces), dtype=bool)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(points)):
        bad[:] = ((faces < 0) | (faces >= len(points))).any(axis=1)
    yield from _some(Kind.BAD_INDEX, np.flatnonzero(bad))
    yield from _some(Kind.TOO_LARGE, np.flatnonzero(far))
    if finite.any() and not far.any():
        columns = points.T if finite.all() else points[finite].T
        if 0.0 < max(np.ptp(column) for column in columns) < _SMALLEST:
            yield Fault(Kind.TOO_SMALL, 1)
    used = np.zeros(len(points), dtype=bool)
    used[faces[~bad] if bad.any() else faces] = True
    yield from _some(Kind.UNREFERENCED, np.flatnonzero(~used))


def _finite(points: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(points).all(axis=1))


def distinct_faces(faces: IntArray, n_vertices: int) -> tuple[BoolArray, BoolArray, HalfEdges]:
    """Return which faces are degenerate, which repeat an earlier one, and the others' half-edges.

    No face is both.
    """
    degenerate, duplicate = repeats_vertex(faces), np.zeros(len(faces), dtype=bool)
    half_edges = HalfEdges(faces[~degenerate] if degenerate.any() else faces, n_vertices)
    if half_edges.repeated.any():
        duplicate[~degenerate] = half_edges.repeated
        half_edges = HalfEdges(faces[~degenerate & ~duplicate], n_vertices)
    return degenerate, duplicate, half_edges


def _flat_faces(points: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces without area, (k,) int."""
    flat = np.zeros(len(faces), dtype=bool)

    def work(start: int, stop: int) -> None:
        with np.errstate(invalid="ignore", over="ignore"):
            a, b, c = corner_columns(points, faces[start:stop])
            area = norm(cross(b - a, c - a))
            longest = np.max([(e * e).sum(axis=0) for e in (b - a, c - b, a - c)], axis=0)
            flat[start:stop] = area <= _FLAT * longest

    in_parallel(work, len(faces), _PIECE)
    return np.flatnonzero(flat)


def _edge_faults(half_edges: HalfEdges) -> Iterator[Fault]:
    def edges(some: IntArray) -> tuple[Id, ...]:
        ends = np.stack([half_edges.tail[some], half_edges.head[some]], axis=1)
        return tuple((a, b) for a, b in np.sort(ends, axis=1).tolist())

    if half_edges.twin is not None:  # nothing else can be wrong
        yield from _some(Kind.NON_MANIFOLD_VERTEX, half_edges.pinched)
        return
    yield from _some(Kind.OPEN_EDGE, half_edges.boundary, edges)
    ends = np.stack(
        [half_edges.tail[half_edges.boundary], half_edges.head[half_edges.boundary]], axis=1
    )
    corners, ends = np.unique(ends, return_inverse=True)
    _, hole = np.unique(connected(len(corners), *ends.reshape(-1, 2).T), return_index=True)
    yield from _some(Kind.HOLE, corners[hole])
    non_manifold = half_edges.order[half_edges.first[half_edges.counts > 2]]
    yield from _some(Kind.NON_MANIFOLD_EDGE, non_manifold, edges)
    yield from _some(Kind.NON_MANIFOLD_VERTEX, half_edges.pinched)
    turned = half_edges.pairs[half_edges.inconsistent, 0]
    if len(turned):
        one_sided = half_edges.one_sided
        yield from _some(
            Kind.TURNED_EDGE, turned[~one_sided[half_edges.shells[turned // 3]]], edges
        )
        _, first = np.unique(half_edges.shells, return_index=True)
        yield from _some(Kind.ONE_SIDED, half_edges.faces[first[one_sided], 0])


def _inward_shells(points: FloatArray, half_edges: HalfEdges) -> Iterator[Fault]:
    """Yield the faults of orientation of the shells that are closed and consistently oriented.

    Others may be around them.
    """
    faces, shells = half_edges.faces, half_edges.shells
    closed = closed_shells(half_edges)
    if not (finite := _finite(points)).all():
        valid = finite[faces].all(axis=1)
        closed[shells[~valid]] = False
        faces = faces[valid]
        left, shells = np.unique(shells[valid], return_inverse=True)
        closed = closed[left]
    if closed.any():
        wrong, flat, first = shell_faults(points, faces, shells, closed)
        yield from _some(Kind.INWARD, faces[first[wrong & ~flat], 0])
        yield from _some(Kind.NO_VOLUME, faces[first[flat], 0])


def _some(
    kind: Kind, where: IntArray, ids: Callable[[IntArray], tuple[Id, ...]] | None = None
) -> Iterator[Fault]:
    """Yield the fault if it occurs; *ids* converts its first few occurrences to examples."""
    if len(where):
        few = where[:_EXAMPLES]
        yield Fault(kind, len(where), ids(few) if ids else tuple(few.tolist()))
