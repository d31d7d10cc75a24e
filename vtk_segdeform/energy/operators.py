"""What the shape energy is made of, over the vertices of a mesh or of a sample of it.

The mean-curvature normals delta, eq. (5), their areas and their Laplacian; and what the rotation
of each vertex, or group of vertices, is fitted to: 3 x 3 matrices that are linear in x (`energy`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..geometry import (
    IntrinsicTriangulation,
    area_gradients,
    cotangent_laplacian,
    mixed_voronoi_areas,
    with_least_areas,
)

_CHUNK = 400_000  # faces


class SurfaceOperators(NamedTuple):
    """Operators of n vertices, for E = detail + s stretch."""

    counts: FloatArray  # c, (n,): how often what a vertex says is counted; 1 over a whole mesh
    areas: FloatArray  # A, (n,)
    delta: FloatArray  # (n, 3), eq. (5)
    laplacian: sparse.csr_array  # C, (n, n)
    stiffness: sparse.csr_array  # C of triangles that count as often as their corners, (n, n)
    detail: sparse.csr_array  # K of the detail, (3 G, n): 3 x 3 matrices S_g by rows
    fans: sparse.csr_array  # K of the stretch, over s


def surface_operators(
    surface: IntrinsicTriangulation, groups: IntArray, counts: FloatArray | None = None
) -> SurfaceOperators:
    """Return the operators of *surface* for the rotation group of each vertex, *groups* (n,).

    *counts* (n,) are those of a `Sample`, whose triangles *surface* then has.
    """
    n, faces = len(surface.vertices), surface.faces
    areas = with_least_areas(mixed_voronoi_areas(surface), faces)
    laplacian = stiffness = cotangent_laplacian(faces, surface.cotangents, n)
    if counts is None:
        counts = np.ones(n)
    else:
        shared = surface.cotangents * counts[faces].mean(axis=1, keepdims=True)
        stiffness = cotangent_laplacian(faces, shared, n)
    delta = (laplacian @ surface.vertices) / (2.0 * areas)[:, None]  # eq. (5)
    return SurfaceOperators(
        counts=counts,
        areas=areas,
        delta=delta,
        laplacian=laplacian,
        stiffness=stiffness,
        detail=_grouped(0.5 * counts[:, None] * delta, groups) @ laplacian,
        fans=_fans(area_gradients(surface) / 3.0, faces, groups, counts),
    )


def _grouped(values: FloatArray, groups: IntArray) -> sparse.csr_array:
    """Return (3 G, n): row 3 g + a has ``values[i, a]`` at each vertex i of group g."""
    n = len(groups)
    rows = (3 * groups[:, None] + np.arange(3)).ravel()
    entries = (values.ravel(), (rows, np.repeat(np.arange(n), 3)))
    return sparse.coo_array(entries, (3 * (int(groups.max()) + 1), n)).tocsr()


def _fans(
    gradients: FloatArray, faces: IntArray, groups: IntArray, counts: FloatArray
) -> sparse.csr_array:
    """Return (3 G, n): row 3 g + a is axis a of sum_{i in g} c_i sum_{T at i} A_T / 3 J_T^T.

    *gradients* (m, 3, 3) are thirds of `area_gradients`: every corner sees the whole face.
    """
    n, shape = len(groups), (3 * (int(groups.max()) + 1), len(groups))
    seen_from, asked = groups[faces], counts[faces]
    alike = seen_from[:, :, None] == seen_from[:, None]
    own = (alike * asked[:, None]).sum(axis=2)  # counts of the corners in each one's group
    axes = (np.bincount(faces.ravel(), (own * g).ravel(), n) for g in np.moveaxis(gradients, 2, 0))
    fans = _grouped(np.stack(list(axes), axis=1), groups)
    border = np.flatnonzero(~alike.all(axis=(1, 2)))  # what is left: corners of other groups
    for start in range(0, len(border), _CHUNK):
        some = border[start : start + _CHUNK]
        other = ~alike[some] & (asked[some] > 0.0)[:, :, None]
        face, seen, corner = np.nonzero(other)
        rows = 3 * seen_from[some[face], seen][:, None] + np.arange(3)
        columns = np.repeat(faces[some[face], corner], 3)
        share = gradients[some[face], corner] * asked[some[face], seen][:, None]
        fans = fans + sparse.coo_array((share.ravel(), (rows.ravel(), columns)), shape).tocsr()
    return sparse.csr_array(fans)
