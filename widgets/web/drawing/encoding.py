"""A mesh and its W~ as one message, from which a page computes every pose.

The mesh follows its cages, x = rest + W~ (p - p_rest).  A page that has W~ needs only the motion of
the cage vertices for a picture, some 155 x 3 numbers, whatever the size of the mesh.

Every row of W~ is sent with all its entries, as whole numbers of 16 bits times a step of its own,

    w_ij = q_ij s_i + e_ij,    s_i = max_j |w_ij| / 32767,    |e_ij| <= s_i / 2

so that a vertex is displaced by no more than ``s_i / 2 * sum_j |p_j - p_rest_j|``, over the cage
vertices j that move it; at rest by nothing.  On drags by up to 0.9 diagonals of the mesh that is
4e-5 diagonals and 0.5 degrees of a normal at most.

All lengths in messages are in diagonals of the mesh, from the middle of its bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vtk_segdeform.arrays import FloatArray, IntArray, as_points, bounds_of
from vtk_segdeform.cages import Cage
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.subspace import Subspace

from .messages import Kind, message

MOST_VERTICES = 1 << 17
"""Vertices of a mesh that a page draws at most."""
MOST_WEIGHTS = 1 << 24
"""Entries of W~ that a page receives at most: 32 megabytes."""
_GROUP = 4  # entries of a row are read four at a time; rows are padded to a multiple
_LARGEST_INT16 = 32767
_ROWS = 1 << 14  # encoded together


@dataclass(frozen=True, eq=False)
class EncodedSurface:
    """What a page needs to pose and draw a mesh; made by `encode_surface`.

    Parameters
    ----------
    centre, scale : (3,) float, float
        A point u of a message is ``centre + scale * u`` in the scene.
    order : (n,) int
        The vertices of the mesh in the order of the message: set by set.
    cages : (m, 3) float
        The cage vertices at rest, in the scene.
    arrays : sequence of array
        Those of the message, `Kind.SURFACE`.
    """

    centre: FloatArray
    scale: float
    order: IntArray
    cages: FloatArray
    arrays: Sequence[NDArray[Any]]

    def message(self, serial: int) -> bytes:
        """Return the message; *serial* tells this surface from earlier ones."""
        return message(Kind.SURFACE, serial, *self.arrays)

    def cage_message(self, serial: int, number: int, cage_vertices: Sequence[ArrayLike]) -> bytes:
        """Return the message of a pose, (m_r, 3) for each cage; *number* counts the poses."""
        p = np.concatenate([np.asarray(each, dtype=np.float64) for each in cage_vertices])
        moves = ((p - self.cages) / self.scale).astype(np.float32)
        return message(Kind.CAGES, serial, np.array([number], np.uint32), moves)

    def offset_message(self, serial: int, offsets: ArrayLike | None) -> bytes:
        """Return the message of *offsets* (n, 3), in the scene, that are added to every pose."""
        if offsets is None:
            return message(Kind.OFFSETS, serial, np.zeros(1, np.float32))
        shift = as_points(offsets, "offsets", len(self.order)) / self.scale
        step = max(float(np.abs(shift).max()) / _LARGEST_INT16, float(np.finfo(np.float32).tiny))
        rounded = np.rint(shift[self.order] / step).astype(np.int16)
        return message(Kind.OFFSETS, serial, np.array([step], np.float32), rounded)

    def colour_message(self, serial: int, colours: NDArray[np.uint8] | None) -> bytes:
        """Return the message of vertex *colours* (n, 3) uint8, or of none."""
        if colours is None:
            return message(Kind.COLOURS, serial)
        opaque = np.full((len(colours), 4), 255, dtype=np.uint8)
        opaque[:, :3] = colours[self.order]
        return message(Kind.COLOURS, serial, opaque)


def is_drawable(mesh: Mesh, subspace: Subspace) -> bool:
    """Return whether *mesh* and its W~ are small enough for a page."""
    size = sum(block.size for block in subspace.blocks)
    return mesh.n_vertices <= MOST_VERTICES and size <= MOST_WEIGHTS


def encode_surface(
    mesh: Mesh, subspace: Subspace, cages: Sequence[Cage], turned: IntArray
) -> EncodedSurface:
    """Return *mesh*, which `is_drawable`, with its W~ as a page needs them.

    Parameters
    ----------
    mesh : Mesh
        n vertices at rest.
    subspace : Subspace
        Its W~.
    cages : sequence of Cage
        At rest, in the order of the columns of W~.
    turned : (k,) int
        The corners of faces that are drawn with opposite normals, `VertexNormals.turned`.
    """
    low, high = bounds_of(mesh.vertices)
    centre, scale = 0.5 * (low + high), float(mesh.diagonal)
    parts = subspace.sets_by_cages()  # vertices of each set
    columns: list[NDArray[np.uint16]] = []
    for members in parts:
        own = subspace.nonzeros(members[:1])[0]
        columns.append(np.pad(own, (0, -len(own) % _GROUP)).astype(np.uint16))
    steps, weights = [], []
    for k, members in enumerate(parts):
        for start in range(0, len(members), _ROWS):
            w = subspace.nonzeros(members[start : start + _ROWS])[1]
            step = (np.abs(w).max(axis=1) / _LARGEST_INT16).astype(np.float32)
            steps.append(step.copy())
            step[step == 0.0] = 1.0
            whole = np.rint(w / step[:, None]).astype(np.int16)
            weights.append(np.pad(whole, ((0, 0), (0, len(columns[k]) - w.shape[1]))).ravel())
    drawn = np.concatenate(parts)
    place = np.empty(mesh.n_vertices, dtype=np.int64)
    place[drawn] = np.arange(mesh.n_vertices)
    twice, second = np.unique(place[mesh.faces.ravel()[turned]], return_inverse=True)
    faces = place[mesh.faces.ravel()]
    faces[turned] = mesh.n_vertices + second
    rest = np.concatenate([cage.vertices for cage in cages])
    lengths, q = [len(own) for own in columns], np.concatenate(weights)
    counts = [len(drawn), len(twice), mesh.n_faces, len(rest), len(parts), sum(lengths), len(q)]
    arrays = (
        np.array(counts, dtype=np.uint32),
        ((mesh.vertices[drawn] - centre) / scale).astype(np.float32),
        np.concatenate(steps),
        np.concatenate([np.full(len(ids), k, dtype=np.uint16) for k, ids in enumerate(parts)]),
        np.array(lengths, dtype=np.uint32),
        np.concatenate(columns),
        q,
        faces.astype(np.uint32),
        twice.astype(np.uint32),
    )
    return EncodedSurface(centre, scale, drawn, rest, arrays)
