"""Volume constraints: the volume of the whole mesh, or of each of its regions, is preserved.

    g_c(x) = V_c(x) - V_c(rest) = 0                                                     (9)

A region is an open surface, and is closed at its border: each connected part of the border is
spanned by a fan of triangles around its centre, which the regions on both sides share.  Region
volumes are then volumes of closed surfaces, do not depend on an origin, and add up to the volume of
the mesh.  The centres are means of mesh vertices, so V_c is the volume (8) of a few more triangles
over ``extension @ x`` instead of x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import signed_volume, step_to_volume, volume_along_path, volume_gradient
from ..mesh import Mesh
from ..subspace import Subspace


@dataclass(frozen=True, eq=False)
class VolumeConstraint:
    """The volume enclosed by *faces* over the points ``extension @ x`` is equal to *target*.

    These points are *x* and the centres of the fans.
    """

    faces: IntArray
    target: float
    extension: sparse.csr_array | None = None  # None: the mesh's own vertices

    def violation(self, x: FloatArray) -> float:
        """Return g(x), in units of volume."""
        return signed_volume(self._extended(x), self.faces) - self.target

    def relative(self, x: FloatArray) -> float:
        """Return g(x) / target."""
        return self.violation(x) / self.target

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return J_g, (n, 3): the derivative of g by each vertex."""
        gradient = volume_gradient(self._extended(x), self.faces)
        return gradient if self.extension is None else self.extension.T @ gradient

    def hessian_halves(self, x: FloatArray) -> sparse.csr_array:
        """Return U_c for each axis c, (3n, n) one below the other, at *x* (n, 3).

        The Hessian is d^2 g / dx_ia dx_jb = sum_c eps_abc (U_c - U_c^T)_ij; U_c of
        det(x_i, x_j, x_k) / 6 is the axis c of x_k / 6.
        """
        i, j, k = (np.concatenate(np.roll(self.faces.T, -turn, axis=0)) for turn in range(3))
        points = self._extended(x) / 6.0
        halves = [
            sparse.coo_array((axis[k], (i, j)), (len(points), len(points))).tocsr()
            for axis in points.T
        ]
        if self.extension is not None:
            halves = [self.extension.T @ half @ self.extension for half in halves]
        return sparse.csr_array(sparse.vstack(halves))

    def exact_step(self, path: FloatArray) -> float:
        """Return the smallest t with g(x + t d) = 0, to rounding; x and d side by side (n, 6)."""
        return step_to_volume(volume_along_path(self._extended(path), self.faces), self.target)

    def _extended(self, x: FloatArray) -> FloatArray:
        """Return all points, relative to a vertex if points were added, to limit cancellation."""
        if self.extension is None:
            return x
        x = x - x[0]
        return np.concatenate([x, self.extension[len(x) :] @ x])  # its upper part is the identity


@dataclass(frozen=True, eq=False)
class Volumes:
    """Constraints as functions of the cage vertices p, on the surface ``surface.map(p)``.

    *hessian*, if given, is a function of p and the multipliers lambda.  It returns G (3, m, m) with
    sum_k lambda_k d^2 g_k / dp_ia dp_jb = sum_c eps_abc G_cij.
    """

    surface: Subspace
    constraints: tuple[VolumeConstraint, ...]
    hessian: Callable[[FloatArray, FloatArray], FloatArray] | None = None

    def preserved_at(self, p: FloatArray) -> Volumes:
        """Return the constraints with the volumes at cage vertices *p* (m, 3) as their targets."""
        x = self.surface.map(p)
        now = (replace(each, target=each.target + each.violation(x)) for each in self.constraints)
        return replace(self, constraints=tuple(now))


def total_volume(mesh: Mesh) -> VolumeConstraint:
    """Return the constraint that *mesh* keeps its enclosed volume."""
    faces = _in_order(mesh.faces)
    return VolumeConstraint(faces, signed_volume(mesh.vertices, faces))


def region_volumes(mesh: Mesh, labels: IntArray) -> tuple[VolumeConstraint, ...]:
    """Return one constraint for each region 0..r-1 of vertex *labels* (n,).

    A face belongs to the region of two of its corners, or to its first corner's.  A region that
    owns no face has no constraint.
    """
    face_labels = _face_labels(labels[mesh.faces])
    n = mesh.n_vertices
    of_several = _of_several(face_labels, mesh.faces, n)
    near = of_several[mesh.faces].any(axis=1)
    halves = mesh.faces[near][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)  # directed edges, 3 a face
    inner = of_several[halves].all(axis=1)  # includes all border edges and their opposites
    halves, owner = halves[inner], np.repeat(face_labels[near], 3)[inner]
    key, opposite = halves[:, 0] * n + halves[:, 1], halves[:, 1] * n + halves[:, 0]
    order = np.argsort(key)
    across = owner[order[np.searchsorted(key, opposite, sorter=order)]]
    border = across != owner

    extension, centre = _with_centres(halves[border], n)
    constraints = []
    for label in np.unique(face_labels):
        u, v = halves[border & (owner == label)].T
        faces = np.concatenate([mesh.faces[face_labels == label], np.stack([v, u, centre[u]], 1)])
        free = VolumeConstraint(faces, 0.0, extension)
        constraints.append(replace(free, target=free.violation(mesh.vertices)))
    return tuple(constraints)


def _in_order(faces: IntArray) -> IntArray:
    """Return *faces* sorted by vertex, as 32-bit integers: sums take a third of the time."""
    short = faces.astype(np.int32)
    key = np.minimum(short[:, 0], short[:, 1]).astype(np.int64)
    np.minimum(key, short[:, 2], out=key)
    key <<= 32  # room for the index of each face
    key |= np.arange(len(key))
    key.sort()
    return np.take(short, key & 0xFFFFFFFF, axis=0)


def _face_labels(corners: IntArray) -> IntArray:
    return np.where(corners[:, 1] == corners[:, 2], corners[:, 1], corners[:, 0])


def _of_several(face_labels: IntArray, faces: IntArray, n: int) -> BoolArray:
    """Return a mask of the n vertices that are corners of faces with different labels."""
    least, most = np.full(n, face_labels.max()), np.full(n, face_labels.min())
    for corner in faces.T:
        np.minimum.at(least, corner, face_labels)
        np.maximum.at(most, corner, face_labels)
    return np.asarray(least != most)


def _with_centres(edges: IntArray, n: int) -> tuple[sparse.csr_array, IntArray]:
    """Return the extension of x by the centres of the borders, and the centre of each vertex."""
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), (n, n))
    _, part = csgraph.connected_components(graph, directed=False)
    on_border = np.unique(edges)
    parts, local = np.unique(part[on_border], return_inverse=True)
    mean = sparse.coo_array((1.0 / np.bincount(local)[local], (local, on_border)), (len(parts), n))
    centre = np.zeros(n, dtype=np.int64)
    centre[on_border] = n + local
    return sparse.csr_array(sparse.vstack([sparse.eye_array(n), mean])), centre
