"""Locality of a pull: what is far from the grabbed point, along the surface, softly stays.

    sum_s w_s |x_s - x_s^0|^2,    w_s = kappa a_s ((d_s / reach)^2 - 1)^2    beyond the reach

The sum is over samples s of the surface, with their share a_s of the area, their distance d_s from
the grabbed point and their position x_s^0 at the press.  Within the reach the surface is free.

Cages are coarse: the cage vertices that move the grabbed point also move much of their region.
Where this is compensated depends on the ratios of the weights.  With equal weights beyond the
reach, a thousand times the weight moves the far surface as much; weights that grow with the
distance move it a fifth as much, and the smaller ones nearby take fewer steps of the solver.

The reach of a pull ends with the limb that is grabbed: a head is turned without the shoulders.
All of the limb is free; see `limbs`.  Its extent L is the reach, and d is L + the distance from
where it has faded, L / 4 beyond its joint: in this room it bends.  Without it, triangles were
distorted by 15 to 25 % more on four bodies.  Up other limbs the room is a fifth as long: a finger
bent by 50 degrees moved others by up to 0.25 % of the height of three hands, now by 0.03 %.

What lies beyond the reach may fall into several parts: who grabs an elbow divides the hand from the
body.  Parts that are small beside the largest one follow the grabbed point, too.

Components that share a region, such as a coat and its buttons, move with the same cage.  So they
are joined by lines, and come along.  So do the two sides of a thin wall, which the
cages cannot move apart: with one of them held, a wall was torn out as a spike of 0.3 diagonals.

The samples are the cells of the coarse volume, or the vertices of a small mesh, and distances are
along the edges between them, so a press takes some milliseconds whatever the size of the mesh; to
fix as many vertices would take a second.

Cages are coarse, so a point is pulled with much of the surface around it.  But where the mesh is
coarse, too, or its detail is sharp, it would become a spike: pulled by 0.3 diagonals, vertices of
meshes of 500 to 2,500 vertices left the plane of their neighbours x_j by up to 1.6 edges.  There
the ring around the point resists.  Added to the shape energy is

    min_R  w |y - R y_rest|^2 + e w mean_j |x_j - x_v - R (x_j - x_v)_rest|^2
    y = x_v - sum_j c_j x_j,    sum_j c_j = 1,    sum_j c_j v_j = v  in their plane at rest

with a rotation R for each ring (`energy.with_rotating_rows`).  The compliance H^-1 of the solver
tells by how much y would change without it, to first order; of 57 vertices none changed by more
than 1.1 times as much.  The weight w is such that y changes by 0.15 edges in a pull by 0.3
diagonals, which nobody sees.  Where y would change by less, as on most dense meshes, nothing is
added.

The price is distortion, because a ring is wider than a point and moves more of the surface with it:
1.1 times as much in the finished poses of 40 bodies.  With 0.05 edges it is 1.14 times as much, and
pulls take a quarter more steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import faces_between, joints
from ..mesh import Mesh, SurfacePoint
from ..solver import CoarseVolume, ContactSurface
from .limbs import Levels, Limb

ANCHOR_WEIGHT = 90.0
"""kappa, times the scale of the shape energy."""

_LARGEST = 1e4  # (d^2 - 1)^2, reached at ten times the reach; also the weight of other bodies
_FADES = 0.25  # of the length of a limb, beyond its joint
_FEWEST = 4  # points of a ring, its own included
_SHORTEST = 1e-12  # reach; the mesh has size 1
_SMOOTHING = 2.0  # rounds, in edges across a cell
_AROUND = 20  # nearest samples that are looked at
_EDGES = 2000  # about, of which the median motion is computed
_RIGID = 0.1  # weight of the edges of a ring together, as a share of that of y
_FLAT = 1e-3  # of the moments: thinner patches count as flat


@dataclass(frozen=True, eq=False)
class Ring:
    """A pulled point and its neighbours, as differences y of points that resist all but rotation.

    The first one is the offset of the point from its neighbours, the others are its edges.  The
    neighbours of a point of a face are those of its corners.
    """

    vertices: IntArray  # (v,), the corners first
    combinations: FloatArray  # (r, v): y = combinations @ x
    offsets: FloatArray  # (r, 3), y at rest
    weights: FloatArray  # (r,)
    edge: float  # mean length

    @classmethod
    def around(cls, mesh: Mesh, x: FloatArray, point: SurfacePoint) -> Ring | None:
        """Return the ring of *point* of *mesh*, at rest at *x* (n, 3); None if it is too small."""
        corners = np.array(point.corners)
        ring = np.setdiff1d(mesh.adjacency[corners].indices, corners)
        arms = x[ring] - point.at(x)
        edge = float(np.linalg.norm(arms, axis=1).mean()) if len(ring) else 0.0
        if len(ring) < _FEWEST - 1 or edge == 0.0:
            return None
        plane = linalg.svd(arms - arms.mean(axis=0))[2][:2]
        basis = np.vstack([np.ones(len(ring)), plane @ arms.T])
        equal = np.full(len(ring), 1.0 / len(ring))
        missing = np.array([1.0, 0.0, 0.0]) - basis @ equal
        shares = equal + np.linalg.pinv(basis, rcond=_FLAT) @ missing
        others = np.vstack([-shares, -np.eye(len(ring))])
        combinations = np.hstack([np.tile(point.shares, (len(ring) + 1, 1)), others])
        vertices = np.concatenate([corners, ring])
        offsets = combinations @ x[vertices]
        weights = np.concatenate([[1.0], np.full(len(ring), _RIGID / len(ring))])
        return cls(vertices, combinations, offsets, weights, edge)


class Reach(NamedTuple):
    """How far the surface around a grabbed point is free; see `Deformer.local`."""

    reach: float
    follows: float
    depth: float


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of a surface at rest, joined by edges.

    Parameters
    ----------
    cells : (n,) int
        The sample of each vertex.
    rows : (s, m) float
        W~ at the samples.
    points : (s, 3) float
        Their positions at rest.
    areas : (s,) float
        Their shares of the area.
    faces : (f, 3) int
        The triangles between them.
    edges : (s, s) sparse
        Lengths of the edges between them.
    rest : Mesh, optional
        The surface.
    parts : (s,) int, optional
        The part of each: components of the same part move together.  None: each alone.
    """

    cells: IntArray
    rows: FloatArray
    points: FloatArray
    areas: FloatArray
    faces: IntArray
    edges: sparse.csr_array
    rest: Mesh | None = None
    parts: IntArray | None = None

    @classmethod
    def of(cls, rest: Mesh, coarse: CoarseVolume, parts: IntArray) -> SurfaceSamples:
        """Return the samples of a mesh at *rest* with its *coarse* volume.

        *parts* (c,) are those of its components.
        """
        n = rest.n_vertices
        cells, faces, points = np.arange(n), rest.faces, rest.vertices
        if coarse.cells is not None and coarse.shares is not None:
            cells, faces = coarse.cells, faces_between(coarse.cells, rest.faces)
            shared = [coarse.shares * axis for axis in rest.vertices.T]
            points = np.stack([np.bincount(cells, axis) for axis in shared], axis=1)
        count = len(points)
        areas = np.asarray(np.bincount(cells, rest.vertex_areas, count), dtype=np.float64)
        i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
        near = sparse.coo_array((np.ones(len(i)), (i, j)), (count, count)).tocsr().tocoo()
        lengths = np.linalg.norm(points[near.row] - points[near.col], axis=1)
        edges = sparse.coo_array((lengths, (near.row, near.col)), (count, count)).tocsr()
        rows = coarse.surface.at(np.arange(count))
        of_sample = None
        if len(parts) > 1:
            of_sample = np.empty(count, dtype=np.int64)
            of_sample[cells] = parts[rest.components]
        return cls(cells, rows, points, areas / areas.sum(), faces, edges, rest, of_sample)

    @cached_property
    def contact_surface(self) -> ContactSurface:
        """The samples as a surface whose parts may come into contact."""
        assert self.rest is not None
        faces, n = self.faces, len(self.points)
        surface = ContactSurface.of(
            self.rows, self.points, faces, areas=self.areas, edges=self.edges
        )
        away = self.rest.vertices - self.points[self.cells]
        over = np.einsum("ij,ij->i", away, surface.normals(self.points)[self.cells])
        heights = np.zeros(n)
        np.maximum.at(heights, self.cells, over)
        return surface.with_heights(heights)

    @cached_property
    def _component(self) -> IntArray:
        return csgraph.connected_components(self.edges, directed=False)[1].astype(np.int64)

    @cached_property
    def _joined(self) -> sparse.csr_array:
        """The edges, and lines between samples that move together without an edge."""
        component = self._component
        pairs = [self._across_walls(component)]
        if self.parts is not None:
            pairs.append(np.stack(joints(self.points, self.areas, component, self.parts)))
        one, other = np.unique(np.sort(np.concatenate(pairs, axis=1), axis=0), axis=1)
        if not len(one):
            return self.edges
        gap = np.linalg.norm(self.points[one] - self.points[other], axis=1)
        gap = np.maximum(gap, np.finfo(float).tiny)  # csgraph reads a zero as "no edge"
        lines = sparse.coo_array((gap, (one, other)), self.edges.shape).tocsr()
        return sparse.csr_array(self.edges.maximum(lines))

    def _across_walls(self, component: IntArray) -> IntArray:
        """Return pairs (2, k) of samples on two layers that the cages cannot move apart.

        Both are nearer, and moved more alike, than the ends of an edge usually are.  They face
        opposite ways, or are of two components.
        """
        i, j = self.edges.nonzero()
        if not len(i):
            return np.empty((2, 0), dtype=np.int64)
        spacing, some = float(self.edges.data.mean()), slice(None, None, 1 + len(i) // _EDGES)
        alike = np.median(np.abs(self.rows[i[some]] - self.rows[j[some]]).sum(axis=1))
        count = min(_AROUND, len(self.points))  # not all: a dense patch would have millions
        found = cKDTree(self.points).query(self.points, count, distance_upper_bound=spacing)
        away, near = (np.reshape(each, (-1, count)) for each in found)
        one, rank = np.nonzero(np.isfinite(away))
        other = near[one, rank]
        facing = np.einsum("ij,ij->i", self._normals[one], self._normals[other])
        layered = (facing < 0.0) | (component[one] != component[other])
        one, other = one[layered], other[layered]
        apart = np.abs(self.rows[one] - self.rows[other]).sum(axis=1)
        return np.stack([one, other])[:, apart < alike]

    @cached_property
    def _normals(self) -> FloatArray:
        """The sum of the normals of the triangles at each sample, (s, 3)."""
        a, b, c = self.points[self.faces.T] if len(self.faces) else np.empty((3, 0, 3))
        normals, across = np.zeros_like(self.points), np.cross(b - a, c - a)
        for corner in self.faces.T:
            np.add.at(normals, corner, across)
        return normals

    def distances(self, point: SurfacePoint) -> FloatArray:
        """Return the distance of each sample from *point*, (s,); infinite elsewhere.

        From the samples of its corners, and for a point of a face to these.
        """
        corners = list(point.corners)
        found = csgraph.dijkstra(self._joined, directed=False, indices=self.cells[corners])
        if self.rest is not None and not point.is_vertex:
            x = self.rest.vertices
            found += np.linalg.norm(x[corners] - point.at(x), axis=1)[:, None]
        return np.asarray(found.min(axis=0), dtype=np.float64)

    def limbs(self, point: SurfacePoint) -> tuple[Limb, ...]:
        """Return the limbs on which *point* is, the smallest first, with shares of samples (s,)."""
        levels = self._levels(point)
        edge = float(self.edges.data.mean()) if self.edges.nnz else _SHORTEST
        found = []
        for joint in levels.joints(self.points, self.faces, edge):
            beyond = self._beyond_joint([levels], joint.depth)
            share = np.clip(1.0 - beyond / (_FADES * joint.length), 0.0, 1.0)
            found.append(Limb(joint.depth, joint.length, share))
        return tuple(found)

    def within(self, point: SurfacePoint, depth: float) -> BoolArray:
        """Return the samples of the limb of *point* whose joint has this *depth*, (s,)."""
        return self._levels(point).within(depth)

    def _levels(self, point: SurfacePoint) -> Levels:
        return Levels.of(self._joined, int(self.cells[point.vertex]))

    def _beyond_joint(self, levels: Sequence[Levels], depth: float) -> FloatArray:
        """Return the distance of each sample from the limbs whose joints have this *depth*, (s,).

        The way up another limb counts five times.
        """
        inside = np.any([each.within(depth) for each in levels], axis=0)
        up = np.where(inside, 0.0, np.min([each.up for each in levels], axis=0))
        return self._beyond(inside) + up / _FADES

    def _beyond(self, inside: BoolArray) -> FloatArray:
        """Return the distance of each sample from those *inside*, (s,)."""
        found = csgraph.dijkstra(
            self._joined, directed=False, indices=np.flatnonzero(inside), min_only=True
        )
        return np.asarray(found, dtype=np.float64)

    def weights(
        self, points: Sequence[SurfacePoint], reach: float, follows: float, depth: float = 0.0
    ) -> FloatArray:
        """Return w_s / a_s for kappa = 1, (s,), around several *points*.

        Parts beyond the *reach* that are smaller than the largest by the factor *follows* are free.
        With the *depth* of a joint, the limbs of the points are free, and the reach begins there.
        """
        if np.isinf(reach):
            return np.zeros(len(self.points))
        if depth:
            levels = [self._levels(each) for each in points]
            away = self._beyond_joint(levels, depth) / max(reach, _SHORTEST) + 1.0 - _FADES
        else:
            away = np.min([self.distances(each) for each in points], axis=0)
            away /= max(reach, _SHORTEST)
        weights = _graded(away)
        far = np.flatnonzero((away > 1.0) & np.isfinite(away))
        if len(far):
            _, part = csgraph.connected_components(self._joined[far][:, far], directed=False)
            size = np.bincount(part, self.areas[far])
            weights[far[(size < follows * size.max())[part]]] = 0.0
        return np.asarray(weights)

    def quadratic(
        self, points: Sequence[SurfacePoint], reach: float, follows: float, depth: float = 0.0
    ) -> FloatArray:
        """Return sum_s w_s W~_s^T W~_s, (m, m), for kappa = 1; see `weights`."""
        return self._sum_over(self.weights(points, reach, follows, depth))

    def quadratic_around(self, vertices: BoolArray, reach: float) -> FloatArray:
        """Return the same for a part of the surface with some *vertices*, a mask (n,).

        The *reach* ends at its border.
        """
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.cells[vertices]] = True
        return self._sum_over(_graded(1.0 + self._beyond(inside) / max(reach, _SHORTEST)))

    def _sum_over(self, weights: FloatArray) -> FloatArray:
        kept = weights > 0.0
        rows = self.rows[kept]
        return np.asarray((rows.T * (self.areas * weights)[kept]) @ rows)

    def smooth_at_vertices(self, values: FloatArray) -> FloatArray:
        """Return *values* (s,) of the samples at all vertices, without steps between cells."""
        at_vertices = values[self.cells]
        if self.rest is None or len(values) == len(at_vertices):
            return at_vertices
        graph = self.rest.adjacency
        near = sparse.csr_array((np.ones(graph.nnz), graph.indices, graph.indptr), graph.shape)
        count = 1.0 + np.diff(near.indptr)
        for _ in range(math.ceil(_SMOOTHING * math.sqrt(len(at_vertices) / len(values)))):
            at_vertices = (at_vertices + near @ at_vertices) / count
        return at_vertices


def _graded(away: FloatArray) -> FloatArray:
    """Return the weights of points that are *away* (s,) in reaches."""
    nearer = np.clip(away, 1.0, 1e2)
    return np.asarray(np.minimum((nearer**2 - 1.0) ** 2, _LARGEST))
