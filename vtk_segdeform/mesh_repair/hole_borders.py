"""Border loops of an oriented triangle surface: the holes, corner by corner.

A loop runs against the sides of the faces along it, so that a lid which follows the loop is
oriented like the surface.  Where several borders meet in a vertex, a loop that arrives along one
fan leaves along the next one counted around the vertex: the gap between two neighbouring fans
belongs to one hole, and lids over all gaps join the fans into one.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Sides, following


def border_loops(vertices: FloatArray, sides: Sides, largest: int) -> list[IntArray]:
    """Return the border sides of each hole of up to *largest* edges, in the order of the loop.

    No loop passes a vertex twice; it is cut where it would.  The corner of a loop at which a side
    begins is the side's head.  A face that shares fewer than two of its vertices has no loop of
    its own: the only lid for it would be the same face.

    Parameters
    ----------
    vertices : (n, 3) float
        Finite.
    sides : Sides
        Consistently oriented, no edge with three sides or more.
    largest : int
        Number of edges.
    """
    border = sides.open[_attached(sides)]
    head, tail = sides.head[border], sides.tail[border]
    onward = _onward(vertices, sides, border)
    starts, ends = head.tolist(), tail.tolist()
    loops: list[IntArray] = []
    seen = [False] * len(border)
    for first in range(len(border)):
        if seen[first]:
            continue
        path: list[int] = []
        place: dict[int, int] = {}
        at = first
        while not seen[at]:
            seen[at] = True
            place[starts[at]] = len(path)
            path.append(at)
            if ends[at] in place:
                begin = place[ends[at]]
                loop, path = path[begin:], path[:begin]
                for left in loop:
                    del place[starts[left]]
                if 3 <= len(loop) <= largest:
                    loops.append(border[loop])
            at = onward[at]
    return [loop for loop in loops if not _is_face(loop)]


def _attached(sides: Sides) -> BoolArray:
    """Return which open sides (b,) do not belong to a nearly isolated face."""
    face = sides.open // 3
    alone = np.bincount(face, minlength=len(sides.faces)) == 3
    if not alone.any():
        return np.ones(len(face), dtype=bool)
    users = np.bincount(sides.tail, minlength=sides.n_vertices)
    shared = (users[sides.faces] > 1).sum(axis=1)
    attached: BoolArray = ~(alone & (shared < 2))[face]
    return attached


def _onward(vertices: FloatArray, sides: Sides, border: IntArray) -> list[int]:
    """Return for each of the *border* sides (b,) the number of the next one in its loop."""
    head, tail = sides.head[border], sides.tail[border]
    leaving = np.argsort(head, kind="stable")
    arriving = np.argsort(tail, kind="stable")
    onward = np.empty(len(border), dtype=np.int64)
    onward[arriving] = leaving  # correct wherever only one border passes
    count = np.bincount(head, minlength=sides.n_vertices)
    crowded = np.flatnonzero(count > 1)
    if not len(crowded):
        return list(onward.tolist())
    fans = sides.fans(sides.pairs)
    fan_in, fan_out = fans[border], fans[following(border)]
    normals = _vertex_normals(vertices, sides.faces)
    begin = np.searchsorted(head[leaving], crowded)
    for vertex, start, k in zip(crowded, begin, count[crowded], strict=True):
        out, into = leaving[start : start + k], arriving[start : start + k]
        by_fan = {int(fan_in[i]): i for i in into}
        into = np.array([by_fan.get(int(fan_out[o]), -1) for o in out])  # of the same fan as out
        if (into < 0).any():
            continue
        if k == 2:
            onward[into] = out[::-1]
            continue
        arms = vertices[tail[out]] - vertices[vertex]
        across = arms[0] - normals[vertex] * (arms[0] @ normals[vertex])
        turn = np.argsort(
            np.arctan2(arms @ np.cross(normals[vertex], across), arms @ across), kind="stable"
        )
        onward[into[turn]] = out[np.roll(turn, -1)]
    return list(onward.tolist())


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
