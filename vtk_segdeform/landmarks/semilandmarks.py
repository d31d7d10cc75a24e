"""Landmarks that slide: of their targets only the curve or the surface is known.

A ridge or a forehead has no points that could be found again, but it is known where it is.  Such
landmarks slide along it to where the thin-plate spline through all landmarks bends least,

    min_t  sum over axes  (u + T t)^T B (u + T t),      T = tangents at u

with B the bending energy of the spline; then they are projected on the curve or surface, and so on
until they stay.  Others do not move.

Source
------
F. Bookstein, "Landmark methods for forms without landmarks: morphometrics of group differences in
outline shape", Med. Image Anal. 1(3), 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray, as_ids, as_points
from ..checks import require_sequence
from ..deformer import SurfaceTrack
from ..errors import ArgumentError
from ..mesh import Mesh
from .spline import Spline

_MOST = 1000  # landmarks, if any slide: the matrix is dense
_ROUNDS, _HALVINGS = 50, 8
_STAYS = 1e-7  # of the size of the targets: a shorter motion

Track = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From points (s, 3) to the nearest ones (s, 3), and projectors (s, 3, 3) on the normals there."""


class Curve:
    """A curve through points in order, as a `Track`; closed if the last point is the first.

    Its tangents are interpolated between points, so that they have no jumps.
    """

    def __init__(self, points: FloatArray) -> None:
        self._start, self._along = points[:-1], np.diff(points, axis=0)
        lengths = np.linalg.norm(self._along, axis=1, keepdims=True)
        tangents = self._along / np.where(lengths > 0.0, lengths, 1.0)
        around = np.concatenate([tangents[:1], tangents, tangents[-1:]])
        if np.array_equal(points[0], points[-1]):
            around[0], around[-1] = tangents[-1], tangents[0]
        self._tangents = around[:-1] + around[1:]  # at each point

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest points of *x* (s, 3), and the projectors there."""
        squares = np.maximum((self._along**2).sum(axis=1), np.finfo(float).tiny)
        share = np.einsum("skj,kj->sk", x[:, None] - self._start, self._along) / squares
        share = share.clip(0.0, 1.0)
        nearest = self._start + share[..., None] * self._along
        best = np.linalg.norm(nearest - x[:, None], axis=2).argmin(axis=1)
        each = np.arange(len(x))
        own = share[each, best, None]
        tangents = (1.0 - own) * self._tangents[best] + own * self._tangents[best + 1]
        size = np.linalg.norm(tangents, axis=1, keepdims=True)
        tangents = tangents / np.where(size > 0.0, size, 1.0)
        return nearest[each, best], np.eye(3) - tangents[:, :, None] * tangents[:, None]


def checked_slides(slides: Any, count: int) -> list[tuple[IntArray, Track]]:
    """Return *slides* of *count* landmarks, as of `fit_landmarks`, with tracks.

    Raises
    ------
    ArgumentError
        If they are no pairs of landmarks and a curve or surface, or a landmark slides twice.
    """
    require_sequence(slides, "slides")
    found: list[tuple[IntArray, Track]] = []
    for each in slides:
        if not isinstance(each, Sequence) or len(each) != 2:
            raise ArgumentError("slides must be pairs of landmarks and a curve or surface")
        try:
            ids = as_ids(each[0], count, "slides")
        except ValueError as fault:
            raise ArgumentError(str(fault)) from None
        if isinstance(each[1], Mesh):
            found.append((ids, SurfaceTrack(each[1])))
            continue
        points = as_points(each[1], "the curve of slides")
        if len(points) < 2:
            raise ArgumentError("the curve of slides must have two points or more")
        found.append((ids, Curve(points)))
    every = np.concatenate([np.zeros(0, dtype=np.int64), *(ids for ids, _ in found)])
    if len(np.unique(every)) < len(every):
        raise ArgumentError("a landmark can slide along one curve or surface only")
    if len(every) and count > _MOST:
        raise ArgumentError(f"of {count} landmarks none can slide; the limit is {_MOST:,}")
    return found


def slid(a: FloatArray, u: FloatArray, slides: Sequence[tuple[IntArray, Track]]) -> FloatArray:
    """Return the targets *u* (k, 3) of landmarks *a* (k, 3), those of *slides* where they slide to.

    A target that is NaN begins where the spline of the others moves its landmark.
    """
    u, known = u.copy(), np.isfinite(u).all(axis=1)
    if not known.all():
        start = Spline(a[known], np.zeros(np.count_nonzero(known)))
        u[~known] = a[~known] + start.at(a[~known], u[known] - a[known])
    if not slides:
        return u
    bending = Spline(a, np.zeros(len(a))).bending
    size = float(np.linalg.norm(np.ptp(u, axis=0)))
    ids = np.concatenate([own for own, _ in slides])
    u, normals = _projected(u, slides)
    energy = np.vdot(u, bending @ u)
    for _ in range(_ROUNDS):
        tangents = _tangents(normals)  # (s, 3, 2), of a curve one of them is zero
        # Rows of T^T B u, and of T^T (B x I) T.
        slope = np.einsum("sjt,sj->st", tangents, (bending @ u)[ids]).ravel()
        turned = np.einsum("sjt,rju->stru", tangents, tangents).reshape(len(slope), -1)
        own = np.repeat(np.repeat(bending[np.ix_(ids, ids)], 2, axis=0), 2, axis=1)
        steps = np.linalg.lstsq(own * turned, -slope, rcond=1e-12)[0].reshape(-1, 2)
        h = np.einsum("sjt,st->sj", tangents, steps)
        for halving in range(_HALVINGS):
            moved = u.copy()
            moved[ids] += 0.5**halving * h
            moved, ahead = _projected(moved, slides)
            lower = np.vdot(moved, bending @ moved)
            if lower < energy:
                break
        else:
            break
        way = float(np.linalg.norm(moved - u, axis=1).max())
        u, normals, energy = moved, ahead, lower
        if way <= _STAYS * size:
            break
    return u


def _projected(
    u: FloatArray, slides: Sequence[tuple[IntArray, Track]]
) -> tuple[FloatArray, FloatArray]:
    """Return *u* (k, 3) on the tracks, and the projectors (s, 3, 3) of sliding landmarks."""
    u, normals = u.copy(), []
    for ids, track in slides:
        u[ids], own = track(u[ids])
        normals.append(own)
    return u, np.concatenate(normals)


def _tangents(normals: FloatArray) -> FloatArray:
    """Return an orthonormal basis (s, 3, 2) of the tangents, from projectors (s, 3, 3)."""
    sizes, ways = np.linalg.eigh(normals)  # 0 for tangents, first
    return np.asarray(ways[:, :, :2] * (sizes[:, None, :2] < 0.5))
