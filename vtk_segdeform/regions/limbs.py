"""Limbs: the parts of a surface behind short closed curves along which it is concave.

A limb is bounded by a curve, its neck.  Two dimensionless numbers describe a neck of length L with
area a behind it:

    p = 4 pi a / L^2        protrusion: 1 for a flat disc, 2 for half a sphere, 4 and more for tubes
    c = L / m               at most 1; m is the largest mean length of two curves parallel to the
                            neck, one on either side, at equal distances up to L / pi

c is 1 where a surface is convex, flat or a tube, 1/2 where a tube stands on a plane, and less in a
waist: by the Gauss-Bonnet theorem it measures the negative curvature along the neck, where people
divide shapes into parts [HR].  The score of a neck is

    s = 2 c^6 / min(p, 6)                                         smaller is better

Scores are those of the whole surface: they depend neither on limbs found before nor on the order,
so that both arms of a symmetric body have nearly equal scores.

A tube with other limbs around it is concave there, but not divided; so a neck also has to be
narrow: either its limb or the body, without all other limbs, must be wider nearby.

Candidates are level sets of the distance from the tips of the surface, because these run across
limbs, and then from all of the end of a limb, because a tip is seldom in its middle.  They are
searched again on the surface without the limbs found, which hide others: ears a head.

Source
------
[HR]  D. Hoffman, W. Richards, "Parts of recognition", Cognition 18, 65-96, 1984: vision divides
      shapes at negative minima of curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from .coarse import Surface

_MOST_SCORE = 0.1  # of a neck, at most
_LEAST_PROTRUSION = 2.5  # of a limb, at least
_ROUGH_FACTOR = 3.0  # candidates may miss both limits by this factor before they are improved
_PARALLELS = np.array([0.5, 0.75, 1.0, 1.5, 2.0])  # distances of the parallel curves, in L / 2 pi
_WIDER_AT = np.arange(0.5, 4.1, 0.5)  # where limb and body may be wider, in L / 2 pi
_WIDER, _WIDER_INSIDE = 1.27, 1.5  # relative to a neck of the body, and of a limb
_MOST_COMMON = 0.15  # limbs with less of the smaller one in common are disjoint
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Limb:
    """One side of a neck: its points (k,), their area, the length and the score of the neck."""

    inside: BoolArray
    area: float
    length: float
    score: float

    @property
    def found(self) -> bool:
        """Whether the neck is sharp and the limb protrudes enough."""
        return self.score < _MOST_SCORE and bool(
            _protrusion(self.area, self.length) > _LEAST_PROTRUSION
        )


def find_limbs(surface: Surface, least: float) -> list[Limb]:
    """Return the limbs of a connected surface with at least the area *least*, most distinct first.

    Any two are disjoint, or one contains the other, up to a few points.
    """
    limbs: list[Limb] = []
    for n_tips in (16, 6, 6) if surface.areas.any() else ():
        candidates = _candidates(surface, least, limbs, n_tips)
        before = len(limbs)
        for limb in sorted(candidates, key=attrgetter("score")):
            if _divides(surface, least, limb, limbs):
                limbs.append(limb)
        for limb in limbs[::-1]:  # again, without the limbs found later
            others = [other for other in limbs if other is not limb]
            if not _divides(surface, least, limb, others):
                limbs = others
        if len(limbs) <= before:
            break
    return sorted(limbs, key=attrgetter("score"))


def _candidates(surface: Surface, least: float, limbs: list[Limb], n_tips: int) -> list[Limb]:
    """Return candidates from the tips of the surface without *limbs*."""
    taken = np.zeros(len(surface.areas), dtype=bool)
    for limb in limbs:
        taken |= limb.inside
    ids = surface.pieces(~taken)[0]
    body = surface.part(ids)
    taken[:] = True
    taken[ids] = False
    pieces = [
        (piece, surface.contact[piece][:, ids].sum(axis=0)) for piece in surface.pieces(taken)
    ]
    rim = np.sum([np.zeros(len(ids)), *(touch for _, touch in pieces)], axis=0)
    candidates: list[Limb] = []
    improved: list[Limb] = []
    for d in body.distances_from_ends(rim, n_tips):
        level = np.zeros(len(surface.areas))
        level[ids] = d
        for piece, touch in pieces:  # all of it on one side
            level[piece] = touch @ d / max(touch.sum(), _TINY)
        rough = [
            _limb(surface, least, level < t, 0.0 if limbs else length)
            for t, length in _level_sets(body, least, d, 3)
        ]
        found = [limb for limb in rough if limb is not None]
        candidates += [limb for limb in found if limb.found]
        if found:
            best = min(found, key=attrgetter("score"))
            if any((best.inside != x.inside).sum() < 0.1 * best.inside.sum() for x in improved):
                continue
            improved.append(best)
            away = np.where(best.inside, _distance(surface, best.inside), 0.0)
            d = surface.distance(np.flatnonzero(away >= 0.6 * away.max()))
            levels = _level_sets(surface, least, d, 2)
            better = [_limb(surface, least, d < t, length) for t, length in levels]
            candidates += [limb for limb in better if limb is not None and limb.found]
    return candidates


def _level_sets(
    surface: Surface, least: float, d: FloatArray, most: int
) -> list[tuple[float, float]]:
    """Return (t, length) of the level sets {d = t} with the best approximate scores, apart."""
    t = d.max() * np.arange(1, 101) / 101
    exact = surface.level_lengths(surface.faces, d, t)
    length = np.convolve(np.pad(exact, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    reach = length / (2.0 * np.pi)
    below, above = (
        np.interp(t + step * _PARALLELS[:, None] * reach, t, length, left=0.0, right=0.0)
        for step in (-1.0, 1.0)
    )
    order = np.argsort(d, kind="stable")
    area = np.append(0.0, np.cumsum(surface.areas[order]))[np.searchsorted(d[order], t)]
    score = _score(below, above, length, area)
    unlikely = (score > _ROUGH_FACTOR * _MOST_SCORE) | (
        _protrusion(area, length) < _LEAST_PROTRUSION / _ROUGH_FACTOR
    )
    unfit = (area < least) | (area > 0.6 * surface.areas.sum()) | (length <= 0.0)
    score[unlikely | unfit] = np.inf
    found: list[tuple[float, float]] = []
    while len(found) < most and np.isfinite(score).any():
        k = int(score.argmin())
        found.append((float(t[k]), float(length[k])))
        score[np.abs(t - t[k]) <= 0.4 * reach[k]] = np.inf
    return found


def _limb(surface: Surface, least: float, inside: BoolArray, length: float) -> Limb | None:
    """Return the limb with a neck between *inside* and the rest, or None if that is no neck.

    *length* is 0 if it is unknown.
    """
    whole = surface.two_pieces(inside)
    if not length or (whole != inside).any():
        length = float(surface.contact[whole][:, ~whole].sum())
    area, total = float(surface.areas[whole].sum()), float(surface.areas.sum())
    if area > total - area:
        whole, area = ~whole, total - area
    if area < least or _protrusion(area, length) < _LEAST_PROTRUSION / _ROUGH_FACTOR:
        return None
    steps = _PARALLELS * length / (2.0 * np.pi)
    away = _distance(surface, whole, 1.25 * steps[-1])
    near = surface.faces[np.isfinite(away[surface.faces]).all(axis=1)]
    limb, body = near[whole[near].all(axis=1)], near[~whole[near].any(axis=1)]
    on_limb, on_body = (surface.level_lengths(side, away, steps) for side in (limb, body))
    score = float(_score(on_limb, on_body, np.array(length), np.array(area)))
    return Limb(whole, area, length, score) if score < _ROUGH_FACTOR * _MOST_SCORE else None


def _distance(surface: Surface, inside: BoolArray, limit: float = np.inf) -> FloatArray:
    """Return the distance from the points on either side of a neck, (k,)."""
    i, j = surface.lines
    return surface.distance(np.unique(i[inside[i] != inside[j]]), limit)


def _protrusion(area: FloatArray | float, length: FloatArray | float) -> FloatArray:
    return np.asarray(4.0 * np.pi * area / np.maximum(np.square(length), 1e-9 * area + _TINY))


def _score(limb: FloatArray, body: FloatArray, length: FloatArray, area: FloatArray) -> FloatArray:
    """Return s from the lengths of parallels, (5, ...) each; those beyond a tip do not count."""
    mean = np.where(limb >= 0.3 * length, limb + body, 0.0).max(axis=0) / 2.0
    c = length / np.maximum(np.maximum(length, mean), _TINY)
    protrusion = np.clip(_protrusion(area, length), _TINY, 6.0)
    return np.asarray(2.0 * c**6 / protrusion)


def _divides(surface: Surface, least: float, limb: Limb, limbs: list[Limb]) -> bool:
    """Return whether *limb* and the part of the body with the others *limbs* are two parts."""
    own, rest, rims = limb.inside.copy(), ~limb.inside, [limb.length]
    least_rest, wider = least, _WIDER
    for other in sorted(limbs, key=attrgetter("area"), reverse=True):
        smaller = min(limb.area, other.area)
        common = surface.areas[limb.inside & other.inside].sum()
        if common <= _MOST_COMMON * smaller:
            rest &= ~other.inside
        elif common < (1.0 - _MOST_COMMON) * smaller:
            return False
        elif other.area < limb.area:
            if own[other.inside].mean() > 0.5:
                rims.append(other.length)
            own &= ~other.inside
        else:  # the smallest such limb comes last
            rest = other.inside & ~limb.inside
            least_rest, wider = max(least, 0.3 * other.area), _WIDER_INSIDE
    area = surface.areas[own].sum()
    if area < least or surface.areas[rest].sum() < least_rest:
        return False
    if _protrusion(area, float(np.linalg.norm(rims))) < _LEAST_PROTRUSION:
        return False
    unit = limb.length / (2.0 * np.pi)
    away = _distance(surface, limb.inside, (_WIDER_AT[-1] + 0.25) * unit)
    neck = _spread(surface, np.flatnonzero(away == 0.0))
    rings = (
        np.flatnonzero(side & (np.abs(away - step * unit) <= 0.25 * unit))
        for side in (own, rest)
        for step in _WIDER_AT
    )
    return any(_spread(surface, ring) > wider * neck for ring in rings)


def _spread(surface: Surface, ids: IntArray) -> float:
    """Return the root mean square distance of points from their centre."""
    x, weight = surface.vertices[ids], surface.areas[ids]
    if not weight.any():
        return 0.0
    x = x - weight @ x / weight.sum()
    return float(np.sqrt(weight @ np.einsum("ij,ij->i", x, x) / weight.sum()))
