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
from scipy import linalg, sparse

from ..arrays import FloatArray, IntArray
from ..energy import rotation_term
from ..errors import ArgumentError
from ..subspace import Subspace
from .gauss_newton import GaussNewton
from .other_measures import AreaConstraint, CentroidConstraint
from .terms import hessian_of, with_terms
from .volumes import Volumes, violations

_AXES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))  # a, b, c with eps_abc = 1


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
        if rows:
            hessian += Curvature.of(volumes, p, multipliers).matrix(m)
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


def rows_of(volumes: Volumes, p: FloatArray) -> tuple[FloatArray, ...]:
    """Return the rows of G at cages *p* (m, 3), (m, 3) each."""
    return volumes.rows(_surface(volumes, p))


def off_volumes(volumes: Volumes, p: FloatArray) -> FloatArray:
    """Return g (c,) at cages *p* (m, 3)."""
    return violations(volumes.constraints, _surface(volumes, p))


@dataclass(frozen=True, eq=False)
class Curvature:
    """sum_k w_k d2g_k/dp2 at cages p (m, 3): W~^T A W~, with A of the points and sparse.

    ``A[a, b] = sum_c eps_abc turned_c`` of the axes a, b, and that of centroids, *rest* (3m, 3m).
    """

    surface: Subspace
    turned: list[sparse.csr_array]  # (n, n) for each axis c
    rest: FloatArray | float

    @classmethod
    def of(cls, volumes: Volumes, p: FloatArray, weights: FloatArray) -> Curvature:
        """Return that of *volumes* with *weights* (c,); ArgumentError if an area is among them."""
        if any(isinstance(each, AreaConstraint) for each in volumes.constraints):
            raise ArgumentError("there are no derivatives while an area is kept; set it free")
        x, n = volumes.surface.map(p), volumes.surface.n_vertices
        halves, rest = sparse.csr_array((3 * n, n)), 0.0
        for each, weight in zip(volumes.constraints, weights, strict=True):
            of_faces = None
            if isinstance(each, CentroidConstraint):
                rows = volumes.surface.at(np.arange(n))
                rows = rows if each.extension is None else np.asarray(each.extension @ rows)
                of_faces, more = each.second_derivatives(each.extended(x), rows)
                rest = rest + weight * more
            halves = halves + weight * each.hessian_halves(x, of_faces)
        parts = [halves[c * n : (c + 1) * n] for c in range(3)]
        return cls(volumes.surface, [sparse.csr_array(part - part.T) for part in parts], rest)

    def matrix(self, m: int) -> FloatArray:
        """Return it for m cage vertices, (3m, 3m), stacked axis by axis."""
        total = np.zeros((3 * m, 3 * m)) + self.rest
        for a, b, c in _AXES:
            block = self.surface.adjoint(self.surface.premultiplied(self.turned[c]))
            total[a * m : (a + 1) * m, b * m : (b + 1) * m] += block
            total[b * m : (b + 1) * m, a * m : (a + 1) * m] -= block
        return total

    def times(self, v: FloatArray) -> FloatArray:
        """Return its product with a motion *v* of the cages, (m, 3)."""
        moved = self.surface.map(v)
        found = np.zeros_like(moved)
        for a, b, c in _AXES:
            found[:, a] += self.turned[c] @ moved[:, b]
            found[:, b] -= self.turned[c] @ moved[:, a]
        product = self.surface.adjoint(found)
        if isinstance(self.rest, float):
            return product
        return product + np.reshape(self.rest @ v.T.ravel(), (3, -1)).T


def _surface(volumes: Volumes, p: FloatArray) -> FloatArray:
    return volumes.surface.map(p)
