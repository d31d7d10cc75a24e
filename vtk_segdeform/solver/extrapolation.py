"""The start of a solve, extrapolated from the ends of the last ones.

The targets u of a drag usually continue in their direction, and the cages p follow a smooth path.
With the length t of the path of the targets as its parameter, p(t) is the polynomial through the
last ends, evaluated at

    t = t_1 + min(s, 2) |u_1 - u_0|,     s = (u - u_1) . (u_1 - u_0) / |u_1 - u_0|^2

where u_0, u_1 are the targets of the last two ends.  Its degree is the one that would have come
closest to the last end, as in integrators of variable order: 3 for a steady hand, 1 for a jerky
one.  A longer motion starts where the last solve ended: after a guess far from the solution, the
length of a step says too little about the remaining distance, by which a live drag decides what to
show.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray

_FARTHEST = 2.0  # times the way between the last two ends
_LONGEST = 0.02  # motion of targets, in mesh sizes
_HIGHEST = 3  # degree of the polynomial
_SAME = 0.2  # of the last way: an end so near the last one replaces it
_STRAIGHT = 0.5  # least cosine between successive ways on one path


@dataclass(frozen=True, eq=False)
class End:
    """Where a solve ended."""

    p: FloatArray  # (m, 3), cage vertices
    targets: FloatArray
    directions: tuple[FloatArray, ...]  # Z, (m, 3) for each constraint


@dataclass(frozen=True, eq=False)
class Way:
    """The ends of the last solves, for different targets, on a path without sharp turns."""

    ends: tuple[End, ...] = ()

    def on_to(self, end: End) -> Way:
        """Return these ends and *end*, which replaces the last one if it is near it."""
        ends = self.ends
        if ends and np.array_equal(ends[-1].targets, end.targets):
            ends = ends[:-1]
        elif len(ends) > 1:
            last = ends[-1].targets - ends[-2].targets
            if np.linalg.norm(end.targets - ends[-1].targets) < _SAME * np.linalg.norm(last):
                ends = ends[:-1]
        if len(ends) > 1:
            last, way = ends[-1].targets - ends[-2].targets, end.targets - ends[-1].targets
            if np.vdot(last, way) < _STRAIGHT * np.linalg.norm(last) * np.linalg.norm(way):
                ends = ends[-1:]
        return Way((*ends[-_HIGHEST - 1 :], end))

    def ahead(self, targets: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]] | None:
        """Return the extrapolated cages (m, 3) for *targets*, and the directions Z.

        None if there are fewer than two ends, or the targets turn back or move far.
        """
        if len(self.ends) < 2:
            return None
        before, last = self.ends[-2:]
        if np.abs(targets - last.targets).max() > _LONGEST:
            return None
        way = last.targets - before.targets
        share = min(float(np.vdot(targets - last.targets, way) / np.vdot(way, way)), _FARTHEST)
        if share <= 0.0:
            return None
        pairs = zip(self.ends[1:], self.ends, strict=False)
        lengths = [float(np.linalg.norm(b.targets - a.targets)) for b, a in pairs]
        t = list(itertools.accumulate(lengths, initial=0.0))
        p = [end.p for end in self.ends]
        degree = _best_degree(p, t)
        there = _extrapolated(p, t, t[-1] + share * lengths[-1], degree)
        return there, last.directions


def _best_degree(p: Sequence[FloatArray], t: Sequence[float]) -> int:
    """Return the degree that comes closest to the last of *p* at *t* (k,) from those before it."""
    off = [
        float(np.linalg.norm(_extrapolated(p[:-1], t[:-1], t[-1], degree) - p[-1]))
        for degree in range(1, len(p) - 1)
    ]
    return 1 + int(np.argmin(off)) if off else 1


def _extrapolated(
    p: Sequence[FloatArray], t: Sequence[float], at: float, degree: int
) -> FloatArray:
    """Return the polynomial of *degree* through the last of *p* at *t* (Lagrange), there *at*."""
    own, found = t[-degree - 1 :], np.zeros_like(p[-1])
    for k, each in enumerate(p[-degree - 1 :]):
        others = [other for j, other in enumerate(own) if j != k]
        found += math.prod((at - other) / (own[k] - other) for other in others) * each
    return found
