"""Separate surfaces that touch at a vertex or along an edge, by copying vertices.

At a vertex of a two-manifold the faces form one fan; each further fan gets a copy of the vertex.
Fans that end at a border count as one: closing the holes between them joins them.

Where bodies touch along an edge, four or more faces meet there.  Around the edge they alternate
between entering and leaving a body, and the two faces that bound a wedge of a body are paired, as
if the others were not there (the cutting part of the source).

Source
------
A. Gueziec, G. Taubin, F. Lazarus, B. Horn, "Cutting and stitching: converting sets of polygons to
manifold surfaces", IEEE Trans. Vis. Comput. Graph. 7(2), 136-151, 2001.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray
from ..mesh import HalfEdges, first_of_group, next_half_edge


def split_fans(vertices: FloatArray, half_edges: HalfEdges) -> tuple[IntArray, IntArray]:
    """Return faces with one fan at every vertex, and the vertices to copy for that.

    If the faces around some edge do not alternate, nothing is split: a cut along that edge would
    open the surface.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    half_edges : HalfEdges
        The half-edges of the faces (m, 3).

    Returns
    -------
    faces : (m, 3) int
        Over the original vertices, followed by the copies n, n + 1, ...
    copied : (c,) int
        The original of each copy; the first fan at a vertex keeps the original.
    """
    crowded = half_edges.crowded
    begin = np.flatnonzero(np.diff(half_edges.keys_of(crowded)))
    edges = np.split(crowded, begin + 1) if len(crowded) else []
    wedges = [_wedges(vertices, half_edges, around) for around in edges]
    if any(not len(pairs) for pairs in wedges):
        return half_edges.faces, np.empty(0, dtype=np.int64)
    fans = half_edges.fans(np.concatenate([half_edges.pairs, *wedges]))
    _, corner = np.unique(fans, return_index=True)
    vertex = half_edges.tail[corner]  # of each fan
    at_border = np.isin(
        np.arange(len(vertex)), fans[[half_edges.boundary, next_half_edge(half_edges.boundary)]]
    )
    joined = first_of_group(np.where(at_border, vertex, len(vertices) + np.arange(len(vertex))))
    _, fans = np.unique(joined[fans], return_inverse=True)
    _, corner = np.unique(fans, return_index=True)
    vertex = half_edges.tail[corner]
    extra = first_of_group(vertex) != np.arange(len(vertex))
    copied = vertex[extra]
    vertex[extra] = len(vertices) + np.arange(len(copied))
    return vertex[fans].reshape(-1, 3), copied


def _wedges(vertices: FloatArray, half_edges: HalfEdges, around: IntArray) -> IntArray:
    """Pair the half-edges *around* an edge, (2k,), that bound a wedge: (k, 2), or (0, 2)."""
    tail, head = half_edges.tail[around], half_edges.head[around]
    start, end = vertices[tail[0]], vertices[head[0]]
    axis = (end - start) / (np.linalg.norm(end - start) or 1.0)
    third = half_edges.faces[around // 3].sum(axis=1) - tail - head
    arms = vertices[third] - start
    arms -= np.outer(arms @ axis, axis)
    angle = np.arctan2(arms @ np.cross(axis, arms[0]), arms @ arms[0])
    order = np.argsort(angle, kind="stable")
    # A half-edge along the axis has the body at smaller angles, an opposite one at larger angles.
    along = tail[order] == tail[0]
    if (along == np.roll(along, 1)).any():
        return np.empty((0, 2), dtype=np.int64)
    return around[np.roll(order, int(along[0]))].reshape(-1, 2)
