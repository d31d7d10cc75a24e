"""Volume constraints: the volume of each body of the mesh (`bodies`), or of each region.

    g_c(x) = V_c(x) - V_c(rest) = 0                                                     (9)

A region is an open surface, and is closed at its border: each connected part of the border is
spanned by a fan of triangles around its centre, which the regions on both sides share.  Region
volumes are then volumes of closed surfaces, do not depend on an origin, and add up to the volume of
the mesh.  The centres are means of mesh vertices, so V_c is the volume (8) of a few more triangles
over ``extension @ x`` instead of x.

An open mesh is closed by lids (`geometry.lids`) in the same way, and borders between regions then
run over the lids too.  Parts of the mesh that enclose nothing, such as sheets, have no volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..freezing import Frozen
from ..geometry import (
    Lids,
    Parts,
    lids_of,
    signed_volumes,
    step_to_volume,
    volume_along_path,
    volume_gradient,
    volume_slopes_along,
)
from ..mesh import Mesh, edge_keys


@dataclass(frozen=True, eq=False, repr=False)
class VolumeConstraint(Frozen):
    """The volume enclosed by *faces* over the points ``extension @ x`` is equal to *target*.

    These points are *x* and the centres of lids and fans.  With a *bound* of 1 it is at least
    *target*, of -1 at most.  *share* is *target* as a share of the volume at rest.
    """

    faces: IntArray
    target: float
    extension: sparse.csr_array | None = None  # None: the mesh's own vertices
    name: str = ""
    share: float = 1.0
    bound: int = 0

    # What other measures have of their own; see `other_measures`.

    @property
    def is_cubic(self) -> bool:
        """Whether it is a cubic along every direction."""
        return True

    @property
    def has_origin(self) -> bool:
        """Whether it changes if all points are moved alike."""
        return False

    @property
    def size(self) -> float:
        """What errors are relative to: the target."""
        return self.target

    def value(self, points: FloatArray) -> float:
        """Return V over all points, those of `extended`."""
        return float(signed_volumes(points, self.parts)[0])

    def slope(self, points: FloatArray) -> FloatArray:
        """Return dV/dx of all points, (n, 3)."""
        return volume_gradient(points, self.faces)

    def along(self, paths: FloatArray) -> FloatArray:
        """Return V, and its derivative along each direction of *paths* (n, 3 + 3 d), (1 + d,).

        *paths* has all points, those of `extended`, and the d directions beside them.
        """
        found: FloatArray = volume_slopes_along(paths, self.parts)[0]
        return found

    @cached_property
    def parts(self) -> Parts:
        """The faces, as they are summed over."""
        return Parts.of([self.faces])

    def change(self, off: float) -> float:
        """Return by how much one that is *off* differs from that at rest, as a share of it."""
        return self.share * (1.0 + off) - 1.0

    def nearer(self, off: float) -> float:
        """Return the target with which one that is *off* would be met."""
        return self.target / (1.0 + off) if off > -1.0 else self.target

    def at_points(self, points: FloatArray, _: float, /) -> VolumeConstraint:
        """Return the same for other *points* at rest, whose unit may be longer."""
        free = replace(self, target=0.0)
        return replace(self, target=self.share * free.violation(points))

    def violation(self, x: FloatArray) -> float:
        """Return g(x), in units of volume."""
        return self.value(self.extended(x)) - self.target

    def relative(self, x: FloatArray) -> float:
        """Return by how much x is off: g(x) / size; 0 if nothing is enclosed."""
        return self.violation(x) / self.size if self.size else 0.0

    def missed(self, off: float) -> float:
        """Return how far it is from its bound if it is *off*; 0 within."""
        return 0.0 if off * self.bound > 0.0 else abs(off)

    @property
    def has_volume(self) -> bool:
        """Whether a volume is enclosed."""
        return bool(self.target)

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return J_g, (n, 3): the derivative of g by each vertex."""
        slope = self.slope(self.extended(x))
        return slope if self.extension is None else np.asarray(self.extension.T @ slope)

    def hessian_halves(self, x: FloatArray, weights: FloatArray | None = None) -> sparse.csr_array:
        """Return U_c for each axis c, (3n, n) one below the other, at *x* (n, 3).

        The Hessian is d^2 g / dx_ia dx_jb = sum_c eps_abc (U_c - U_c^T)_ij; U_c of
        det(x_i, x_j, x_k) / 6 is the axis c of x_k / 6.  *weights* (m,) multiply it for each face.
        """
        points = self.extended(x) / 6.0
        face, tail, columns, opposite = self._half_edges
        starts = np.searchsorted(tail, np.arange(len(points) + 1))
        values = points[opposite].T
        if weights is not None:
            values = weights[face] * values
        n = len(points)
        if self.extension is None:
            begins = len(face) * np.arange(3)[:, None] + starts[:-1]
            rows = np.append(begins.ravel(), values.size)
            return sparse.csr_array((values.ravel(), np.tile(columns, 3), rows), (3 * n, n))
        halves = (sparse.csr_array((each, columns, starts), (n, n)) for each in values)
        return sparse.csr_array(
            sparse.vstack([self.extension.T @ half @ self.extension for half in halves])
        )

    @cached_property
    def _half_edges(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """The half-edges of the faces by their first end: face, both ends, the third corner."""
        i, j, k = (np.concatenate(np.roll(self.faces.T, -turn, axis=0)) for turn in range(3))
        order = np.argsort(i, kind="stable")
        return order % len(self.faces), i[order], j[order], k[order]

    def exact_step(self, path: FloatArray) -> float:
        """Return the smallest t with g(x + t d) = 0, to rounding; x and d side by side (n, 6)."""
        return step_to_volume(volume_along_path(self.extended(path), self.parts), self.target)

    def extended(self, x: FloatArray) -> FloatArray:
        """Return all points, relative to a vertex if points were added, to limit cancellation."""
        if self.extension is None:
            return x
        x = x if self.has_origin else x - x[0]
        return np.concatenate([x, self._means @ x])

    def shares_points(self, other: VolumeConstraint) -> bool:
        """Return whether `extended` is the same for both."""
        return self.extension is other.extension and self.has_origin is other.has_origin

    @cached_property
    def _means(self) -> sparse.csr_array:
        """The points that were added, from the others: `extension` below the identity."""
        assert self.extension is not None
        return self.extension[self.extension.shape[1] :]


def with_same_points(constraints: Sequence[VolumeConstraint]) -> tuple[VolumeConstraint, ...]:
    """Return the *constraints* over points that all of them share."""
    distinct: list[sparse.csr_array] = []
    for each in constraints:
        if each.extension is not None and not any(each.extension is one for one in distinct):
            distinct.append(each.extension)
    if not distinct or all(each.extension is distinct[0] for each in constraints):
        return tuple(constraints)
    n = distinct[0].shape[1]
    added = [each[n:] for each in distinct]
    extension = sparse.csr_array(sparse.vstack([sparse.eye_array(n), *added]))
    starts = np.cumsum([0, *(each.shape[0] for each in added)])
    found = []
    for each in constraints:
        at = [k for k, one in enumerate(distinct) if each.extension is one]
        shift = int(starts[at[0]]) if at else 0
        faces = np.where(each.faces >= n, each.faces + shift, each.faces)
        found.append(replace(each, faces=faces, extension=extension))
    return tuple(found)


def total_volume(mesh: Mesh, lids: Lids | None = None) -> VolumeConstraint:
    """Return the constraint that *mesh* keeps its enclosed volume.

    An open mesh encloses it together with its *lids*, by default `geometry.lids_of` the mesh.  If
    nothing is enclosed the constraint has no faces.
    """
    lids = lids_of(mesh) if lids is None else lids
    extension = lids.extension if lids.used.any() else None
    free = VolumeConstraint(_in_order(lids.closed(mesh)), 0.0, extension)
    return replace(free, target=free.violation(mesh.vertices))


def region_volumes(
    mesh: Mesh, labels: IntArray, lids: Lids | None = None
) -> tuple[VolumeConstraint, ...]:
    """Return one constraint for each region 0..r-1 of vertex *labels* (n,).

    A face belongs to the region of two of its corners, or to its first corner's, and a face of a
    lid to the region of the face at its border edge.  A region that owns no face around an enclosed
    volume has no constraint.
    """
    return tuple(volumes_by_label(mesh, labels, lids).values())


def volumes_by_label(
    mesh: Mesh, labels: IntArray, lids: Lids | None = None
) -> dict[int, VolumeConstraint]:
    """Return the constraint of each of *labels*, as `region_volumes`."""
    lids = lids_of(mesh) if lids is None else lids
    faces = lids.closed(mesh)
    if not len(faces):
        return {}
    face_labels = _labels_of_faces(mesh, labels, faces)
    n = mesh.n_vertices + len(lids.component)
    halves, owner = _borders(faces, face_labels, n)
    extension, centre = _with_centres(halves, n)
    if len(lids.component):
        extension = sparse.csr_array(extension @ lids.extension)
    constraints = {}
    for label in np.unique(face_labels).tolist():
        u, v = halves[owner == label].T
        own = np.concatenate([faces[face_labels == label], np.stack([v, u, centre[u]], 1)])
        free = VolumeConstraint(own, 0.0, extension)
        constraints[label] = replace(free, target=free.violation(mesh.vertices))
    return constraints


def _in_order(faces: IntArray) -> IntArray:
    """Return *faces* sorted by vertex, as 32-bit integers: sums take a third of the time."""
    short = faces.astype(np.int32)
    key = np.minimum(short[:, 0], short[:, 1]).astype(np.int64)
    np.minimum(key, short[:, 2], out=key)
    key <<= 32  # room for the index of each face
    key |= np.arange(len(key))
    key.sort()
    return np.take(short, key & 0xFFFFFFFF, axis=0)


def _labels_of_faces(mesh: Mesh, labels: IntArray, faces: IntArray) -> IntArray:
    """Return the label of each of *faces* (m', 3), which may be lids."""
    n = mesh.n_vertices
    of_lids = faces.max(axis=1) >= n
    own = faces[~of_lids]
    b, c = labels[own[:, 1]], labels[own[:, 2]]
    found = np.empty(len(faces), dtype=labels.dtype)
    found[~of_lids] = np.where(b == c, b, labels[own[:, 0]])
    if of_lids.any():
        keys = edge_keys(own.ravel(), np.roll(own, -1, axis=1).ravel(), n)
        order = np.argsort(keys)
        one, two, _ = np.sort(faces[of_lids], axis=1).T  # the centre is last
        beside = order[np.searchsorted(keys, edge_keys(one, two, n), sorter=order)] // 3
        found[of_lids] = found[~of_lids][beside]
    return found


def _borders(faces: IntArray, face_labels: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return the directed border edges (b, 2) of all labels of faces, and the label of each.

    An edge that k more faces of a label have in one direction occurs k times.
    """
    of_several = _of_several(face_labels, faces, n)
    near = of_several[faces].any(axis=1)
    halves = faces[near][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)  # directed edges, 3 a face
    inner = of_several[halves].all(axis=1)  # includes all border edges and their opposites
    halves, owner = halves[inner], np.repeat(face_labels[near], 3)[inner]
    forward = halves[:, 0] < halves[:, 1]
    key = (owner * n + halves.min(axis=1)) * n + halves.max(axis=1)
    _, edge = np.unique(key, return_inverse=True)
    net = np.rint(np.bincount(edge, np.where(forward, 1, -1))).astype(np.int64)
    excess = np.where(forward, net[edge], -net[edge])
    order = np.lexsort((forward, edge))
    place = np.arange(len(order))
    begins = np.diff(2 * edge[order] + forward[order], prepend=-1) != 0
    rank = np.empty_like(place)  # among the half-edges of a label with this direction
    rank[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    border = rank < excess
    return halves[border], owner[border]


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
