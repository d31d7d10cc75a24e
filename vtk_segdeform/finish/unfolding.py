"""Folded triangles of a pose are opened, and everything farther away stays where it is.

Each triangle near a fold gets a gradient J*: that of the pose, without what folds it.

    edges        where the normals on both sides turn against each other, both triangles turn back
                 about the edge, by half of the excess each
    flatness     singular values are at least, and at most, those of a triangle far from folded

The vertices then follow all of these as well as they can (`gradients`), a few dozen times over,
with larger weights for triangles that are, or were, changed: so that their neighbours give way.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray
from ..mesh import Mesh
from .folds import Folds
from .gradients import Patch, around

_RINGS = 3, 6, 12  # around folded triangles, that move; one after the other
_STEPS = 30  # with one of them, at most
_LEAST, _MOST = 0.3, 4.0  # singular values of gradients
_TURNED, _CHANGED = np.radians(115.0), np.radians(60.0)  # as in `folds`, of triangles far from it
# It ends half way between these bounds and a fold.
_ENOUGH, _SLACK = 0.2, np.radians(17.5)
_HEAVY = 10.0  # weight of changed triangles
_TINY = 1e-300


def unfolded(mesh: Mesh, folds: Folds, x: FloatArray, free: BoolArray) -> FloatArray:
    """Return the pose *x* (n, 3) with as few folds as the *free* vertices (n,) allow."""
    best, least = x, folds.at(x)
    for rings in _RINGS:
        if not least.any():
            break
        patch = Patch(mesh, folds, around(mesh, least, rings) & free)
        here = _Opening(patch, folds).opened(best)
        folded = folds.at(here)
        if np.count_nonzero(folded) < np.count_nonzero(least):
            best, least = here, folded
    return best


class _Opening:
    """Folds of the triangles of a patch, opened step by step."""

    def __init__(self, patch: Patch, folds: Folds) -> None:
        inside, self._sides = patch.edges(folds)
        self._patch, self._edges, self._angles = patch, folds.edges[inside], folds.angles[inside]

    def opened(self, x: FloatArray) -> FloatArray:
        """Return the pose *x* (n, 3) with its folds opened, as far as that is possible."""
        heavy = np.zeros(len(self._patch.triangles), dtype=bool)
        for _ in range(_STEPS):
            wanted, changed, is_open = self._wanted(x, self._patch.at(x))
            if is_open:
                break
            heavy |= changed
            x = self._patch.fitted(x, wanted, np.where(heavy, _HEAVY, 1.0))
        return x

    def _wanted(self, x: FloatArray, j: FloatArray) -> tuple[FloatArray, BoolArray, bool]:
        """Return J* (m, 3, 2), which differ from *j*, and whether *j* is far from folds."""
        a, b, c = (x[corner] for corner in self._patch.faces.T)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
        along = x[self._edges[:, 1]] - x[self._edges[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _TINY)
        left, right = normals[self._sides[:, 0]], normals[self._sides[:, 1]]
        now = np.arctan2(
            np.einsum("ij,ij->i", np.cross(left, right), along),
            np.einsum("ij,ij->i", left, right),
        )
        change = (now - self._angles + np.pi) % (2.0 * np.pi) - np.pi
        excess = np.minimum(np.abs(now) - _TURNED, np.abs(change) - _CHANGED)
        back = np.where(excess > 0.0, 0.5 * np.sign(now) * excess, 0.0)[:, None] * along
        turn = np.zeros((len(j), 3))
        np.add.at(turn, self._sides[:, 0], back)
        np.add.at(turn, self._sides[:, 1], -back)
        changed = np.zeros(len(j), dtype=bool)
        changed[self._sides[excess > 0.0].ravel()] = True
        turned = _rotated(turn, j)
        u, s, v = np.linalg.svd(turned, full_matrices=False)
        bounded = np.clip(s, _LEAST, _MOST)
        changed |= (bounded != s).any(axis=1)
        is_open = bool((excess <= _SLACK).all() and (s[:, 1] >= _ENOUGH).all())
        return (u * bounded[:, None, :]) @ v, changed, is_open


def _rotated(turn: FloatArray, j: FloatArray) -> FloatArray:
    """Return *j* (m, 3, 2) rotated by the rotation vectors *turn* (m, 3)."""
    angle = np.linalg.norm(turn, axis=1)
    axis = (turn / np.maximum(angle, _TINY)[:, None])[:, :, None]
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    across = np.cross(axis, j, axis=1)
    dot = (axis * j).sum(axis=1, keepdims=True)
    result: FloatArray = cosine * j + sine * across + (1.0 - cosine) * axis * dot
    return result
