"""How far a handle has turned in a pose: beyond half a turn its targets do not tell.

A body that is wound up too far snaps back by whole turns, and its handles are in their places all
the same.  So the turn is measured along the surface, from the fixed vertices to the handle: it is
the sum of the rotations between neighbours on the way, each of less than half a turn.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray
from ..geometry import rigid_fit
from ..mesh import Mesh


def turn(
    mesh: Mesh, x: FloatArray, axis: FloatArray, *, fixed: IntArray, handle: IntArray
) -> float | None:
    """Return by how many radians the *handle* is turned about *axis* (3,) in the pose *x* (n, 3).

    Relative to the *fixed* vertices; None if no edges lead there.
    """
    away, before, _ = csgraph.dijkstra(
        mesh.adjacency, indices=fixed, unweighted=True, min_only=True, return_predecessors=True
    )
    vertex = int(handle[away[handle].argmin()])
    if not np.isfinite(away[vertex]):
        return None
    way = list(_way(vertex, before.astype(np.int64)))
    patches = (np.append(mesh.adjacency[[each]].indices, each) for each in way)
    R = np.stack([rigid_fit(mesh.vertices[patch], x[patch])[0] for patch in patches])
    between = Rotation.from_matrix(R[:-1] @ np.swapaxes(R[1:], 1, 2)).as_rotvec()
    return float(between.sum(axis=0) @ axis)


def _way(vertex: int, before: IntArray) -> Iterator[int]:
    while vertex >= 0:
        yield vertex
        vertex = int(before[vertex])
