"""What keeps triangles from being a closed, oriented two-manifold, in sentences.

For cages, which are either right or refused; a mesh is told more, and mended (`faults`, `repair`).
"""

from __future__ import annotations

import numpy as np

from ..arrays import IntArray
from .topology import Sides, connected


def connectivity_faults(n_points: int, faces: IntArray) -> list[str]:
    """Return one sentence per fault of *faces* (m, 3) over *n_points* vertices; [] if none."""
    if len(faces) < 4:
        return [f"a closed surface needs 4 faces or more; got {len(faces)}"]
    a, b, c = faces.T
    repeated = np.count_nonzero((a == b) | (b == c) | (c == a))
    if repeated:
        return [f"{counted(int(repeated), 'face repeats', 'faces repeat')} a vertex"]
    sides = Sides(faces, n_points)
    faults = []
    if len(sides.open):
        border = counted(len(sides.open), "edge borders", "edges border")
        faults.append(f"{border} one face only: the cage is open")
    if len(sides.crowded):
        edges = counted(len(sides.crowded), "edge borders", "edges border")
        faults.append(f"{edges} three faces or more")
    turned = int(np.count_nonzero(sides.turned))
    if turned:
        faults.append(f"{counted(turned, 'edge has', 'edges have')} faces of opposite orientation")
    unused = n_points - len(np.unique(faces))
    if unused:
        faults.append(f"{counted(unused, 'vertex is', 'vertices are')} in no face")
    if not faults:
        fans = sides.fans(sides.pairs)
        pinched = len(np.unique(fans)) - n_points
        if pinched:
            faults.append(f"{counted(pinched, 'vertex joins', 'vertices join')} several fans")
    return faults


def components(n_points: int, faces: IntArray) -> IntArray:
    """Return the component of each vertex, (n,) int, numbered from 0."""
    return connected(n_points, faces.ravel(), faces[:, [1, 2, 0]].ravel())


def counted(number: int, one: str, many: str) -> str:
    """Return "1 edge is", "2 edges are": *number* with the words that fit it."""
    return f"{number} {one if number == 1 else many}"


def face_edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (e, 2), and for each face (m, 3) the edges opposite its three corners."""
    opposite = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    edges, which = np.unique(opposite, axis=0, return_inverse=True)
    return edges, which.reshape(-1, 3)
