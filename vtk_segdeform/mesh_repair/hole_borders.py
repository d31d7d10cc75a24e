"""Border loops of the holes of an oriented triangle surface.

A loop runs against the half-edges of the adjacent faces, so that a lid with the direction of the
loop is oriented like the surface.  Where several borders meet in a vertex, a loop that arrives
along one fan leaves along another one, so that lids join the fans to one.
"""

from __future__ import annotations

import numpy as np

from ..arrays import IntArray
from ..mesh import HalfEdges, next_half_edge


def border_loops(half_edges: HalfEdges, largest: int) -> list[IntArray]:
    """Return the border half-edges of each hole of up to *largest* edges, in the order of the loop.

    A loop that passes a vertex twice is cut into two.  As loops run backwards, the corner at which
    an edge of the loop begins is the head of its half-edge.  A loop around a single face is left
    out: its only lid would be the same face again.

    Parameters
    ----------
    half_edges : HalfEdges
        Consistently oriented, at most two on each edge.
    largest : int
        Largest number of edges of a hole.
    """
    border = half_edges.boundary
    head, tail = half_edges.head[border], half_edges.tail[border]
    after = _successors(half_edges, border)
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


def _successors(half_edges: HalfEdges, border: IntArray) -> list[int]:
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
    begin = np.searchsorted(head[leaving], several)
    for start, k in zip(begin, count[several], strict=True):
        out, into = leaving[start : start + k], arriving[start : start + k]
        by_fan = {int(fan_in[i]): i for i in into}
        into = np.array([by_fan.get(int(fan_out[o]), -1) for o in out])  # in the same fan as out
        if (into < 0).any():
            continue
        after[into] = np.roll(out, -1)
    return list(after.tolist())


def _is_face(loop: IntArray) -> bool:
    """Return whether the loop runs around a single face that has no other border."""
    return len(loop) == 3 and bool((loop // 3 == loop[0] // 3).all())
