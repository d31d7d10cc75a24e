"""Edges and corners of triangles (m, 3): numbers, lists and components."""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, IntArray
from .grouping import connected


def edge_keys(one: IntArray, other: IntArray, n_vertices: int) -> IntArray:
    """Return one number for each pair of vertices, the same for (a, b) and (b, a)."""
    return np.minimum(one, other) * n_vertices + np.maximum(one, other)


def next_half_edge(half_edges: IntArray) -> IntArray:
    """Return the next half-edge, or corner, of the same face."""
    after = half_edges + 1
    return after - 3 * (after // 3 - half_edges // 3)


def repeats_vertex(faces: IntArray) -> BoolArray:
    """Return which faces contain a vertex twice, (m,) bool."""
    a, b, c = faces.T
    repeats: BoolArray = (a == b) | (b == c) | (c == a)
    return repeats


def flipped_faces(faces: IntArray, flip: BoolArray) -> IntArray:
    """Return *faces* (m, 3) with the second and third corner of those to *flip* (m,) exchanged."""
    flipped, some = faces.copy(), np.flatnonzero(flip)
    flipped[some, 1], flipped[some, 2] = faces[some, 2], faces[some, 1]
    return flipped


def components(n_points: int, faces: IntArray) -> IntArray:
    """Return the component of each vertex, (n,) int, numbered from 0."""
    return connected(n_points, faces.ravel(), faces[:, [1, 2, 0]].ravel())


def face_edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2), and for each face (m, 3) the edges opposite its three corners."""
    opposite = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    edges, which = np.unique(opposite, axis=0, return_inverse=True)
    return edges, which.reshape(-1, 3)
