"""Symmetry: motions on one side of a plane are mirrored on the other side.

Every vertex has a *mate*, the point of the surface that is nearest to its mirror image.  What is
mirrored is the displacement u from rest, so that a scan that is only nearly symmetric keeps what is
not:

    u_i = M u_mate(i),    M = I - 2 n n^T

The mates of handles and fixed vertices are handles and fixed vertices as well; a handle across the
plane moves along it.  The cages, which are not symmetric, follow by a term of the objective,

    sum_i omega |u_i - M u_mate(i)|^2

and a finish makes the pose symmetric: to rounding, if the mesh is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, plain
from ..checks import shown
from ..errors import ArgumentError, ConstraintError
from ..freezing import Frozen
from ..mesh import Mesh, SurfacePoint, nearest_on_triangles, ragged_arange
from ..solver import MirrorTerm
from ..subspace import Subspace

Symmetry: TypeAlias = str | tuple[ArrayLike, ArrayLike] | None
"""As the option of `Deformer`."""

_AXES = {"x": 0, "y": 1, "z": 2}
_SAME = 1e-6  # diagonals, between a mirror image and a vertex that is its mate
# Diagonals: a mesh whose mirror image is farther off is not symmetric.  Those of models, scans
# and a body with one arm raised are off by at most 4e-3, of a dog in seven poses by 1e-4 to 2.3e-2,
# and of bodies with random limbs by at least 1.4e-2.
_FARTHEST = 0.01
_ROUNDS, _POINTS, _FEW_POINTS = 20, 2_000, 300  # of the search for the plane
_TERM_POINTS = 400  # vertices in the objective
_NEIGHBOURS = 3  # vertices whose triangles are searched for a mate


@dataclass(frozen=True, eq=False, repr=False)
class Mirror(Frozen):
    """A plane of symmetry of a mesh, with the mates of its vertices; made by `Mirror.of`."""

    point: FloatArray  # (3,)
    normal: FloatArray  # (3,)
    corners: IntArray  # (n, 3), of the faces that the mates are in
    shares: FloatArray  # (n, 3)
    error: float
    """The mean distance of mirror images from the surface, in diagonals."""

    @classmethod
    def of(cls, mesh: Mesh, symmetry: object) -> Mirror | None:
        """Return the mirror plane of *mesh* by the option *symmetry* of `Deformer`.

        Raises
        ------
        ConstraintError
            If the option is no plane, or the mesh is not symmetric about it.
        """
        if symmetry is None:
            return None
        if isinstance(symmetry, str) and symmetry in _AXES:
            axis = np.eye(3)[_AXES[symmetry]]
            plane = _settled(mesh, mesh.bounds.mean(axis=0), axis, turns=False)
        elif isinstance(symmetry, str) and symmetry == "auto":
            plane = _found(mesh)
        else:
            plane = _given(symmetry)
        best = _with_mates(mesh, plane.point, plane.normal)
        if best.error > _FARTHEST:
            raise ConstraintError(
                f"the mesh is not symmetric about this plane: its mirror image is off by "
                f"{100 * best.error:.3g} % of the diagonal in the mean; choose another plane"
            )
        return best

    def mirrored(self, u: FloatArray) -> FloatArray:
        """Return M u_mate(i) of displacements *u* (n, 3)."""
        return self.reflected(np.einsum("nc,ncj->nj", self.shares, u[self.corners]))

    def reflected(self, u: FloatArray) -> FloatArray:
        """Return M u of vectors *u* (k, 3)."""
        return np.asarray(u - 2.0 * np.outer(u @ self.normal, self.normal))

    def symmetric(self, u: FloatArray) -> FloatArray:
        """Return the mean of displacements *u* (n, 3) and their mirror images."""
        return 0.5 * (u + self.mirrored(u))

    def mate_of(self, mesh: Mesh, point: SurfacePoint) -> SurfacePoint:
        """Return the point of *mesh* that is nearest to the mirror image of *point*."""
        if point.is_vertex:
            return SurfacePoint.at_vertex(int(self.mates[point.vertex]))
        image = self.point + self.reflected((point.at(mesh.vertices) - self.point)[None])[0]
        return SurfacePoint.nearest(mesh, image)

    @cached_property
    def mates(self) -> IntArray:
        """(n,) int: the vertex nearest to each mate."""
        each = np.arange(len(self.corners))
        return np.asarray(self.corners[each, self.shares.argmax(axis=1)])

    def with_mates(self, ids: IntArray, taken: IntArray) -> tuple[IntArray, IntArray]:
        """Return *ids* (k,) and their mates, but for those *taken* (t,), and whose mates these are.

        The latter (e,) are indices into *ids*.
        """
        mates = self.mates[ids]
        _, first = np.unique(mates, return_index=True)
        is_new = np.zeros(len(ids), dtype=bool)
        is_new[first] = True
        is_new &= ~np.isin(mates, np.concatenate([ids, taken]))
        sources = np.flatnonzero(is_new)
        return np.concatenate([ids, mates[sources]]), sources

    def moved(
        self, mesh: Mesh, ids: IntArray, sources: IntArray, targets: FloatArray
    ) -> FloatArray:
        """Return the *targets* (k, 3) of vertices of *mesh* and those of their mates, (k + e, 3).

        *ids* (k + e,) are all these vertices, *sources* (e,) whose mates the last ones are.
        Targets of vertices whose mates have targets as well become mirror images of each other:
        the mean of both, so that a handle across the plane moves along it.
        """
        rest, given = mesh.vertices[ids], ids[: len(targets)]
        u = targets - rest[: len(targets)]
        both, mates = self._pairs(given)
        u[both] = 0.5 * (u[both] + self.reflected(u[mates]))
        return np.asarray(rest + np.concatenate([u, self.reflected(u[sources])]))

    def adjoint(self, ids: IntArray, sources: IntArray, slopes: FloatArray) -> FloatArray:
        """Return the gradient (k, 3) by the targets of `moved`, from that by its result."""
        count = len(ids) - len(sources)
        found = slopes[:count].copy()
        np.add.at(found, sources, self.reflected(slopes[count:]))
        both, mates = self._pairs(ids[:count])
        halves = 0.5 * found[both]
        found[both] -= halves
        np.add.at(found, mates, self.reflected(halves))
        return found

    def _pairs(self, ids: IntArray) -> tuple[IntArray, IntArray]:
        """Return the places in *ids* (k,) of vertices whose mates are there, too, and of these."""
        order, mates = np.argsort(ids), self.mates[ids]
        place = order[np.searchsorted(ids, mates, sorter=order).clip(max=len(ids) - 1)]
        both = np.flatnonzero(ids[place] == mates) if len(ids) else order
        return both, place[both]

    def term(self, subspace: Subspace, rest_cages: FloatArray, weight: float) -> MirrorTerm:
        """Return the term that keeps the cages symmetric, of this *weight* in all."""
        n = len(self.corners)
        some = np.arange(0, n, 1 + n // _TERM_POINTS)
        rows = subspace.at(some)
        at_mates = subspace.at(self.corners[some].ravel()).reshape(len(some), 3, -1)
        mates = np.einsum("kc,kcm->km", self.shares[some], at_mates)
        return MirrorTerm.of(
            rows, mates, normal=self.normal, rest=rest_cages, weight=weight / len(some)
        )


class _Plane(NamedTuple):
    point: FloatArray  # (3,)
    normal: FloatArray  # (3,)
    off: float = 0.0  # mean distance between mirror images of vertices and the nearest vertices


def _given(symmetry: object) -> _Plane:
    """Return the plane that is given by a point and its normal."""
    try:
        plane = plain(symmetry, "symmetry")  # type: ignore[arg-type]
    except ArgumentError:
        plane = np.zeros(0)
    is_pair = plane.shape == (2, 3) and plane.dtype.kind in "fiu"
    point, normal = plane * 1.0 if is_pair else np.zeros((2, 3))
    length = float(np.linalg.norm(normal))
    if not (np.isfinite(point).all() and 0.0 < length < np.inf):
        raise ConstraintError(
            f"symmetry must be 'x', 'y', 'z', 'auto', or a point and a normal of the plane; "
            f"got {shown(symmetry)}"
        )
    return _Plane(point, normal / length)


def _found(mesh: Mesh) -> _Plane:
    """Return the plane about which *mesh* is most symmetric.

    The normal of a plane of symmetry is a principal axis.  Where some are equally long it is any
    direction between them, so the search also starts there.
    """
    areas = mesh.vertex_areas
    middle = areas @ mesh.vertices / areas.sum()
    x = mesh.vertices - middle
    own = np.linalg.eigh((x.T * areas) @ x)[1].T
    between = [a + sign * b for a, b in combinations(own, 2) for sign in (1.0, -1.0)]
    starts = [*np.eye(3), *own, *(each / np.linalg.norm(each) for each in between)]
    planes = [_settled(mesh, middle, axis, most=_FEW_POINTS) for axis in starts]
    best = min(planes, key=lambda each: each.off)
    return _settled(mesh, best.point, best.normal)


def _settled(
    mesh: Mesh, point: FloatArray, normal: FloatArray, *, turns: bool = True, most: int = _POINTS
) -> _Plane:
    """Return the plane near one through *point* (3,) about which *mesh* is most symmetric.

    By iterated nearest points, of *most* vertices; it keeps its *normal* (3,) unless it *turns*.
    """
    x = mesh.vertices[:: 1 + mesh.n_vertices // most]
    tree = cKDTree(mesh.vertices)
    away = np.zeros(0)
    for _ in range(_ROUNDS):
        image = x - 2.0 * np.outer((x - point) @ normal, normal)
        away, ids = (np.asarray(each) for each in tree.query(image))
        near = mesh.vertices[ids]
        if turns:
            a, b = x - x.mean(axis=0), near - near.mean(axis=0)
            covariance = a.T @ b
            normal = np.linalg.eigh(covariance + covariance.T)[1][:, 0]
        between = 0.5 * (x + near).mean(axis=0)
        point = point + ((between - point) @ normal) * normal
    return _Plane(point, normal, float(away.mean()))


def _with_mates(mesh: Mesh, point: FloatArray, normal: FloatArray) -> Mirror:
    x, faces = mesh.vertices, mesh.faces
    image = x - 2.0 * np.outer((x - point) @ normal, normal)
    found = cKDTree(x).query(image, k=_NEIGHBOURS)
    away, near = (np.asarray(each) for each in found)
    order = np.argsort(faces.ravel(), kind="stable")
    counts = np.bincount(faces.ravel(), minlength=len(x))
    starts = np.cumsum(counts) - counts
    each, k = ragged_arange(counts[near.ravel()])
    face, at = order[starts[near.ravel()][each] + k] // 3, each // _NEIGHBOURS
    shares, off = nearest_on_triangles(x[faces[face]], image[at])
    by_point = np.lexsort((off, at))
    best = by_point[np.diff(at[by_point], prepend=-1) != 0]
    corners, weights = faces[face[best]], shares[best]
    is_vertex = away[:, 0] <= _SAME * mesh.diagonal
    corners[is_vertex] = near[is_vertex, :1]
    weights[is_vertex] = [1.0, 0.0, 0.0]
    return Mirror(point, normal, corners, weights, float(off[best].mean()) / mesh.diagonal)
