"""Where a point is with respect to a closed surface: inside or outside, and how far.

The winding number is the share of the full sphere that the surface covers as seen from x, with
a, b, c the corners of a face relative to x:

    w(x) = 1 / (4 pi) sum over faces omega
    tan(omega / 2) = det(a, b, c) / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|)

1 inside, 0 outside.  a.b belongs to an edge and |a| to a vertex: neither is computed per face.

Source
------
A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomedical
Engineering 30(2), 125-126, 1983.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_faces, as_points
from ..kernels import in_parallel
from .manifold import face_edges

_BLOCK = 1 << 17  # numbers per temporary: a megabyte, stays in the cache


def winding_number(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> FloatArray:
    """Return (n,) how often a closed surface winds around each point: 1 inside, 0 outside.

    *vertices* (m, 3) and *faces* (k, 3) need not close: the number then falls smoothly from the
    inside to the outside.  Memory is bounded whatever n and k are.
    """
    x = as_points(points, "points")
    p = as_points(vertices, "vertices")
    faces = as_faces(faces, len(p), "faces")
    if not len(faces):
        return np.zeros(len(x))
    centre = p.mean(axis=0)
    x, p = x - centre, p - centre
    edges, sides = face_edges(faces)
    i, j = edges.T
    dot_ij, sum_ij = np.einsum("ej,ej->e", p[i], p[j])[:, None], p[i] + p[j]
    a, b, c = p[faces.T]
    normal, det_abc = np.cross(b - a, c - a), np.einsum("fj,fj->f", a, np.cross(b, c))[:, None]
    number = np.empty(len(x))

    def work(start: int, stop: int) -> None:
        y = x[start:stop]
        d = np.linalg.norm(p[:, None] - y, axis=2)
        dot = dot_ij - sum_ij @ y.T + np.einsum("nj,nj->n", y, y)
        d_a, d_b, d_c = (d[faces[:, k]] for k in range(3))
        bc, ca, ab = (dot[sides[:, k]] for k in range(3))
        half_omega = np.arctan2(
            det_abc - normal @ y.T, d_a * d_b * d_c + ab * d_c + bc * d_a + ca * d_b
        )
        number[start:stop] = half_omega.sum(axis=0) / (2.0 * np.pi)

    in_parallel(work, len(x), max(1, _BLOCK // len(faces)))
    return number


def distance_to_surface(x: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n,) the distance from each point *x* (n, 3) to the nearest face."""
    a = vertices[faces]  # (k, 3 corners, 3)
    along = a[:, [1, 2, 0]] - a
    normal = np.cross(along[:, 0], along[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    nearest = np.empty(len(x))
    rows = max(1, _BLOCK // (3 * len(faces)))
    for start in range(0, len(x), rows):
        to_x = x[start : start + rows, None, None] - a  # (rows, k, 3 corners, 3)
        t = np.einsum("nkcj,kcj->nkc", to_x, along) / np.einsum("kcj,kcj->kc", along, along)
        off_edge = np.linalg.norm(to_x - t.clip(0, 1)[..., None] * along, axis=-1).min(axis=2)
        over = (np.einsum("nkcj,kcj->nkc", to_x, np.cross(normal[:, None], along)) >= 0).all(axis=2)
        off_plane = np.abs(np.einsum("nkj,kj->nk", to_x[:, :, 0], normal))
        nearest[start : start + rows] = np.where(over, off_plane, off_edge).min(axis=1)
    return nearest
