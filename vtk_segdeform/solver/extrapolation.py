"""The start of a solve, extrapolated from the ends of the last two.

The targets of a drag usually continue in their direction, and the cages with them:

    s    = (u - u_1) . (u_1 - u_0) / |u_1 - u_0|^2,  at most 2
    p    = p_1 + s (p_1 - p_0)

The ends of the last two solves are p_0, p_1, and their targets u_0, u_1.  A longer motion
starts where the last solve ended: after a guess far from the solution, the length of a step says
too little about the remaining distance, by which a live drag decides what to show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray

_FARTHEST = 2.0  # times the way between the last two ends
_LONGEST = 0.02  # motion of targets, in mesh sizes


@dataclass(frozen=True, eq=False)
class End:
    """Where a solve ended."""

    p: FloatArray  # (m, 3), cage vertices
    targets: FloatArray
    directions: tuple[FloatArray, ...]  # Z, (m, 3) for each constraint


@dataclass(frozen=True, eq=False)
class Way:
    """The ends of the last solves, for two different targets at most."""

    ends: tuple[End, ...] = ()

    def on_to(self, end: End) -> Way:
        """Return these ends and *end*, which replaces one for the same targets."""
        others = [each for each in self.ends if not np.array_equal(each.targets, end.targets)]
        return Way((*others[-1:], end))

    def ahead(self, targets: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]] | None:
        """Return the extrapolated motion of the cages (m, 3) for *targets*, and the directions Z.

        None if there are fewer than two ends, or the targets turn back or move far.
        """
        if len(self.ends) < 2:
            return None
        before, last = self.ends
        if np.abs(targets - last.targets).max() > _LONGEST:
            return None
        way = last.targets - before.targets
        share = min(float(np.vdot(targets - last.targets, way) / np.vdot(way, way)), _FARTHEST)
        return (share * (last.p - before.p), last.directions) if share > 0.0 else None
