"""Mean-curvature normals, eq. (5): the detail that a deformation keeps.

    kappa_i n_i = 1/(4 A_i) sum_j (cot alpha_ij + cot beta_ij) (x_i - x_j) = delta_i      (5)

alpha_ij, beta_ij are the angles opposite edge (i, j) in its two triangles, A_i is the mixed
Voronoi area of vertex i, kappa_i the mean curvature and n_i the outward normal.  With the
cotangent Laplacian C, (C x)_i = 1/2 sum_j (cot alpha_ij + cot beta_ij) (x_i - x_j), the left
side reads (C x)_i / (2 A_i).

Needles have cotangents without bound; they are cut at `_MAX_COTANGENT` (an angle of 1e-3
radians), so that one bad triangle cannot outweigh all others.

Source
------
M. Meyer, M. Desbrun, P. Schroeder, A. H. Barr, "Discrete differential-geometry operators for
triangulated 2-manifolds", Visualization and Mathematics III, 35-57, 2003.  Eqs. (7), (8), Fig. 4.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from .arrays import FloatArray, IntArray
from .threads import in_parallel

_PIECE = 50_000  # faces to a thread
_MAX_COTANGENT = 1e3
_MIN_AREA = 1e-6  # share of the mean vertex area; keeps 1/A finite beside degenerate triangles


def corner_cotangents(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3): the cotangent of the angle at each corner of each face."""
    cotangents = np.zeros(faces.shape)

    def work(start: int, stop: int) -> None:
        a, b, c = vertices[faces[start:stop].T]
        sides = c - b, a - c, b - a  # opposite their corners
        sine = np.linalg.norm(np.cross(sides[1], sides[2]), axis=1)  # twice the area: of all three
        for corner in range(3):
            cosine = -np.einsum("ij,ij->i", sides[corner - 1], sides[corner - 2])
            bound = np.maximum(sine, np.abs(cosine) / _MAX_COTANGENT)
            np.divide(cosine, bound, where=bound > 0, out=cotangents[start:stop, corner])

    in_parallel(work, len(faces), _PIECE)
    return cotangents


def cotangent_laplacian(
    vertices: FloatArray, faces: IntArray, *, cotangents: FloatArray | None = None
) -> sparse.csr_array:
    """Return the (n, n) symmetric positive semi-definite C; x^T C x is twice Dirichlet's energy.

    *cotangents* are those of `corner_cotangents`, where they are known already.
    """
    if cotangents is None:
        cotangents = corner_cotangents(vertices, faces)
    half = 0.5 * cotangents.ravel()
    i, j = faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()
    n = len(vertices)
    weights = sparse.coo_array((half, (i, j)), shape=(n, n)).tocsr()
    weights = weights + weights.T
    return (sparse.diags_array(weights.sum(axis=1)) - weights).tocsr()


def mixed_voronoi_areas(
    vertices: FloatArray, faces: IntArray, *, cotangents: FloatArray | None = None
) -> FloatArray:
    """Return (n,): each vertex's mixed Voronoi area; they sum to the mesh's area."""
    if cotangents is None:
        cotangents = corner_cotangents(vertices, faces)
    parts = np.empty(faces.shape)

    def work(start: int, stop: int) -> None:
        a, b, c = vertices[faces[start:stop].T]
        sides = c - b, a - c, b - a  # opposite their corners
        square = np.stack([np.einsum("ij,ij->i", side, side) for side in sides], axis=1)
        area = 0.5 * np.linalg.norm(np.cross(sides[0], sides[1]), axis=1)[:, None]
        # Voronoi part of corner a: (|ab|^2 cot c + |ac|^2 cot b) / 8.
        share = square * cotangents[start:stop] / 8.0
        voronoi = share.sum(axis=1, keepdims=True) - share
        # An obtuse triangle's circumcentre is outside: half to its obtuse corner, a quarter each.
        obtuse = cotangents[start:stop] < 0.0
        split = np.where(obtuse, 0.5, 0.25) * area
        parts[start:stop] = np.where(obtuse.any(axis=1, keepdims=True), split, voronoi)

    in_parallel(work, len(faces), _PIECE)
    areas = np.bincount(faces.ravel(), parts.ravel(), minlength=len(vertices))
    return np.asarray(np.maximum(areas, _MIN_AREA * areas.mean()))


def mean_curvature_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return delta of eq. (5), (n, 3), in 1/length: outward and of length 1/r on a sphere."""
    areas = mixed_voronoi_areas(vertices, faces)
    return (cotangent_laplacian(vertices, faces) @ vertices) / (2.0 * areas)[:, None]


def area_gradients(
    vertices: FloatArray, faces: IntArray, *, cotangents: FloatArray | None = None
) -> FloatArray:
    """Return (m, 3, 3): for each face and corner k, face area times the gradient of k's hat.

    With J the gradient over a face of a map x of the mesh, area J^T = sum_k g_k x_k^T.
    """
    if cotangents is None:
        cotangents = corner_cotangents(vertices, faces)
    half = 0.5 * cotangents
    gradients = np.empty((len(faces), 3, 3))

    def work(start: int, stop: int) -> None:
        x, share = vertices[faces[start:stop]], half[start:stop]
        here = gradients[start:stop]
        for corner in range(3):
            after, last = (corner + 1) % 3, (corner + 2) % 3
            here[:, corner] = share[:, [last]] * (x[:, corner] - x[:, after])
            here[:, corner] += share[:, [after]] * (x[:, corner] - x[:, last])

    in_parallel(work, len(faces), _PIECE)
    return gradients
