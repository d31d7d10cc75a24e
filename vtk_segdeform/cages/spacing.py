"""Spacing of cage vertices: small where the shape can bend, large where it is fixed.

A density rho of cage vertices per area asks for a spacing of (c rho)^(-1/2).  Spacing must not grow
too fast along the surface, or cages have needles:

    h(x) = min over y of  (c rho(y))^(-1/2) + d(x, y)

    d       distance along edges
    c       such that the integral of h^-2 is the number of cage vertices

Where rho is zero, in a fixed part, the spacing grows from its border inwards: there are cage
vertices on both sides of the border, and few in the rest of it.

By default rho is the inverse of the thickness t.  The same spacing everywhere would give a limb of
length L a number of vertices proportional to L t, and the same number of edges around thin and
thick limbs one proportional to L / t; this is the geometric mean of the two.

t is the diameter of the largest ball inside that touches the surface at x, found by shrinking: a
large ball is made smaller until it contains no other vertex [MBC12].

Source
------
[MBC12]  J. Ma, S. W. Bae, S. Choi, "3D medial axis point approximation using nearest neighbors and
         the normal field", The Visual Computer 28, 7-19, 2012.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ..arrays import FloatArray
from ..kernels import nearest
from ..mesh import Mesh

_ROUNDS, _ENOUGH = 6, 0.03  # of the search for c, and the error of the number at which it ends
_SHORTEST_EDGE = 1e-12  # edge, in diagonals: a sparse graph has no edges of length 0
_MOST_CONTRAST = 8.0  # largest ratio of a density to the median one
_MOST_SHRINKS = 12  # of a ball
_LEAST_COSINE = 0.3  # cosine of the normal to the direction of the other side; smaller is a bump
_SMOOTHINGS = 6  # rounds that average the thickness of neighbours, in the logarithm


def cage_spacing(mesh: Mesh, density: FloatArray, n_vertices: int) -> FloatArray:
    """Return the spacing of about *n_vertices* cage vertices at each vertex, (n,).

    *density* (n,) is relative: not negative, and not zero everywhere.
    """
    area = np.maximum(mesh.vertex_areas, np.finfo(float).tiny)
    i, j = mesh.edges.T
    length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    length = np.maximum(length, _SHORTEST_EDGE * mesh.diagonal)
    # h is the distance from a further vertex that is (c rho)^(-1/2) away from every other one
    n, some = mesh.n_vertices, np.flatnonzero(density > 0.0)
    first = density[some] ** -0.5
    ends = np.concatenate([i, np.full(len(some), n)]), np.concatenate([j, some])
    scale = float(np.sqrt(np.maximum(area @ density, np.finfo(float).tiny) / n_vertices))
    for _ in range(_ROUNDS):
        weights = np.concatenate([length, scale * first])
        graph = sparse.coo_array((weights, ends), shape=(n + 1, n + 1)).tocsr()
        spacing = csgraph.dijkstra(graph, directed=False, indices=np.array([n]))[0, :n]
        spacing = np.where(np.isfinite(spacing), spacing, mesh.diagonal)  # fixed components
        ratio = (area @ spacing**-2.0) / n_vertices
        if abs(ratio - 1.0) < _ENOUGH:
            break
        scale *= float(np.sqrt(ratio))
    return np.asarray(spacing)


def bending_density(mesh: Mesh) -> FloatArray:
    """Return the inverse of the local thickness, (n,), without extreme values."""
    density = 1.0 / thickness(mesh)
    middle = np.median(density)
    return np.asarray(np.clip(density, middle / _MOST_CONTRAST, middle * _MOST_CONTRAST))


def thickness(mesh: Mesh) -> FloatArray:
    """Return the diameter of the largest inner ball that touches the surface at each vertex, (n,).

    At most the diagonal of the mesh, and smoothed over neighbours.
    """
    x, area = mesh.vertices, mesh.vertex_areas
    near = sparse.csr_array(mesh.adjacency > 0.0).astype(np.float64)
    normal = _normals(mesh)
    normal += near @ normal
    normal += near @ normal
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    tree = cKDTree(x)
    radius = np.full(len(x), 0.5 * mesh.diagonal)
    active = np.arange(len(x))
    for _ in range(_MOST_SHRINKS):
        centre = x[active] - radius[active, None] * normal[active]
        other = nearest(tree, centre)[1][:, 0]
        chord = x[active] - x[other]
        square = np.einsum("ij,ij->i", chord, chord)
        height = np.einsum("ij,ij->i", chord, normal[active])
        is_across = height > _LEAST_COSINE * np.sqrt(square)
        smaller = square[is_across] / (2.0 * height[is_across])
        active, shrinks = active[is_across], smaller < (1.0 - 1e-3) * radius[active[is_across]]
        active = active[shrinks]
        radius[active] = smaller[shrinks]
        if not len(active):
            break
    area = np.maximum(area, np.finfo(float).tiny * 1e6)
    log = np.log(2.0 * radius / mesh.diagonal)
    total = area + near @ area
    for _ in range(_SMOOTHINGS):
        log = (area * log + near @ (area * log)) / total
    return np.asarray(np.exp(log) * mesh.diagonal)


def _normals(mesh: Mesh) -> FloatArray:
    """Return the sum of the area vectors of the faces at each vertex, (n, 3)."""
    a, b, c = mesh.vertices[mesh.faces.T]
    vectors = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    at = mesh.faces.ravel()
    sums = [np.bincount(at, column, minlength=mesh.n_vertices) for column in vectors.T]
    return np.stack(sums, axis=1)
