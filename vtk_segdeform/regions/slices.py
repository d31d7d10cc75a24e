"""Slicing of a surface without limbs into parts of equal area with short borders.

A surface for q parts is cut into two sides, for q // 2 parts and the rest, along the shortest level
set with the right area on each side, and each side recursively.  Level sets of the distance from
the ends of a surface run across it, so a tube is cut into rings.
"""

from __future__ import annotations

import heapq

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .coarse import Surface

_AREA_TOLERANCE = 0.15  # relative error of the area of a side


def quotas(areas: FloatArray, points: IntArray, count: int) -> IntArray:
    """Return the number of parts of each surface, *count* in total: by area, at least one each.

    Each further part goes to the surface whose parts are largest so far, if it has enough *points*.
    """
    quota = np.ones(len(areas), dtype=np.int64)
    heap = [(-area, k) for k, area in enumerate(areas) if points[k] > 1]
    heapq.heapify(heap)
    for _ in range(count - len(areas)):
        _, k = heapq.heappop(heap)
        quota[k] += 1
        if quota[k] < points[k]:
            heapq.heappush(heap, (-areas[k] / quota[k], k))
    return quota


def fair_slice(part: Surface, rim: FloatArray, fraction: float) -> BoolArray:
    """Return a side of the surface with about *fraction* of its area, (k,) bool.

    Parameters
    ----------
    part : Surface
        Connected, at least two points.
    rim : (k,) float
        Length of earlier cuts at each point.
    fraction : float
        Between 0 and 1.

    Returns
    -------
    inside : (k,) bool
        Both sides are connected and not empty.
    """
    total = part.areas.sum()
    found = []
    for d in part.distances_from_ends(rim):
        order = np.argsort(d, kind="stable")
        below = np.cumsum(part.areas[order]) / total
        for target in {fraction, 1.0 - fraction}:
            count = int(np.clip(np.searchsorted(below, target), 1, len(d) - 1))
            t = (d[order[count - 1]] + d[order[count]]) / 2.0
            length = part.level_lengths(part.faces, d, np.array([t]))[0]
            found.append((length, target, order[:count]))
    found.sort(key=lambda candidate: candidate[0])

    best, least = np.zeros(len(rim), dtype=bool), np.inf
    for _, target, ids in found:
        inside = np.zeros(len(rim), dtype=bool)
        inside[ids] = True
        inside = part.two_pieces(inside)
        miss = abs(part.areas[inside].sum() / total - target) / min(fraction, 1.0 - fraction)
        if miss < least and not inside.all():
            best, least = inside if target == fraction else ~inside, miss
        if least <= _AREA_TOLERANCE:
            break
    return best
