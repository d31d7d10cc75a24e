"""Rotations of a camera, and checks of its vectors."""

from __future__ import annotations

import math

import numpy as np

from vtk_segdeform.arrays import FloatArray, is_number


def numbers(value: object, count: int) -> FloatArray | None:
    """Return *count* numbers of a file, (count,) float; None if *value* is anything else."""
    values = value if isinstance(value, list) else [value]
    is_sound = len(values) == count and all(map(is_number, values))
    return np.array(values, dtype=float) if is_sound else None


def is_sound(away: FloatArray, up: FloatArray) -> bool:
    """Return whether a camera may look along *away* with *up* on its screen."""
    if not (np.isfinite(away).all() and np.isfinite(up).all()):
        return False
    length = np.linalg.norm(away) * np.linalg.norm(up)
    return bool(length > 0.0 and np.linalg.norm(np.cross(away, up)) > 1e-9 * length)


def rotation(axis: FloatArray, angle: float) -> FloatArray:
    """Return the rotation (3, 3) about *axis* of length 1 by *angle* in radians."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def axis_angle(turn: FloatArray) -> tuple[FloatArray, float]:
    """Return the axis (3,) of length 1 and the angle of a rotation (3, 3)."""
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = float(np.linalg.norm(vector)), float(np.trace(turn)) - 1.0
    if sine > 1e-9:
        return vector / sine, math.atan2(sine, cosine)
    if cosine > 0.0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    axis = np.linalg.eigh(0.5 * (turn + turn.T))[1][:, -1]  # a half turn
    return np.asarray(axis), math.pi
