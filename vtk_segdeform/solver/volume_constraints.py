"""Volume constraints: the volume of each body of the mesh, or of each of its regions, is preserved.

    g_c(x) = V_c(x) - V_c(rest) = 0                                                     (9)

A *body* is a connected component, with the cavities in it.  The paper has one constraint for the
whole mesh; with several bodies one could then grow while the others shrink.

A region is an open surface, and is closed at its border: each connected part of the border is
spanned by a fan of triangles around its centre, which the regions on both sides share.  Region
volumes are then volumes of closed surfaces, do not depend on an origin, and add up to the volume of
the mesh.  The centres are means of mesh vertices, so V_c is the volume (8) of a few more triangles
over ``extension @ x`` instead of x.

An open mesh is closed by lids (`geometry.lids`) in the same way, and borders between regions then
run over the lids too.  Parts of the mesh that enclose nothing, such as sheets, have no volume.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import (
    Lids,
    corner_and_edges,
    lids_of,
    outer_components,
    signed_volume,
    step_to_volume,
    volume_along_path,
    volume_gradient,
)
from ..kernels import in_parallel
from ..mesh import Mesh
from ..subspace import Subspace

_MOST_BODIES = 6  # with a constraint of their own, the largest ones: each takes a few solves a step
_LEAST_BODY = 1e-4  # relative to the largest: too small for one of its own
_PIECE = 1 << 15  # faces processed together


@dataclass(frozen=True, eq=False)
class VolumeConstraint:
    """The volume enclosed by *faces* over the points ``extension @ x`` is equal to *target*.

    These points are *x* and the centres of lids and fans.
    """

    faces: IntArray
    target: float
    extension: sparse.csr_array | None = None  # None: the mesh's own vertices

    def violation(self, x: FloatArray) -> float:
        """Return g(x), in units of volume."""
        return float(violations((self,), x)[0])

    def relative(self, x: FloatArray) -> float:
        """Return g(x) / target; 0 if nothing is enclosed."""
        return self.violation(x) / self.target if self.target else 0.0

    @property
    def has_volume(self) -> bool:
        """Whether a volume is enclosed."""
        return bool(self.target)

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return J_g, (n, 3): the derivative of g by each vertex."""
        return gradients((self,), x)[0]

    def hessian_halves(self, x: FloatArray, weights: FloatArray | None = None) -> sparse.csr_array:
        """Return U_c for each axis c, (3n, n) one below the other, at *x* (n, 3).

        The Hessian is d^2 g / dx_ia dx_jb = sum_c eps_abc (U_c - U_c^T)_ij; U_c of
        det(x_i, x_j, x_k) / 6 is the axis c of x_k / 6.  *weights* (m,) multiply it for each face.
        """
        i, j, k = (np.concatenate(np.roll(self.faces.T, -turn, axis=0)) for turn in range(3))
        points, weight = self.extended(x) / 6.0, 1.0 if weights is None else np.tile(weights, 3)
        halves = [
            sparse.coo_array((weight * axis[k], (i, j)), (len(points), len(points))).tocsr()
            for axis in points.T
        ]
        if self.extension is not None:
            halves = [self.extension.T @ half @ self.extension for half in halves]
        return sparse.csr_array(sparse.vstack(halves))

    def exact_step(self, path: FloatArray) -> float:
        """Return the smallest t with g(x + t d) = 0, to rounding; x and d side by side (n, 6)."""
        return step_to_volume(volume_along_path(self.extended(path), self.faces), self.target)

    def extended(self, x: FloatArray) -> FloatArray:
        """Return all points, relative to a vertex if points were added, to limit cancellation."""
        if self.extension is None:
            return x
        x = x - x[0]
        return np.concatenate([x, self._means @ x])

    def shares_points(self, other: VolumeConstraint) -> bool:
        """Return whether `extended` is the same for both."""
        return self.extension is other.extension

    @cached_property
    def _means(self) -> sparse.csr_array:
        """The points that were added, from the others: `extension` below the identity."""
        assert self.extension is not None
        return self.extension[self.extension.shape[1] :]


def violations(constraints: Sequence[VolumeConstraint], x: FloatArray) -> FloatArray:
    """Return g(x) of all *constraints*, (c,), in units of volume."""
    each = _with_points(constraints, x)
    return np.array([signed_volume(points, one.faces) - one.target for one, points in each])


def gradients(constraints: Sequence[VolumeConstraint], x: FloatArray) -> list[FloatArray]:
    """Return J_g of all *constraints*, (n, 3) each: the derivative of g by each vertex."""
    found = []
    for one, points in _with_points(constraints, x):
        gradient = volume_gradient(points, one.faces)
        found.append(gradient if one.extension is None else one.extension.T @ gradient)
    return found


def _with_points(
    constraints: Sequence[VolumeConstraint], x: FloatArray
) -> Iterator[tuple[VolumeConstraint, FloatArray]]:
    """Yield each constraint with its points, which are computed once if all share them."""
    last, points = None, x
    for each in constraints:
        if last is None or not each.shares_points(last):
            points = each.extended(x)
        last = each
        yield each, points


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


def total_volume(mesh: Mesh, lids: Lids | None = None) -> VolumeConstraint:
    """Return the constraint that *mesh* keeps its enclosed volume.

    An open mesh encloses it together with its *lids*, by default `geometry.lids_of` the mesh.  If
    nothing is enclosed the constraint has no faces.
    """
    lids = lids_of(mesh) if lids is None else lids
    extension = lids.extension if lids.used.any() else None
    free = VolumeConstraint(_in_order(lids.closed(mesh)), 0.0, extension)
    return replace(free, target=free.violation(mesh.vertices))


@dataclass(frozen=True, eq=False)
class Bodies:
    """The bodies of a mesh, and the constraints that preserve the volume of each.

    Parameters
    ----------
    mesh : Mesh
        n vertices, c components.
    whole : VolumeConstraint
        The total volume.
    lids : Lids
        Of the mesh.
    """

    mesh: Mesh
    whole: VolumeConstraint
    lids: Lids

    def numbers(self, moved: IntArray) -> IntArray:
        """Return the constraint of each component, (c,) int.

        At most six bodies have one of their own: first those with vertices among *moved* (k,), then
        the largest; the others share one, and very small ones that of the largest.
        """
        if np.count_nonzero(self.lids.encloses) < 2:
            return np.zeros(len(self.lids.encloses), dtype=np.int64)
        is_moved = np.zeros(len(self._volumes), dtype=bool)
        is_moved[self._outer[self.mesh.components[moved]]] = True
        sizes = np.abs(np.bincount(self._outer, self._volumes, len(is_moved)))
        least = _LEAST_BODY * sizes.max()
        alone = np.lexsort((-sizes, ~is_moved))[:_MOST_BODIES]
        alone = alone[sizes[alone] >= least]
        alone = alone[np.argsort(-sizes[alone], kind="stable")]
        number = np.full(len(sizes), len(alone))
        number[alone] = np.arange(len(alone))
        if sizes[number == len(alone)].sum() < least:
            number[number == len(alone)] = 0
        return np.asarray(number[self._outer])

    def constraints(self, numbers: IntArray) -> tuple[VolumeConstraint, ...]:
        """Return the constraints for the `numbers` of components; they add up to the whole."""
        if not numbers.any():
            return (self.whole,) if self.whole.has_volume else ()
        body, found = numbers[self._component], []
        for k in range(int(body.max()) + 1):
            free = replace(self.whole, faces=self.whole.faces[body == k], target=0.0)
            found.append(replace(free, target=free.violation(self.mesh.vertices)))
        return tuple(found)

    @cached_property
    def _component(self) -> IntArray:
        """The component of each face of the whole, (m,) int."""
        each = np.concatenate([self.mesh.components, self.lids.component])
        return each[self.whole.faces[:, 0]]

    @cached_property
    def _volumes(self) -> FloatArray:
        """Six times the signed volume of each component, (c,)."""
        points, faces = self.whole.extended(self.mesh.vertices), self.whole.faces
        determinants = np.empty(len(faces))

        def work(start: int, stop: int) -> None:
            a, e, f = corner_and_edges(points, faces[start:stop])
            determinants[start:stop] = np.einsum("ij,ij->i", a - points[0], np.cross(e, f))

        in_parallel(work, len(faces), _PIECE)
        sums = np.bincount(self._component, determinants, len(self.lids.encloses))
        return np.asarray(sums, dtype=np.float64)

    @cached_property
    def _outer(self) -> IntArray:
        """The component around each cavity, and of other components their own number, (c,) int."""
        return outer_components(self.mesh.vertices, self.mesh.components, self._volumes)


def region_volumes(
    mesh: Mesh, labels: IntArray, lids: Lids | None = None
) -> tuple[VolumeConstraint, ...]:
    """Return one constraint for each region 0..r-1 of vertex *labels* (n,).

    A face belongs to the region of two of its corners, or to its first corner's, and a face of a
    lid to the region of the face at its border edge.  A region that owns no face around an enclosed
    volume has no constraint.
    """
    lids = lids_of(mesh) if lids is None else lids
    faces, face_labels = lids.closed(mesh), _labels_of_faces(mesh, labels, lids)
    if not len(faces):
        return ()
    n = mesh.n_vertices + len(lids.component)
    halves, owner = _borders(faces, face_labels, n)
    extension, centre = _with_centres(halves, n)
    if lids.used.any():
        extension = sparse.csr_array(extension @ lids.extension)
    constraints = []
    for label in np.unique(face_labels):
        u, v = halves[owner == label].T
        own = np.concatenate([faces[face_labels == label], np.stack([v, u, centre[u]], 1)])
        free = VolumeConstraint(own, 0.0, extension)
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


def _labels_of_faces(mesh: Mesh, labels: IntArray, lids: Lids) -> IntArray:
    """Return the label of each face of ``lids.closed(mesh)``."""
    b, c = labels[mesh.faces[:, 1]], labels[mesh.faces[:, 2]]
    of_mesh = np.where(b == c, b, labels[mesh.faces[:, 0]])
    if not len(lids.component) and lids.encloses.all():
        return of_mesh
    n = mesh.n_vertices
    head, tail, _ = lids.faces[lids.used[lids.loop]].T
    keys = (mesh.faces * n + np.roll(mesh.faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    beside = order[np.searchsorted(keys, tail * n + head, sorter=order)] // 3
    around = lids.encloses[mesh.components[mesh.faces[:, 0]]]
    return np.concatenate([of_mesh[around], of_mesh[beside]])


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
