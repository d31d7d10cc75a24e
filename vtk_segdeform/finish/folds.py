"""Triangles that a pose turned over.

A triangle is folded if it is flat, s2 < 0.1 with s1 >= s2 the singular values of its gradient, or
turned over against a neighbour: the angle between their normals is beyond 150 degrees, and differs
by more than 90 from that at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, Mesh, cross_rows

_FLAT = 0.1
_TURNED, _CHANGED = np.radians(150.0), np.radians(90.0)


@dataclass(frozen=True, eq=False)
class Folds:
    """The folded triangles of poses of one mesh; made by `Folds.of`."""

    faces: IntArray  # (m, 3)
    edges: IntArray  # (e, 2): of two faces each
    sides: IntArray  # (e, 2): the faces on both sides, the left one first
    angles: FloatArray  # (e,): between their normals at rest, signed
    inverses: FloatArray  # (3, m): of the rest triangles in their planes, [[a, b], [0, d]]
    good: BoolArray  # (m,): triangles with an area at rest

    @classmethod
    def of(cls, mesh: Mesh) -> Folds:
        """Return the test for poses of *mesh*."""
        half_edges = HalfEdges(mesh.faces, mesh.n_vertices)
        pairs = half_edges.pairs[~half_edges.inconsistent]
        edges = np.stack([half_edges.tail[pairs[:, 0]], half_edges.head[pairs[:, 0]]], axis=1)
        length, along, height, normals = _frames(mesh.vertices, mesh.faces)
        good = length * height > 1e-14 * mesh.diagonal**2
        length, height = np.where(good, length, 1.0), np.where(good, height, 1.0)
        inverses = np.stack([1.0 / length, -along / (length * height), 1.0 / height])
        sides = pairs // 3
        angles = _angles(mesh.vertices, normals, edges, sides)
        return cls(mesh.faces, edges, sides, angles, inverses, good)

    def at(self, x: FloatArray) -> BoolArray:
        """Return which triangles are folded in the pose *x* (n, 3), (m,) bool."""
        length, along, height, normals = _frames(x, self.faces)
        a, b, d = self.inverses
        one, shear, other = length * a, length * b + along * d, height * d
        area = one * other
        total = one * one + shear * shear + other * other  # s1^2 + s2^2
        folded: BoolArray = self.good & (area * area < _FLAT * _FLAT * total)
        thin = np.flatnonzero(folded)
        area, total = area[thin], total[thin]
        largest = 0.5 * (total + np.sqrt(np.maximum(total * total - 4.0 * area * area, 0.0)))
        folded[thin] = area * area < _FLAT * _FLAT * largest
        left, right = (np.take(normals, side, axis=0) for side in self.sides.T)
        turned = np.flatnonzero(np.einsum("ij,ij->i", left, right) < np.cos(_TURNED))
        now = _angles(x, normals, self.edges[turned], self.sides[turned])
        change = (now - self.angles[turned] + np.pi) % (2.0 * np.pi) - np.pi
        folded[self.sides[turned[np.abs(change) > _CHANGED]].ravel()] = True
        return folded


def _frames(
    x: FloatArray, faces: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the first edge's length, the second along it, its height, and the unit normals."""
    a, b, c = (np.take(x, corner, axis=0) for corner in faces.T)
    first, second = b - a, c - a
    normals = cross_rows(first, second)
    tiny = np.finfo(float).tiny
    length = np.sqrt(np.einsum("ij,ij->i", first, first))
    double = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    along = np.einsum("ij,ij->i", first, second) / np.maximum(length, tiny)
    normals /= np.maximum(double, tiny)[:, None]
    return length, along, double / np.maximum(length, tiny), normals


def _angles(x: FloatArray, normals: FloatArray, edges: IntArray, sides: IntArray) -> FloatArray:
    """Return the signed angle between the normals at each edge."""
    along = x[edges[:, 1]] - x[edges[:, 0]]
    length = np.sqrt(np.einsum("ij,ij->i", along, along))
    left, right = normals[sides[:, 0]], normals[sides[:, 1]]
    sines = np.einsum("ij,ij->i", cross_rows(left, right), along)
    sines /= np.maximum(length, np.finfo(float).tiny)
    return np.asarray(np.arctan2(sines, np.einsum("ij,ij->i", left, right)))
