"""What keeps triangles from being a closed, outward oriented two-manifold: the search.

The checks go from the outside in: numbers, indices, single faces, edges, vertices, and at last
the side each shell faces.  Each looks only at what the ones before found sound, so that a fault is
named once and under its own name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, plain
from ..errors import ArgumentError
from ..kernels import in_parallel
from .report import Fault, Id, Kind, MeshReport
from .shells import corner_columns, cross, judged, norm
from .topology import Sides, connected, first_equal_row, repeats_face, repeats_vertex

HOPELESS = (Kind.EMPTY, Kind.BAD_INDEX, Kind.TOO_LARGE, Kind.TOO_SMALL)  # nothing else is asked
_EXAMPLES = 4
_PIECE = 10_000  # faces to a thread; what they need stays in the cache
_LARGEST, _SMALLEST = 1e70, 1e-70  # fourth powers of lengths must be numbers
_FLAT = 1e-12  # a face of less height than this share of its longest edge has no area


def find_faults(vertices: ArrayLike, faces: ArrayLike) -> MeshReport:
    """Return every fault of the triangles *faces* over *vertices*, with counts and examples.

    Degenerate and duplicate faces are reported, and then left out of what follows, so that each
    fault is named once.  Whether shells face outward is asked of closed, consistent ones only.

    Parameters
    ----------
    vertices : (n, 3) float
        NaN and infinite coordinates are a fault, not an error.
    faces : (m, 3) int
        Bad indices are a fault, not an error.

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.

    Examples
    --------
    A tetrahedron that lacks a face:

    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> report = find_faults(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> report.ok, report.count(Kind.OPEN_EDGE), report.count(Kind.HOLE)
    (False, 3, 1)
    >>> print(report.faults[0])
    3 open edges (1-2, 1-3, 2-3)
    """
    points, triangles = as_soup(vertices, faces)
    n_components = 0
    found = list(_number_faults(points, triangles))
    if not any(fault.kind in HOPELESS for fault in found):
        degenerate, duplicate, sides = _unlike_faces(triangles, len(points))
        n_components = int(sides.shells.max(initial=-1)) + 1
        found += _some(Kind.DEGENERATE, np.flatnonzero(degenerate))
        found += _some(Kind.DUPLICATE_FACE, np.flatnonzero(duplicate & ~degenerate))
        flat = _flat_faces(points, triangles)
        found += _some(Kind.ZERO_AREA, flat[~degenerate[flat]])
        found += _edge_faults(sides)
        found += _inward_shells(points, sides)
        coincident = first_equal_row(points) != np.arange(len(points))
        found += _some(Kind.COINCIDENT, np.flatnonzero(coincident))
        if n_components > 1:
            found.append(Fault(Kind.COMPONENTS, n_components))
    return MeshReport(
        n_vertices=len(points),
        n_faces=len(triangles),
        n_components=n_components,
        faults=tuple(fault for fault in found if fault.kind.fatal),
        notes=tuple(fault for fault in found if not fault.kind.fatal),
    )


def as_soup(vertices: ArrayLike, faces: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Return arrays (n, 3) float and (m, 3) int whatever they hold; only shape and type matter."""
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
        raise ArgumentError(f"vertices must hold numbers; got {points.dtype}")
    if triangles.dtype.kind not in "iu":
        raise ArgumentError(f"faces must hold integers; got {triangles.dtype}")
    return (
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.int64),
    )


def _number_faults(points: FloatArray, faces: IntArray) -> Iterator[Fault]:
    if not len(faces):
        yield Fault(Kind.EMPTY, 1)
    finite, far = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    if not (np.abs(points) <= _LARGEST).all():  # one cheap question, before several
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


def _unlike_faces(faces: IntArray, n_vertices: int) -> tuple[BoolArray, BoolArray, Sides]:
    """Return which faces repeat a vertex, which an earlier face, and the sides of the others.

    Two faces on the same three vertices share three edges.  Where every edge has its two faces,
    each face is therefore asked only for its neighbours: whether two of them are the same.
    """
    degenerate = repeats_vertex(faces)
    if not degenerate.any():
        sides = Sides(faces, n_vertices)
        if sides.neighbours is not None:
            one, other, _ = sides.neighbours.T
            if not (one == other).any():
                return degenerate, degenerate, sides
    duplicate = repeats_face(faces)
    return degenerate, duplicate, Sides(faces[~degenerate & ~duplicate], n_vertices)


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


def _edge_faults(sides: Sides) -> Iterator[Fault]:
    def edges(some: IntArray) -> tuple[Id, ...]:
        ends = np.stack([sides.tail[some], sides.head[some]], axis=1)
        return tuple((a, b) for a, b in np.sort(ends, axis=1).tolist())

    if sides.partner is not None:  # nothing else can be wrong
        yield from _some(Kind.NON_MANIFOLD_VERTEX, sides.pinched)
        return
    yield from _some(Kind.OPEN_EDGE, sides.open, edges)
    ends = np.stack([sides.tail[sides.open], sides.head[sides.open]], axis=1)
    corners, ends = np.unique(ends, return_inverse=True)
    _, hole = np.unique(connected(len(corners), *ends.reshape(-1, 2).T), return_index=True)
    yield from _some(Kind.HOLE, corners[hole])
    crowded = sides.order[sides.first[sides.n_sides > 2]]
    yield from _some(Kind.NON_MANIFOLD_EDGE, crowded, edges)
    yield from _some(Kind.NON_MANIFOLD_VERTEX, sides.pinched)
    yield from _some(Kind.TURNED_EDGE, sides.pairs[sides.turned, 0], edges)


def _inward_shells(points: FloatArray, sides: Sides) -> Iterator[Fault]:
    """Ask the shells whose every edge joins two faces that face the same side."""
    asked = np.ones(len(sides.faces), dtype=bool)
    if sides.partner is None:
        good = np.ones(int(sides.shells.max(initial=-1)) + 1, dtype=bool)
        good[sides.shells[sides.open // 3]] = False
        good[sides.shells[sides.order[sides.first[sides.n_sides > 2]] // 3]] = False
        good[sides.shells[sides.pairs[sides.turned, 0] // 3]] = False
        asked = good[sides.shells]
    if not (finite := _finite(points)).all():
        asked &= finite[sides.faces].all(axis=1)
    faces, shells = sides.faces, sides.shells
    if not asked.all():
        faces, (_, shells) = faces[asked], np.unique(shells[asked], return_inverse=True)
    if len(faces):
        wrong, flat, first = judged(points, faces, shells)
        yield from _some(Kind.INWARD, faces[first[wrong & ~flat], 0])
        yield from _some(Kind.NO_VOLUME, faces[first[flat], 0])


def _some(
    kind: Kind, where: IntArray, ids: Callable[[IntArray], tuple[Id, ...]] | None = None
) -> Iterator[Fault]:
    """Yield the fault if it occurs at all; *ids* turns the first few places into what is shown."""
    if len(where):
        few = where[:_EXAMPLES]
        yield Fault(kind, len(where), ids(few) if ids else tuple(few.tolist()))
