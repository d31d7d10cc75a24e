"""The boundary of a mesh as loops of vertices."""

from __future__ import annotations

import numpy as np

from ..arrays import IntArray


def loops_of(boundary: IntArray) -> list[IntArray]:
    """Return the directed edges (b, 2) of a boundary as loops, the vertices (k,) of each in order.

    Loops are in the order of their first edges, and begin there.  Where several loops pass a
    vertex, a walk closes the shortest one first, so that no loop passes a vertex twice.
    """
    following: dict[int, list[int]] = {}
    for tail, head in boundary[::-1].tolist():
        following.setdefault(tail, []).append(head)
    loops = []
    for start in boundary[:, 0].tolist():
        path, place = [start], {start: 0}
        while following.get(path[-1]):
            vertex = following[path[-1]].pop()
            if vertex in place:  # a loop is closed
                loop = path[place[vertex] :]
                loops.append(np.array(loop))
                del path[place[vertex] + 1 :]
                for each in loop[1:]:
                    del place[each]
            else:
                place[vertex] = len(path)
                path.append(vertex)
    return loops
