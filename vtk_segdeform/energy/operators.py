"""Operators of the shape energy on a surface, and their products with the subspace.

On the vertices of a mesh, or of a sample of it: the mean-curvature normals delta, eq. (5), their
areas and Laplacian C; and K, which takes vertices to the 3 x 3 matrices to which the rotation of
each vertex, or cluster of vertices, is fitted (`energy`).

In the subspace: the Galerkin products W~^T A W~, (m, m), which make a step independent of the size
of the mesh.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import (
    IntrinsicTriangulation,
    area_gradients,
    cotangent_laplacian,
    mixed_voronoi_areas,
    with_least_areas,
)
from ..kernels import in_parallel
from ..subspace import Subspace

_NUMBERS_AT_ONCE = 1 << 19  # of W~, that are multiplied together


class SurfaceOperators(NamedTuple):
    """Operators of n vertices, for E = detail + s stretch."""

    weights: FloatArray  # c, (n,): of the vertices in the sums over a sample; 1 over a whole mesh
    bends: FloatArray  # c in the sum of the detail, (n,): 0 where a vertex has none
    areas: FloatArray  # A, (n,)
    delta: FloatArray  # (n, 3), eq. (5)
    laplacian: sparse.csr_array  # C, (n, n)
    stiffness: sparse.csr_array  # C with each triangle weighted as its corners, (n, n)
    detail: sparse.csr_array  # K of the detail, (3G, n): 3 x 3 matrices S_g by rows
    fans: sparse.csr_array  # K of the stretch, over s


def surface_operators(
    surface: IntrinsicTriangulation,
    clusters: IntArray,
    weights: FloatArray | None = None,
    *,
    inner: BoolArray | None = None,
) -> SurfaceOperators:
    """Return the operators of *surface* for the rotation cluster of each vertex, *clusters* (n,).

    For a `Sample`, *surface* has its triangles, and *weights* (n,) are its weights.  *inner* (n,)
    are the vertices that have a detail (`geometry.inner_vertices`); None means all.
    """
    n, faces = len(surface.vertices), surface.faces
    areas = with_least_areas(mixed_voronoi_areas(surface), faces)
    laplacian = stiffness = cotangent_laplacian(faces, surface.cotangents, n)
    if weights is None:
        weights = np.ones(n)
    else:
        shared = surface.cotangents * weights[faces].mean(axis=1, keepdims=True)
        stiffness = cotangent_laplacian(faces, shared, n)
    delta = (laplacian @ surface.vertices) / (2.0 * areas)[:, None]  # eq. (5)
    bends = weights if inner is None else weights * inner
    return SurfaceOperators(
        weights=weights,
        bends=bends,
        areas=areas,
        delta=delta,
        laplacian=laplacian,
        stiffness=stiffness,
        detail=_summed(0.5 * bends[:, None] * delta, clusters) @ laplacian,
        fans=_fans(area_gradients(surface) / 3.0, faces, clusters, weights),
    )


def _summed(values: FloatArray, clusters: IntArray) -> sparse.csr_array:
    """Return (3G, n): row 3 g + a has ``values[i, a]`` at each vertex i of cluster g."""
    n = len(clusters)
    rows = (3 * clusters[:, None] + np.arange(3)).ravel()
    entries = (values.ravel(), (rows, np.repeat(np.arange(n), 3)))
    return sparse.coo_array(entries, (3 * (int(clusters.max()) + 1), n)).tocsr()


def _fans(
    gradients: FloatArray, faces: IntArray, clusters: IntArray, weights: FloatArray
) -> sparse.csr_array:
    """Return (3G, n): row 3 g + a is axis a of sum_{i in g} c_i sum_{T at i} A_T / 3 J_T^T.

    *gradients* (m, 3, 3) are a third of `area_gradients`: a face is compared with three rotations.
    """
    n, shape = len(clusters), (3 * (int(clusters.max()) + 1), len(clusters))
    at, weight = clusters[faces], weights[faces]
    alike = at[:, :, None] == at[:, None]
    own = (alike * weight[:, None]).sum(axis=2)  # weights of the corners in the same cluster
    axes = (np.bincount(faces.ravel(), (own * g).ravel(), n) for g in np.moveaxis(gradients, 2, 0))
    fans = _summed(np.stack(list(axes), axis=1), clusters)
    border = np.flatnonzero(~alike.all(axis=(1, 2)))  # faces with corners in several clusters
    face, seen, corner = np.nonzero(~alike[border] & (weight[border] > 0.0)[:, :, None])
    face = border[face]
    rows = 3 * at[face, seen][:, None] + np.arange(3)
    share = gradients[face, corner] * weight[face, seen][:, None]
    entries = share.ravel(), (rows.ravel(), np.repeat(faces[face, corner], 3))
    return sparse.csr_array(fans + sparse.coo_array(entries, shape).tocsr())


def reduced_operators(
    subspace: Subspace,
    laplacian: sparse.csr_array,
    strength: FloatArray,
    mass: FloatArray,
    *,
    stiffness: sparse.csr_array | None = None,
    clusters: IntArray | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return W~^T C diag(strength) C W~, W~^T B W~ and W~^T diag(mass) W~, (m, m) each.

    C and B (n, n) are the symmetric *laplacian* and *stiffness*; without *stiffness*, B is C.
    The sums go over pieces of the mesh, of vertices that lie together: few cages move a piece and
    its neighbours, so the dense matrix of their weights is narrow and stays in the cache.  Cages
    that move no common piece have a zero block, which is why several cages are faster than one.
    Pieces follow *clusters* (n,) of neighbours, or else the regions; the results are the same.
    """
    both = [laplacian] if stiffness is None or stiffness is laplacian else [laplacian, stiffness]
    m = subspace.n_columns
    order = np.argsort(_last_region(subspace) if clusters is None else clusters, kind="stable")
    size = max(_NUMBERS_AT_ONCE // m, 1)
    found: dict[int, tuple[IntArray, list[FloatArray]]] = {}

    def work(first: int, start: int, stop: int) -> None:
        vertices = order[first + start : first + stop]
        bent = np.flatnonzero(strength[vertices])  # of a sample, only the sampled vertices
        rings = [each[vertices] for each in both[-1:]]
        if len(both) > 1:
            rings.insert(0, laplacian[vertices[bent]])
        met = [vertices, *(ring.indices.astype(np.int64) for ring in rings)]
        used, place = np.unique(np.concatenate(met), return_inverse=True)
        columns, w = subspace.nonzeros(used)
        own, *places = np.split(place.astype(np.int32), np.cumsum([len(ids) for ids in met[:-1]]))
        products = []
        for ring, at in zip(rings, places, strict=True):
            compact = ring.data, at, ring.indptr.astype(np.int32)
            products.append(sparse.csr_array(compact, (ring.shape[0], len(used))) @ w)
        normals = products[0] if len(both) > 1 else products[0][bent]
        squares = (normals * strength[vertices[bent], None]).T @ normals
        plain = w[own].T @ products[-1]
        heavy = np.flatnonzero(mass[vertices])
        here = w[own[heavy]]
        masses = (here * mass[vertices[heavy], None]).T @ here
        found[start] = columns, [squares, plain, masses]

    totals, together = np.zeros((3, m, m)), 32 * size
    for first in range(0, subspace.n_vertices, together):  # summed in a fixed order
        stop = min(first + together, subspace.n_vertices)
        in_parallel(partial(work, first), stop - first, size)
        for start in sorted(found):
            columns, products = found.pop(start)
            for total, product in zip(totals, products, strict=True):
                total[np.ix_(columns, columns)] += product
    squares, plain, masses = 0.5 * (totals + np.swapaxes(totals, 1, 2))
    return squares, plain, masses


def _last_region(subspace: Subspace) -> IntArray:
    """Return the last region of each vertex, (n,)."""
    region = np.zeros(subspace.n_vertices, dtype=np.int64)
    for r, rows in enumerate(subspace.rows):
        region[rows] = r
    return region
