"""Stiffness: a factor of the energy at each vertex, and parts that are rigid.

    s = 1         as usual
    s = 5         the surface and the body below it resist bending and stretching five times as much
    s = infinity  rigid: bones, teeth, buttons

Only ratios matter: if all vertices have the same, nothing changes.  Each connected part of rigid
vertices moves as one body, whose place the solve finds.  In the cages it is affine, and rigid
nearly (`subspace.affine_parts`); a finish places it exactly, where it is nearest to their pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, plain
from ..checks import shown
from ..errors import ConstraintError
from ..geometry import rigid_fit
from ..mesh import Mesh
from ..solver import connected_sets
from .symmetry import Mirror

_LEAST, _MOST = 1e-2, 1e2  # of s, in medians


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
        soft = values[~is_rigid & (values > 0.0)]
        usual = np.median(soft) if len(soft) else 1.0
        values = np.clip(np.where(is_rigid, usual, values) / usual, _LEAST, _MOST)
        if not len(rigid) and (values == values[0]).all():
            return None
        return cls(values, tuple(rigid[own] for own in connected_sets(mesh, rigid)))


def rigid_places(rest: FloatArray, pose: FloatArray, weights: FloatArray) -> FloatArray:
    """Return *rest* (k, 3) moved as one body to where it is nearest to *pose* (k, 3).

    In the mean of squares with *weights* (k,).
    """
    turn, shift = rigid_fit(rest, pose, weights)
    return rest @ turn.T + shift
