"""Goals for volumes, as texts or numbers: ``{"whole": "keep", "cavity": "-40%", "body 1": 2.5}``.

    keep                   the volume at rest
    free                   any volume
    2.5                    in the mesh's unit, cubed
    40%, +10%, -40%        of the volume at rest; more, or less, than it
    at least 2.5, >= 2.5   a bound, with any of the above after it; at most 110%, <= 110%

Areas have such goals, too, and coordinates of centroids all but percentages.

What is given takes precedence over what is preserved by default: a body is not preserved if all its
faces are around a volume that is given, and no body and no region if the whole is.  Volumes may
depend on each other, as the whole on its bodies: then they must agree.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray, is_number
from ..checks import shown
from ..errors import ConstraintError
from ..solver import CentroidConstraint, VolumeConstraint, gradients

_GOAL = re.compile(
    r"(?P<bound>at least|at most|>=|<=)?\s*"
    r"(?:(?P<word>keep|free)|(?P<sign>[+-]?)(?P<number>(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(?P<percent>%?))"
)
_DIRECTIONS = 8  # more random directions than volumes, along which their derivatives are compared
_DEPENDENT = 1e-9  # relative residual of a volume that is a sum of others
_AGREE = 1e-9  # relative

OTHER_MEASURE = re.compile(r"(area|centroid [xyz])(?: of (.+))?")
"""Names of goals for other measures of a volume; the groups are the measure and the volume."""

Goals = Mapping[str, str | float]


@dataclass(frozen=True)
class VolumeGoal:
    """A parsed goal.

    Parameters
    ----------
    share : float or None
        Of the volume at rest; None: *value* is a volume.
    value : float
        In the unit of the mesh, cubed.
    bound : int
        0: the volume is equal to it; 1: at least; -1: at most.
    """

    share: float | None = 1.0
    value: float = 0.0
    bound: int = 0

    def target(self, rest: float) -> float:
        """Return the volume, for that at *rest*."""
        return self.value if self.share is None else self.share * rest


def checked_goals(volumes: object) -> Mapping[str, VolumeGoal | None]:
    """Return the goals by the names of volumes; None: free.

    Raises
    ------
    ConstraintError
        If *volumes* is no mapping from names to goals.

    Examples
    --------
    >>> checked_goals({"whole": "-40%", "cavity": "at most 2.5", "body 1": "free"})
    ... # doctest: +NORMALIZE_WHITESPACE
    {'whole': VolumeGoal(share=0.6, value=0.0, bound=0),
     'cavity': VolumeGoal(share=None, value=2.5, bound=-1), 'body 1': None}
    """
    if volumes is None:
        return {}
    if not isinstance(volumes, Mapping) or not all(isinstance(name, str) for name in volumes):
        raise ConstraintError(
            'volumes must be goals by the names of volumes, such as {"whole": "keep"}; '
            f"got {shown(volumes)}"
        )
    return {name: _parsed(name, goal) for name, goal in volumes.items()}


def _parsed(name: str, goal: object) -> VolumeGoal | None:
    if isinstance(goal, bool) or not (isinstance(goal, str) or is_number(goal)):
        raise _not_a_goal(name, goal)
    text = f"{goal}".strip().lower().replace("\N{MINUS SIGN}", "-")
    match = _GOAL.fullmatch(text)
    if match is None:
        raise _not_a_goal(name, goal)
    bound = {"at least": 1, ">=": 1, "at most": -1, "<=": -1}.get(match["bound"] or "", 0)
    if match["word"] == "free":
        if bound:
            raise _not_a_goal(name, goal)
        return None
    if match["word"] == "keep":
        return VolumeGoal(bound=bound)
    number = float(match["number"]) * (-1.0 if match["sign"] == "-" else 1.0)
    if match["percent"]:
        found = VolumeGoal((1.0 if match["sign"] else 0.0) + number / 100.0, bound=bound)
    else:
        found = VolumeGoal(None, number, bound)
    if is_centroid(name):
        if found.share not in (None, 1.0) or not np.isfinite(found.value):
            raise ConstraintError(
                f"the goal of {name!r} must be keep or a coordinate; got {shown(goal)}"
            )
        return found
    if not 0.0 < found.target(1.0) < np.inf:
        raise ConstraintError(f"the volume of {name!r} must be positive; got {shown(goal)}")
    return found


def is_centroid(name: str) -> bool:
    """Return whether a goal called *name* is one for a coordinate of a centroid."""
    match = OTHER_MEASURE.fullmatch(name)
    return match is not None and match[1] != "area"


def _not_a_goal(name: str, goal: object) -> ConstraintError:
    return ConstraintError(
        f"the goal of the volume {name!r} must be keep, free, a volume, or a percentage such as "
        f"-40%, also after 'at least' or 'at most'; got {shown(goal)}"
    )


def consistent(
    given: Sequence[VolumeConstraint], kept: Sequence[VolumeConstraint], x: FloatArray
) -> tuple[VolumeConstraint, ...]:
    """Return those of *given* and *kept* constraints that do not follow from the others.

    All share their points.  Those of *given* that follow from others must agree with them, those of
    *kept* that do not agree are left out.  *x* (n, 3) is the mesh at rest.

    Raises
    ------
    ConstraintError
        If they do not agree; it names them, and what would.
    """
    rows = _derivatives([*given, *kept], x)
    equalities = [k for k, each in enumerate(given) if not each.bound]
    bounds = [k for k, each in enumerate(given) if each.bound]
    chosen: list[int] = []  # that do not follow from each other
    opposite: list[int] = []  # bounds of the same volumes as other bounds, from the other side
    every = [*given, *kept]
    for k in [*equalities, *bounds, *range(len(given), len(every))]:
        base, shares = _followed([j for j in chosen if not every[j].bound], rows, k)
        if base is None:  # not from equalities alone
            base, shares = _followed(chosen, rows, k)
        if base is None:
            chosen.append(k)
            continue
        others = [every[j] for j in base]
        if not _agree(every[k], others, shares):
            if k < len(given):
                raise _contradiction(every[k], others, shares)
            continue
        limits = [j for j in base if every[j].bound]
        if len(limits) == 1 and _is_tighter(every[k], others, shares):
            chosen[chosen.index(limits[0])] = k
        elif limits and every[k].bound:
            opposite.append(k)
    return tuple(every[k] for k in [*chosen, *opposite])


def _followed(base: list[int], rows: FloatArray, k: int) -> tuple[list[int] | None, FloatArray]:
    """Return those of *base* of which row *k* is a sum, and their shares; None if it is not."""
    if not base:
        return None, np.zeros(0)
    shares = np.linalg.lstsq(rows[base].T, rows[k], rcond=None)[0]
    if np.linalg.norm(rows[k] - shares @ rows[base]) > _DEPENDENT * np.linalg.norm(rows[k]):
        return None, shares
    used = np.abs(shares) > _AGREE
    return [j for j, is_used in zip(base, used, strict=True) if is_used], shares[used]


def _derivatives(constraints: Sequence[VolumeConstraint], x: FloatArray) -> FloatArray:
    """Return the derivatives (c, d) of volumes along random directions."""
    rng = np.random.default_rng(0)
    slopes = gradients(constraints, x)
    count = len(constraints) + _DIRECTIONS
    rows = np.empty((len(constraints), count))
    for d in range(count):
        direction = rng.standard_normal(x.shape)
        rows[:, d] = [np.vdot(slope, direction) for slope in slopes]
    return rows


def _sides(others: Sequence[VolumeConstraint], shares: FloatArray) -> set[int]:
    """Return whether the sum of *shares* of *others* may be above (1) that of their targets.

    Or below (-1), by each bound.
    """
    pairs = zip(shares, others, strict=True)
    return {int(np.sign(share)) * each.bound for share, each in pairs if each.bound}


def _implied(others: Sequence[VolumeConstraint], shares: FloatArray) -> float:
    return float(sum(share * each.target for share, each in zip(shares, others, strict=True)))


def _agree(one: VolumeConstraint, others: Sequence[VolumeConstraint], shares: FloatArray) -> bool:
    """Return whether *one*, the sum of *shares* of *others*, can be met together with them."""
    off = _implied(others, shares) - one.target
    if abs(off) <= _AGREE * abs(one.target) or off * one.bound > 0.0:
        return True
    sides = _sides(others, shares)
    return len(sides) > 1 or (len(sides) == 1 and (one.bound in sides or off * min(sides) < 0.0))


def _is_tighter(
    one: VolumeConstraint, others: Sequence[VolumeConstraint], shares: FloatArray
) -> bool:
    """Return whether *one* met implies the only bound of *others*."""
    (side,) = _sides(others, shares)
    off = _implied(others, shares) - one.target
    return one.bound in (0, side) and off * side <= 0.0


def _contradiction(
    one: VolumeConstraint, others: Sequence[VolumeConstraint], shares: FloatArray
) -> ConstraintError:
    names = " and ".join(f"{each.name!r}" for each in others)
    words = {0: "", 1: "at least ", -1: "at most "}
    side = max(_sides(others, shares), default=0)
    return ConstraintError(
        f"the volume of {one.name!r} follows from that of {names}: it is then {words[side]}"
        f"{_implied(others, shares):.6g}, so it cannot be {words[one.bound]}{one.target:.6g}; "
        "leave one of them out, or set it free"
    )


def with_goal(constraint: VolumeConstraint, name: str, goal: VolumeGoal) -> VolumeConstraint:
    """Return the *constraint*, whose target is its volume at rest, with a *goal* instead."""
    rest, target = constraint.target, goal.target(constraint.target)
    if isinstance(constraint, CentroidConstraint):
        shift = (target - rest) / constraint.size
        return replace(constraint, name=name, target=target, shift=shift, bound=goal.bound)
    return replace(constraint, name=name, target=target, share=target / rest, bound=goal.bound)
