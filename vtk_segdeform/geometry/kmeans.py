"""Clusters of points by k-means, and points as far from each other as possible.

Lloyd's algorithm: every point joins its nearest centre, every centre moves to the mean of its
points.  The first centres are the points farthest from each other.

Results are deterministic and the same in every frame of reference (`ties`).

Source
------
S. P. Lloyd, "Least squares quantization in PCM", IEEE Trans. Inf. Theory 28(2), 1982.
T. F. Gonzalez, "Clustering to minimize the maximum intercluster distance", Theor. Comput. Sci. 38,
1985: farthest-point seeding.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, is_whole
from ..errors import ArgumentError
from ..kernels import nearest
from .ties import tie_breakers


def cluster_positions(
    positions: FloatArray, n_clusters: int, *, rounds: int = 5, seeded: bool = True
) -> IntArray:
    """Return (n,) int: the cluster, 0..k-1 with k <= *n_clusters*, of each of *positions* (n, 3).

    Without *seeded* the first centres are random points instead of the points farthest from each
    other, which is faster.
    """
    n_clusters = min(n_clusters, len(positions))
    rng = np.random.default_rng(0)
    favour = tie_breakers(len(positions))
    sample = positions
    enough = max(8000, 10 * n_clusters)  # to compute centres from
    if len(positions) > enough:
        sample = positions[np.sort(rng.permutation(len(positions))[:enough])]
    if seeded:
        centres = sample[farthest_points(sample, n_clusters)]
    else:
        centres = sample[rng.permutation(len(sample))[:n_clusters]]
    for _ in range(rounds - 1):
        labels = _numbered(_nearest(sample, centres, favour))
        counts = np.bincount(labels)
        centres = np.stack([np.bincount(labels, p) / counts for p in sample.T], axis=1)
    return _numbered(_nearest(positions, centres, favour))


def cluster_within_parts(
    positions: FloatArray,
    parts: IntArray,
    n_clusters: int,
    *,
    shares: FloatArray | None = None,
) -> IntArray:
    """Return (n,) int: about *n_clusters* clusters of position, each within one of the *parts*.

    *parts* (n,) are numbers from 0; some may be unused.  Numbers of clusters are proportional to
    the *shares* of the parts, by default the numbers of their positions.
    """
    if not is_whole(n_clusters, 1):
        raise ArgumentError(
            f"the number of clusters must be a whole number, 1 or more; got {n_clusters!r}"
        )
    shares = None if shares is None else shares[np.unique(parts)]
    parts, clusters = _numbered(parts), np.empty(len(positions), dtype=np.int64)
    used = 0
    by_part = np.argsort(parts, kind="stable")
    counts = np.bincount(parts)
    wanted = n_clusters * (counts / len(positions) if shares is None else shares / shares.sum())
    for here, number in zip(np.split(by_part, np.cumsum(counts)[:-1]), wanted, strict=True):
        share = min(max(1, round(number)), len(here))
        local = cluster_positions(positions[here], share)
        clusters[here] = used + local
        used += int(local.max()) + 1
    return clusters


def farthest_points(positions: FloatArray, count: int) -> IntArray:
    """Return (count,) int: indices into *positions* (n, 3), each farthest from all before it."""
    favour = tie_breakers(len(positions))
    chosen = np.empty(count, dtype=np.int64)
    x = np.ascontiguousarray(positions.T)
    offset, squared = np.empty_like(x), np.empty(len(positions))

    def squared_distances(centre: FloatArray) -> FloatArray:
        np.subtract(x, centre[:, None], out=offset)
        np.multiply(offset, offset, out=offset)
        return np.asarray(np.add.reduce(offset, axis=0, out=squared))

    distance = squared_distances(x.mean(axis=1)).copy()
    for k in range(count):
        chosen[k] = np.argmax(distance * favour)
        to_chosen = squared_distances(x[:, chosen[k]])
        distance = to_chosen.copy() if k == 0 else np.minimum(distance, to_chosen, out=distance)
    return chosen


def _numbered(labels: IntArray) -> IntArray:
    """Return *labels* renumbered 0..k-1, without gaps."""
    number = np.cumsum(np.bincount(labels) > 0) - 1
    return np.asarray(number[labels], dtype=np.int64)


def _nearest(positions: FloatArray, centres: FloatArray, favour: FloatArray) -> IntArray:
    """Return the nearest of the *centres* to each position, (n,)."""
    few = min(4, len(centres))  # that are compared for ties
    distance, which = nearest(cKDTree(centres), positions, range(1, few + 1))
    best = (distance**2 * favour[which]).argmin(axis=1)
    return np.asarray(np.take_along_axis(which, best[:, None], axis=1)[:, 0], dtype=np.int64)
