"""Waypoints: intermediate targets along a screw motion to a far target.

If a handle is rotated by 180 degrees at once, the mesh folds in the first step, and the local
rotations keep the fold.  So a large motion is divided into short ones.  A rigid motion (R, t) is a
screw motion, a rotation about a line and a translation along it (Chasles), and has fractions s:

    x(s) = c + exp(s theta [a]) (x - c) + s (a . t) a

a, theta are the axis and angle of R and c is a point on the axis.  The rest of a handle's motion,
which is not rigid, is rotated along and added in proportion to s.

The angle is at most half a turn, the shorter way: whoever wants more gives targets on the way.
Exactly half a turn can be made in either sense.  The rule: of all points of the handle, the
farthest from its mean along the axis of rotation is in the positive direction of the axis.  So the
sense depends on the handle only, and not on rounding.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray
from ..geometry import rigid_fit

_LONGEST_TURN = np.radians(30.0)
_SHORT_TURN = np.radians(10.0)
LONGEST_MOVE = 0.2
"""Distance between waypoints, at most, as a share of the mesh's size."""
_MOST_MOTIONS = 50
_SAMPLE = 500  # vertices of a large handle that are tested for a far motion
_HALF_TURN = 1e-6  # radians below 180 degrees that count as 180


def waypoints(
    start: FloatArray, end: FloatArray, handles: list[IntArray], share: float = 1.0
) -> list[FloatArray]:
    """Return the targets (k, 3) to solve for in order; the last one is *end*.

    Parameters
    ----------
    start, end : (k, 3) float
        Present and final positions of the handle vertices, mesh size 1.
    handles : list of int arrays
        The indices in 0..k-1 of each handle, which has a motion of its own.
    share : float
        Of the usual distance between waypoints, at most 1.
    """
    samples = [h[:: max(1, len(h) // _SAMPLE)] for h in handles]
    if all(_is_short(start[h], end[h], share) for h in samples):
        return [end]
    motions = [_ScrewMotion(start[h], end[h]) for h in handles]
    length = max([0.0, *(motion.length for motion in motions)])
    count = max(1, min(int(np.ceil(length / share - 1e-6)), _MOST_MOTIONS))
    way = []
    for k in range(1, count):
        targets = np.empty_like(end)
        for handle, motion in zip(handles, motions, strict=True):
            targets[handle] = motion.at(k / count)
        way.append(targets)
    return [*way, end]


def _is_short(start: FloatArray, end: FloatArray, share: float) -> bool:
    """Tell whether a motion is so short that it needs no waypoint; faster than `_ScrewMotion`.

    A rotation by theta moves points by 2 sin(theta / 2) times their distance from its axis, and
    the sum of squared distances is least for the axis along which the points are longest.
    """
    move, mean = end - start, np.full(len(start), 1.0 / len(start))
    if np.einsum("ij,ij->i", move, move).max() > (share * LONGEST_MOVE) ** 2:
        return False
    move -= mean @ move
    arms = start - mean @ start
    about_longest = np.linalg.eigvalsh(arms.T @ arms)[:2].sum()
    return bool(np.vdot(move, move) <= (share * _SHORT_TURN) ** 2 * about_longest)


class _ScrewMotion:
    def __init__(self, start: FloatArray, end: FloatArray) -> None:
        self._start = start
        rotation, self._shift = rigid_fit(start, end)
        turn = Rotation.from_matrix(rotation)
        # The rest of the motion, before the rotation.
        self._remainder = turn.inv().apply(end - self._shift) - start
        rotvec = turn.as_rotvec()
        self._angle = float(np.linalg.norm(rotvec))
        self._axis = rotvec / self._angle if self._angle > 0.0 else np.zeros(3)
        if self._angle > np.pi - _HALF_TURN:
            self._axis = self._axis * _side(self._axis, start)
        # c: the point nearest the origin with R c + t = c + (a . t) a.
        across = self._shift - self._axis * (self._axis @ self._shift)
        half = np.tan(0.5 * self._angle)
        screw = self._angle > 1e-9
        self._centre = 0.5 * (across + np.cross(self._axis, across) / half) if screw else None
        # The longest path of any of its points decides the number of parts.
        way = np.linalg.norm(end - start, axis=1)
        if self._centre is not None:
            arms = np.cross(start - self._centre, self._axis)
            way = np.maximum(way, self._angle * np.linalg.norm(arms, axis=1))
        # In units of the longest motion between two waypoints.
        self.length = max(self._angle / _LONGEST_TURN, float(way.max()) / LONGEST_MOVE)

    def at(self, s: float) -> FloatArray:
        """Return the handle after the fraction *s* of its motion, (k, 3)."""
        points = self._start + s * self._remainder
        if self._centre is None:
            return points + s * self._shift
        turn = Rotation.from_rotvec(s * self._angle * self._axis)
        slide = s * (self._axis @ self._shift) * self._axis
        return np.asarray(self._centre + turn.apply(points - self._centre) + slide)


def _side(axis: FloatArray, points: FloatArray) -> float:
    """Return 1 or -1, so that rounding does not decide the direction of half a turn."""
    along = (points - points.mean(axis=0)) @ axis
    far = along[np.argmax(np.round(np.abs(along), 9))]
    return -1.0 if far < 0.0 else 1.0
