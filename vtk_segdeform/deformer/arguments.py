"""Checks of the arguments of a `Deformer`: each raises an error that names the argument."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, as_points, is_number, is_whole
from ..cages import Cage
from ..checks import require_sequence, shown
from ..errors import ArgumentError, CageError, ConstraintError

_FARTHEST = 1e3  # sizes of the mesh


def check_options(hold_tolerance: float, stretch: float, rotation_groups: int | None) -> None:
    """Raise an ArgumentError unless all are numbers in their range."""
    if not is_number(hold_tolerance, 0.0):
        raise ArgumentError(f"hold_tolerance must be 0 or more; got {shown(hold_tolerance)}")
    if not is_number(stretch, 0.0):
        raise ArgumentError(f"stretch must be a number, 0 or more; got {shown(stretch)}")
    if rotation_groups is not None and not is_whole(rotation_groups, 1):
        raise ArgumentError(
            f"rotation_groups must be a whole number, 1 or more; got {shown(rotation_groups)}"
        )


def check_distance(targets: FloatArray) -> None:
    """Raise a ConstraintError if *targets*, in units of the mesh's size, are absurdly far away."""
    if max(targets.max(initial=0.0), -targets.min(initial=0.0)) > _FARTHEST:
        raise ConstraintError(
            f"a target is {np.abs(targets).max():.0e} times the mesh's size away from it; "
            "are both in the same unit?"
        )


def stacked_cages(cages: Sequence[Cage], cage_vertices: Sequence[ArrayLike]) -> FloatArray:
    """Return *cage_vertices* (m, 3) of all *cages*, or raise a CageError if they do not fit."""
    require_sequence(cage_vertices, "cage_vertices")
    poses = [as_points(vertices, "cage_vertices") for vertices in cage_vertices]
    expected, got = [cage.n_vertices for cage in cages], [len(pose) for pose in poses]
    if got != expected:
        raise CageError(f"cage_vertices must hold {expected} points, cage by cage; got {got}")
    return np.concatenate(poses)
