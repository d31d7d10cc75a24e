"""Blend weights of overlapping regions at a vertex, eqs. (3) and (4).

The paper blends two cages by

    x = alpha x_A + (1 - alpha) x_B        alpha = d_A / (d_A + d_B)                      (4)

where d_A is printed as the distance to the edge of cage A.  Both cages have about the same distance
from the surface by construction, so that this alpha is near 1/2 up to the last vertex of a region
and jumps to 0 at the next.  Here d is the distance along the surface to the *border of the region*,
where it is zero, and the sum runs over any number of regions:

    w_r = d_r^p / sum_s d_s^p

    d_r     length of the shortest path along edges to the border of region r, that is, to its
            members with a neighbour outside; 0 outside the region, infinite without a border
    p       1 gives (4); a larger p gives weights with zero slope at the border

Along an edge d_r changes by at most the length of the edge, so w changes by at most about p / D
times that length, with D the width of the overlap: w is continuous, unlike (4) as printed.

Source
------
[DM] Doba and Masuda, "Rapid Mesh Deformation with Non-linear Constraints Using Segmentation",
     section 2.2, eqs. (2)-(4).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray
from ..mesh import Mesh


def borders(mesh: Mesh, membership: BoolArray) -> BoolArray:
    """Return the members of each region that have a neighbour outside, (r, n) bool."""
    i, j = mesh.edges.T
    border = np.zeros_like(membership)
    for members, edge in zip(membership, border, strict=True):
        crosses = members[i] != members[j]
        edge[i[crosses]] = edge[j[crosses]] = True
    return border & membership


def border_distance(mesh: Mesh, membership: BoolArray) -> FloatArray:
    """Return the distance of each vertex to the border of each region that contains it.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    membership : (r, n) bool
        The vertices of each region.

    Returns
    -------
    d : (r, n) float
        Along mesh edges, in the unit of the mesh.  0 on the border and outside the region, infinite
        on connected parts of a region without a border.

    Notes
    -----
    A path that leaves a region crosses its border, so shortest paths stay inside, and each region
    is processed on its own.
    """
    distance = np.zeros(membership.shape)
    for d, members, edge in zip(distance, membership, borders(mesh, membership), strict=True):
        inside = np.flatnonzero(members)
        start = np.flatnonzero(edge[inside])
        if not len(start):
            d[inside] = np.inf
            continue
        own = mesh.adjacency[inside][:, inside]
        d[inside] = csgraph.dijkstra(own, directed=False, indices=start, min_only=True)
    return distance


def overlap_weights(mesh: Mesh, membership: BoolArray, power: float) -> FloatArray:
    """Return the `blend_weights` (r, n) of regions, from distances where regions overlap."""
    shared = np.flatnonzero(np.count_nonzero(membership, axis=0) > 1)
    weights = membership.astype(np.float64)
    if len(shared):
        distance = np.take(border_distance(mesh, membership), shared, axis=1)
        weights[:, shared] = blend_weights(np.take(membership, shared, axis=1), distance, power)
    return weights


def blend_weights(membership: BoolArray, distance: FloatArray, power: float = 1.0) -> FloatArray:
    """Return w_r = d_r^p / sum_s d_s^p over the regions that contain a vertex.

    Parameters
    ----------
    membership : (r, n) bool
        Every column has at least one True.
    distance : (r, n) float
        d >= 0; may be infinite.
    power : float
        p > 0.

    Returns
    -------
    weights : (r, n) float
        Non-negative, 0 outside each region; columns sum to 1.  Regions with infinite d have equal
        weights, all others 0; where every d is zero, all regions of the vertex have equal weights.
    """
    d = np.where(membership, distance, 0.0)
    largest = d.max(axis=0)
    d = np.where(np.isinf(largest), np.isinf(d), d)
    d = np.where(largest == 0.0, membership, d)
    d = (d / d.max(axis=0)) ** power  # the largest is 1, which prevents overflow of the power
    return np.asarray(d / d.sum(axis=0))
