"""A minimum of the objective under its volumes, to first order in whatever it depends on.

    F(p, lambda; theta) = d(p) + G(p)^T lambda = 0        half the gradient of the Lagrangian
    g(p; theta) = 0                                       the volumes

By the implicit function theorem the minimum moves with a parameter theta by

    K (dp, dlambda) = -(dF, dg)/dtheta,      K = [H + sum_k lambda_k d2g_k, G^T; G, 0]

with the exact H, rotations included, and the exact second derivatives of the volumes.  A linear
function <c, p> of the minimum has the gradient -<(v, mu), (dF, dg)/dtheta>, K^T (v, mu) = (c, 0).
So one factor of K serves all parameters and all functions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..arrays import FloatArray, IntArray
from ..energy import rotation_term
from ..errors import ArgumentError
from .gauss_newton import GaussNewton
from .other_measures import AreaConstraint, CentroidConstraint
from .terms import hessian_of, with_terms
from .volume_constraints import Volumes, gradients, violations


@dataclass(frozen=True, eq=False)
class StationaryPoint:
    """A minimum; made by `StationaryPoint.of`."""

    p: FloatArray  # (m, 3)
    multipliers: FloatArray  # lambda, (c,)
    rows: tuple[FloatArray, ...]  # of G, (m, 3) each
    _factor: tuple[FloatArray, IntArray]  # of K

    @classmethod
    def of(
        cls,
        solver: GaussNewton,
        p: FloatArray,
        places: FloatArray,
        exact: FloatArray | None = None,
    ) -> StationaryPoint:
        """Return the minimum at cages *p* (m, 3) for targets *places* (s, 3).

        *exact* are the gradients of other volumes that are kept instead, (c, m, 3), where those of
        *solver* only give the direction of G^T lambda.
        """
        m, volumes, x = len(p), solver.volumes, _surface(solver.volumes, p)
        rows = rows_of(volumes, p)
        across = np.reshape([row.T.ravel() for row in rows], (len(rows), 3 * m))
        slope = half_gradient(solver, p, places)
        multipliers = np.linalg.lstsq(across.T, -slope.T.ravel(), rcond=None)[0]
        lower = -rotation_term(solver.energy, p)
        if (added := hessian_of(solver.terms, p, x)) is not None:
            lower += added
        hessian = np.tril(lower) + np.tril(lower, -1).T
        quadratic = solver.energy.quadratic + solver.positions.quadratic()
        for axis in range(3):
            own = slice(axis * m, (axis + 1) * m)
            hessian[own, own] += quadratic
        hessian += curvature(volumes, p, multipliers)
        kept = across
        if exact is not None:
            kept = np.reshape([row.T.ravel() for row in exact], across.shape)
        corner = np.zeros((len(rows), len(rows)))
        factor = linalg.lu_factor(np.block([[hessian, across.T], [kept, corner]]))
        return cls(p, multipliers, tuple(rows), factor)

    def moved(self, f: FloatArray, g: FloatArray) -> FloatArray:
        """Return dp (m, 3) for changes -*f* (m, 3) of F and -*g* (c,) of the volumes."""
        change = linalg.lu_solve(self._factor, np.concatenate([f.T.ravel(), g]))
        return np.asarray(change[: f.size].reshape(3, -1).T)

    def loads(self, cotangent: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return v (m, 3) and mu (c,) of the function <*cotangent*, p>, (m, 3)."""
        right = np.concatenate([cotangent.T.ravel(), np.zeros(len(self.rows))])
        found = linalg.lu_solve(self._factor, right, trans=1)
        return found[: cotangent.size].reshape(3, -1).T, found[cotangent.size :]


def half_gradient(solver: GaussNewton, p: FloatArray, places: FloatArray) -> FloatArray:
    """Return d, (m, 3), at cages *p* (m, 3) for targets *places* (s, 3)."""
    value, slope = solver.energy.value_and_slope(p)
    _, slope = with_terms(solver.terms, p, _surface(solver.volumes, p), value=value, slope=slope)
    return slope + solver.positions.value_and_slope(p, places)[1]


def rows_of(volumes: Volumes, p: FloatArray) -> list[FloatArray]:
    """Return the rows of G at cages *p* (m, 3), (m, 3) each."""
    return [
        volumes.surface.adjoint(g) for g in gradients(volumes.constraints, _surface(volumes, p))
    ]


def off_volumes(volumes: Volumes, p: FloatArray) -> FloatArray:
    """Return g (c,) at cages *p* (m, 3)."""
    return violations(volumes.constraints, _surface(volumes, p))


def curvature(volumes: Volumes, p: FloatArray, weights: FloatArray) -> FloatArray:
    """Return sum_k weights_k d2g_k/dp2, (3m, 3m), stacked axis by axis, at cages *p* (m, 3).

    Raises
    ------
    ArgumentError
        If an area is among the volumes.
    """
    m, surface = len(p), volumes.surface
    total = np.zeros((3 * m, 3 * m))
    if not volumes.constraints:
        return total
    if any(isinstance(each, AreaConstraint) for each in volumes.constraints):
        raise ArgumentError("there are no derivatives while an area is kept; set it free")
    x, w = surface.map(p), surface.at(np.arange(surface.n_vertices))
    for each, weight in zip(volumes.constraints, weights, strict=True):
        of_faces = None
        if isinstance(each, CentroidConstraint):
            rows = w if each.extension is None else each.extension @ w
            of_faces, rest = each.second_derivatives(each.extended(x), np.asarray(rows))
            total += weight * rest
        halves = (each.hessian_halves(x, of_faces) @ w).reshape(3, len(x), m)
        turned = w.T @ halves
        turned -= np.swapaxes(turned, 1, 2)
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # eps_abc
            total[a * m : (a + 1) * m, b * m : (b + 1) * m] += weight * turned[c]
            total[b * m : (b + 1) * m, a * m : (a + 1) * m] -= weight * turned[c]
    return total


def _surface(volumes: Volumes, p: FloatArray) -> FloatArray:
    return volumes.surface.map(p)
