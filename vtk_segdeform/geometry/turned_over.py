"""Folds of a pose: faces that it turned over.

A face is turned over if its normal points against where the surface around it has turned it,

    n' . R n < 0,      R = the rotation closest to  sum_k A_k J_k

n and n' are its normals at rest and in the pose.  The faces k share a vertex with it; those that
share an edge count twice.  J_k takes the edges and the normal of k from rest to the pose, and A_k
is its area at rest, so needles have hardly any weight.  So a sharp edge of the surface is no fold,
nor is a bend, however far it goes.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray
from .rotations import closest_rotations


def turned_over(vertices: FloatArray, rest: FloatArray, faces: IntArray) -> IntArray:
    """Return which *faces* are turned over at *vertices* (n, 3), compared with *rest*: (k,) int."""
    before, now = _frames(rest, faces), _frames(vertices, faces)
    areas = np.linalg.norm(np.cross(before[:, :, 0], before[:, :, 1]), axis=1)
    flat = areas == 0.0
    before[flat] = np.eye(3)
    maps = areas[:, None, None] * (now @ np.linalg.inv(before))
    corners = faces.ravel()
    at_vertices = [
        np.bincount(corners, np.repeat(entry, 3), len(rest)) for entry in maps.reshape(-1, 9).T
    ]
    around = np.stack(at_vertices, axis=1)[faces].sum(axis=1).reshape(-1, 3, 3) - 3.0 * maps
    rotations = closest_rotations(np.swapaxes(around, 1, 2))
    turned = (rotations @ before[:, :, 2, None])[:, :, 0]
    return np.flatnonzero((np.einsum("ij,ij->i", now[:, :, 2], turned) < 0.0) & ~flat)


def _frames(x: FloatArray, faces: IntArray) -> FloatArray:
    """Return two edges and the unit normal of each face as columns, (m, 3, 3)."""
    a, b, c = (x[corner] for corner in faces.T)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.stack([b - a, c - a, normals / np.where(length > 0.0, length, 1.0)], axis=2)
