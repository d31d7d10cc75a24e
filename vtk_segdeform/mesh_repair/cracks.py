"""Replace flat lids: split the adjacent face at the vertex that lies on its edge.

A crack along a straight edge, where a vertex lies on the edge of a face (a T-junction), has no lid
of positive area.  The flat triangle over it and the face beyond its longest edge are replaced by
the two halves of that face.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, edge_keys, least_angle, normals

_FLAT = 1e-9  # radians


def close_cracks(
    vertices: FloatArray, faces: IntArray, lids: BoolArray
) -> tuple[IntArray, BoolArray]:
    """Return *faces* (m, 3) with flat *lids* (m,) replaced, and which faces changed.

    A flat lid is kept if a half would be flat too, fold over, or repeat an existing edge.
    """
    changed = np.zeros(len(faces), dtype=bool)
    while True:
        flat = np.flatnonzero(lids & (least_angle(vertices[faces]) <= _FLAT))
        cut, beyond, halves = _halves(vertices, faces, flat)
        if not len(cut):
            return faces, changed
        faces = faces.copy()
        faces[cut], faces[beyond] = halves[:, 0], halves[:, 1]
        changed[cut] = changed[beyond] = True


def _halves(
    vertices: FloatArray, faces: IntArray, flat: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return flat faces (k,), the faces across their longest edges (k,), and halves (k, 2, 3)."""
    half_edges = HalfEdges(faces, len(vertices))
    twin = np.full(3 * len(faces), -1)
    one, other = half_edges.pairs[~half_edges.inconsistent].T
    twin[one], twin[other] = other, one
    corners = vertices[faces[flat]]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    longest = 3 * flat + length.argmax(axis=1)
    paired = twin[longest] >= 0
    flat, longest = flat[paired], longest[paired]
    across = twin[longest]
    beyond = across // 3
    a, b = half_edges.tail[longest], half_edges.head[longest]
    c = faces[flat, (longest % 3 + 2) % 3]
    d = faces[beyond, (across % 3 + 2) % 3]
    halves = np.stack([np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)], axis=1)
    good = (least_angle(vertices[halves]) > _FLAT).all(axis=1) & (c != d)
    up = normals(vertices[faces[beyond]])
    good &= ((normals(vertices[halves]) * up[:, None]).sum(axis=2) > 0.0).all(axis=1)
    keys = edge_keys(c, d, len(vertices))
    good &= ~np.isin(keys, half_edges.keys)
    # At most one split per face and edge at a time.
    some = np.flatnonzero(good)
    some = some[np.unique(beyond[some], return_index=True)[1]]
    some = some[np.unique(keys[some], return_index=True)[1]]
    return flat[some], beyond[some], halves[some]
