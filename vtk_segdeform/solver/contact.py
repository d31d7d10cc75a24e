"""Contact: a term that pushes parts of the surface apart where they would cross.

The surface is given by samples a (the cells of the coarse volume, or the vertices of a small mesh),
each with a position y_a = W~_a p, a unit normal n_a and a radius h_a, about half the distance to
its neighbours.  Two samples that are no neighbours at rest push each other apart if they face each
other and are closer than a margin:

    sum over pairs a, b    k w_ab  f(-<n_a, n_b>)  l(s^2 / r_ab^2)  (d_ab - g)^2        for g < d_ab

    e = y_a - y_b,    g = <n_b - n_a, e> / 2,    s^2 = |e|^2 - g^2,    r_ab = 1.1 (h_a + h_b)

g is the gap, negative where the parts have crossed, and s the distance along the surface.  f and l
fade smoothly to 0 where the samples do not face each other or are not opposite, and the last factor
where they have crossed by more than D_ab = 1.5 (h_a + h_b): so deep it is unknown which way is out.
All of it is a smooth function of p that does not depend on how the mesh is moved as a whole.

Four kinds of pairs are no contact, mostly since they are near each other at rest already:

    neighbours      within 2.5 (h_a + h_b) along the surface
    two sides       of a thin part: one is behind the other, within 4.5 (h_a + h_b), facing away
    crossings       the same, of a mesh that crosses itself at rest
    without normal  samples whose faces face all ways, such as those of both sides of a thin wall

and the margin d_ab = d_a + d_b is at most the gap at rest.  Otherwise d_a is the height of the true
surface over its sample, and a tenth of the distance between samples.

Only pairs that may soon be active are evaluated.  Their list is valid until a sample has moved by
half the additional distance to which it was searched, apart from the mean motion.

Long because the derivatives of a pair, its search and what is no contact at rest share one formula.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import blas
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..freezing import Frozen
from ..kernels import compiled_kernels, inputs
from .terms import NO_SURFACE

_LATERAL = 1.1  # r_ab / (h_a + h_b): discs of this radius about the samples cover the surface
_DEPTH = 1.5  # D_ab / (h_a + h_b)
_BEHIND = 4.5  # (h_a + h_b): distance of two sides of a thin part, at most
_SIDES = 0.5  # <n_a, n_b> of these, at most: a convex part is thick, and may fold inwards
_ALL_WAYS = 0.1  # length of the sum of the normals of faces, by area, that is none
_NEIGHBOURS = 2.5  # (h_a + h_b): distance along the surface
_MARGIN = 0.2  # of h_a
_OF_GAP = 0.45  # of the least gap at rest: the most of it that a margin takes
_FACING = 0.1, 0.6  # -<n_a, n_b> where f begins and ends to rise
_AWAY = 0.8  # <n_a, n_b> of samples that face away from each other until the next search
_OF_MOTION = 0.5  # of a gap, which closes by motion; the rest by rotation of the normals
_LARGEST = 2.0  # times the median: radii of samples, at most
_SLACK = 2.5  # median (h_a + h_b): additional distance of a search
_PARTS = 16  # of that distance, by which pairs are sorted
_FARTHEST_SOUGHT = 0.1  # mesh sizes: distance up to which samples are checked before a step
_ROOM = 50  # pairs per sample for which a search makes room
_STIFFNESS = 1.5e5  # k, times the scale of the shape energy
_TINY = 1e-30


@dataclass(frozen=True, eq=False, repr=False)
class ContactSurface(Frozen):
    """Samples of a surface at rest, size about 1, and which of them are in contact with which.

    Parameters
    ----------
    rows : (s, m) float
        W~ at the samples.
    faces : (t, 3) int
        The triangles between them.
    areas : (s,) float
        Their shares of the area; the sum is 1.
    radii : (s,) float
        h_a.
    margins, gaps : (s,) float
        d_a, and its limit: the share of the least gap at rest.
    excluded : (s, s) bool
        Pairs that are no contact.
    """

    rows: FloatArray
    faces: IntArray
    areas: FloatArray
    radii: FloatArray
    margins: FloatArray
    gaps: FloatArray
    excluded: BoolArray
    spacing: float  # median of h_a + h_b
    corners: sparse.csr_array  # (s, t), 1 where a face is at a sample

    @classmethod
    def of(
        cls,
        rows: FloatArray,
        points: FloatArray,
        faces: IntArray,
        *,
        areas: FloatArray,
        edges: sparse.csr_array,
    ) -> ContactSurface:
        """Return the surface of samples at rest, size about 1.

        Parameters
        ----------
        rows : (s, m) float
            W~ at the samples.
        points : (s, 3) float
            Their positions.
        faces : (t, 3) int
            The triangles between them.
        areas : (s,) float
            Share of the area of each sample.
        edges : (s, s) sparse
            Lengths of the edges between them.
        """
        n = len(points)
        a, b, c = points[faces.T]
        total = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        radii = np.sqrt(areas * total / np.pi)
        radii = np.minimum(radii, _LARGEST * float(np.median(radii)))
        places = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
        corners = sparse.coo_array((np.ones(faces.size), places), (n, len(faces))).tocsr()
        no_pairs, spacing = np.eye(n, dtype=bool), 2.0 * float(np.median(radii))
        free = np.full(n, np.inf)
        margins = _MARGIN * radii
        own = cls(rows, faces, areas, radii, margins, free, no_pairs, spacing, corners)
        return own._excluding(points, edges)

    def with_heights(self, heights: FloatArray) -> ContactSurface:
        """Return the same where the true surface has *heights* (s,) over the samples, at most."""
        return replace(self, margins=np.minimum(self.margins + heights, self.gaps))

    def _excluding(self, points: FloatArray, edges: sparse.csr_array) -> ContactSurface:
        """Return the same without contact of samples near each other at rest, at *points*."""
        n, radii = len(points), self.radii
        lengths, normals = self.sums(points, np.arange(n))
        a, b, c = points[self.faces.T]
        all_ways = lengths < _ALL_WAYS * (self.corners @ _lengths(np.cross(b - a, c - a)))
        largest = 2.0 * float(radii.max(initial=0.0))
        near = csgraph.dijkstra(edges, directed=False, limit=_NEIGHBOURS * largest)
        excluded = np.asarray(near <= _NEIGHBOURS * np.add.outer(radii, radii))
        pairs = cKDTree(points).query_pairs(_BEHIND * largest, output_type="ndarray")
        a, b = np.sort(pairs, axis=1).T
        e, sums = points[a] - points[b], radii[a] + radii[b]
        squared = np.einsum("ij,ij->i", e, e)
        gap = 0.5 * np.einsum("ij,ij->i", normals[b] - normals[a], e)
        facing = np.einsum("ij,ij->i", normals[a], normals[b])
        behind = (gap <= 0.0) & (squared < (_BEHIND * sums) ** 2) & (facing < _SIDES)
        excluded[a[behind], b[behind]] = excluded[b[behind], a[behind]] = True
        excluded[all_ways] = excluded[:, all_ways] = True
        in_front = (gap > 0.0) & (squared - gap**2 < (_LATERAL * sums) ** 2)
        in_front &= (facing < -_FACING[0]) & ~excluded[a, b]
        least = np.full(n, np.inf)
        for each in (a, b):
            np.minimum.at(least, each[in_front], gap[in_front])
        gaps = _OF_GAP * least
        return replace(self, margins=np.minimum(self.margins, gaps), gaps=gaps, excluded=excluded)

    def normals(self, y: FloatArray) -> FloatArray:
        """Return unit normals (s, 3) of samples at *y* (s, 3)."""
        return self.sums(y, np.arange(len(y)))[1]

    def sums(self, y: FloatArray, some: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the lengths (k,) of the sums of face normals, and the unit normals (k, 3).

        *y* (s, 3) are all samples, *some* (k,) those asked for, in increasing order.
        """
        corners, faces = self.corners, self.faces
        if len(some) < len(y):
            corners = corners[some]
            used, places = np.unique(corners.indices, return_inverse=True)
            faces = faces[used]
            shape = len(some), len(used)
            corners = sparse.csr_array((corners.data, places, corners.indptr), shape)
        a, b, c = y[faces.T]
        total = corners @ np.cross(b - a, c - a)
        length = _lengths(total) + _TINY
        return length, total / length[:, None]

    def pairs_near(self, y: FloatArray, reach: float) -> IntArray:
        """Return the pairs (k, 2) within *reach* at *y* that may be in contact."""
        pairs = np.sort(cKDTree(y).query_pairs(reach, output_type="ndarray"), axis=1)
        return pairs[~self.excluded[pairs[:, 0], pairs[:, 1]]]


@dataclass(eq=False)
class Contact:
    """The term of one `ContactSurface`, whose samples are those of the volumes.

    *stiffness* is k.
    """

    surface: ContactSurface
    held: BoolArray  # (s,), samples whose places are given: no contact among them
    stiffness: float
    _listed: _Listed | None = field(default=None, repr=False)
    _last: tuple[FloatArray, _Pairs | None] = field(default=(NO_SURFACE, None), repr=False)

    @classmethod
    def of(cls, surface: ContactSurface, held: BoolArray, scale: float) -> Contact:
        """Return the term of *surface* beside a shape energy of this *scale*."""
        return cls(surface, held, _STIFFNESS * scale)

    is_always_active = False

    def renewed(self, _: FloatArray, /) -> Contact:
        """Return the term itself: it is the same at all poses."""
        return self

    def value_and_slope(
        self, p: FloatArray, x: FloatArray = NO_SURFACE
    ) -> tuple[float, FloatArray]:
        """Return the term at cages *p* (m, 3), and half its gradient (m, 3)."""
        found = self._active(p, x)
        if found is None:
            return 0.0, np.zeros_like(p)
        weight = 0.5 * self.stiffness
        return 2.0 * weight * found.value, weight * (self.surface.rows.T @ found.gradient())

    def hessian(self, p: FloatArray, x: FloatArray = NO_SURFACE) -> FloatArray | None:
        """Return half the Gauss-Newton Hessian at *p*, (3m, 3m); or None.

        The derivatives of normals and weights are in it: without them poses converge slowly.
        """
        found = self._active(p, x)
        if found is None:
            return None
        jacobian = found.jacobian()
        rows, used = self.surface.rows, np.unique(jacobian.indices // 3)
        count, m = jacobian.shape[0], rows.shape[1]
        flat = np.empty((count, 3 * m))
        for axis in range(3):
            part = jacobian[:, 3 * used + axis].toarray()
            flat[:, axis * m : (axis + 1) * m] = part @ rows[used]
        flat *= np.sqrt(self.stiffness)
        return np.asarray(blas.dsyrk(1.0, flat.T, lower=0).T)

    def share(self, p: FloatArray, step: FloatArray) -> float:
        """Return the share of a *step* (m, 3) from *p*, at most 1, for which pairs stay in reach.

        Two samples that face each other may move, relative to each other, by their distance and a
        typical D_ab.  A longer step could take them so far through each other that the term no
        longer separates them.
        """
        surface = self.surface
        motion, room = surface.rows @ step, _DEPTH * surface.spacing
        far = 2.0 * _largest(motion - motion.mean(axis=0))
        if far <= room:
            return 1.0
        y, reach = surface.rows @ p, min(far, _FARTHEST_SOUGHT)
        a, b = self._facing(y, reach).T
        closing = _lengths(motion[a] - motion[b]).clip(_TINY)
        shares = (_lengths(y[a] - y[b]) + room) / closing
        return float(shares.min(initial=min(1.0, (reach + room) / far)))

    def is_active(self, p: FloatArray) -> bool:
        """Return whether samples push each other apart at *p*."""
        return self._active(p) is not None

    def clearance(self, p: FloatArray, most: float) -> float:
        """Return the least distance of samples that may come into contact, at most *most*."""
        y = self.surface.rows @ p
        a, b = self._facing(y, most).T
        return float(_lengths(y[a] - y[b]).min(initial=most))

    def _facing(self, y: FloatArray, reach: float) -> IntArray:
        """Return the pairs (k, 2) within *reach* at *y* that are in front of each other."""
        pairs = self.surface.pairs_near(y, reach)
        pairs = pairs[~self.held[pairs].all(axis=1)]
        a, b = pairs.T
        n, e = self.surface.normals(y), y[a] - y[b]
        in_front = np.asarray(np.einsum("ij,ij->i", n[b], e) > 0.0)
        in_front &= np.einsum("ij,ij->i", n[a], e) < 0.0
        return np.asarray(pairs[in_front])

    def _active(self, p: FloatArray, x: FloatArray = NO_SURFACE) -> _Pairs | None:
        """Return the active pairs at *p*, if there are any."""
        last, found = self._last
        if np.array_equal(p, last):
            return found
        y = x if len(x) else self.surface.rows @ p
        pairs = None if self._listed is None else self._listed.near(y)
        if pairs is None:
            slack = _SLACK * self.surface.spacing
            listed = _Listed.of(self.surface, y.copy(), *self._list(y, slack), slack=slack)
            self._listed, pairs = listed, listed.near(y)
        found = None
        if pairs is not None and len(pairs):
            found = _Pairs.of(self.surface, y, pairs)
        self._last = p.copy(), found
        return found

    def _list(self, y: FloatArray, slack: float) -> tuple[IntArray, FloatArray]:
        """Return the pairs (k, 2) that may be active before a sample has moved by half *slack*.

        And how far each of them is beyond the reach of a pair.  *y* (s, 3) are the samples.
        """
        surface, reaches = self.surface, np.hypot(_DEPTH, _LATERAL) * self.surface.radii
        normals, reach = surface.normals(y), 2.0 * float(reaches.max()) + slack
        kernels = compiled_kernels()
        if kernels is not None:
            axis = int(np.argmax(np.ptp(y, axis=0)))
            order = np.argsort(y[:, axis])
            limits = np.array([reach, _AWAY, _OF_MOTION, slack])
            turned = [np.roll(each, -axis, axis=1).T for each in (y, normals)]
            samples = np.concatenate([*turned, [reaches], [surface.margins]])[:, order]
            given = inputs(samples, self.held[order], order, surface.excluded, limits)
            count = room = _ROOM * len(y)
            while count >= room:
                room = max(room, count + 1)
                found, beyond = np.empty((room, 2), dtype=np.int64), np.empty(room)
                count = kernels.facing_pairs(*given, found, beyond)
            return np.asarray(order[found[:count]]), beyond[:count]
        a, b = np.sort(cKDTree(y).query_pairs(reach, output_type="ndarray"), axis=1).T
        kept = ~(self.held[a] & self.held[b]) & ~surface.excluded[a, b]
        a, b = a[kept], b[kept]
        e, cosine = y[a] - y[b], np.einsum("ij,ij->i", normals[a], normals[b])
        gap = 0.5 * np.einsum("ij,ij->i", normals[b] - normals[a], e)
        gap = _OF_MOTION * (gap - surface.margins[a] - surface.margins[b])
        beyond = np.maximum(_lengths(e) - reaches[a] - reaches[b], gap)
        near = (beyond < slack) & (cosine < _AWAY)
        return np.stack([a[near], b[near]], axis=1), beyond[near]


@dataclass(frozen=True, eq=False)
class _Listed:
    """Pairs that may soon be active."""

    y: FloatArray  # (s, 3), the samples when the pairs were listed
    pairs: IntArray  # (k, 2)
    farthest: float  # motion since then, apart from the mean, for which the list is valid
    given: tuple[FloatArray, ...]  # for the kernel

    @classmethod
    def of(
        cls,
        surface: ContactSurface,
        y: FloatArray,
        pairs: IntArray,
        beyond: FloatArray,
        *,
        slack: float,
    ) -> _Listed:
        """Return the *pairs* (k, 2) listed with the samples at *y* (s, 3).

        *beyond* (k,) is how far each was beyond the reach of a pair, at most *slack*.  The pairs
        are sorted by it, and a pair is tested only once something has moved that far.
        """
        part = np.clip(_PARTS * beyond / slack, 0, _PARTS - 1).astype(np.int8)
        pairs = pairs[np.argsort(part, kind="stable")]
        ends = np.cumsum(np.bincount(part, minlength=_PARTS))
        farthest = 0.5 * slack
        corners, limits = surface.corners, np.array([_DEPTH, _LATERAL, _FACING[0], farthest])
        faces = surface.faces, corners.indptr, corners.indices
        given = inputs(y, *faces, surface.radii, surface.margins, limits, pairs, ends)
        return cls(y, pairs, farthest, given)

    def near(self, y: FloatArray) -> IntArray | None:
        """Return the pairs (k, 2) that may be active when the samples are at *y* (s, 3).

        None if a sample has moved too far since the pairs were listed.
        """
        pairs, kernels = self.pairs, compiled_kernels()
        if kernels is None:
            motion = y - self.y
            return None if _largest(motion - motion.mean(axis=0)) > self.farthest else pairs
        found = np.empty(len(pairs), dtype=np.int64)
        count = kernels.opposite_pairs(*inputs(y), *self.given, found)
        return None if count < 0 else pairs[found[:count]]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """The active pairs at a pose, and the factors of their sum."""

    surface: ContactSurface
    y: FloatArray  # (s, 3)
    a: IntArray  # (k,)
    b: IntArray
    e: FloatArray  # (k, 3)
    direction: FloatArray  # (k, 3), half n_b - n_a
    gap: FloatArray  # (k,), g
    into: FloatArray  # d_ab - g
    weight: FloatArray  # w_ab f l
    facing: FloatArray  # f
    lateral: FloatArray  # l
    facing_slope: FloatArray  # df / d<n_a, n_b>
    lateral_slope: FloatArray  # dl / ds^2
    fading: FloatArray  # of deep pairs
    fading_slope: FloatArray
    lengths: FloatArray  # (s,)
    normals: FloatArray  # (s, 3)

    @classmethod
    def of(cls, surface: ContactSurface, y: FloatArray, pairs: IntArray) -> _Pairs | None:
        """Return the active ones among *pairs* (k, 2); None if there are none."""
        a, b = pairs.T
        radii, margins = surface.radii, surface.margins
        e = y[a] - y[b]
        sums = radii[a] + radii[b]
        near = np.einsum("ij,ij->i", e, e) < (np.hypot(_DEPTH, _LATERAL) * sums) ** 2
        if not near.any():
            return None
        a, b, e, sums = a[near], b[near], e[near], sums[near]
        some = np.unique(np.concatenate([a, b]))
        lengths, normals = np.ones(len(y)), np.zeros_like(y)
        lengths[some], normals[some] = surface.sums(y, some)
        direction = 0.5 * (normals[b] - normals[a])
        gap = np.einsum("ij,ij->i", direction, e)
        facing, facing_slope = _step(-np.einsum("ij,ij->i", normals[a], normals[b]), *_FACING)
        squared = np.einsum("ij,ij->i", e, e) - gap**2
        r2 = (_LATERAL * sums) ** 2
        q = np.clip(1.0 - squared / r2, 0.0, None)
        into = margins[a] + margins[b] - gap
        fading, fading_slope = _step(gap, -_DEPTH * sums, -0.5 * _DEPTH * sums)
        kept = (into > 0.0) & (facing > 0.0) & (q > 0.0) & (fading > 0.0)
        if not kept.any():
            return None
        lateral, lateral_slope = q**2, -2.0 * q / r2
        weight = np.minimum(surface.areas[a], surface.areas[b]) * facing * lateral
        parts = (a, b, e, direction, gap, into, weight, facing, lateral)
        more = (-facing_slope, lateral_slope, fading, fading_slope)
        own: list[Any] = [part[kept] for part in (*parts, *more)]
        every: list[Any] = [surface, y, *own, lengths, normals]
        return cls(*every)

    @property
    def value(self) -> float:
        """The sum over the pairs, for k = 1."""
        return float((self.weight * self.fading) @ self.into**2)

    def gradient(self) -> FloatArray:
        """Return the derivative of `value` by the samples, (s, 3)."""
        residual = 2.0 * np.sqrt(self.weight * self.fading) * self.into
        return np.reshape(residual @ self.jacobian(), self.y.shape)

    def jacobian(self) -> sparse.csr_array:
        """Return the derivatives of r, of which `value` is the sum of squares, (k, 3s)."""
        surface, a, b, n = self.surface, self.a, self.b, self.normals
        area = np.minimum(surface.areas[a], surface.areas[b])
        r = np.sqrt(self.weight * self.fading) * self.into
        half = 0.5 / np.maximum(r, _TINY)
        depth = self.into**2 * self.fading
        by_s = area * self.facing * self.lateral_slope * depth * half
        by_g = self.weight * (self.into**2 * self.fading_slope - 2.0 * self.into * self.fading)
        by_g = by_g * half - 2.0 * by_s * self.gap
        by_c = (area * self.lateral * self.facing_slope * depth * half)[:, None]
        by_e = by_g[:, None] * self.direction + 2.0 * by_s[:, None] * self.e
        by_n = 0.5 * by_g[:, None] * self.e
        k, count = len(a), len(n)
        pairs = np.arange(k)
        rows, places, values = [pairs, pairs], [a, b], [by_e, -by_e]
        for sample, at_n in (a, by_c * n[b] - by_n), (b, by_n + by_c * n[a]):
            at_n = at_n - np.einsum("ij,ij->i", at_n, n[sample])[:, None] * n[sample]
            at_n = at_n / self.lengths[sample][:, None]
            ring = surface.corners[sample]
            owner = np.repeat(pairs, np.diff(ring.indptr))
            corners, torque = surface.faces[ring.indices], at_n[owner]
            y = self.y[corners]
            for c in range(3):
                side = y[:, (c + 1) % 3] - y[:, (c + 2) % 3]
                rows.append(owner)
                places.append(corners[:, c])
                values.append(np.cross(side, torque))
        row, place = np.concatenate(rows), np.concatenate(places)
        columns = 3 * place[:, None] + np.arange(3)
        ends = np.repeat(row, 3), columns.ravel()
        entries = np.concatenate(values).ravel()
        return sparse.coo_array((entries, ends), (k, 3 * count)).tocsr()


def _largest(vectors: FloatArray) -> float:
    """Return the largest length of *vectors* (k, 3)."""
    return float(_lengths(vectors).max())


def _lengths(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def _step(
    x: FloatArray, start: FloatArray | float, end: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Return a smooth step from 0 at *start* to 1 at *end*, and its derivative."""
    t = np.clip((x - start) / (end - start), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (end - start)
