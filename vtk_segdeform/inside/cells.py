"""Corners and faces of cells of volume meshes, and their scaled Jacobians.

Every cell is measured at its corners.  The three edges from a corner span a tetrahedron, whose
determinant D tells the orientation there:

    scaled Jacobian    c D / (l1 l2 l3),      l the lengths of the edges; c makes it 1 at best

The smallest one at the corners of a cell is that of the cell, as in the Verdict library and VTK.
A cell is inverted if it is 0 or less.  A hexahedron may be inverted between its corners although it
is at none of them; this is not measured.

Some programs number the corners of a cell in the opposite direction.  So determinants have the sign
that most of the cell has at rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray
from ..io import means_at


class Kind(NamedTuple):
    """One type of cells: for each corner itself and three neighbours, and the outward faces."""

    corners: tuple[tuple[int, int, int, int], ...]
    faces: tuple[tuple[int, ...], ...]
    best: float
    """The largest product of D and 1 / (l1 l2 l3), of an ideal cell."""
    share: float
    """Volume of the cell relative to the sum of D at the corners that its energy is taken from."""


_HALF = 0.5**0.5
_TETRA = 10
# By VTK's types.
KINDS: Mapping[int, Kind] = {
    _TETRA: Kind(
        ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)),
        ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
        _HALF,
        1.0 / 6.0,
    ),
    12: Kind(
        (
            (0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7),
            (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3),
        ),
        ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
        1.0,
        1.0 / 8.0,
    ),
    13: Kind(
        ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
        ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
        0.75**0.5,
        1.0 / 12.0,
    ),
    14: Kind(
        ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
        ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
        _HALF,
        1.0 / 12.0,
    ),
}  # fmt: skip


class Corners(NamedTuple):
    """The c corners of all m cells of a mesh, and its boundary."""

    points: IntArray
    """(c, 4): the corner, and its three neighbours."""
    cell: IntArray
    """(c,): the cell of each, as numbered in the grid."""
    signs: FloatArray
    """(c,): 1, or -1 in cells that are numbered in the opposite direction."""
    scales: FloatArray
    """(c,): 1 / `Kind.best`."""
    volumes: FloatArray
    """(c,): the part of the volume of the cell at rest that is at the corner, or 0."""
    sizes: IntArray
    """(f,): numbers of corners of the outward faces that are of one cell only."""
    faces: IntArray
    """The corners of these faces, one after another."""

    @classmethod
    def of(cls, points: FloatArray, groups: Iterable[tuple[int, IntArray, IntArray]]) -> Corners:
        """Return those of cells at rest at *points* (p, 3).

        *groups* has for each type its number in VTK, the cells (k,), and their points (k, v).
        """
        parts: list[tuple[Any, ...]] = []
        faces: list[IntArray] = []
        for number, cells, ids in groups:
            kind = KINDS[number]
            corners = ids[:, np.array(kind.corners)]
            found = determinants(edges(points, corners.reshape(-1, 4))).reshape(len(ids), -1)
            signs = np.where(found.sum(axis=1) < 0.0, -1.0, 1.0)
            count, volumes = len(kind.corners), kind.share * np.abs(found)
            if number == _TETRA:  # the same gradient at each of its corners
                volumes[:, 1:] = 0.0
            parts.append(
                (
                    corners.reshape(-1, 4),
                    np.repeat(cells, count),
                    np.repeat(signs, count),
                    np.full(found.size, 1.0 / kind.best),
                    volumes.ravel(),
                )
            )
            for face in kind.faces:
                own = np.full((len(ids), 4), -1)
                own[:, : len(face)] = ids[:, face]
                back = own[signs < 0.0, : len(face)][:, ::-1]
                own[signs < 0.0, : len(face)] = back
                faces.append(own)
        corner, cell, sign, scale, volume = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        together = np.concatenate(faces)
        _, first, times = np.unique(
            np.sort(together, axis=1), axis=0, return_index=True, return_counts=True
        )
        outer = together[np.sort(first[times == 1])]
        sizes = np.count_nonzero(outer >= 0, axis=1)
        return cls(corner, cell, sign, scale, volume, sizes, outer[outer >= 0])

    def scaled_jacobians(self, points: FloatArray, n_cells: int) -> FloatArray:
        """Return those of all cells at *points* (p, 3), (n_cells,); 1 for other cells."""
        spanned = edges(points, self.points)
        lengths = np.linalg.norm(spanned, axis=2)
        found = self.signs * self.scales * determinants(spanned)
        found /= np.maximum(lengths.prod(axis=1), np.finfo(float).tiny)
        result = np.ones(n_cells)
        np.minimum.at(result, self.cell, found)
        return result

    def gradients(
        self, rest: FloatArray, points: FloatArray, n_cells: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return the deformation gradients from *rest* to *points*, (p, 3, 3) and (n_cells, 3, 3).

        Means over the corners at a point and in a cell, by volume; the unit matrix elsewhere.
        """
        used = self.volumes > 0.0
        ids, cell, volumes = self.points[used], self.cell[used], self.volumes[used]
        each = np.swapaxes(
            np.linalg.solve(edges(rest, ids), edges(points, ids)), 1, 2
        )  # F_ij = d x_i / d X_j
        at = means_at(np.repeat(each, 4, axis=0), np.repeat(volumes, 4), ids.ravel(), len(rest))
        return at, means_at(each, volumes, cell, n_cells)


def edges(points: FloatArray, corners: IntArray) -> FloatArray:
    """Return the three edges (c, 3, 3) from *corners* (c, 4), as rows."""
    return np.asarray(points[corners[:, 1:]] - points[corners[:, :1]])


def cofactors(rows: FloatArray) -> FloatArray:
    """Return the derivatives of `determinants` by the matrices *rows* (c, 3, 3)."""
    a, b, c = rows[:, 0], rows[:, 1], rows[:, 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def determinants(rows: FloatArray) -> FloatArray:
    """Return the determinants (c,) of matrices (c, 3, 3)."""
    return np.asarray(np.einsum("ci,ci->c", rows[:, 0], np.cross(rows[:, 1], rows[:, 2])))


def hat_gradients(rows: FloatArray) -> FloatArray:
    """Return the derivatives (c, 3, 4), by each coordinate, of the functions that are 1 at a point.

    They are linear, and 0 at the other three points; *rows* (c, 3, 3) are the edges from the first.
    """
    inverse = np.linalg.inv(rows)
    return np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2)
