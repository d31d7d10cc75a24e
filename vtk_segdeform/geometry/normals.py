"""Unit vertex normals of a moving mesh, for drawing.

The normal is the area-weighted mean of the face normals around a vertex: the direction in which
moving the vertex adds most volume.  With the neighbours x_1 ... x_d of a vertex x in cyclic order,
it is the direction of

    sum_k (x_k - x) x (x_{k+1} - x)

The rings of neighbours are computed once.  Each vertex depends on its own ring only, so the loop
over vertices runs in parallel.  At borders and non-manifold vertices, which have no such ring, the
normals of the faces are summed.

A surface with one side cannot be oriented: somewhere it has a seam, where neighbouring faces differ
in orientation.  At its vertices the normals of the faces that are `turned` count negative.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..kernels import compiled_kernels, in_parallel, inputs
from ..mesh import HalfEdges, Mesh, two_sides

_all_rings: WeakKeyDictionary[Mesh, tuple[NDArray[np.int32], IntArray]] = WeakKeyDictionary()


class VertexNormals:
    """Unit vertex normals of *mesh* in any pose.

    Parameters
    ----------
    mesh : Mesh
        n vertices; poses are scaled by its diagonal.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._faces, self._n = mesh.faces, mesh.n_vertices
        self._scale = 1.0 / mesh.diagonal
        self._mesh = mesh

    @cached_property
    def turned(self) -> IntArray:
        """(k,) int: the corners, 3 f + c, of faces oriented against the normal at that corner.

        They are at the seam of a surface with one side; any other mesh has none.
        """
        if self._mesh.is_two_manifold:
            return np.empty(0, dtype=np.int64)
        edges = HalfEdges(self._faces, self._n)
        opposite = edges.inconsistent
        if not opposite.any():
            return np.empty(0, dtype=np.int64)
        corners, across = edges.fan_links(edges.pairs)
        _, turned, _ = two_sides(self._faces.size, corners, across, np.tile(opposite, 2))
        return np.flatnonzero(turned)

    def of(self, x: FloatArray, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return the normals (n, 3) of the pose *x* (n, 3), in *out* if given.

        A normal is zero where the faces around the vertex have no area.
        """
        out = np.empty((self._n, 3), dtype=np.float32) if out is None else out
        if compiled_kernels(len(self._faces)):
            self._around_rings(x, self._every, out)
            vertices, faces, around = self._open
            if len(vertices):
                out[vertices] = self._summed(x, faces, around)
            return out
        out[:] = self._summed(x, self._faces, self._around)
        return out

    def subset(self, vertices: IntArray) -> Callable[[FloatArray], NDArray[np.float32]]:
        """Return a function of a pose (n, 3) for the normals (k, 3) of these *vertices* (k,)."""
        is_open = np.ones(len(vertices), dtype=bool)
        if compiled_kernels(len(self._faces)):
            is_open = np.isin(vertices, self._open[0])
        summed = self._sums_at(vertices[is_open])

        def normals(x: FloatArray) -> NDArray[np.float32]:
            out = np.empty((len(vertices), 3), dtype=np.float32)
            if not is_open.all():
                self._around_rings(x, vertices, out)
            out[is_open] = summed(x)
            return out

        return normals

    def _around_rings(self, x: FloatArray, vertices: IntArray, out: NDArray[np.float32]) -> None:
        """Put the normals of *vertices* (k,) into *out* (k, 3), by their closed rings."""
        kernels = compiled_kernels()
        arguments = inputs(vertices, x, *self._rings)
        size = max(1 << 12, -(-len(vertices) // 16))

        def work(first: int, last: int) -> None:
            kernels.ring_normals(out, *arguments, self._scale, first, last)

        in_parallel(work, len(vertices), size)

    def _sums_at(self, vertices: IntArray) -> Callable[[FloatArray], FloatArray]:
        """Return `subset` by sums over the faces at *vertices*."""
        row = np.full(self._n, -1)
        row[vertices] = np.arange(len(vertices))
        faces = np.flatnonzero((row[self._faces] >= 0).any(axis=1))
        corners = 3 * np.repeat(faces, 3) + np.tile(np.arange(3), len(faces))
        signs = np.where(np.isin(corners, self.turned), -1.0, 1.0)
        rows, columns = row[self._faces.ravel()[corners]], np.repeat(np.arange(len(faces)), 3)
        kept = rows >= 0
        entries = signs[kept], (rows[kept], columns[kept])
        around = sparse.coo_array(entries, shape=(len(vertices), len(faces))).tocsr()
        return lambda x: self._summed(x, self._faces[faces], around)

    def _summed(self, x: FloatArray, faces: IntArray, around: sparse.csr_array) -> FloatArray:
        """Return the unit sums of the normals of *faces*, as *around* has them at vertices."""
        a, b, c = (np.take(x, corner, axis=0) * self._scale for corner in faces.T)
        normals = around @ np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), 0.0)

    @cached_property
    def _every(self) -> IntArray:
        return np.arange(self._n)

    @cached_property
    def _open(self) -> tuple[IntArray, IntArray, sparse.csr_array]:
        """The vertices without a closed ring, the faces at them, and `_around` of both."""
        ring, starts = self._rings
        vertices = np.flatnonzero(ring[starts[:-1]] == np.arange(self._n))
        around = self._around[vertices] if len(vertices) else sparse.csr_array((0, 0))
        faces = np.unique(around.indices)
        return vertices, self._faces[faces], around[:, faces]

    @cached_property
    def _rings(self) -> tuple[NDArray[np.int32], IntArray]:
        """(3m,) and (n + 1,): the neighbours of all vertices, and where each ring begins.

        They are kept as long as the mesh, so another thread can compute them before it is drawn.
        """
        known = _all_rings.get(self._mesh)
        if known is not None:
            return known
        starts = np.concatenate([[0], np.cumsum(np.bincount(self._faces.ravel()))])
        ring = np.empty(self._faces.size, dtype=np.int32)
        compiled_kernels().rings(ring, *inputs(self._faces, starts))
        _all_rings[self._mesh] = ring, starts
        return ring, starts

    @cached_property
    def _around(self) -> sparse.csr_array:
        """(n, m) sparse: 1 where a vertex is a corner of a face, -1 where that is turned."""
        corners = self._faces.ravel(), np.repeat(np.arange(len(self._faces)), 3)
        signs = np.ones(self._faces.size)
        signs[self.turned] = -1.0
        return sparse.coo_array((signs, corners)).tocsr()
