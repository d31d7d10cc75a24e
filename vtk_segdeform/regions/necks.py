"""Where a surface has a limb: the best neck to cut it at.

A limb is a part of the surface with much area behind a short closed curve.  A curve of length L
that leaves area a on its smaller side is judged by the number without unit

    s = (c^3 L + R / 2)^2 / (2 pi a)                              smaller is better

    R       length of older cuts on the smaller side; half of each belongs to either neighbour
    c       L over the mean length of the two curves parallel to it at distances up to L / 2 pi,
            at most 1.  It is 1 on a tube and on a disc, 2/3 where a tube stands on a plane: by
            Gauss and Bonnet it tells how much negative curvature, a crease round the limb, the
            curve lies on.  The parallel on the smaller side counts as at most L, since a limb does
            not widen.

s is 1 for half a sphere and r / (l + r) for the closed end of a tube (radius r, length l), a tenth
of that where the tube stands on a plane.  What stays below `NECK` is a neck: a tube on a plane that
is longer than its radius, or a plain tube ten times as long as its radius.

Candidates are level sets of the distance from the ends of the surface, because those run across
limbs.  All of them are judged roughly, with parallel level sets in place of parallel curves, and
the best are measured.

Source
------
[HR]  D. Hoffman, W. Richards, "Parts of recognition", Cognition 18, 65-96, 1984: people cut shapes
      at negative minima of curvature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .coarse import Surface

NECK = 0.1  # s below which a cut is a neck
_SHARPNESS = 3  # power of c
_LEVELS = 100  # level sets of each distance, all judged roughly;
_PER_END, _MEASURED = 5, 24  # so many of each, and of all, are measured
_LEAST = 0.2  # the smallest limb, in fair shares
_PARALLELS = np.array([0.5, 0.75, 1.0])  # distances of the parallel curves, in L / 2 pi


@dataclass(frozen=True, eq=False)
class Neck:
    """One side of the best cut of a surface; among surfaces, cut the one of lowest *rank* first."""

    rank: float
    inside: BoolArray


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The points with d < t, bounded by a curve of length *length*."""

    d: FloatArray
    t: float
    length: float
    rank: float


def best_neck(part: Surface, rim: FloatArray, share: float) -> Neck | None:
    """Return the best neck of a connected surface, or None where it has no limb.

    Parameters
    ----------
    part : Surface
        k points.
    rim : (k,) float
        Length of older cuts at each point.
    share : float
        The area a region should have; no limb is much smaller.

    Returns
    -------
    neck : Neck or None
        Both sides are connected and not empty.
    """
    candidates = [
        c for d in part.distances_from_ends(rim) for c in _candidates(part, rim, share, d)
    ]
    candidates.sort(key=lambda candidate: candidate.rank)
    i, j = part.graph.nonzero()
    best, bound = None, np.inf

    def measured(inside: BoolArray, length: float) -> float:
        curve = np.unique(i[inside[i] != inside[j]])
        return _measured_rank(part, rim, share, inside, length, curve)

    for candidate in candidates[:_MEASURED]:
        if candidate.rank > 4.0 * bound:  # measured, it seldom falls to less than a quarter
            break
        inside = candidate.d < candidate.t
        rank = measured(inside, candidate.length)
        if rank >= bound:
            continue
        whole = part.two_pieces(inside)
        if (whole != inside).any():
            rank = measured(whole, float(part.contact[whole][:, ~whole].sum()))
        if rank < bound:
            bound, best = rank, Neck(rank, whole)
    return best


def _candidates(part: Surface, rim: FloatArray, share: float, d: FloatArray) -> list[_Candidate]:
    """Return the level sets of *d* that look like necks: the best, and others some way apart."""
    t = d.max() * np.arange(1, _LEVELS + 1) / (_LEVELS + 1)
    exact = part.level_lengths(part.faces, d, t)
    length = np.convolve(np.pad(exact, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    reach = length / (2.0 * np.pi)
    parallel = np.interp(t - reach, t, length, left=0.0) + np.interp(t + reach, t, length, right=0)
    sharp = length / np.maximum(np.maximum(length, parallel / 2.0), np.finfo(float).tiny)

    order = np.argsort(d, kind="stable")
    below = np.searchsorted(d[order], t)
    area = np.append(0.0, np.cumsum(part.areas[order]))[below]
    older = np.append(0.0, np.cumsum(rim[order]))[below]
    total = part.areas.sum()
    older = np.where(area <= total - area, older, rim.sum() - older)
    area = np.minimum(area, total - area)
    rank = _rank(sharp * length + older / 2.0, area, total, share)
    rank[(area < _LEAST * share) | (length <= 0.0)] = np.inf

    found: list[_Candidate] = []
    while len(found) < _PER_END and np.isfinite(rank).any():
        k = int(rank.argmin())
        found.append(_Candidate(d, float(t[k]), float(length[k]), float(rank[k])))
        rank[np.abs(t - t[k]) <= 0.4 * reach[k]] = np.inf
    return found


def _measured_rank(
    part: Surface, rim: FloatArray, share: float, inside: BoolArray, length: float, curve: IntArray
) -> float:
    """Return the rank of the cut along the points *curve*; infinite where it is no neck."""
    total, area = part.areas.sum(), part.areas[inside].sum()
    if area > total - area:
        inside, area = ~inside, total - area
    if area < _LEAST * share or not len(curve) or length <= 0.0:
        return np.inf
    reach = length / (2.0 * np.pi)
    away = part.distance(curve, limit=1.5 * reach)
    near = part.faces[np.isfinite(away[part.faces]).all(axis=1)]
    limb, body = near[inside[near].all(axis=1)], near[~inside[near].any(axis=1)]
    on_limb = part.level_lengths(limb, away, reach * _PARALLELS).mean()
    on_body = part.level_lengths(body, away, reach * _PARALLELS).mean()
    sharp = length / max(length, (min(on_limb, length) + on_body) / 2.0)
    cost = sharp**_SHARPNESS * length + rim[inside].sum() / 2.0
    if cost**2 >= NECK * 2.0 * np.pi * area:
        return np.inf
    return float(_rank(cost, area, total, share))


def _rank(cost: FloatArray, area: FloatArray, total: float, share: float) -> FloatArray:
    """Return s, but area beyond the share is worth little, and larger surfaces are cut first."""
    area = np.maximum(area, np.finfo(float).tiny)
    worth = np.minimum(area, share * (share / area) ** 0.25)
    return np.asarray(cost**2 / (2.0 * np.pi * worth) * share / total)
