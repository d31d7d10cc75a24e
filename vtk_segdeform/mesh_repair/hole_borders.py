"""Border loops of the holes of an oriented triangle surface.

A loop runs against the half-edges of the adjacent faces, so that a lid with the direction of the
loop is oriented like the surface.  Where several borders meet in a vertex, a loop that arrives
along one fan leaves along the next fan around the vertex: the gap between two neighbouring fans
belongs to one hole, and lids over all gaps join the fans to one.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import HalfEdges, next_half_edge


def border_loops(vertices: FloatArray, half_edges: HalfEdges, largest: int) -> list[IntArray]:
    """Return the border half-edges of each hole of up to *largest* edges, in the order of the loop.

    A loop that passes a vertex twice is cut into two.  As loops run backwards, the corner at which
    an edge of the loop begins is the head of its half-edge.  A face that shares fewer than two of
    its vertices with others has no loop: its only lid would be the same face again.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    half_edges : HalfEdges
        Consistently oriented, at most two on each edge.
    largest : int
        Largest number of edges of a hole.
    """
    border = half_edges.boundary[_attached(half_edges)]
    head, tail = half_edges.head[border], half_edges.tail[border]
    after = _successors(vertices, half_edges, border)
    starts, ends = head.tolist(), tail.tolist()
    loops: list[IntArray] = []
    seen = [False] * len(border)
    for first in range(len(border)):
        if seen[first]:
            continue
        path: list[int] = []
        position: dict[int, int] = {}
        at = first
        while not seen[at]:
            seen[at] = True
            position[starts[at]] = len(path)
            path.append(at)
            if ends[at] in position:
                begin = position[ends[at]]
                loop, path = path[begin:], path[:begin]
                for each in loop:
                    del position[starts[each]]
                if 3 <= len(loop) <= largest:
                    loops.append(border[loop])
            at = after[at]
    return [loop for loop in loops if not _is_face(loop)]


def _attached(half_edges: HalfEdges) -> BoolArray:
    """Return which border half-edges (b,) do not belong to a nearly isolated face."""
    face = half_edges.boundary // 3
    alone = np.bincount(face, minlength=len(half_edges.faces)) == 3
    if not alone.any():
        return np.ones(len(face), dtype=bool)
    users = np.bincount(half_edges.tail, minlength=half_edges.n_vertices)
    shared = (users[half_edges.faces] > 1).sum(axis=1)
    attached: BoolArray = ~(alone & (shared < 2))[face]
    return attached


def _successors(vertices: FloatArray, half_edges: HalfEdges, border: IntArray) -> list[int]:
    """Return for each of the *border* half-edges (b,) the index of the next one in its loop."""
    head, tail = half_edges.head[border], half_edges.tail[border]
    leaving = np.argsort(head, kind="stable")
    arriving = np.argsort(tail, kind="stable")
    after = np.empty(len(border), dtype=np.int64)
    after[arriving] = leaving  # correct where only one border passes
    count = np.bincount(head, minlength=half_edges.n_vertices)
    several = np.flatnonzero(count > 1)
    if not len(several):
        return list(after.tolist())
    fans = half_edges.fans(half_edges.pairs)
    fan_in, fan_out = fans[border], fans[next_half_edge(border)]
    normals = _vertex_normals(vertices, half_edges.faces)
    begin = np.searchsorted(head[leaving], several)
    for vertex, start, k in zip(several, begin, count[several], strict=True):
        out, into = leaving[start : start + k], arriving[start : start + k]
        by_fan = {int(fan_in[i]): i for i in into}
        into = np.array([by_fan.get(int(fan_out[o]), -1) for o in out])  # in the same fan as out
        if (into < 0).any():
            continue
        if k == 2:
            after[into] = out[::-1]
            continue
        arms = vertices[tail[out]] - vertices[vertex]
        across = arms[0] - normals[vertex] * (arms[0] @ normals[vertex])
        turn = np.argsort(
            np.arctan2(arms @ np.cross(normals[vertex], across), arms @ across), kind="stable"
        )
        after[into[turn]] = out[np.roll(turn, -1)]
    return list(after.tolist())


def _vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = vertices[faces.T]
    cross = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for corner in faces.T:
        for axis in range(3):
            normals[:, axis] += np.bincount(corner, cross[:, axis], minlength=len(vertices))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _is_face(loop: IntArray) -> bool:
    """Return whether the loop runs around a single face that has no other border."""
    return len(loop) == 3 and bool((loop // 3 == loop[0] // 3).all())
