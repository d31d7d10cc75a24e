"""How much each of several overlapping regions has to say at a vertex, eqs. (3) and (4).

The paper blends two cages by

    x = alpha x_A + (1 - alpha) x_B        alpha = d_A / (d_A + d_B)                      (4)

and prints d_A as the distance to the edge of cage A.  Where both cages stand equally far from the
skin, which is everywhere by construction, that alpha is near 1/2 right up to the last vertex of a
region, and jumps to 0 one vertex further.  Here d is measured along the surface instead, to the
*region's own border*, where it is zero, and the sum runs over any number of regions:

    w_r = d_r^p / sum_s d_s^p

    d_r     length of the shortest path over mesh edges to the border of region r: its members that
            have a neighbour outside.  0 outside the region; infinite where it has no border.
    p       1 is (4); with a larger p the weight leaves zero with a horizontal tangent.

d_r changes by at most the edge's length along an edge, so w changes by at most about p / D times
that length, D being the width of the overlap: it is continuous, and (4) as printed is not.

Source
------
[DM] Doba and Masuda, "Rapid Mesh Deformation with Non-linear Constraints Using Segmentation",
     section 2.2, eqs. (2)-(4).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Mesh

_PAIRS_AT_ONCE = 400_000  # point-triangle pairs held in memory together, about 100 MB


def borders(mesh: Mesh, membership: BoolArray) -> BoolArray:
    """Return (r, n) bool: the members of each region that have a neighbour outside of it."""
    i, j = mesh.edges.T
    border = np.zeros_like(membership)
    for members, edge in zip(membership, border, strict=True):
        edge[i[members[i] & ~members[j]]] = True
        edge[j[members[j] & ~members[i]]] = True
    return border


def border_distance(mesh: Mesh, membership: BoolArray) -> FloatArray:
    """Return the distance of every vertex to the border of each region, inside that region.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    membership : (r, n) bool
        Which vertices each region holds.

    Returns
    -------
    d : (r, n) float
        Along mesh edges, in the mesh's own unit.  0 on the border and outside the region, infinite
        on the connected parts of a region that have no border.

    Notes
    -----
    A path that leaves a region crosses its border again to come back, so the shortest path stays
    inside, and each region is searched by itself.
    """
    distance = np.zeros(membership.shape)
    for d, members, edge in zip(distance, membership, borders(mesh, membership), strict=True):
        inside = np.flatnonzero(members)
        start = np.flatnonzero(edge[inside])
        if not len(start):
            d[inside] = np.inf
            continue
        graph = mesh.adjacency[inside][:, inside]
        d[inside] = csgraph.dijkstra(graph, directed=False, indices=start, min_only=True)
    return distance


def shares(membership: BoolArray, distance: FloatArray, power: float = 1.0) -> FloatArray:
    """Return w_r = d_r^p / sum_s d_s^p over the regions that hold a vertex.

    Parameters
    ----------
    membership : (r, n) bool
        Every column holds at least one True.
    distance : (r, n) float
        d >= 0; may be infinite.
    power : float
        p > 0.

    Returns
    -------
    weights : (r, n) float
        At least 0, 0 outside each region, columns sum to 1.  Regions at infinite d share alone and
        equally; where every d is zero, all regions that hold the vertex share equally.
    """
    d = np.where(membership, distance, 0.0)
    largest = d.max(axis=0)
    d = np.where(np.isinf(largest), np.isinf(d), d)
    d = np.where(largest == 0.0, membership, d)
    d = (d / d.max(axis=0)) ** power  # the largest is 1, so that no power over- or underflows
    return np.asarray(d / d.sum(axis=0))


def distance_to_triangles(
    points: FloatArray, vertices: FloatArray, triangles: IntArray
) -> FloatArray:
    """Return (n,) float: the distance of each point to the nearest point of (k, 3) *triangles*."""
    corners = vertices[triangles]  # (k, 3, 3)
    step = max(1, _PAIRS_AT_ONCE // max(1, len(triangles)))
    parts = [_nearest(points[i : i + step], corners) for i in range(0, len(points), step)]
    return np.concatenate(parts) if parts else np.empty(0)


def _nearest(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the least distance: to the plane above a triangle's inside, to an edge elsewhere."""
    x = points[:, None, :]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    above_all = np.broadcast_to(length > 0.0, (len(points), len(corners))).copy()
    squared = np.full(above_all.shape, np.inf)
    for corner in range(3):
        a = corners[:, corner]
        edge = corners[:, (corner + 1) % 3] - a
        from_a = x - a
        along = np.einsum("nkc,kc->nk", from_a, edge)
        size = np.einsum("kc,kc->k", edge, edge)
        t = np.clip(along / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
        gap = from_a - t[:, :, None] * edge
        squared = np.minimum(squared, np.einsum("nkc,nkc->nk", gap, gap))
        above_all &= np.einsum("nkc,kc->nk", from_a, np.cross(normal, edge)) >= 0.0
    height = np.einsum("nkc,kc->nk", x - corners[:, 0], normal)
    squared = np.where(above_all, height**2, squared)
    return np.asarray(np.sqrt(squared.min(axis=1)))
