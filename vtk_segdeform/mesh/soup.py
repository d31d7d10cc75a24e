"""A `Mesh` from any triangles, and the map between both: what is given and what is deformed.

    drop       faces without three different vertices, repeated faces, points in no face, and
               components without area, or as small as a rounding error
    weld       points of borders at the same position, and open sheets that coincide; see `welding`
    orient     neighbouring faces alike, closed surfaces and nearly closed ones outward

Vertices within a surface are not welded, so a closed surface remains as it is.  Of a face that is
given twice, in any orientation, the mesh has the first.

Nothing is lost: every given point follows a vertex of the mesh, so a pose of the mesh is one of
the given triangles, with the same points in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray, as_ids, as_points
from ..errors import ConstraintError, MeshError
from .edges import components, repeats_vertex
from .faults import UNREPAIRABLE, Search, as_soup
from .grouping import connected, first_members
from .mesh import Mesh
from .orientation import faces_to_flip
from .report import Fault, Kind, counted
from .topology import HalfEdges
from .triangles import flat_faces
from .welding import rounding, welded

_POINT = 1e-13  # of the largest component: no cage resolves so small a one
_NONE: IntArray = np.empty(0, dtype=np.int64)
_REFUSED = (*UNREPAIRABLE, Kind.NON_FINITE)


@dataclass(frozen=True)
class Workaround:
    """A difference between the given triangles and the mesh: a sentence, and where it is."""

    text: str
    points: IntArray  # (k,) int: the given points there
    kind: Kind | None = None
    count: int = 1  # of that kind

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, eq=False)
class Soup:
    """Given points and triangles, and their mesh.

    Attributes
    ----------
    points : (p, 3) float
        As given.
    mesh : Mesh
        What is deformed.
    vertex_of : (p,) int
        The vertex that each given point follows: its own, or the nearest one if it is in no face.
    workarounds : tuple of Workaround
        What differs between the two.
    """

    points: FloatArray
    mesh: Mesh
    vertex_of: IntArray
    workarounds: tuple[Workaround, ...] = ()

    def vertices_at(self, points: ArrayLike) -> IntArray:
        """Return the vertices (k,) of the mesh that given *points* (mask or ids) are, sorted.

        Points in no face are no vertices.
        """
        ids = as_ids(points, len(self.points), "points")
        return np.unique(self.vertex_of[ids[~np.isin(ids, self.loose)]])

    def at_vertices(self, values: Any) -> Any:
        """Return *values* (p, ...) of the given points at the vertices (n, ...).

        Of several points that follow a vertex, the first one in a face counts.
        """
        in_face = np.delete(np.arange(len(self.points)), self.loose)
        _, first = np.unique(self.vertex_of[in_face], return_index=True)
        return values[in_face[first]]

    def targets_at(self, points: ArrayLike, targets: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Return the vertices (k,) that given *points* are, and their targets (k, 3).

        A vertex that is several points with *targets* (q, 3) goes to the mean.
        """
        ids = as_ids(points, len(self.points), "points")
        ends = as_points(targets, "targets")
        if len(ends) != len(ids):
            raise ConstraintError(
                f"targets must be a point for each of the {len(ids)} points of the handle; got "
                f"shape {ends.shape}"
            )
        is_vertex = ~np.isin(ids, self.loose)
        if len(ids) and not is_vertex.any():
            raise ConstraintError(
                "no point of the handle is in a face; points in no face only follow the surface"
            )
        ids, ends = ids[is_vertex], ends[is_vertex]
        vertices, number = np.unique(self.vertex_of[ids], return_inverse=True)
        sums = np.zeros((len(vertices), 3))
        np.add.at(sums, number, ends)
        return vertices, sums / np.bincount(number, minlength=len(vertices))[:, None]

    @cached_property
    def loose(self) -> IntArray:
        """(k,) int: the given points that are not at a vertex of the mesh, and only follow one."""
        some = np.flatnonzero((self.points != self.mesh.vertices[self.vertex_of]).any(axis=1))
        with np.errstate(over="ignore", invalid="ignore"):
            away = np.abs(self.points[some] - self.mesh.vertices[self.vertex_of[some]])
        return some[~(away <= rounding(self.mesh.vertices)).all(axis=1)]

    def moved(self, vertices: FloatArray) -> FloatArray:
        """Return the given points (p, 3) for the mesh at *vertices* (n, 3).

        Welded points have equal positions then, so they are welded again after writing and reading.
        For the mesh at rest the given points are returned, bit for bit.
        """
        if np.array_equal(vertices, self.mesh.vertices):
            return self.points.copy()
        points: FloatArray = vertices[self.vertex_of]
        followed = self.vertex_of[self.loose]
        step = vertices[followed] - self.mesh.vertices[followed]
        points[self.loose] = self.points[self.loose] + step
        return points


def mesh_of(vertices: ArrayLike, faces: ArrayLike) -> Soup:
    """Return the mesh of any triangles *faces* (m, 3) over *vertices* (p, 3).

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.
    MeshError
        If there are no faces, all faces are flat, an index is out of range, or a point of a face is
        not finite, or too far or too near for computing volumes.
    """
    points, triangles = as_soup(vertices, faces)
    found = Search(points, triangles)
    if len(triangles) and found.n_repeating is not None:
        used = found.used
        if found.n_repeating:
            used = np.zeros(len(points), dtype=bool)
            used[triangles[~repeats_vertex(triangles)]] = True
        if not used.all():  # points in no face must not matter
            other = points[used.argmax()] if used.any() else 0.0
            found = found.at(np.where(used[:, None], points, other))
    _require_usable(found)
    if found.half_edges.all_twins and found.is_closed and not _may_have_points(found):
        return Soup(points, Mesh.of(found), np.arange(len(points)))
    valid = found.points
    target, kept, half_edges, near = welded(valid, found)
    without_area = _without_area(found, kept, half_edges)
    flat = np.flatnonzero(kept)[without_area] if without_area.any() else _NONE
    if len(flat):
        kept[flat] = False
        half_edges = HalfEdges(half_edges.faces[~without_area], len(valid))
    flip, depth = faces_to_flip(valid, half_edges)
    left = found.used
    if not (half_edges is found.half_edges and found.n_repeating == 0 and kept.all()):
        left = np.zeros(len(valid), dtype=bool)
        left[half_edges.faces] = True
    vertex_of, loose, flipped = target, _NONE, half_edges.flipped(flip)
    if left.all():
        mesh = Mesh.of(Search.known(valid, flipped, depth))
    else:
        number = np.cumsum(left) - 1
        flipped = HalfEdges(number[flipped.faces], int(left.sum()))
        mesh = Mesh.of(Search.known(valid[left], flipped, depth))
        loose = np.flatnonzero(~left[target])
        vertex_of = number[target]
        vertex_of[loose] = _nearest(points[loose], mesh.vertices)
    workarounds = tuple(_workarounds(triangles, kept, flat, target, loose, flip, half_edges, near))
    return Soup(points, mesh, vertex_of, workarounds)


def _require_usable(found: Search) -> None:
    if not len(found.triangles):
        raise MeshError("this surface cannot be deformed: it has no faces; give at least one")
    faults = [fault for fault in found.number_faults if fault.kind in _REFUSED]
    if not faults and found.all_flat:
        faults = [Fault(Kind.FLAT, 1)]
    if faults:
        reasons = "; ".join(f"{fault}; {fault.kind.advice}" for fault in faults)
        raise MeshError(f"this surface cannot be deformed: {reasons}")


def _without_area(found: Search, kept: BoolArray, half_edges: HalfEdges) -> BoolArray:
    """Return which faces *kept* are in a component of flat faces only, connected at any vertex.

    So are those of a component that is a point beside the largest one with area.
    """
    faces, few = half_edges.faces, half_edges.faces[first_members(half_edges.shells)]
    may_be_points = _are_points(found, few).any()
    if not (may_be_points or len(flat_faces(found.points, few))):  # usually enough
        return np.zeros(len(faces), dtype=bool)
    is_flat = np.zeros(len(found.triangles), dtype=bool)
    is_flat[found.flat] = True
    is_flat = is_flat[kept]
    if not (may_be_points or is_flat.any()):
        return is_flat
    of_vertex = components(half_edges.n_vertices, faces)
    has_area = np.zeros(len(of_vertex), dtype=bool)
    has_area[of_vertex[faces[~is_flat, 0]]] = True
    if may_be_points:
        low = np.full((len(of_vertex), 3), np.inf)
        high = -low
        np.minimum.at(low, of_vertex[faces], found.points[faces])
        np.maximum.at(high, of_vertex[faces], found.points[faces])
        extent = np.where(has_area, (high - low).max(axis=1), 0.0)
        has_area &= extent > _POINT * extent.max()
    return np.asarray(~has_area[of_vertex[faces[:, 0]]])


def _are_points(found: Search, faces: IntArray) -> BoolArray:
    """Return which *faces* (k, 3) are points beside the whole surface."""
    with np.errstate(over="ignore"):
        return np.asarray(np.ptp(found.points[faces], axis=1).max(axis=1) <= _POINT * found.extent)


def _may_have_points(found: Search) -> bool:
    """Return whether a shell may be a point beside the whole surface."""
    first = first_members(found.half_edges.shells)
    return len(first) > 1 and bool(_are_points(found, found.triangles[first]).any())


def _nearest(points: FloatArray, vertices: FloatArray) -> IntArray:
    """Return the nearest of *vertices* to each of *points* (k, 3), or the first if not finite."""
    nearest = np.zeros(len(points), dtype=np.int64)
    finite = (np.abs(points) < 1e100).all(axis=1)
    if finite.any():
        tree = cKDTree(vertices, compact_nodes=False, balanced_tree=False)  # sooner built
        nearest[finite] = tree.query(points[finite])[1]
    return nearest


def _workarounds(
    triangles: IntArray,
    kept: BoolArray,
    flat: IntArray,
    target: IntArray,
    loose: IntArray,
    flip: BoolArray,
    half_edges: HalfEdges,
    near: IntArray,
) -> Iterator[Workaround]:
    """Yield the sentences, from what was changed to what was left as it is."""

    def marked(points: IntArray) -> BoolArray:
        mask = np.zeros(len(target), dtype=bool)
        mask[points] = True
        return mask

    def at(vertices: IntArray) -> IntArray:
        """Return the given points that follow *vertices*."""
        return np.flatnonzero(marked(vertices)[target])

    members = np.bincount(target, minlength=len(target))[target]
    if len(seam := np.flatnonzero(members > 1)):
        yield _workaround(Kind.COINCIDENT, len(seam), "welded # seam point", seam)
    if flip.any():
        is_all = flip.all() and len(flip) == len(triangles)
        faces = triangles if is_all else triangles[np.flatnonzero(kept)[flip]]
        there = np.flatnonzero(marked(faces))
        yield _workaround(Kind.TURNED_EDGE, len(faces), "flipped # face", there)
    dropped = np.setdiff1d(np.flatnonzero(~kept), flat, assume_unique=True)
    faces = triangles[dropped]
    degenerate = repeats_vertex(target[faces])
    for kind, ignored in (
        (Kind.DUPLICATE_FACE, faces[~degenerate]),
        (Kind.DEGENERATE, faces[degenerate]),
        (Kind.ZERO_AREA, triangles[flat]),
    ):
        if len(ignored):
            text = f"ignored {counted(len(ignored), kind.one, kind.many)}"
            yield Workaround(text, np.flatnonzero(marked(ignored)), kind, len(ignored))
    if len(flat):
        loose = np.setdiff1d(loose, at(target[triangles[flat]]))
    if len(loose):
        text = f"{counted(len(loose), 'point is', 'points are')} in no face"
        yield Workaround(text, loose, Kind.UNREFERENCED, len(loose))
    if len(some := half_edges.boundary):
        ends = half_edges.tail[some], half_edges.head_of(some)
        on_border = marked(np.append(*ends))
        number = np.cumsum(on_border) - 1
        n_holes = int(connected(int(on_border.sum()), *(number[end] for end in ends)).max()) + 1
        yield _workaround(Kind.HOLE, n_holes, "# hole", np.flatnonzero(on_border[target]))
    if len(near):
        text = f"{len(near)} border points almost coincide (not welded)"
        yield Workaround(text, at(near), None, len(near))
    if len(crowded := half_edges.branching):
        text = f"{counted(len(crowded), 'edge', 'edges')} with three or more faces"
        there = at(np.append(half_edges.tail[crowded], half_edges.head_of(crowded)))
        yield Workaround(text, there, Kind.NON_MANIFOLD_EDGE, len(crowded))
    if not half_edges.is_oriented and half_edges.one_sided.any():
        one_sided = half_edges.one_sided
        there = at(half_edges.faces[one_sided[half_edges.shells]])
        yield _workaround(Kind.ONE_SIDED, int(one_sided.sum()), "# one-sided component", there)


def _workaround(kind: Kind, count: int, text: str, points: IntArray) -> Workaround:
    """Return a workaround whose *text* has "#" for its count and ends with a noun."""
    return Workaround(text.replace("#", str(count)) + "s" * (count != 1), points, kind, count)
