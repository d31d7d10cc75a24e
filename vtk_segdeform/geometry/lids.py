"""Lids over the borders of an open mesh, under which it encloses a volume.

The boundary of the faces of a mesh is a sum of loops of directed edges.  Each loop gets a *lid*: a
fan of triangles from its edges to its centre, the mean of its vertices.  Faces and lids together
have no boundary, so their volume (8) does not depend on an origin, and a centre is a linear
function of the mesh: its volume, gradient and cubic along a direction are computed as for a closed
mesh, over the points ``extension @ x``.

A component of the mesh *encloses* a volume if it is closed, or if its lids are small: a bottle
does, a sheet of cloth does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, IntArray
from ..mesh import Mesh

_LARGEST = 0.6  # area of the lids of a component that encloses a volume, relative to its own


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

    def closed(self, mesh: Mesh) -> IntArray:
        """Return the faces of *mesh* and of lids around the enclosed volumes, (m', 3)."""
        around = self.encloses[mesh.components[mesh.faces[:, 0]]]
        return np.concatenate(
            [mesh.faces[around], self.faces[self.encloses[self.component[self.loop]]]]
        )


def lids_of(mesh: Mesh, encloses: bool | None = None) -> Lids:
    """Return the lids of *mesh*; *encloses* decides for all open components, None for each by area."""
    n, k = mesh.n_vertices, len(mesh.borders)
    sizes = np.array([len(loop) for loop in mesh.borders], dtype=np.int64)
    tail = np.concatenate([np.empty(0, np.int64), *mesh.borders])
    head = np.concatenate([np.empty(0, np.int64), *(np.roll(loop, -1) for loop in mesh.borders)])
    loop = np.repeat(np.arange(k), sizes)
    faces = np.stack([head, tail, n + loop], axis=1)
    means = sparse.coo_array((1.0 / sizes[loop], (loop, tail)), (k, n))
    extension = sparse.csr_array(sparse.vstack([sparse.eye_array(n), means]))
    component = mesh.components[[each[0] for each in mesh.borders]].astype(np.int64)
    own = np.bincount(mesh.components[mesh.faces[:, 0]], mesh.face_areas)
    a, b, c = (extension @ mesh.vertices)[faces.T]
    areas = np.bincount(loop, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), k)
    lids = np.bincount(component, areas, len(own))
    by_area = lids <= _LARGEST * own
    closed = np.bincount(component, minlength=len(own)) == 0
    return Lids(
        faces, loop, extension, component, closed | (by_area if encloses is None else encloses)
    )
