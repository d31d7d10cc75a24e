"""Products W~^T A W~ of the subspace with operators of the mesh: what makes the energy small.

A piece of the mesh at a time, of vertices that lie together: few cages reach it and its
neighbours, so the dense matrix of their weights is narrow, and small enough to stay in the cache.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy import sparse

from ..arrays import FloatArray, IntArray
from ..kernels import in_parallel
from ..subspace import Subspace

_TOGETHER, _BATCH = 1 << 19, 32  # numbers of W~ multiplied at a time, and so many pieces at once


def grams(
    subspace: Subspace,
    laplacian: sparse.csr_array,
    strength: FloatArray,
    mass: FloatArray,
    *,
    stiffness: sparse.csr_array | None = None,
    near: IntArray | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return W~^T C diag(strength) C W~, W~^T B W~ and W~^T diag(mass) W~, (m, m) each.

    And (n,), the contribution of each vertex to the trace of the first.

    For symmetric sparse C and B (n, n), *laplacian* and *stiffness*; B is C where it is not given.
    Cages that reach no common piece of the mesh have a zero block: this is where several beat one.
    Vertices with the same number in *near* (n,) lie together and in one region; it only saves time.
    """
    both = [laplacian] if stiffness is None or stiffness is laplacian else [laplacian, stiffness]
    m = subspace.n_columns
    order = np.argsort(_last_region(subspace) if near is None else near, kind="stable")
    size = max(_TOGETHER // m, 1)
    found: dict[int, tuple[IntArray, list[FloatArray]]] = {}
    traces = np.empty(subspace.n_vertices)

    def work(first: int, start: int, stop: int) -> None:
        vertices = order[first + start : first + stop]
        rings = [each[vertices] for each in both]
        met = [vertices, *(ring.indices.astype(np.int64) for ring in rings)]
        used, place = np.unique(np.concatenate(met), return_inverse=True)
        columns, w = subspace.reaching(used)
        own, *places = np.split(place.astype(np.int32), np.cumsum([len(ids) for ids in met[:-1]]))
        here, products = w[own], []
        for ring, at in zip(rings, places, strict=True):
            compact = ring.data, at, ring.indptr.astype(np.int32)
            products.append(sparse.csr_array(compact, (len(vertices), len(used))) @ w)
        traces[vertices] = strength[vertices] * np.einsum("ij,ij->i", products[0], products[0])
        squares = (products[0] * strength[vertices][:, None]).T @ products[0]
        plain, masses = here.T @ products[-1], (here * mass[vertices][:, None]).T @ here
        found[start] = columns, [squares, plain, masses]

    totals = np.zeros((3, m, m))
    for first in range(0, subspace.n_vertices, _BATCH * size):  # and added up in one order
        stop = min(first + _BATCH * size, subspace.n_vertices)
        in_parallel(partial(work, first), stop - first, size)
        for start in sorted(found):
            columns, products = found.pop(start)
            for total, product in zip(totals, products, strict=True):
                total[np.ix_(columns, columns)] += product
    squares, plain, masses = 0.5 * (totals + np.swapaxes(totals, 1, 2))
    return squares, plain, masses, traces


def _last_region(subspace: Subspace) -> IntArray:
    """Return the last region that has each vertex, (n,)."""
    region = np.zeros(subspace.n_vertices, dtype=np.int64)
    for r, rows in enumerate(subspace.rows):
        region[rows] = r
    return region
