"""Remeshing operations: split, flip, relax, refine.

    split       an edge at its midpoint: adds one vertex and two triangles
    flip        an edge to the other diagonal of its two triangles
    relax       each vertex towards the mean of its neighbours, in its tangent plane
    refine      each triangle into four at the midpoints of its edges: V' = V + E

Every operation accepts vertices (n, 3) and faces (m, 3) of a closed mesh and returns new ones; the
mesh remains closed, oriented and manifold.

Source
------
M. Botsch, L. Kobbelt, "A remeshing approach to multiresolution modeling", Proc. SGP, 185-192,
2004, section 4; without edge collapses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray

Field = Callable[[FloatArray], FloatArray]  # (n, 3) -> (n,), negative inside

_WIDEST = np.radians(110.0)  # largest angle that flips for a better fit may create


def split_to(vertices: FloatArray, faces: IntArray, n: int) -> tuple[FloatArray, IntArray]:
    """Split the longest edges, at most one per triangle at a time, until there are *n* vertices."""
    while len(vertices) < n:
        edges, corners = _edges(faces)
        a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
        longest = np.argsort(-np.linalg.norm(a - b, axis=1), kind="stable")
        chosen = _independent(longest, corners // 3, n - len(vertices))
        middle = len(vertices) + np.arange(len(chosen))
        vertices = np.concatenate([vertices, 0.5 * (a[chosen] + b[chosen])])
        parts = []
        for corner in corners[chosen].T:
            tip, left, right = _around(faces, corner)
            parts.append((corner // 3, tip, left, middle))
            parts.append((np.arange(len(faces), len(faces) + len(chosen)), tip, middle, right))
            faces = np.concatenate([faces, faces[corner // 3]])
        faces = _rewritten(faces, parts)
    return vertices, faces


def flip(vertices: FloatArray, faces: IntArray, field: Field | None = None) -> IntArray:
    """Flip edges to the other diagonal of their two triangles.

    Without *field*, flip edges whose opposite angles sum to more than pi (not Delaunay).  With
    *field*, flip edges whose midpoint is more than twice as far from the surface field = 0 as that
    of the other diagonal, so that edges align with ribs.
    """
    n = len(vertices)
    for _ in range(4):
        edges, corners = _edges(faces)
        tips = faces.ravel()[corners]
        flipped = np.sort(tips, axis=1)
        if field is None:
            gain = _angle(vertices, tips[:, 0], edges) + _angle(vertices, tips[:, 1], edges) - np.pi
        else:
            now, then = (np.abs(field(vertices[ends].mean(axis=1))) for ends in (edges, flipped))
            widest = np.maximum(*(_angle(vertices, end, flipped) for end in edges.T))
            gain = np.where(widest < _WIDEST, now - 2.0 * then, 0.0)
        is_new = ~np.isin(flipped @ [n, 1], edges @ [n, 1])
        best = np.argsort(-gain, kind="stable")
        best = best[(gain > 1e-6)[best] & is_new[best]]
        _, first = np.unique(flipped[best] @ [n, 1], return_index=True)
        best = best[np.sort(first)]
        chosen = _independent(best, corners // 3, len(best))
        if not len(chosen):
            break
        one, two = corners[chosen].T
        tip, left, right = _around(faces, one)
        across = faces.ravel()[two]
        parts = [(one // 3, tip, left, across), (two // 3, across, right, tip)]
        faces = _rewritten(faces, parts)
    return faces


def relax(vertices: FloatArray, faces: IntArray, *, step: float = 0.7) -> FloatArray:
    """Move each vertex by *step* times the way to the mean of its neighbours, tangentially."""
    edges, _ = _edges(faces)
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    neighbours = sparse.csr_array((np.ones(len(i)), (i, j)), shape=(len(vertices),) * 2)
    move = neighbours @ vertices / np.bincount(i)[:, None] - vertices
    normals = vertex_normals(vertices, faces)
    move -= np.einsum("ij,ij->i", move, normals)[:, None] * normals
    relaxed: FloatArray = vertices + step * move
    return relaxed


def refine(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Divide every triangle into four at the midpoints of its edges; vertices keep their index."""
    edges, corners = _edges(faces)
    middle = np.empty(faces.size, dtype=np.int64)
    middle[corners] = len(vertices) + np.arange(len(edges))[:, None]
    (a, b, c), (bc, ca, ab) = faces.T, middle.reshape(-1, 3).T
    parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return (
        np.concatenate([vertices, vertices[edges].mean(axis=1)]),
        np.concatenate([np.stack(part, axis=-1) for part in parts]),
    )


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return area-weighted unit vertex normals, (n, 3)."""
    a, b, c = vertices[faces.T]
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    columns = [np.bincount(faces.ravel(), area[:, k], len(vertices)) for k in range(3)]
    normals = np.stack(columns, axis=-1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: FloatArray = normals / np.maximum(length, np.finfo(float).tiny)
    return unit


def _edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2) and their opposite corners (e, 2) as indices into faces.ravel()."""
    pairs = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    order = np.argsort(pairs @ [faces.max() + 1, 1], kind="stable")
    return pairs[order[::2]], order.reshape(-1, 2)  # closed: each edge occurs twice in sequence


def _around(faces: IntArray, corners: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the vertex of each corner and the next two of its triangle."""
    face, k = corners // 3, corners % 3
    return faces[face, k], faces[face, (k + 1) % 3], faces[face, (k + 2) % 3]


def _rewritten(
    faces: IntArray, parts: list[tuple[IntArray, IntArray, IntArray, IntArray]]
) -> IntArray:
    """Return a copy of *faces* with *parts*, each indices of triangles and their three corners."""
    faces = faces.copy()
    for which, a, b, c in parts:
        faces[which] = np.stack([a, b, c], axis=-1)
    return faces


def _independent(order: IntArray, triangles: IntArray, most: int) -> IntArray:
    """Return the first *most* edges in *order* that share no triangle."""
    taken: set[int] = set()
    chosen: list[int] = []
    for edge, (left, right) in zip(order.tolist(), triangles[order].tolist(), strict=True):
        if len(chosen) == most:
            break
        if left not in taken and right not in taken:
            taken.update((left, right))
            chosen.append(edge)
    return np.array(chosen, dtype=np.int64)


def _angle(vertices: FloatArray, tip: IntArray, ends: IntArray) -> FloatArray:
    """Return the angles at the vertices *tip* between the pairs *ends*."""
    u, v = vertices[ends[:, 0]] - vertices[tip], vertices[ends[:, 1]] - vertices[tip]
    angle: FloatArray = np.arctan2(
        np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)
    )
    return angle
