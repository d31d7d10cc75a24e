"""A coarse surface of some thousand points, on which the segmentation is computed.

Its points are samples of the vertices, and every vertex belongs to the Voronoi cell of a sample
(`geometry.voronoi_cells`).  Its triangles are the faces with corners in three different cells; the
area of a point is the area of its cell, so that the total is exact.

    d           distance along the surface, along edges and along the straight line between the
                opposite corners of two triangles unfolded into a plane (edges alone overestimate
                distances by 15 %)
    {d = t}     level set; a triangle contains a segment of it, longest at its middle corner
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import unique_edges, voronoi_cells
from ..mesh import Mesh, connected, ragged_arange
from ..progress import Progress

COARSE_POINTS = sizes.COARSE_VOLUME_POINTS  # of the coarse surface, about
_PER_STEP = np.pi / 4  # mean of length over steps, for a straight line walked in steps


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangulated surface, or a part of one, with k points.

    Parameters
    ----------
    vertices : (k, 3) float
    faces : (m, 3) int
        Used for lengths of level sets only; may be non-manifold.
    areas : (k,) float
        The area of the cell of each point.
    graph : (k, k) sparse
        Distances between neighbours, symmetric.
    contact : (k, k) sparse
        Length of the border between neighbouring cells, symmetric.
    """

    vertices: FloatArray
    faces: IntArray
    areas: FloatArray
    graph: sparse.csr_array
    contact: sparse.csr_array

    @cached_property
    def lines(self) -> tuple[IntArray, IntArray]:
        """The ends (i, j) of the lines of the graph, each in both directions."""
        i, j = self.graph.nonzero()
        return i.astype(np.int64), j.astype(np.int64)

    def part(self, ids: IntArray) -> Surface:
        """Return the surface over the points *ids*, renumbered in their order."""
        number = np.full(len(self.areas), -1)
        number[ids] = np.arange(len(ids))
        faces = number[self.faces]
        faces = faces[(faces >= 0).all(axis=1)]
        graph, contact = self.graph[ids][:, ids], self.contact[ids][:, ids]
        return Surface(self.vertices[ids], faces, self.areas[ids], graph, contact)

    def distance(self, start: IntArray, limit: float = np.inf) -> FloatArray:
        """Return the distance to the nearest of *start*, (k,); infinite beyond *limit*."""
        return np.asarray(csgraph.dijkstra(self.graph, indices=start, min_only=True, limit=limit))

    def pieces(self, members: BoolArray) -> list[IntArray]:
        """Return the connected pieces of the points in *members*, by decreasing area."""
        ids = np.flatnonzero(members)
        count, piece = csgraph.connected_components(self.graph[ids][:, ids], directed=False)
        area = np.bincount(piece, self.areas[ids], minlength=count)
        return [ids[piece == k] for k in np.argsort(-area, kind="stable")]

    def two_pieces(self, inside: BoolArray) -> BoolArray:
        """Return the largest piece of *inside* with its holes filled.

        Both sides are then connected if the surface is.
        """
        i, j = self.lines
        uncut = inside[i] == inside[j]
        if connected(len(inside), i[uncut], j[uncut]).max() == 1:
            return inside
        outside = np.zeros_like(inside)
        outside[self.pieces(~inside)[0]] = True
        largest = np.zeros_like(inside)
        largest[self.pieces(~outside)[0]] = True
        return largest

    def distances_from_ends(self, rim: FloatArray, most: int = 12) -> list[FloatArray]:
        """Return distances (k,) from the ends of the surface; their level sets run across limbs.

        The first ends are the largest connected pieces of {rim > 0}, with *rim* (k,) the length of
        earlier cuts at each point; then single points, each the farthest from all ends before.
        """
        fields = []
        nearest = self.distance(np.array([0]))
        if rim.any():
            loops = self.pieces(rim > 0.0)
            loops.sort(key=lambda loop: -rim[loop].sum())
            fields = [self.distance(loop) for loop in loops[:4]]
            nearest = np.min(fields, axis=0)
        for number in range(min(most, len(rim))):
            fields.append(self.distance(np.array([np.argmax(nearest)])))
            first = number == 0 and not rim.any()  # discard the arbitrary start
            nearest = fields[-1] if first else np.minimum(nearest, fields[-1])
        return [d for d in fields if d.max() > 0.0]

    def level_lengths(self, faces: IntArray, d: FloatArray, levels: FloatArray) -> FloatArray:
        """Return the length of each level set {d = level} within *faces*; *levels* increase."""
        x, y, z = d[faces].T
        low, high = np.minimum(np.minimum(x, y), z), np.maximum(np.maximum(x, y), z)
        first, end = np.searchsorted(levels, low, "right"), np.searchsorted(levels, high)
        some = np.flatnonzero(end > first)  # faces with a level in between
        first, end, faces = first[some], end[some], faces[some]
        corners = np.take_along_axis(faces, np.argsort(d[faces], axis=1), axis=1)
        low, middle, high = d[corners].T
        a, b, c = (self.vertices[column] for column in corners.T)
        least = max(1e-12 * float(np.max(levels, initial=0.0)), float(np.finfo(float).tiny))
        opposite = a + ((middle - low) / np.maximum(high - low, least))[:, None] * (c - a)
        longest = np.linalg.norm(b - opposite, axis=1)
        f, k = ragged_arange(end - first)
        k += first[f]
        rise = (levels[k] - low[f]) / np.maximum(middle - low, least)[f]
        fall = (high[f] - levels[k]) / np.maximum(high - middle, least)[f]
        piece = longest[f] * np.minimum(np.minimum(rise, fall), 1.0)
        return np.asarray(np.bincount(k, piece, minlength=len(levels)))


def coarsen(
    mesh: Mesh, n_points: int, rng: np.random.Generator, progress: Progress | None = None
) -> tuple[IntArray, Surface]:
    """Return the cell of each vertex, (n,) int, and the coarse surface with one point per cell.

    There are about *n_points* cells, or as many as vertices if these are fewer.  Every cell is
    connected, and every component of the mesh has at least one.
    """
    kept, cell = voronoi_cells(mesh, n_points, rng, progress)
    return cell, _surface(mesh, cell, kept, unique_edges(cell[mesh.edges], len(kept)))


def symmetric(edges: IntArray, values: FloatArray, n: int) -> sparse.csr_array:
    """Return the symmetric (n, n) matrix with *values* at *edges*; repeated edges are summed."""
    i, j = edges.T
    half = sparse.coo_array((values, (i, j)), shape=(n, n)).tocsr()
    return sparse.csr_array(half + half.T)


def _surface(mesh: Mesh, cell: IntArray, kept: IntArray, edges: IntArray) -> Surface:
    x, k = mesh.vertices[kept], len(kept)
    corners = cell[mesh.faces]
    areas = np.bincount(corners.ravel(), np.repeat(mesh.face_areas / 3.0, 3), k).astype(float)
    # The border between two cells runs from the centre of a triangle over the midpoint of an edge
    # between the cells to the centre of the next triangle.
    face, corner = np.nonzero(corners != corners[:, [1, 2, 0]])
    ends = np.stack([mesh.faces[face, corner], mesh.faces[face, (corner + 1) % 3]], axis=1)
    centres = mesh.vertices[mesh.faces[face]].mean(axis=1)
    width = np.linalg.norm(mesh.vertices[ends].mean(axis=1) - centres, axis=1)
    contact = symmetric(cell[ends], _PER_STEP * width, k)
    faces = corners[np.bincount(face, minlength=len(corners)) == 3]
    length = np.linalg.norm(np.subtract(*x[edges.T]), axis=1)
    shortcuts, straight = _shortcuts(x, faces)
    lines, lengths = np.concatenate([edges, shortcuts]), np.concatenate([length, straight])
    order = np.lexsort((lengths, lines[:, 1], lines[:, 0]))  # the shorter of two equal lines
    lines, first = np.unique(lines[order], axis=0, return_index=True)
    lengths = np.maximum(lengths[order][first], np.finfo(float).tiny)
    return Surface(x, faces, areas, symmetric(lines, lengths, k), contact)


def _shortcuts(x: FloatArray, faces: IntArray) -> tuple[IntArray, FloatArray]:
    """Return lines between opposite corners of neighbouring triangles, and their lengths.

    The two triangles are unfolded into a plane about their common edge; lines that do not cross
    this edge are omitted.
    """
    a, b, c = (np.roll(faces, -turn, axis=1).ravel() for turn in range(3))
    key = np.minimum(a, b) * len(x) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    twins = np.flatnonzero(np.diff(key[order]) == 0)
    one, two = order[twins], order[twins + 1]
    origin, edge = x[a[one]], x[b[one]] - x[a[one]]
    size = np.linalg.norm(edge, axis=1)
    edge = edge / np.maximum(size, np.finfo(float).tiny)[:, None]

    def unfolded(corner: IntArray) -> tuple[FloatArray, FloatArray]:
        arm = x[corner] - origin
        along = np.einsum("ij,ij->i", arm, edge)
        return along, np.linalg.norm(arm - along[:, None] * edge, axis=1)

    (s, height), (t, depth) = unfolded(c[one]), unfolded(c[two])
    where = (s * depth + t * height) / np.maximum(height + depth, np.finfo(float).tiny)
    hits = (where > 0.0) & (where < size) & (c[one] != c[two])
    lines = np.sort(np.stack([c[one], c[two]], axis=1)[hits], axis=1)
    return lines, np.hypot(s - t, height + depth)[hits]
