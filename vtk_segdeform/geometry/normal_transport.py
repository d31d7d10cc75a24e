"""Normals and tangents given with a surface, carried along by a deformation.

Normals that a file stores are not those of its faces: they are smooth across seams, sharp at
edges, or painted.  So they are not recomputed, but transported.  With the faces f around n,

    A_f, A'_f        area vectors of the triangles at rest and deformed
    F_f              deformation gradient of a triangle, its normal scaled by sqrt(|A'_f| / |A_f|)
    n  = sum_f c_f A_f + r                  c of least norm; r is normal to all A_f
    n' = sum_f c_f A'_f + mean of cof(F_f) r                    area-weighted mean
    t' = mean of F_f t                                          at the same angle to n' as t to n

Area vectors transform by the cofactor matrix, so n' is exact for rotations, and for every affine
map where n is a combination of the normals around it, as all computed normals are.  Where it is not
(sum |c_f A_f| > 2 |n|), the combination would amplify bending and is replaced by the mean of
cof(F_f) n.  Lengths are preserved; what is at rest stays the same to rounding.

The faces around n are those of all normals at the same position that agree with it: hard edges
remain hard, and both sides of a texture seam stay alike.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from ..arrays import BoolArray, FloatArray, IntArray

_EQUAL_NORMALS = 1e-3  # distance of two unit normals that are the same one, stored in few bits
_LEAST_EIGENVALUE = 1e-6  # relative eigenvalue below which area vectors around a normal do not span
_LARGEST_COORDINATE = 1e100
_FLAT_AREA = 1e-5  # over the longest edge squared: the normal of a flatter face is rounding
_MOST_AMPLIFIED = 2.0  # largest sum |c_f A_f| / |n| of a combination


class NormalTransport:
    """Transport of normals and tangents by deformations of one surface.

    Parameters
    ----------
    points : (n, 3) float
        Positions at rest.
    counts, corners : (m,) int, (k,) int
        Polygons: their numbers of corners, and these one after another.
    normals : (j, 3) float
        Normals at rest, of any length; one that is zero or NaN remains as it is.
    of_corner : (k,) int
        The normal of each corner; points, corners and cells may have normals.
    place : (j,) int or None
        The point at which each normal is: those at equal positions that agree are transported
        alike.  None if every normal has its own faces only.
    """

    @np.errstate(over="ignore", invalid="ignore")  # faces of infinite area do not count
    def __init__(
        self, points: FloatArray, counts: IntArray, corners: IntArray, normals: FloatArray,
        *, of_corner: IntArray, place: IntArray | None,
    ) -> None:  # fmt: skip
        self._given = np.asarray(normals, dtype=float)
        finite = (np.abs(self._given) < _LARGEST_COORDINATE).all(axis=1)  # not NaN either
        self._normals = np.where(finite[:, None], self._given, 0.0)
        group = np.arange(len(self._normals))
        if place is not None:
            group = _agreeing(points[place], self._normals)
        starts = np.cumsum(counts) - counts
        n_triangles = np.maximum(counts - 2, 0)
        polygon = np.repeat(np.arange(len(counts)), n_triangles)
        first = np.cumsum(n_triangles) - n_triangles
        rank = np.arange(len(polygon)) - np.repeat(first, n_triangles)
        at = starts[polygon]
        cut = np.stack([at, at + rank + 1, at + rank + 2], axis=1)  # corners of triangles of a fan
        self._triangles = corners[cut]
        first, second = self._edges(points)
        self._area_vectors = np.cross(first, second)
        areas = np.linalg.norm(self._area_vectors, axis=1)
        usable = np.isfinite(areas) & (areas > 0)
        self._areas = np.where(usable, areas, 1.0)
        longest = np.maximum((first**2).sum(axis=1), (second**2).sum(axis=1))
        sound = usable & (areas > _FLAT_AREA * longest)
        # A polygon counts as a whole, with all its triangles, for the normals at its corners.
        width = counts[polygon]
        triangle = np.repeat(np.arange(len(cut)), width)
        offset = np.arange(len(triangle)) - np.repeat(np.cumsum(width) - width, width)
        owner = group[of_corner[starts[polygon][triangle] + offset]]
        shape = len(self._normals), len(cut)
        every, around = (
            csr_array((np.ones(here.sum()), (owner[here], triangle[here])), shape=shape)
            for here in (usable[triangle], sound[triangle])
        )
        lost = np.flatnonzero((np.diff(around.indptr) == 0) & (np.diff(every.indptr) > 0))
        if len(lost):
            entries = np.ones(len(lost)), (lost, np.arange(len(lost)))
            into = csr_array(entries, shape=(shape[0], len(lost)))
            around = csr_array(around + into @ self._beside(every[lost], sound, len(points)))
        around.sum_duplicates()
        around.data[:] = 1.0
        self._around = around[group]  # of each normal
        self._frames = np.stack([first, second, self._area_vectors / self._areas[:, None]], axis=2)
        self._by_area, self._by_frame = self._weights()

    def _beside(self, flat: csr_array, sound: BoolArray, n: int) -> csr_array:
        """Return sound triangles at corners of the *flat* ones, (l, t); these where none is."""
        rows = np.repeat(np.arange(len(self._triangles)), 3)
        at = csr_array((np.ones(len(rows)), (rows, self._triangles.ravel())), (len(sound), n))
        near = (flat @ at) @ (at.T * sound).tocsr()
        near.eliminate_zeros()
        none = np.diff(near.indptr) == 0
        return csr_array(near + flat * none[:, None])

    def _edges(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        a, b, c = (points[each] for each in self._triangles.T)
        return b - a, c - a

    def _weights(self) -> tuple[csr_array, list[csr_array]]:
        """Return the matrices by which triangles contribute to normals."""
        around, triangle = self._around, self._around.indices
        owner = np.repeat(np.arange(len(self._normals)), np.diff(around.indptr))
        n, vectors, areas = _unit(self._normals), self._area_vectors, self._areas
        outer = vectors[:, :, None] * (vectors / areas[:, None])[:, None, :]
        moments = (around @ (outer / areas.max(initial=0.0)).reshape(-1, 9)).reshape(-1, 3, 3)
        values, axes = np.linalg.eigh(moments)
        spans = values > _LEAST_EIGENVALUE * np.maximum(values[:, 2:], np.finfo(float).tiny)
        inverse = np.where(spans, 1.0 / np.where(spans, values, 1.0), 0.0) / areas.max(initial=0.0)
        local = np.einsum("gij,gi->gj", axes, n)
        dual = np.einsum("gij,gj->gi", axes, inverse * local)
        c = np.einsum("pi,pi->p", (vectors / areas[:, None])[triangle], dual[owner])
        amplified = np.bincount(owner, np.abs(c) * areas[triangle], len(n)) > _MOST_AMPLIFIED
        c[amplified[owner]] = 0.0
        by_area = self._matrix(c)
        rest = n - by_area @ vectors
        rest[np.abs(rest).max(axis=1) < 1e-14] = 0.0
        if not rest.any():
            return by_area, []
        # cof(F) r in terms of the cross products of the columns u, v, w of F:
        # r = (r.w) u x v / |A| + (r.u) v x w / |A| + (r.v) w x u / |A|, area-weighted
        share = rest / np.maximum(around @ areas, np.finfo(float).tiny)[:, None]
        u, v, w = np.moveaxis(self._frames, 2, 0)
        matrices = [
            self._matrix(np.einsum("pi,pi->p", share[owner], column[triangle]))
            for column in (w, u, v)
        ]
        return by_area, matrices

    def _matrix(self, entries: FloatArray) -> csr_array:
        """Return a matrix of normals by triangles, with an entry per triangle around a normal."""
        around = self._around
        return csr_array((entries, around.indices, around.indptr), shape=around.shape)

    def _moved_frames(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        first, second = self._edges(points)
        third = np.cross(first, second)
        area = np.linalg.norm(third, axis=1)
        third /= np.sqrt(np.where(area > 0, area * self._areas, 1.0))[:, None]
        return first, second, third

    def normals(self, points: FloatArray) -> FloatArray:
        """Return the normals (j, 3) for the points at other positions (n, 3)."""
        u, v, w = self._moved_frames(points)
        result = self._by_area @ np.cross(u, v)
        for matrix, product in zip(self._by_frame, ((u, v), (v, w), (w, u)), strict=False):
            result += matrix @ np.cross(*product)
        length, unit = np.linalg.norm(self._normals, axis=1, keepdims=True), _unit(result)
        good = np.isfinite(unit).all(axis=1) & (np.linalg.norm(unit, axis=1) > 0.5)
        return np.where(good[:, None] & (length > 0), length * unit, self._given)

    def tangents(self, tangents: FloatArray, points: FloatArray) -> FloatArray:
        """Return *tangents* (j, 3), given at the same places as the normals, transported."""
        t, n = np.asarray(tangents, dtype=float), _unit(self._normals)
        t = np.where((np.abs(t) < _LARGEST_COORDINATE).all(axis=1, keepdims=True), t, 0.0)
        moved = np.stack(self._moved_frames(points), axis=2)
        weighted = moved @ np.linalg.inv(self._safe_frames()) * self._areas[:, None, None]
        gradient = self._around @ weighted.reshape(-1, 9)
        moved_t = np.einsum("jik,jk->ji", gradient.reshape(-1, 3, 3), t)
        along = np.einsum("ji,ji->j", t, n)
        length = np.linalg.norm(t - along[:, None] * n, axis=1, keepdims=True)
        n = _unit(self.normals(points))
        flat = _unit(moved_t - np.einsum("ji,ji->j", moved_t, n)[:, None] * n)
        good = (np.linalg.norm(flat, axis=1) > 0.5) & np.isfinite(flat).all(axis=1)
        return np.where(good[:, None], length * flat + along[:, None] * n, tangents)

    def _safe_frames(self) -> FloatArray:
        frames = self._frames.copy()
        bad = ~np.isfinite(frames).all(axis=(1, 2)) | (np.abs(np.linalg.det(frames)) == 0)
        frames[bad] = np.eye(3)
        return frames


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: FloatArray = vectors / np.where(length > 0, length, 1.0)
    return result


def _agreeing(positions: FloatArray, normals: FloatArray) -> IntArray:
    """Return the group of each normal: the first one at the same position that agrees with it."""
    order = np.lexsort(positions.T)
    ordered, n = positions[order], _unit(normals)[order]
    place = np.cumsum(np.insert((ordered[1:] != ordered[:-1]).any(axis=1), 0, False))
    pairs = []
    for step in range(1, int(np.bincount(place).max(initial=1))):
        k = np.flatnonzero(place[step:] == place[:-step])
        k = k[((n[k] - n[k + step]) ** 2).sum(axis=1) < _EQUAL_NORMALS**2]
        pairs.append(np.stack([order[k], order[k + step]]))
    if not pairs:
        return np.arange(len(normals))
    tail, head = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(tail)), (tail, head)), shape=(len(normals),) * 2)
    labels = connected_components(graph, directed=False)[1]
    _, first = np.unique(labels, return_index=True)
    groups: IntArray = first[labels]
    return groups
