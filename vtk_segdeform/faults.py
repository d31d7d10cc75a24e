"""What keeps triangles from being a closed, outward oriented two-manifold: the search.

The checks go from the outside in: numbers, indices, single faces, edges, vertices, and at last
the side each shell faces.  Each looks only at what the ones before found sound, so that a fault is
named once and under its own name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, IntArray, plain
from .errors import ArgumentError
from .surface.report import Fault, Id, Kind, MeshReport
from .surface.shells import without_volume, wrong_way_round
from .surface.topology import Sides, connected, first_equal_row, repeats_face, repeats_vertex

HOPELESS = (Kind.EMPTY, Kind.BAD_INDEX, Kind.TOO_LARGE, Kind.TOO_SMALL)  # nothing else is asked
_EXAMPLES = 4
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
        sound = ~repeats_vertex(triangles) & ~repeats_face(triangles)
        sides = Sides(triangles[sound], len(points))
        n_components = int(sides.shells.max(initial=-1)) + 1
        found += _face_faults(points, triangles)
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
    yield from _some(Kind.NON_FINITE, np.flatnonzero(~np.isfinite(points).all(axis=1)))
    bad = ((faces < 0) | (faces >= len(points))).any(axis=1)
    yield from _some(Kind.BAD_INDEX, np.flatnonzero(bad))
    finite = points[np.isfinite(points).all(axis=1)]
    far = np.where(np.isfinite(points), np.abs(points), 0.0).max(axis=1, initial=0.0) > _LARGEST
    yield from _some(Kind.TOO_LARGE, np.flatnonzero(far))
    if len(finite) and not far.any() and 0.0 < np.ptp(finite, axis=0).max() < _SMALLEST:
        yield Fault(Kind.TOO_SMALL, 1)
    used = np.zeros(len(points), dtype=bool)
    used[faces[~bad]] = True
    yield from _some(Kind.UNREFERENCED, np.flatnonzero(~used))


def _face_faults(points: FloatArray, faces: IntArray) -> Iterator[Fault]:
    degenerate = repeats_vertex(faces)
    yield from _some(Kind.DEGENERATE, np.flatnonzero(degenerate))
    yield from _some(Kind.DUPLICATE_FACE, np.flatnonzero(repeats_face(faces) & ~degenerate))
    with np.errstate(invalid="ignore", over="ignore"):
        a, b, c = points[faces].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        longest = np.max([np.einsum("ij,ij->i", e, e) for e in (b - a, c - b, a - c)], axis=0)
    yield from _some(Kind.ZERO_AREA, np.flatnonzero((area <= _FLAT * longest) & ~degenerate))


def _edge_faults(sides: Sides) -> Iterator[Fault]:
    def edges(some: IntArray) -> tuple[Id, ...]:
        ends = np.stack([sides.tail[some], sides.head[some]], axis=1)
        return tuple((a, b) for a, b in np.sort(ends, axis=1).tolist())

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
    good = np.ones(int(sides.shells.max(initial=-1)) + 1, dtype=bool)
    good[sides.shells[sides.open // 3]] = False
    good[sides.shells[sides.order[sides.first[sides.n_sides > 2]] // 3]] = False
    good[sides.shells[sides.pairs[sides.turned, 0] // 3]] = False
    asked = good[sides.shells] & np.isfinite(points[sides.faces]).all(axis=(1, 2))
    if asked.any():
        _, shells = np.unique(sides.shells[asked], return_inverse=True)
        wrong = wrong_way_round(points, sides.faces[asked], shells)
        flat = without_volume(points, sides.faces[asked], shells)
        _, first = np.unique(shells, return_index=True)
        yield from _some(Kind.INWARD, sides.faces[asked][first[wrong & ~flat], 0])
        yield from _some(Kind.NO_VOLUME, sides.faces[asked][first[flat], 0])


def _some(
    kind: Kind, where: IntArray, ids: Callable[[IntArray], tuple[Id, ...]] | None = None
) -> Iterator[Fault]:
    """Yield the fault if it occurs at all; *ids* turns the first few places into what is shown."""
    if len(where):
        few = where[:_EXAMPLES]
        yield Fault(kind, len(where), ids(few) if ids else tuple(few.tolist()))
