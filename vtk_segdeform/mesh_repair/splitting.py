"""Part surfaces that touch in a vertex or along an edge, by giving each a vertex of its own.

At a vertex of a two-manifold the faces form one fan; each further fan gets a copy of the vertex.
Fans that end at a border count as one: the holes between them are what is wrong there.

A body that touches itself or another along an edge leaves four or more faces there.  Around the
edge they alternate between entering and leaving the body.  Each wedge of the body takes the two
faces that bound it, which then hold together in a fan as if nothing else were there (the cutting
half of the source).

Source
------
A. Gueziec, G. Taubin, F. Lazarus, B. Horn, "Cutting and stitching: converting sets of polygons to
manifold surfaces", IEEE Trans. Vis. Comput. Graph. 7(2), 136-151, 2001.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray
from ..mesh import Sides, first_of_group, following


def split_fans(vertices: FloatArray, sides: Sides) -> tuple[IntArray, IntArray]:
    """Return faces with one fan at every vertex, and which vertices to copy for that.

    Where the faces around an edge do not alternate, nothing is split anywhere: a cut along that
    edge would tear the surface open.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    sides : Sides
        Of the faces (m, 3).

    Returns
    -------
    faces : (m, 3) int
        Over the old vertices, followed by the copies n, n + 1, ...
    copied : (c,) int
        The vertex that each copy is made of; the first fan at a vertex keeps it.
    """
    wedges = [_wedges(vertices, sides, around) for around in sides.crowded]
    if any(not len(pairs) for pairs in wedges):
        return sides.faces, np.empty(0, dtype=np.int64)
    fans = sides.fans(np.concatenate([sides.pairs, *wedges]))
    _, corner = np.unique(fans, return_index=True)
    vertex = sides.tail[corner]  # of each fan
    at_border = np.isin(np.arange(len(vertex)), fans[[sides.open, following(sides.open)]])
    one = first_of_group(np.where(at_border, vertex, len(vertices) + np.arange(len(vertex))))
    _, fans = np.unique(one[fans], return_inverse=True)
    _, corner = np.unique(fans, return_index=True)
    vertex = sides.tail[corner]
    extra = first_of_group(vertex) != np.arange(len(vertex))
    copied = vertex[extra]
    vertex[extra] = len(vertices) + np.arange(len(copied))
    return vertex[fans].reshape(-1, 3), copied


def _wedges(vertices: FloatArray, sides: Sides, around: IntArray) -> IntArray:
    """Pair the sides *around* an edge, (2k,), that bound a wedge of the body: (k, 2), or (0, 2)."""
    tail, head = sides.tail[around], sides.head[around]
    start, end = vertices[tail[0]], vertices[head[0]]
    axis = (end - start) / (np.linalg.norm(end - start) or 1.0)
    third = sides.faces[around // 3].sum(axis=1) - tail - head
    arms = vertices[third] - start
    arms -= np.outer(arms @ axis, axis)
    angle = np.arctan2(arms @ np.cross(axis, arms[0]), arms @ arms[0])
    order = np.argsort(angle, kind="stable")
    # A side that runs along the axis has the body at smaller angles, one that runs back at larger.
    along = tail[order] == tail[0]
    if (along == np.roll(along, 1)).any():
        return np.empty((0, 2), dtype=np.int64)
    return around[np.roll(order, int(along[0]))].reshape(-1, 2)
