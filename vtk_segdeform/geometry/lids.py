"""Lids over the borders of an open mesh, under which it encloses a volume.

The boundary of the faces of a mesh is a sum of loops of directed edges.  Each loop gets a *lid*: a
fan of triangles from its edges to its centre, the mean of its vertices.  Faces and lids together
have no boundary, so their volume (8) does not depend on an origin, and a centre is a linear
function of the mesh: its volume, gradient and cubic along a direction are computed as for a closed
mesh, over the points ``extension @ x``.

Which components of a mesh enclose a volume is decided by their mean winding number.  The solid
angle under which an oriented surface S is seen from a point x just inside it is 4 pi w(x),

    w(x) = 1/2 + (1 / 4 pi) integral over S of n(y) . (y - x) / |y - x|^3 dA(y)

and w = 1 on a closed surface: no line of sight leads out.  On a plane w = 1/2, half of them do.
A wrinkled sheet has the same mean as a flat one, while a closed surface with a small hole has a
mean close to 1.  In two dimensions an arc of the angle a has the mean 1/2 + a / 4 pi.

    component                                        encloses a volume
    closed                                           yes
    open, | 2 mean(w) - 1 | >= 0.45                  yes: a bottle, a tube, half of a ball
    open, below                                      no: a sheet, a cloth, a shallow cap
    one-sided, such as a Moebius strip               no
    volume under lids is 0 to rounding               no: a closed shell around nothing

The absolute value is taken because an open surface may be turned inside out.

Source
------
The winding number of open surfaces: A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-
outside segmentation using generalized winding numbers", SIGGRAPH 2013.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, Mesh
from .volume import signed_volume

_LEAST = 0.45  # |2 mean(w) - 1| of an open component that encloses a volume
_SAMPLES = 1000  # points on a component
_NO_VOLUME = 1e-11  # of the area to the power 3/2
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class Lids:
    """The lids of a mesh with n vertices and k border loops.

    Attributes
    ----------
    faces : (l, 3) int
        Over the n vertices and k centres.
    loop : (l,) int
        The loop of each face.
    extension : (n + k, n) sparse
        From vertices to vertices and centres: rows of the identity, then of means.
    component : (k,) int
        The component of the mesh that each loop bounds.
    encloses : (c,) bool
        Whether each component of the mesh encloses a volume.
    """

    faces: IntArray
    loop: IntArray
    extension: sparse.csr_array
    component: IntArray
    encloses: BoolArray

    @property
    def has_volume(self) -> bool:
        """Whether any component encloses a volume."""
        return bool(self.encloses.any())

    @property
    def used(self) -> BoolArray:
        """(k,) bool: the loops whose lids close an enclosed volume."""
        return self.encloses[self.component]

    def closed(self, mesh: Mesh) -> IntArray:
        """Return the faces of *mesh* and of lids around the enclosed volumes, (m', 3)."""
        if not len(self.component) and self.encloses.all():
            return mesh.faces
        around = self.encloses[mesh.components[mesh.faces[:, 0]]]
        return np.concatenate([mesh.faces[around], self.faces[self.used[self.loop]]])


def lids_of(mesh: Mesh, lids: bool | None = None) -> Lids:
    """Return the lids of *mesh*, and which of its components enclose a volume.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    lids : bool or None
        True: every open component encloses a volume under its lids.  False: none does.  None:
        those do whose mean winding number says so; see above.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> open_corner = Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> lids = lids_of(open_corner)
    >>> lids.encloses, lids.closed(open_corner).tolist()
    (array([ True]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [3, 1, 4], [2, 3, 4], [1, 2, 4]])
    >>> lids_of(Mesh(corners[:3], [[0, 1, 2]])).encloses
    array([False])
    """
    n, k = mesh.n_vertices, len(mesh.borders)
    sizes = np.array([len(loop) for loop in mesh.borders], dtype=np.int64)
    tail = np.concatenate([np.empty(0, np.int64), *mesh.borders])
    head = np.concatenate([np.empty(0, np.int64), *(np.roll(loop, -1) for loop in mesh.borders)])
    loop = np.repeat(np.arange(k), sizes)
    faces = np.stack([head, tail, n + loop], axis=1)
    means = sparse.coo_array((1.0 / sizes[loop], (loop, tail)), (k, n))
    extension = sparse.csr_array(sparse.vstack([sparse.eye_array(n), means]))
    component = mesh.components[[each[0] for each in mesh.borders]].astype(np.int64)
    every = np.ones(int(mesh.components.max()) + 1, dtype=bool)
    found = Lids(faces, loop, extension, component, every)
    return replace(found, encloses=_enclosing(mesh, found, lids))


def mean_winding(points: FloatArray, faces: IntArray) -> float:
    """Return the mean winding number just inside the surface of *points* (n, 3), *faces* (m, 3).

    From a thousand points y_i that share its area: the integral above is a sum over pairs, with
    distances below that of neighbouring points replaced by it.  The error is about 0.01.
    """
    corner = points[faces[:, 0]]
    e, f = points[faces[:, 1]] - corner, points[faces[:, 2]] - corner
    normals = np.cross(e, f)
    areas = np.linalg.norm(normals, axis=1)  # twice the area
    total = float(areas.sum())
    if not total > 0.0:
        return 0.5
    ends = np.cumsum(areas)
    place = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * ends[-1]
    own = np.searchsorted(ends, place).clip(max=len(faces) - 1)
    u, v = np.arange(_SAMPLES) * _GOLDEN % 1.0, (np.arange(_SAMPLES) + 0.5) * _GOLDEN**2 % 1.0
    u, v = np.where(u + v > 1.0, [1.0 - u, 1.0 - v], [u, v])
    y = corner[own] + u[:, None] * e[own] + v[:, None] * f[own]
    unit = normals[own] / areas[own, None]
    share = 0.5 * total / _SAMPLES
    apart = y[None] - y[:, None]
    distance = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart)).clip(min=np.sqrt(share))
    seen = np.einsum("ijk,jk->ij", apart, unit) / distance**3
    return 0.5 + float(seen.sum()) * share / (4.0 * np.pi * _SAMPLES)


def _enclosing(mesh: Mesh, lids: Lids, wanted: bool | None) -> BoolArray:
    """Return which components enclose a volume, (c,) bool."""
    count = len(lids.encloses)
    is_open = np.bincount(lids.component, minlength=count) > 0
    of_face = mesh.components[mesh.faces[:, 0]]
    encloses = ~is_open | (wanted is not False)
    if is_open.any():
        half_edges = HalfEdges(mesh.faces, mesh.n_vertices)
        one_sided = half_edges.one_sided[half_edges.shells]
        encloses[of_face[one_sided]] = False
    x = lids.extension @ (mesh.vertices - mesh.vertices[0])
    of_lid = lids.component[lids.loop]
    for c in np.flatnonzero(encloses):
        own = mesh.faces if count == 1 else mesh.faces[of_face == c]
        closed = np.concatenate([own, lids.faces[of_lid == c]])
        area = float(mesh.face_areas.sum() if count == 1 else mesh.face_areas[of_face == c].sum())
        encloses[c] = abs(signed_volume(x, closed)) > _NO_VOLUME * area**1.5
        if encloses[c] and is_open[c] and wanted is None:
            encloses[c] = abs(2.0 * mean_winding(mesh.vertices, own) - 1.0) >= _LEAST
    return encloses
