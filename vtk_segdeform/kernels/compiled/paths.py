"""Shortest paths along edges, for `blending.border_distance`."""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile("f8[:], const b1[:], const i8[:], const i4[:], const i4[:], const f8[:], const i8[:]")
def distances_inside(distance, inside, sources, starts, ends, lengths, wanted):
    """Put into *distance* (n,) the length of the shortest path from *sources* (s,) to each vertex.

    Paths run along edges, in rows *starts* (n + 1,) of *ends* (e,) with *lengths* (e,), between
    vertices that are *inside* (n,) bool.  Elsewhere *distance* keeps its value.  With *wanted* (k,)
    the search ends when these have theirs, so that others may have none, or too large a one.
    """
    n = len(distance)
    heap = np.empty(n, np.int32)  # vertices, the nearest first
    place = np.full(n, -1, np.int32)  # of each vertex in it; -2 once its distance is final
    missing = np.zeros(n, np.bool_)
    n_missing = -1
    if len(wanted):
        n_missing = 0
        for v in wanted:
            if inside[v] and not missing[v]:
                missing[v] = True
                n_missing += 1
    size = 0
    for v in sources:
        if place[v] == -1:
            distance[v] = 0.0
            heap[size] = v
            place[v] = size
            size += 1
    while size and n_missing:
        v = heap[0]
        place[v] = -2
        if missing[v]:
            n_missing -= 1
        size -= 1
        if size:  # the last one sinks from the top
            moved = heap[size]
            at = 0
            while True:
                below = 2 * at + 1
                if below >= size:
                    break
                if below + 1 < size and distance[heap[below + 1]] < distance[heap[below]]:
                    below += 1
                if distance[heap[below]] >= distance[moved]:
                    break
                heap[at] = heap[below]
                place[heap[at]] = at
                at = below
            heap[at] = moved
            place[moved] = at
        for k in range(starts[v], starts[v + 1]):
            w = ends[k]
            if not inside[w] or place[w] == -2:
                continue
            there = distance[v] + lengths[k]
            at = place[w]
            if at == -1:
                at = size
                size += 1
            elif there >= distance[w]:
                continue
            distance[w] = there
            while at and distance[heap[(at - 1) // 2]] > there:  # it rises
                heap[at] = heap[(at - 1) // 2]
                place[heap[at]] = at
                at = (at - 1) // 2
            heap[at] = w
            place[w] = at
