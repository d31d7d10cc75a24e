"""Folded triangles of a pose are opened, and everything farther away stays where it is.

Each triangle near a fold gets a gradient J*: that of the pose, without what folds it.

    edges        where the normals on both sides turn against each other, both triangles turn back
                 about the edge, by half of the excess each
    flatness     singular values are at least, and at most, those of a triangle far from folded

The vertices then follow all of these as well as they can, a few dozen times over,

    minimise  sum_T w_T A_T |J_T - J*_T|^2     over the vertices near, with the others in place

where w_T is larger for triangles that are, or were, changed: so that their neighbours give way.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Mesh
from .folds import Folds

_RINGS = 3, 6, 12  # around folded triangles, that move; one after the other
_STEPS = 30  # with one of them, at most
_LEAST, _MOST = 0.3, 4.0  # singular values of gradients
_TURNED, _CHANGED = np.radians(115.0), np.radians(60.0)  # as in `folds`, of triangles far from it
_HEAVY = 10.0  # w_T of changed triangles
_TINY = 1e-300


def unfolded(mesh: Mesh, folds: Folds, x: FloatArray, free: BoolArray) -> FloatArray:
    """Return the pose *x* (n, 3) with as few folds as the *free* vertices (n,) allow."""
    best, least = x, folds.at(x)
    for rings in _RINGS:
        if not least.any():
            break
        near = _around(mesh, least, rings)
        patch = _Patch(mesh, folds, near & free)
        here = patch.opened(best)
        folded = folds.at(here)
        if np.count_nonzero(folded) < np.count_nonzero(least):
            best, least = here, folded
    return best


def _around(mesh: Mesh, folded: BoolArray, rings: int) -> BoolArray:
    """Return the vertices within so many *rings* around *folded* triangles (m,), (n,) bool."""
    near = np.zeros(mesh.n_vertices, dtype=bool)
    near[mesh.faces[folded]] = True
    for _ in range(rings):
        near |= mesh.adjacency @ near.astype(float) > 0.0
    return near


class _Patch:
    """The triangles at the vertices *moving* (n,) bool."""

    def __init__(self, mesh: Mesh, folds: Folds, moving: BoolArray) -> None:
        triangles = np.flatnonzero(moving[mesh.faces].any(axis=1) & folds.good)
        self._own = np.flatnonzero(moving)
        number = np.full(mesh.n_faces, -1)
        number[triangles] = np.arange(len(triangles))
        sides = number[folds.sides]
        inside = (sides >= 0).all(axis=1)
        self._edges, self._sides = folds.edges[inside], sides[inside]
        self._angles = folds.angles[inside]
        self._faces: IntArray = mesh.faces[triangles]
        a, b, d = folds.inverses[:, triangles]
        zero = np.zeros_like(a)
        self._inverses = np.stack([np.stack([a, b], 1), np.stack([zero, d], 1)], 1)
        self._areas = 0.5 / (a * d)
        rows = np.arange(2 * len(triangles))
        # J^T of all triangles, two rows each, is B x.
        inverse = np.swapaxes(self._inverses, 1, 2)
        values = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2)
        columns = np.repeat(self._faces, 2, axis=0)
        places = np.repeat(rows, 3), columns.ravel()
        self._gradient = sparse.csr_array((values.ravel(), places), (len(rows), mesh.n_vertices))
        self._heavy = np.zeros(len(triangles), dtype=bool)

    def opened(self, x: FloatArray) -> FloatArray:
        """Return the pose *x* (n, 3) with its folds opened, as far as that is possible."""
        x = x.copy()
        own = self._gradient[:, self._own]
        for _ in range(_STEPS):
            j = np.swapaxes((self._gradient @ x).reshape(-1, 2, 3), 1, 2)
            wanted, changed = self._wanted(x, j)
            if not changed.any():
                break
            self._heavy |= changed
            weights = np.repeat(self._areas * np.where(self._heavy, _HEAVY, 1.0), 2)
            weighted = own.T * weights
            off = np.swapaxes(wanted - j, 1, 2).reshape(-1, 3)
            x[self._own] += splu((weighted @ own).tocsc()).solve(np.asarray(weighted @ off))
        return x

    def _wanted(self, x: FloatArray, j: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return J* (m, 3, 2), and which of them differ from *j*."""
        a, b, c = (x[corner] for corner in self._faces.T)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
        along = x[self._edges[:, 1]] - x[self._edges[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _TINY)
        left, right = normals[self._sides[:, 0]], normals[self._sides[:, 1]]
        now = np.arctan2(
            np.einsum("ij,ij->i", np.cross(left, right), along),
            np.einsum("ij,ij->i", left, right),
        )
        change = (now - self._angles + np.pi) % (2.0 * np.pi) - np.pi
        excess = np.minimum(np.abs(now) - _TURNED, np.abs(change) - _CHANGED)
        back = np.where(excess > 0.0, 0.5 * np.sign(now) * excess, 0.0)[:, None] * along
        turn = np.zeros((len(j), 3))
        np.add.at(turn, self._sides[:, 0], back)
        np.add.at(turn, self._sides[:, 1], -back)
        changed = np.zeros(len(j), dtype=bool)
        changed[self._sides[excess > 0.0].ravel()] = True
        turned = _rotated(turn, j)
        u, s, v = np.linalg.svd(turned, full_matrices=False)
        bounded = np.clip(s, _LEAST, _MOST)
        changed |= (bounded != s).any(axis=1)
        return (u * bounded[:, None, :]) @ v, changed


def _rotated(turn: FloatArray, j: FloatArray) -> FloatArray:
    """Return *j* (m, 3, 2) rotated by the rotation vectors *turn* (m, 3)."""
    angle = np.linalg.norm(turn, axis=1)
    axis = (turn / np.maximum(angle, _TINY)[:, None])[:, :, None]
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    across = np.cross(axis, j, axis=1)
    dot = (axis * j).sum(axis=1, keepdims=True)
    result: FloatArray = cosine * j + sine * across + (1.0 - cosine) * axis * dot
    return result
