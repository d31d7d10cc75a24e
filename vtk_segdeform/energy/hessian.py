"""The exact Hessian of the shape energy, local rotations included, and its factor.

The paper's step holds the rotations fixed, so that its Hessian is Q alone; the rotations then
follow one step behind, and stiff directions that are mostly rotation converge slowly.  But their
derivative is known.  With S = K p, one 3 x 3 matrix per cluster, and N = R S its symmetric part,

    f(S) = max_R tr(R S),      f(S + dS) = f(S) + tr(R dS) + 1/2 b^T M^-1 b + ...
    b = axis of (R dS),  b_k = eps_kij (R dS)_ij,      M = tr(N) I - N

b is the torque of dS and M the stiffness against it, both about the same axes, so that half the
Hessian of E = tr(p^T Q p) - 2 sum_g f(K_g p) + c is

    H = Q (x) I  -  sum_g T_g M_g^-1 T_g^T,      T_g^T dp = b

With all of the sum the whole mesh could turn freely about a single handle, so a thousandth is left
out.  Compressed or mirrored clusters can make H indefinite; then the largest share of the sum that
leaves H convex is used.  With no share of it H is the paper's.  Coordinates are stacked axis by
axis.

Source
------
B. Smith, F. de Goes, T. Kim, "Analytic eigensystems for isotropic distortion energies", ACM
Trans. Graph. 38(1), 2019: the twist modes of the rotation's derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg
from scipy.linalg import blas, lapack

from ..arrays import FloatArray
from ..freezing import stored_whole, without_zeros
from ..geometry import closest_rotations
from ..kernels import compiled_kernels
from ..subspace import NUMBERS_PER_FACE
from .energy import Energy

_ROTATION_SHARES = (
    0.999,
    0.99,
    0.96,
    0.8,
    0.5,
)  # of the rotations' term; the first that leaves H convex
LEAST_STIFFNESS = 1e-3  # of a cluster, along or about an axis, as a share of its largest
_MOST_SIDES = 8  # right-hand sides; with more LAPACK is as fast
# eps_kic as (k, c, i): axis of rotation, column of dp, row of R S; k and c side by side.
_EPSILON = np.zeros((9, 3))
for _k, _i, _j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _EPSILON[3 * _k + _j, _i], _EPSILON[3 * _k + _i, _j] = 1.0, -1.0


@dataclass(frozen=True, eq=False)
class Factor:
    """A factored Hessian: (m, m), the same for all three axes, or (3m, 3m)."""

    triangle: FloatArray  # in LAPACK's order; zero above its diagonal
    coupled: bool
    share: float = 0.0  # of the term of the rotations, which the Hessian contains

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"triangle": without_zeros(self.triangle)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, triangle=stored_whole(state["triangle"]))

    def solve(self, y: FloatArray) -> FloatArray:
        """Return H^-1 y, (m, 3), for *y* (m, 3)."""
        return self.solve_all([y])[0]

    def solve_all(self, ys: Sequence[FloatArray]) -> list[FloatArray]:
        """Return H^-1 y for each y (m, 3)."""
        if not ys:
            return []
        n = len(self.triangle)
        solved = np.ascontiguousarray(np.concatenate([y.T for y in ys])).reshape(-1, n)
        kernels = (
            compiled_kernels(n * n // NUMBERS_PER_FACE) if len(solved) <= _MOST_SIDES else None
        )
        if kernels:
            kernels.solve_factored(np.ascontiguousarray(self.triangle.T), solved)
        else:
            solved = lapack.dpotrs(self.triangle, solved.T, lower=1)[0].T
        return [own.T for own in solved.reshape(len(ys), 3, -1)]


def quadratic_factor(hessian: FloatArray) -> Factor | None:
    """Return the factor of a Hessian (m, m) that is the same for all axes; None if not convex."""
    try:
        return Factor(linalg.cholesky(hessian, lower=True), coupled=False)
    except linalg.LinAlgError:
        return None


def full_factor(
    hessian: FloatArray,
    rotations: FloatArray | None,
    *,
    volumes: FloatArray | None = None,
    centroids: FloatArray | None = None,
    added: FloatArray | None = None,
) -> Factor | None:
    """Return the factor of *hessian* (m, m) minus the term of the *rotations*, `rotation_term`.

    The Hessian of the preserved *volumes*, G (3, m, m) of `volume_constraints.Volumes`, is added,
    so is that of *centroids* (3m, 3m), and so is *added* (3m, 3m), which is positive
    semi-definite.  None if no share of the rotations' term leaves the sum convex; with *added*, or
    without *rotations*, no share at all is tried, too.
    """
    m = len(hessian)
    term = np.zeros((3 * m, 3 * m)) if rotations is None else rotations
    shares = (_ROTATION_SHARES if rotations is not None else ()) + (0.0,) * (
        rotations is None or added is not None
    )
    for share in shares:
        full = -share * term
        for axis in range(3):
            block = slice(axis * m, (axis + 1) * m)
            full[block, block] += hessian
        if volumes is not None and share:  # below the diagonal: eps_abc G_c for a > b
            full[m : 2 * m, :m] -= volumes[2]
            full[2 * m :, :m] += volumes[1]
            full[2 * m :, m : 2 * m] -= volumes[0]
        if centroids is not None and share:
            full += centroids
        if added is not None:
            full += added
        try:
            return Factor(
                linalg.cholesky(full, lower=True, overwrite_a=True, check_finite=False),
                coupled=True,
                share=share,
            )
        except linalg.LinAlgError:
            continue
    return None


def rotation_term(energy: Energy, p: FloatArray) -> FloatArray:
    """Return the lower half of sum_g T_g M_g^-1 T_g^T, (3m, 3m), stacked axis by axis."""
    m = len(p)
    total = np.zeros((3 * m, 3 * m))  # its upper half; the transpose is in BLAS's order
    twists = _twists(energy.covariances(p))
    size = sum((3 * len(columns)) ** 2 for _, columns, _ in energy.nonzero_rows)
    kernels = compiled_kernels(size // NUMBERS_PER_FACE)
    for clusters, columns, reduced in energy.nonzero_rows:
        rows = (twists[clusters] @ reduced).reshape(-1, 3 * len(columns))  # T^T in M's own axes
        part = blas.dsyrk(1.0, rows.T, lower=1).T
        places = (m * np.arange(3)[:, None] + columns).ravel()
        if kernels:
            kernels.add_upper(total, part, places)
        else:
            total[np.ix_(places, places)] += part
    return total.T


def turning(energy: Energy, p: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return R and N (G, 3, 3) at *p*: sum_g tr(R_g K_g v) changes by sum_g tr(N_g dS_g).

    *v* (m, 3) is a motion of the cages, and S are the covariances; v remains.
    """
    covariances, moved = energy.covariances(p), energy.covariances(v)
    rotations = closest_rotations(covariances)
    stretched = rotations @ covariances
    symmetric = 0.5 * (stretched + np.swapaxes(stretched, 1, 2))
    root = _roots(np.trace(symmetric, axis1=1, axis2=2)[:, None, None] * np.eye(3) - symmetric)
    epsilon = _EPSILON.reshape(3, 3, 3)  # eps_kic as (k, c, i)
    torque = np.einsum("kji,gij->gk", epsilon, rotations @ moved)
    turned = np.einsum("gak,gab,gb->gk", root, root, torque)
    return rotations, np.einsum("kji,gk,gic->gjc", epsilon, turned, rotations)


def _twists(covariances: FloatArray) -> FloatArray:
    """Return (G, 9, 3), which takes K_g to M^-1/2 T^T, for each axis of rotation and of dp."""
    rotations = closest_rotations(covariances)
    stretched = rotations @ covariances
    symmetric = 0.5 * (stretched + np.swapaxes(stretched, 1, 2))
    trace = np.trace(symmetric, axis1=1, axis2=2)
    root = _roots(trace[:, None, None] * np.eye(3) - symmetric)
    turned = (_EPSILON @ rotations).reshape(-1, 3, 9)  # T^T for each axis c of dp: eps_kic R_i.
    return np.asarray((root @ turned).reshape(-1, 9, 3))


def _roots(stiffness: FloatArray) -> FloatArray:
    """Return U with U^T U = M^-1, (G, 3, 3), for each *stiffness* M; the least ones are raised."""
    (a, _, _), (p, b, _), (q, r, c) = stiffness.transpose(1, 2, 0)
    root = np.zeros(stiffness.shape)
    trace = a + b + c
    with np.errstate(all="ignore"):  # M = L L^T and U = L^-1, where M is firm
        a = np.sqrt(a)
        p, q = p / a, q / a
        b = np.sqrt(b - p * p)
        r = (r - p * q) / b
        c = np.sqrt(c - q * q - r * r)
        root[:, 0, 0], root[:, 1, 1], root[:, 2, 2] = 1.0 / a, 1.0 / b, 1.0 / c
        root[:, 1, 0], root[:, 2, 1] = -p / (a * b), -r / (b * c)
        root[:, 2, 0] = (p * r / b - q) / (a * c)
        # The determinant is at most the least eigenvalue times trace^2.
        is_firm = (a * b * c) ** 2 >= LEAST_STIFFNESS * trace**3
    weak = np.flatnonzero(~is_firm)
    if len(weak):
        least, axes = np.linalg.eigh(stiffness[weak])
        floor = LEAST_STIFFNESS * np.abs(least).max(axis=1, keepdims=True)
        least = np.maximum(np.maximum(least, floor), np.finfo(float).tiny)
        root[weak] = np.swapaxes(axes / np.sqrt(least)[:, None], 1, 2)
    return root
