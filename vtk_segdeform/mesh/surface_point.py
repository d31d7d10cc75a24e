"""A point of a surface, which moves with it: a combination of the corners of a face.

    x = sum_i b_i x_i,    sum_i b_i = 1,    b_i > 0

A point inside a face has three corners, one on an edge two, and a vertex is its own.  So a point
of an edge is the same in both faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray
from ..kernels import compiled_kernels, inputs
from .mesh import Mesh

_ROUNDING = 1e-9  # smaller shares are rounding: the point is on an edge, or a vertex


class SurfacePoint(NamedTuple):
    """A point of a surface by its barycentric coordinates."""

    corners: tuple[int, ...]
    """One to three vertices."""
    shares: tuple[float, ...]
    """Of each corner: positive, with the sum 1."""

    @classmethod
    def of(cls, corners: ArrayLike, shares: ArrayLike) -> SurfacePoint:
        """Return the point with *shares* (c,) of the *corners* (c,) of a face or an edge.

        >>> SurfacePoint.of([7, 2, 5], [0.25, 0.75, 0.0])
        SurfacePoint(corners=(2, 7), shares=(0.75, 0.25))
        """
        ids, own = np.asarray(corners), np.asarray(shares, dtype=np.float64)
        kept = np.flatnonzero(own > _ROUNDING)
        kept = kept[np.argsort(ids[kept])]
        own = own[kept] / own[kept].sum()
        return cls(tuple(ids[kept].tolist()), tuple(own.tolist()))

    @classmethod
    def at_vertex(cls, vertex: int) -> SurfacePoint:
        """Return a vertex as a point."""
        return cls((vertex,), (1.0,))

    @classmethod
    def in_face(cls, vertices: FloatArray, corners: ArrayLike, point: FloatArray) -> SurfacePoint:
        """Return the point of the face *corners* (3,) of *vertices* (n, 3) nearest to *point*."""
        ids = np.asarray(corners)
        shares, _ = nearest_on_triangles(vertices[ids[None]], point)
        return cls.of(ids, shares[0])

    @classmethod
    def nearest(cls, mesh: Mesh, point: FloatArray) -> SurfacePoint:
        """Return the point of *mesh* that is nearest to *point* (3,)."""
        shares, away = nearest_on_triangles(mesh.vertices[mesh.faces], point)
        face = int(away.argmin())
        return cls.of(mesh.faces[face], shares[face])

    @property
    def vertex(self) -> int:
        """The corner with the largest share; of equal ones the first."""
        return self.corners[int(np.argmax(self.shares))]

    @property
    def is_vertex(self) -> bool:
        """Whether it is a vertex."""
        return len(self.corners) == 1

    def at(self, values: FloatArray) -> FloatArray:
        """Return where it is with the vertices at *values* (n, 3); or other values (n, ...)."""
        if self.is_vertex:
            return np.array(values[self.corners[0]])
        return np.asarray(np.array(self.shares) @ values[list(self.corners)])


def nearest_on_triangles(corners: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the shares (k, 3) of the nearest points of triangles (k, 3, 3), and how far they are.

    From *points* (k, 3), or one (3,).  The nearest point is on one of the three edges, unless the
    point is above the triangle.
    """
    points = np.broadcast_to(points, (len(corners), 3))
    if kernels := compiled_kernels(len(corners)):
        shares, away = np.zeros((len(corners), 3)), np.empty(len(corners))
        kernels.nearest_on_triangles(*inputs(corners, points), shares, away)
        return shares, away
    a = corners - points[:, None]
    along = np.roll(a, -1, axis=1) - a  # from each corner to the next one
    squares = np.einsum("kcj,kcj->kc", along, along)
    t = -np.einsum("kcj,kcj->kc", a, along) / np.where(squares > 0.0, squares, 1.0)
    t = t.clip(0.0, 1.0)
    off_edge = np.linalg.norm(a + t[..., None] * along, axis=2)
    edge, each = off_edge.argmin(axis=1), np.arange(len(a))
    shares, away = np.zeros((len(a), 3)), off_edge[each, edge]
    shares[each, edge] = 1.0 - t[each, edge]
    shares[each, (edge + 1) % 3] = t[each, edge]

    normal = np.cross(along[:, 0], along[:, 1])
    size = np.einsum("kj,kj->k", normal, normal)
    parts = [np.cross(a[:, i - 2], a[:, i - 1]) for i in range(3)]  # opposite each corner
    over = np.stack([np.einsum("kj,kj->k", part, normal) for part in parts], axis=1)
    inside = (over >= 0.0).all(axis=1) & (size > 0.0)
    shares[inside] = over[inside] / over[inside].sum(axis=1, keepdims=True)
    off_plane = np.abs(np.einsum("kj,kj->k", a[inside, 0], normal[inside]))
    away[inside] = off_plane / np.sqrt(size[inside])
    return shares, away
