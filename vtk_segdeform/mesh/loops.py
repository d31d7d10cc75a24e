"""The boundary of a mesh as loops of vertices."""

from __future__ import annotations

import numpy as np

from ..arrays import IntArray
from .grouping import connected, first_members


def loops_of(boundary: IntArray) -> list[IntArray]:
    """Return the directed edges (b, 2) of a boundary as loops, the vertices (k,) of each in order.

    Loops are in the order of their first edges, and begin there.  Where several loops pass a
    vertex, a walk closes the shortest one first, so that no loop passes a vertex twice.
    """
    vertices, ends = np.unique(boundary, return_inverse=True)
    tail, head = ends.reshape(-1, 2).T
    part = connected(len(vertices), tail, head)
    crossed = np.zeros(len(vertices), dtype=bool)  # parts in which loops share a vertex
    crossed[part[np.bincount(tail, minlength=len(vertices)) > 1]] = True
    walked = crossed[part[tail]]
    first, loops = _cycles(tail[~walked], head[~walked], len(vertices))
    first = np.flatnonzero(~walked)[first]
    loops = [vertices[loop] for loop in loops]
    if not walked.any():
        return loops
    more_first, more = _walk(boundary[walked])
    first = np.append(first, np.flatnonzero(walked)[more_first])
    loops += more
    return [loops[i] for i in np.argsort(first, kind="stable")]


def _cycles(tail: IntArray, head: IntArray, n: int) -> tuple[IntArray, list[IntArray]]:
    """Return the first edge of each cycle, and its vertices in order; no vertex is in two.

    The steps from each edge to the last one of its cycle are counted by doubling: in each round,
    an edge looks twice as far ahead.
    """
    b = len(tail)
    leaving = np.zeros(n, dtype=np.int64)
    leaving[tail] = np.arange(b)
    following = leaving[head]
    label = connected(b, np.arange(b), following)
    first = first_members(label)
    last = np.zeros(b, dtype=bool)
    last[first] = True
    last = last[following]  # whether the next edge is the first one again
    ahead = np.where(last, np.arange(b), following)
    steps = np.where(last, 0, 1)  # from each edge to the one ahead
    while (further := ahead[ahead] != ahead).any():
        steps[further] += steps[ahead[further]]
        ahead[further] = ahead[ahead[further]]
    order = np.lexsort((-steps, label))
    return first, np.split(tail[order], np.cumsum(np.bincount(label))[:-1]) if b else []


def _walk(boundary: IntArray) -> tuple[list[int], list[IntArray]]:
    """Return the edge at which each walk begins, and its loops."""
    following: dict[int, list[int]] = {}
    for tail, head in boundary[::-1].tolist():
        following.setdefault(tail, []).append(head)
    begun, loops = [], []
    for edge, start in enumerate(boundary[:, 0].tolist()):
        path, place = [start], {start: 0}
        while following.get(path[-1]):
            vertex = following[path[-1]].pop()
            if vertex in place:  # a loop is closed
                loop = path[place[vertex] :]
                begun.append(edge)
                loops.append(np.array(loop))
                del path[place[vertex] + 1 :]
                for each in loop[1:]:
                    del place[each]
            else:
                place[vertex] = len(path)
                path.append(vertex)
    return begun, loops
