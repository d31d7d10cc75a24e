"""Necks: the best closed curves for cutting limbs off a surface.

A limb is a part of the surface with a large area behind a short closed curve.  The score of a curve
of length L with area a on its smaller side is dimensionless:

    s = (c^3 L + R / 2)^2 / (2 pi a)                              smaller is better

    R       length of earlier cuts on the smaller side; half of each counts for either neighbour
    c       L over the mean length of the two curves parallel to it at distances up to L / 2 pi,
            at most 1.  It is 1 on a tube and on a disc, 2/3 where a tube stands on a plane: by the
            Gauss-Bonnet theorem it measures the negative curvature along the curve, as in a crease
            around the limb.  The parallel on the smaller side counts as at most L, since a limb
            does not widen.

s is 1 for half a sphere and r / (l + r) for the closed end of a tube (radius r, length l), a tenth
of that where the tube stands on a plane.  A curve with s below `NECK` is a neck: on a tube on a
plane that is longer than its radius, or a plain tube ten times as long as its radius.

Candidates are level sets of the distance from the ends of the surface, because these run across
limbs.  All are scored approximately, with parallel level sets in place of parallel curves, and the
best ones exactly.

Source
------
[HR]  D. Hoffman, W. Richards, "Parts of recognition", Cognition 18, 65-96, 1984: vision divides
      shapes at negative minima of curvature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .coarse import Surface

NECK = 0.1  # s below which a cut is a neck
_SHARPNESS = 3  # power of c
_LEVELS = 100  # level sets of each distance, scored approximately
_PER_END, _MEASURED = 5, 24  # candidates per distance, and in total, scored exactly
_LEAST = 0.2  # area of the smallest limb, relative to that of a region
_PARALLELS = np.array([0.5, 0.75, 1.0])  # distances of the parallel curves, in L / 2 pi


@dataclass(frozen=True, eq=False)
class Neck:
    """One side of the best cut of a surface; the surface of lowest *rank* is cut first."""

    rank: float
    inside: BoolArray


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The points with d < t, bounded by a curve of the given length."""

    d: FloatArray
    t: float
    length: float
    rank: float


def best_neck(part: Surface, rim: FloatArray, share: float) -> Neck | None:
    """Return the best neck of a connected surface, or None if it has no limb.

    Parameters
    ----------
    part : Surface
        k points.
    rim : (k,) float
        Length of earlier cuts at each point.
    share : float
        The typical area of a region; limbs are not much smaller.

    Returns
    -------
    neck : Neck or None
        Both sides are connected and not empty.
    """
    if not part.areas.any():
        return None
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
        if candidate.rank > 4.0 * bound:  # the exact score is seldom less than a quarter
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
    """Return the level sets of *d* with the best approximate scores, at some distance apart."""
    t = d.max() * np.arange(1, _LEVELS + 1) / (_LEVELS + 1)
    exact = part.level_lengths(part.faces, d, t)
    length = np.convolve(np.pad(exact, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    reach = length / (2.0 * np.pi)
    parallel = np.interp(t - reach, t, length, left=0.0) + np.interp(t + reach, t, length, right=0)
    sharp = length / np.maximum(np.maximum(length, parallel / 2.0), np.finfo(float).tiny)

    order = np.argsort(d, kind="stable")
    below = np.searchsorted(d[order], t)
    area = np.append(0.0, np.cumsum(part.areas[order]))[below]
    earlier = np.append(0.0, np.cumsum(rim[order]))[below]
    total = part.areas.sum()
    earlier = np.where(area <= total - area, earlier, rim.sum() - earlier)
    area = np.minimum(area, total - area)
    rank = _rank(sharp * length + earlier / 2.0, area, total, share)
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
    """Return the rank of the cut along the points *curve*; infinite if it is not a neck."""
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
    """Return s, modified: area beyond the share counts less, and larger surfaces come first."""
    area = np.maximum(area, _LEAST * share)  # smaller ones are no limbs
    effective = np.minimum(area, share * (share / area) ** 0.25)
    return np.asarray(cost**2 / (2.0 * np.pi * effective) * share / total)
