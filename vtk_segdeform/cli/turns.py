"""Whole turns that a pose has lost: beyond half a turn the targets of a handle do not tell.

A body that is wound up too far snaps back by whole turns, and its handles are in their places all
the same.  So the turn is measured along the surface, from the fixed vertices to the handle: it is
the sum of the rotations between neighbours on the way, each of less than half a turn.  Where few
vertices share a bend, the sum is inaccurate, and differs from one side of the body to the other; so
it is measured along several ways, and turns are lost only if all of them say so.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray
from ..geometry import rigid_fit
from ..mesh import Mesh

_WAYS = 16  # to vertices of the handle, at most


def turns_off(
    mesh: Mesh, x: FloatArray, axis: FloatArray, angle: float, *, fixed: IntArray, handle: IntArray
) -> int:
    """Return how many turns more than *angle* the *handle* has made about *axis*, nearest to 0.

    The turn about the unit axis (3,) in the pose *x* (n, 3) is relative to the *fixed* vertices; 0
    if no edges lead from these to the handle.
    """
    away, before, _ = csgraph.dijkstra(
        mesh.adjacency, indices=fixed, unweighted=True, min_only=True, return_predecessors=True
    )
    reached = handle[np.isfinite(away[handle])]
    ends = np.unique(np.linspace(0, len(reached) - 1, min(_WAYS, len(reached))).astype(np.int64))
    ways = (list(_way(int(end), before.astype(np.int64))) for end in reached[ends])
    turned = (float(_turn(mesh, x, way) @ axis) for way in ways)
    return min((round((each - angle) / (2.0 * np.pi)) for each in turned), key=abs, default=0)


def _turn(mesh: Mesh, x: FloatArray, way: list[int]) -> FloatArray:
    """Return the sum (3,) of the rotation vectors from the last vertex of *way* to the first."""
    patches = (np.append(mesh.adjacency[[each]].indices, each) for each in way)
    R = np.stack([rigid_fit(mesh.vertices[patch], x[patch])[0] for patch in patches])
    between = Rotation.from_matrix(R[:-1] @ np.swapaxes(R[1:], 1, 2)).as_rotvec()
    return np.asarray(between.sum(axis=0))


def _way(vertex: int, before: IntArray) -> Iterator[int]:
    while vertex >= 0:
        yield vertex
        vertex = int(before[vertex])
