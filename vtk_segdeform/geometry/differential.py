"""Mean-curvature normals, eq. (5): the detail that a deformation preserves.

    kappa_i n_i = 1/(4 A_i) sum_j (cot alpha_ij + cot beta_ij) (x_i - x_j) = delta_i      (5)

alpha_ij, beta_ij are the angles opposite edge (i, j) in its two triangles, A_i is the mixed
Voronoi area of vertex i, kappa_i the mean curvature and n_i the outward normal.  With the
cotangent Laplacian C, (C x)_i = 1/2 sum_j (cot alpha_ij + cot beta_ij) (x_i - x_j), the detail is
delta_i = (C x)_i / (2 A_i).

Cotangents and areas come from an intrinsic triangulation (`intrinsic`), which equals the mesh where
its triangles are well shaped; C is therefore positive semi-definite for any triangles.

*At a border* (C x)_i is the integral of the Laplacian over the one-sided cell of the vertex plus
the conormal of the cut, of the length of an edge; divided by A_i it grows like 1 / edge.  It is no
curvature, so only *inner vertices* have a detail (`inner_vertices`): the natural boundary
condition of eq. (5).  The same holds where three or more sheets meet, since their conormals do not
cancel.  C, areas and triangles at a border remain, one-sided.

Source
------
O. Stein, E. Grinspun, M. Wardetzky, A. Jacobson, "Natural boundary conditions for smoothing in
geometry processing", ACM Trans. Graph. 37(2), 2018: boundary rows of the Laplacian energy.
M. Meyer, M. Desbrun, P. Schroeder, A. H. Barr, "Discrete differential-geometry operators for
triangulated 2-manifolds", Visualization and Mathematics III, 35-57, 2003.  Eqs. (7), (8), Fig. 4.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import ROWS_AT_ONCE, in_parallel
from ..mesh import HalfEdges, Mesh
from .intrinsic import IntrinsicTriangulation


def cotangent_laplacian(
    faces: IntArray, cotangents: FloatArray, n_vertices: int
) -> sparse.csr_array:
    """Return C, (n, n) and symmetric; x^T C x is twice the Dirichlet energy.

    C is positive semi-definite if *cotangents* (m, 3) are those of an intrinsic triangulation, or
    non-negative multiples of them, one factor per face.
    """
    half = 0.5 * cotangents.ravel()
    i, j = faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()
    weights = sparse.coo_array((half, (i, j)), shape=(n_vertices, n_vertices)).tocsr()
    weights = weights + weights.T
    return (sparse.diags_array(weights.sum(axis=1)) - weights).tocsr()


def mixed_voronoi_areas(surface: IntrinsicTriangulation) -> FloatArray:
    """Return the mixed Voronoi area of each vertex, (n,); their sum is the surface area."""
    square, cotangents = surface.lengths**2, surface.cotangents
    # Voronoi part of corner a: (|ab|^2 cot c + |ac|^2 cot b) / 8.
    share = square * cotangents / 8.0
    voronoi = share.sum(axis=1, keepdims=True) - share
    # The circumcentre of an obtuse triangle is outside: half its area goes to the obtuse corner.
    obtuse = cotangents < 0.0
    split = np.where(obtuse, 0.5, 0.25) * surface.face_areas[:, None]
    parts = np.where(obtuse.any(axis=1, keepdims=True), split, voronoi)
    faces, n = surface.faces, len(surface.vertices)
    return np.asarray(np.bincount(faces.ravel(), parts.ravel(), minlength=n), dtype=np.float64)


def with_least_areas(areas: FloatArray, faces: IntArray) -> FloatArray:
    """Return vertex *areas* (n,), each at least a twentieth of its neighbours' mean.

    Eq. (5) divides by the area, so a patch of tiny triangles would outweigh all others.
    """
    n = len(areas)
    around = np.bincount(faces.ravel(), areas[faces[:, [1, 2, 0]]].ravel(), n)
    around += np.bincount(faces.ravel(), areas[faces[:, [2, 0, 1]]].ravel(), n)
    count = 2.0 * np.bincount(faces.ravel(), minlength=n)
    floor = 0.05 * around / np.maximum(count, 1.0)
    return np.asarray(np.maximum(np.maximum(areas, floor), np.finfo(float).tiny))


def inner_vertices(mesh: Mesh) -> BoolArray:
    """Return which vertices have a detail (5), (n,) bool: those whose edges all have two faces.

    In a component with hardly any, such as a strip one face wide, every vertex has, from its
    one-sided row: it would have no resistance to bending otherwise.
    """
    if mesh.is_two_manifold:
        return np.ones(mesh.n_vertices, dtype=bool)
    half_edges = HalfEdges(mesh.faces, mesh.n_vertices)
    ends = half_edges.order[half_edges.first[half_edges.counts != 2]]
    inner = np.ones(mesh.n_vertices, dtype=bool)
    inner[half_edges.tail[ends]] = inner[half_edges.head[ends]] = False
    count = np.bincount(mesh.components, inner)
    is_strip = count < 0.1 * np.bincount(mesh.components)
    return np.asarray(inner | is_strip[mesh.components])


def area_gradients(surface: IntrinsicTriangulation) -> FloatArray:
    """Return the face area times the gradient of the hat function of each corner, (m, 3, 3).

    With J the gradient over a face of a map x of the mesh, area J^T = sum_k g_k x_k^T.
    """
    vertices, faces = surface.vertices, surface.faces
    half = 0.5 * surface.cotangents
    gradients = np.empty((len(faces), 3, 3))

    def work(start: int, stop: int) -> None:
        x, share = vertices[faces[start:stop]], half[start:stop]
        out = gradients[start:stop]
        for corner in range(3):
            after, last = (corner + 1) % 3, (corner + 2) % 3
            out[:, corner] = share[:, [last]] * (x[:, corner] - x[:, after])
            out[:, corner] += share[:, [after]] * (x[:, corner] - x[:, last])

    in_parallel(work, len(faces), ROWS_AT_ONCE)
    return gradients
