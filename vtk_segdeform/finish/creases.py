"""Creases in which a pose crosses itself are smoothed, and everything farther away stays.

In the inside of a sharp bend a surface has less room than it has detail: a few triangles cross
others nearby.  The gradients of the triangles around them, with the normal as a third direction,
are averaged with those of their neighbours, over and over, while the ones at the border of the
patch stay.  The vertices follow (`gradients`), so the detail is bent as its surroundings are.

What is smoothed too little still crosses, and too much loses its shape, so both the patches and
the number of averages grow step by step.  A patch is kept once none of its triangles cross.  Where
the first averages hardly help, parts are pushed through each other: they stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Mesh
from ..progress import Progress, tell
from .folds import Folds
from .gradients import Patch, around

_ATTEMPTS = (2, 20), (2, 60), (4, 60)  # rings around crossing faces, and averages
_HELPED = 0.8  # share of the crossing faces of a patch that remain, at most, if it is tried again
_TINY = 1e-300


def smoothed(
    mesh: Mesh,
    x: FloatArray,
    free: BoolArray,
    crossing: Callable[[FloatArray], IntArray],
    *,
    progress: Progress | None = None,
) -> FloatArray:
    """Return the pose *x* (n, 3) with fewer *crossing* faces, if *free* vertices (n,) allow it."""
    folds, begin, tried = Folds.of(mesh), x, crossing(x)
    for turn, (rings, averages) in enumerate(_ATTEMPTS):
        moving = around(mesh, tried, rings) & free
        if not moving.any():
            break
        tell(progress, turn / len(_ATTEMPTS), "smoothing creases")
        there = _averaged(mesh, folds, begin, moving, averages)
        if not np.isfinite(there).all():
            break
        patches = _Patches(mesh, moving)
        before, left = patches.counts(tried), patches.counts(crossing(there))
        chosen = patches.vertices(left == 0)
        x = np.where(chosen[:, None], there, x)
        again = patches.vertices((left > 0) & (left <= _HELPED * before))
        tried = tried[again[mesh.faces[tried]].any(axis=1)]
    return x


def _averaged(
    mesh: Mesh, folds: Folds, x: FloatArray, moving: BoolArray, averages: int
) -> FloatArray:
    """Return *x* with the gradients at *moving* vertices averaged so many times."""
    patch = Patch(mesh, folds, moving)
    _, sides = patch.edges(folds)
    m = len(patch.triangles)
    frames, posed = _frames(mesh, patch.faces), patch.at(x)
    normals = np.cross(posed[:, :, 0], posed[:, :, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
    gradients = np.concatenate([posed, normals[:, :, None]], axis=2) @ np.swapaxes(frames, 1, 2)
    links = np.ones(len(sides)), (sides[:, 0], sides[:, 1])
    graph = sparse.coo_array(links, (m, m)).tocsr()
    graph = graph + graph.T
    counts = np.maximum(graph.sum(axis=1), 1.0)[:, None]
    inside = np.asarray(moving[patch.faces].all(axis=1))
    flat = gradients.reshape(m, 9)
    rows = graph[inside]
    for _ in range(averages):
        flat[inside] = (rows @ flat) / counts[inside]
    wanted = flat.reshape(m, 3, 3) @ frames[:, :, :2]
    return patch.fitted(x, wanted, np.ones(m))


class _Patches:
    """The connected parts of the vertices *moving* (n,) bool."""

    def __init__(self, mesh: Mesh, moving: BoolArray) -> None:
        own = np.flatnonzero(moving)
        self._faces = mesh.faces
        self._n, label = connected_components(mesh.adjacency[own][:, own], directed=False)
        self._patch = np.full(mesh.n_vertices, -1)
        self._patch[own] = label

    def counts(self, faces: IntArray) -> IntArray:
        """Return how many of the *faces* (k,) are at vertices of each patch."""
        patch = self._patch[self._faces[faces]].max(axis=1, initial=-1)
        return np.bincount(patch[patch >= 0], minlength=self._n)

    def vertices(self, chosen: BoolArray) -> BoolArray:
        """Return which vertices are in the *chosen* patches, (n,) bool."""
        return np.asarray(np.append(chosen, False)[self._patch])


def _frames(mesh: Mesh, faces: IntArray) -> FloatArray:
    """Return the axes of the triangles *faces* (m, 3) at rest as columns, (m, 3, 3)."""
    a, b, c = mesh.vertices[faces.T]
    first, normal = b - a, np.cross(b - a, c - a)
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=2)
