"""Growth: volumes that are set change the shape whose detail and lengths are kept.

The energy keeps lengths, so if a volume were set in a solve only, the surface would buckle: a thin
wall around a cavity that shrinks collapses on one side.  Bodies that grow, or contract, change
their lengths.  So the shape to keep is first changed until it has the volumes that are set, and
then deformed; a *grown* shape depends on the volumes only, not on handles or fixed vertices.

The change is the one of least energy with fixed rotations, which varies smoothly, along

    Z = H^-1 G^T      (21), with the constant H of the paper

in legs of 5 %, after each of which the shape reached is the rest shape of the next.  Bounds change
nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..arrays import FloatArray
from ..solver import Anchors, GaussNewton, Together, Volumes, position_term
from .problem import Problem

VOLUME_LEG = 0.05
"""Change of the logarithm of a volume in one leg, at most."""


def grown_cages(problem: Problem, volumes: Volumes) -> FloatArray:
    """Return the cages (m, 3) of the shape with *volumes*; those at rest if they are those at rest.

    All volumes that are kept or set take part, but no bounds.
    """
    volumes = volumes.among([k for k, each in enumerate(volumes.constraints) if not each.bound])
    shares = [each.share for each in volumes.constraints]
    p = problem.rest_cages
    legs = math.ceil(max((abs(math.log(share)) for share in shares), default=0.0) / VOLUME_LEG)
    if not legs:
        return p
    free = position_term(problem.subspace, problem.rest, [], 1.0)
    gaps = Anchors(problem.kept_gaps(np.zeros(0, dtype=np.int64)), p, np.zeros_like(p))
    free = free.local(free.rows, gaps)
    solver = GaussNewton(problem.energy, free, volumes)
    for leg in range(1, legs + 1):
        now = (
            replace(each, target=each.target / share * (1.0 + leg / legs * (share - 1.0)))
            for each, share in zip(volumes.constraints, shares, strict=True)
        )
        solver.preserve(replace(volumes, constraints=Together(now)))
        if (ahead := solver.landed(p)) is p:
            break  # nor would it lead farther from here
        p = ahead
    return p
