"""Stiffness: a factor of the energy at each vertex, and parts that are rigid.

    s = 1         as usual
    s = 5         the surface and the body below it resist bending and stretching five times as much
    s = infinity  rigid: bones, teeth, buttons

Only ratios matter: if all vertices have the same, nothing changes.  Each connected part of rigid
vertices moves as one body, whose place the solve finds.  In the cages it is affine, and rigid
nearly (`subspace.affine_parts`); a finish places it exactly, where it is nearest to their pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..arrays import BoolArray, FloatArray, IntArray, largest_length, plain
from ..checks import shown
from ..errors import ConstraintError
from ..geometry import rigid_fit
from ..mesh import Mesh
from ..solver import connected_sets
from .symmetry import Mirror

_LEAST, _MOST = 1e-2, 1e2  # of s, in medians
# Of placing a rigid part: rounds; the longest step, in its sizes and radians, and by how much it is
# shortened in each round; a step that is rounding; and the change of a place by a motion of length
# 1 that counts as none.
_ROUNDS, _LONGEST, _SHORTENED, _SHORTEST, _RANK = 100, 0.3, 0.8, 1e-14, 1e-6


@dataclass(frozen=True, eq=False)
class Stiffness:
    """The stiffness of a mesh; made by `Stiffness.of`."""

    factors: FloatArray  # (n,) float, finite; 1 in rigid parts
    rigid: tuple[IntArray, ...]  # (k,) int each: connected parts

    @classmethod
    def of(
        cls, mesh: Mesh, stiffness: ArrayLike | None, mirror: Mirror | None = None
    ) -> Stiffness | None:
        """Return the *stiffness* (n,) of *mesh*; None if it is the same everywhere.

        With a *mirror*, what is stiff on one side of it is as stiff on the other side.

        Raises
        ------
        ConstraintError
            If it is not one number, 0 or more, or infinity, for each vertex.
        """
        if stiffness is None:
            return None
        given = plain(stiffness, "stiffness")
        n = mesh.n_vertices
        if given.shape != (n,) or given.dtype.kind not in "fiu" or not (given >= 0.0).all():
            raise ConstraintError(
                f"stiffness must be {n} numbers, 0 or more, or infinity, one for each vertex; "
                f"got {shown(stiffness)}"
            )
        values = np.asarray(given, dtype=np.float64)
        if mirror is not None:
            values = np.maximum(values, values[mirror.mates])
        is_rigid = np.isinf(values)
        rigid = np.flatnonzero(is_rigid)
        usual = _median_of(values[~is_rigid & (values > 0.0)])
        values = np.clip(np.where(is_rigid, usual, values) / usual, _LEAST, _MOST)
        if not len(rigid) and (values == values[0]).all():
            return None
        return cls(values, tuple(rigid[own] for own in connected_sets(mesh, rigid)))


@dataclass(frozen=True, eq=False)
class FactorSlopes:
    """How the factors of `Stiffness` change with the stiffness, to first order.

    Limited and rigid factors stay.  Where the stiffness is not smooth, the slope is a mean: both
    vertices of a pair, of a mirror, that are equally stiff count half, and vertices with the
    median count alike.
    """

    soft: FloatArray  # (n,): the stiffness over its median, or 0 where the factor stays
    median: float
    of_median: FloatArray  # (n,), sum 1: how the median changes with the soft vertices
    shares: FloatArray  # (n,): of the vertex itself; the rest is of its mate
    mates: IntArray  # (n,)

    @classmethod
    def of(cls, stiffness: FloatArray, mirror: Mirror | None) -> FactorSlopes:
        """Return the slopes at *stiffness* (n,)."""
        mates = np.arange(len(stiffness)) if mirror is None else mirror.mates
        values, other = np.maximum(stiffness, stiffness[mates]), stiffness[mates]
        more, less = stiffness > other, stiffness < other
        shares = np.where(more, 1.0, np.where(less, 0.0, 0.5))
        is_soft = np.isfinite(values) & (values > 0.0)
        of_median, median = np.zeros(len(values)), _median_of(values[is_soft])
        if is_soft.any():
            middle = np.quantile(values[is_soft], 0.5, method="inverted_cdf")
            for value in (middle, 2.0 * median - middle):
                nearest = np.abs(np.where(is_soft, values, np.inf) - value)
                ties = nearest == nearest.min()
                of_median += 0.5 * ties / np.count_nonzero(ties)
        soft = np.asarray(np.where(is_soft, values, 0.0) / median, dtype=np.float64)
        soft[(soft <= _LEAST) | (soft >= _MOST)] = 0.0
        return cls(soft, median, of_median, shares, mates)

    def along(self, change: FloatArray) -> FloatArray:
        """Return the change (n,) of the factors with a *change* (n,) of the stiffness."""
        own = self.shares * change + (1.0 - self.shares) * change[self.mates]
        return (np.where(self.soft > 0.0, own, 0.0) - self.soft * (self.of_median @ own)) / (
            self.median
        )

    def adjoint(self, gradient: FloatArray) -> FloatArray:
        """Return the gradient (n,) by the stiffness for a *gradient* (n,) by the factors."""
        own = np.where(self.soft > 0.0, gradient, 0.0)
        own = (own - self.of_median * (self.soft @ gradient)) / self.median
        others = np.bincount(self.mates, (1.0 - self.shares) * own, len(own))
        return np.asarray(self.shares * own + others)


def _median_of(soft: FloatArray) -> float:
    return float(np.median(soft)) if len(soft) else 1.0


def rigid_places(
    rest: FloatArray,
    pose: FloatArray,
    held: BoolArray,
    places: FloatArray,
    *,
    on_tracks: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
) -> FloatArray:
    """Return *rest* (k, 3) moved as one body, with the *held* points (k,) at their *places* (k, 3).

    As far as that leaves it free, points that slide are on their tracks, and as far as this leaves
    it free, the others are where they are in the *pose* (k, 3); each by least squares, and solved
    by Newton's method, in ever shorter steps where they contradict each other.  *on_tracks* returns
    the nearest points (k, 3) of the tracks of (k, 3), and the projections on their normals
    (k, 3, 3), which are 0 for points that do not slide.
    """
    turn, shift = rigid_fit(rest, np.where(held[:, None], places, pose))
    x, size = rest @ turn.T + shift, largest_length(rest - rest.mean(axis=0)) or 1.0
    for turns in range(_ROUNDS):
        centre = x.mean(axis=0)
        motions = _of_one_body((x - centre) / size)
        on_track, normals = on_tracks(x)
        step = _in_turn(
            (motions[held], (places - x)[held] / size),
            (normals @ motions, np.einsum("kab,kb->ka", normals, on_track - x) / size),
            (motions[~held], (pose - x)[~held] / size),
            longest=_LONGEST * _SHORTENED**turns,
        )
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        x = (x - centre) @ turn.T + centre + size * step[3:]
        if np.linalg.norm(step) <= _SHORTEST:
            break
    return x


def _of_one_body(arms: FloatArray) -> FloatArray:
    """Return the motions (k, 3, 6) of *arms* (k, 3) by rotations about three axes, and by shifts.

    Row a of ``motions[:, :, c]`` is e_c x arm.
    """
    turns = np.cross(np.eye(3)[:, None], arms).transpose(1, 2, 0)
    return np.concatenate([turns, np.broadcast_to(np.eye(3), turns.shape)], axis=2)


def _in_turn(*levels: tuple[FloatArray, FloatArray], longest: float) -> FloatArray:
    """Return the z (6,) with A z = b nearly, for each of *levels* as far as those before allow.

    A is (k, 3, 6) and b (k, 3).  What a level adds to the first one has at most the length
    *longest*.
    """
    z, free = np.zeros(6), np.eye(6)
    for a, b in levels:
        rows, off = a.reshape(-1, 6), b.ravel()
        padding = max(0, 6 - len(rows))
        across = np.pad(rows @ free, ((0, padding), (0, 0)))
        u, s, vt = np.linalg.svd(across, full_matrices=False)
        own = s > _RANK * math.sqrt(1 + len(rows))
        along = u.T[own] @ np.pad(off - rows @ z, (0, padding))
        added = free @ (vt[own].T @ (along / s[own]))
        limit = math.inf if a is levels[0][0] else longest
        z = z + added * min(1.0, limit / max(float(np.linalg.norm(added)), _SHORTEST))
        free = free @ vt[~own].T
    return z
