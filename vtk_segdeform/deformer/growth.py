"""Growth: volumes that are set change the shape whose detail and lengths are kept.

The energy keeps lengths, so if a volume were set in a solve only, the surface would buckle: a thin
wall around a cavity that shrinks collapses on one side.  Bodies that grow, or contract, change
their lengths.  So the shape to keep is first changed until it has the volumes that are set, and
then deformed; a *grown* shape depends on the volumes only, not on handles or fixed vertices.

The change is the one of least energy with fixed rotations, which varies smoothly, along

    Z = H^-1 G^T      (21), with the constant H of the paper

in legs of 5 %, after each of which the shape reached is the rest shape of the next.  Bounds change
nothing.

If the volumes of some parts are set, as of a region, but none of what is around them, the surface
beyond the parts stays: H has its anchors, as those of a pull beyond its reach in `locality`.  A
belly that grew by 20 % moved hands, feet and head of four figures by at most 0.03 % of the height,
without anchors by 0.7 to 4.6 %.  The steps preserve coarse volumes, so the last legs correct the
exact ones: off by 0.2 %, these moved the feet by 0.3 % in the solve that followed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..arrays import BoolArray, FloatArray
from ..solver import Anchors, GaussNewton, Together, Volumes, position_term
from .locality import ANCHOR_WEIGHT
from .problem import Problem

VOLUME_LEG = 0.05
"""Change of the logarithm of a volume in one leg, at most."""

_ROOM = 0.1  # reach around a part, in square roots of its area
_CORRECTIONS = 2  # more legs, for exact volumes


def kept_around(problem: Problem, part: BoolArray) -> FloatArray:
    """Return the quadratic (m, m) that keeps the surface beyond a *part*, a mask (n,)."""
    reach = _ROOM * math.sqrt(problem.rest.vertex_areas[part].sum())
    return ANCHOR_WEIGHT * problem.energy.scale * problem.samples.quadratic_around(part, reach)


def grown_cages(
    problem: Problem, volumes: Volumes, exact: Together, part: BoolArray | None
) -> FloatArray:
    """Return the cages (m, 3) of the shape with *volumes*; those at rest if they are those at rest.

    All volumes that are kept or set take part, but no bounds.  Those of the mesh are *exact*.
    If only a *part* of the surface changes its volume, a mask (n,), the surface beyond it stays.
    """
    equal = [k for k, each in enumerate(volumes.constraints) if not each.bound]
    volumes, exact = volumes.among(equal), Together(exact[k] for k in equal)
    shares = [each.share for each in volumes.constraints]
    p = problem.rest_cages
    legs = math.ceil(max((abs(math.log(share)) for share in shares), default=0.0) / VOLUME_LEG)
    if not legs:
        return p
    free = position_term(problem.subspace, problem.rest, [], 1.0)
    quadratic = problem.kept_gaps(np.zeros(0, dtype=np.int64))
    if part is not None:
        quadratic += kept_around(problem, part)
    free = free.local(free.rows, Anchors(quadratic, p, np.zeros_like(p)))
    solver = GaussNewton(problem.energy, free, volumes)
    for leg in range(legs + _CORRECTIONS, 0, -1):
        share, off = 1.0 / max(leg - _CORRECTIONS, 1), exact.relative(problem.map(p)).tolist()
        ahead = (
            replace(at, target=at.target + share * (at.nearer(by) - at.target))
            for at, by in zip(volumes.preserved_at(p).constraints, off, strict=True)
        )
        solver.preserve(replace(volumes, constraints=Together(ahead)))
        if (landed := solver.landed(p)) is p:
            break  # nor would it lead farther from here
        p = landed
    return p
