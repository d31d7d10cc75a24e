"""Where a solve starts: on along the way of the last two.

The targets of a drag move on as they did before, and the cages with them:

    s    = (u - u_1) . (u_1 - u_0) / |u_1 - u_0|^2,  at most 2
    p    = p_1 + s (p_1 - p_0)

The ends of the last two solves are p_0, p_1, and their targets u_0, u_1.  Longer motions start
where the last one ended: from a guess far off, the length of a step says too little about the
distance that remains, by which a live drag decides what to show.
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
        """Return the way with another *end*, which replaces one for the same targets."""
        others = [each for each in self.ends if not np.array_equal(each.targets, end.targets)]
        return Way((*others[-1:], end))

    def ahead(self, targets: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]] | None:
        """Return how far cages (m, 3) should move on for *targets*, and directions Z there.

        None if there is no way yet, or the targets turn back or move far.
        """
        if len(self.ends) < 2:
            return None
        before, last = self.ends
        if np.abs(targets - last.targets).max() > _LONGEST:
            return None
        way = last.targets - before.targets
        share = min(float(np.vdot(targets - last.targets, way) / np.vdot(way, way)), _FARTHEST)
        return (share * (last.p - before.p), last.directions) if share > 0.0 else None
