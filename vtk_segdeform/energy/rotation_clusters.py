"""Rotation clusters: cluster rotations that move alike, and correct the stiffness this adds.

Patches of surface that share one rotation, instead of each having its own, make the body stiffer.
If patch f alone would turn a little by omega_f, and its cluster g by omega_g, the energy is too
large by

    sum_g sum_{f in g}  (omega_f - omega_g)^T M_f (omega_f - omega_g),     M = tr(N) I - N,  N = K p

with p at rest.  The clusters minimise this: k-means of how the patches turn, each in its own
metric M, begun from clusters of position.  Where a limb bends they become bands across it, thin
along it; where nothing bends they stay as wide as they are long.  How patches turn is computed by
pulling at places spread over the cages, along every axis and each time with the same work:

    H u = f,        M omega = b,        b the torque of K u, H the Hessian at rest: `hessian`

Most of the remaining excess is then subtracted.  Let F be the deformation of a patch, N^-1 K p.
The energy measures the difference between F of a whole cluster and R_g, and

    sum_g sum_{f in g}  tr (F_f - F_g) N_f (F_f - F_g)^T

the variation within it; which, like tr(p^T Q p), does not depend on rotations.  The share of it
that was rotation, not stretch, when the body was pulled, is subtracted from Q, cluster by cluster.
Each share is below 1, so that E is still a sum of squares, and turning the body still costs
nothing.

The mesh is traversed once, for some 2000 patches; clusters sum up their rows of K.

Source
------
A. Jacobson, I. Baran, L. Kavan, J. Popovic, O. Sorkine, "Fast automatic skinning transformations",
ACM Trans. Graph. 31(4), 2012: clusters by motion, not by position.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray
from ..geometry import cluster_within_parts, farthest_points, tie_breakers
from ..progress import Progress, tell
from .energy import Energy
from .hessian import LEAST_STIFFNESS, full_factor, rotation_term

_PULLED_PLACES = 12
_ANCHOR = 1e-9  # of the stiffness, against motion of a free body
_DISTANCE_WEIGHT = 0.3  # of distance, relative to rotation
_ROUNDS = 3  # of k-means
# Poses differ from the few pulls, so only this share of their rotation is subtracted; and of all
# variation, this share at most.
_SUBTRACTED, _MOST_SUBTRACTED = 0.9, 0.95
_MESSAGE = "clustering rotations"
_ROUNDING = 1e-13  # of a sum over the patches of a cluster


class _Response(NamedTuple):
    """Responses of k surface patches to c test loads."""

    metric: FloatArray  # (k, 3, 3), M
    torques: FloatArray  # (k, 3, c), b
    turned: FloatArray  # (k,), sum of omega^T M omega
    varied: FloatArray  # (k,), sum of tr F N F^T
    roots: FloatArray  # (k, 3, m), N^-1/2 K


def join_rotations(
    energy: Energy,
    rest: FloatArray,
    patches: tuple[FloatArray, IntArray, IntArray],
    n_clusters: int,
    *,
    shares: FloatArray | None = None,
    progress: Progress | None = None,
) -> tuple[Energy, IntArray]:
    """Return *energy* with fewer rotations, and the new cluster of each of the present ones.

    Parameters
    ----------
    energy : Energy
        With k rotations.
    rest : (m, 3) float
        The cage vertices at rest, stacked.
    patches : (k, 3) float, (k,) int, (k,) int
        Of the patch of surface of each rotation: its position, its part, and its number of
        vertices.  No cluster spans two parts.
    n_clusters : int
        About how many; at least one for each part.
    shares : (number of parts,) float, optional
        Relative number of clusters of each part; by default the number of its rotations.
    progress : Progress, optional
        Called between the steps; may cancel.
    """
    positions, parts, counts = patches
    rows = energy.rotation_operator.reshape(len(parts), 3, -1)
    clusters = cluster_within_parts(positions, parts, n_clusters, shares=shares)
    tell(progress, 0.0, _MESSAGE)
    pulls = _pulls(energy, rest, progress)
    tell(progress, 0.4, _MESSAGE)
    one = _response(rows, rest, pulls)
    for done in range(_ROUNDS if pulls.size else 0):
        tell(progress, 0.5 + 0.1 * done, _MESSAGE)
        clusters = _reassigned(clusters, one, positions, parts)

    rows = _sums(rows, clusters)
    whole = _response(rows, rest, pulls)
    of_patches = _sums(one.varied, clusters)
    varied = of_patches - whole.varied
    turned = _sums(one.turned, clusters) - whole.turned
    alike = varied <= _ROUNDING * of_patches  # patches that deform alike, up to rounding
    share = _SUBTRACTED * np.clip(turned / np.where(alike, np.inf, varied), 0.0, 1.0)
    # Of a variation over n vertices, k equal patches show only (1 - 1 / k) / (1 - 1 / n).
    n, k = np.bincount(clusters, counts), np.bincount(clusters).clip(min=2)
    share = np.minimum(share * (1.0 - 1.0 / n) / (1.0 - 1.0 / k), _MOST_SUBTRACTED)
    tell(progress, 0.9, _MESSAGE)
    excess = _squares(one.roots, share[clusters]) - _squares(whole.roots, share)
    quadratic = energy.quadratic - _invariant(rest, excess)
    return _with_rotations(replace(energy, quadratic=quadratic), rows), clusters


def _with_rotations(energy: Energy, rows: FloatArray) -> Energy:
    """Return *energy* with K of *rows* (G, 3, m)."""
    return replace(energy, rotation_operator=rows.reshape(-1, rows.shape[2]))


def _pulls(energy: Energy, rest: FloatArray, progress: Progress | None) -> FloatArray:
    """Return (m, c, 3): how cages move as the body is pulled at c / 3 places along three axes.

    A free body is pulled against its own inertia, so that it neither translates nor rotates.  c is
    0 if the Hessian at rest is not convex.
    """
    m, mass, anchor = len(rest), energy.mass, _ANCHOR * np.trace(energy.quadratic)
    factor = full_factor(
        energy.quadratic + anchor / np.trace(mass) * mass, rotation_term(energy, rest)
    )
    if factor is None:
        return np.zeros((m, 0, 3))
    tell(progress, 0.2, _MESSAGE)
    axes = np.eye(3)
    shifts = np.broadcast_to(axes[:, None], (3, m, 3))
    fields = np.concatenate([shifts, np.cross(axes[:, None], rest)])
    rigid, inertia = fields.reshape(6, -1), (mass @ fields).reshape(6, -1)
    rigid_share = np.linalg.solve(inertia @ rigid.T, inertia)  # of a motion, (6, 3m)
    where = farthest_points(rest, min(_PULLED_PLACES, m))
    forces = np.einsum("pm,ab->pamb", mass[where], axes).reshape(-1, 3 * m)
    forces -= forces @ rigid.T @ rigid_share
    moves = np.stack(factor.solve_all(list(forces.reshape(-1, m, 3)))).reshape(-1, 3 * m)
    moves -= moves @ rigid_share.T @ rigid
    u, f = moves.reshape(-1, 3, 3 * m), forces.reshape(-1, 3, 3 * m)
    work, modes = np.linalg.eigh(f @ np.swapaxes(u, 1, 2))
    least = 1e-9 * work.max()  # of a cage vertex that moves nothing
    even = np.where(work > least, 1.0 / np.sqrt(np.maximum(work, least)), 0.0)
    u = (even[:, :, None] * np.swapaxes(modes, 1, 2)) @ u
    return np.ascontiguousarray(np.moveaxis(u.reshape(-1, m, 3), 1, 0))


def _response(rows: FloatArray, rest: FloatArray, pulls: FloatArray) -> _Response:
    """Return the response of patches with K *rows* (k, 3, m) to *pulls* (m, c, 3)."""
    k, _, m = rows.shape
    n = rows @ rest
    sizes, axes = np.linalg.eigh(0.5 * (n + np.swapaxes(n, 1, 2)))
    back, sizes = np.swapaxes(axes, 1, 2), _floored(sizes)
    stiffness = _floored(sizes.sum(axis=1, keepdims=True) - sizes)
    pulled = (rows.reshape(-1, m) @ pulls.reshape(m, -1)).reshape(k, 3, -1)  # K u
    seen = back @ pulled  # in the axes of N
    moved = pulled.reshape(k, 3, -1, 3)
    pairs = (1, 2), (2, 0), (0, 1)
    torques = np.stack([moved[:, a, :, b] - moved[:, b, :, a] for a, b in pairs], axis=1)
    return _Response(
        metric=(axes * stiffness[:, None]) @ back,
        torques=torques,
        turned=((back @ torques) ** 2 / stiffness[:, :, None]).sum(axis=(1, 2)),
        varied=((seen**2).sum(axis=2) / sizes).sum(axis=1),
        roots=(back / np.sqrt(sizes)[:, :, None]) @ rows,
    )


def _reassigned(
    clusters: IntArray, patches: _Response, positions: FloatArray, parts: IntArray
) -> IntArray:
    """Return the nearest cluster, within its part, of each of the *patches*."""
    k, weights = len(clusters), np.trace(patches.metric, axis1=1, axis2=2)
    apart = positions - weights @ positions / weights.sum()
    near = _DISTANCE_WEIGHT * patches.turned.sum() / (weights @ (apart**2).sum(axis=1))
    metric, mass = _sums(patches.metric, clusters), _sums(weights, clusters)
    turns = np.linalg.solve(metric, _sums(patches.torques, clusters))
    middles = _sums(weights[:, None] * apart, clusters) / mass[:, None]
    squares = (turns @ np.swapaxes(turns, 1, 2)).reshape(len(turns), -1)
    away = near * (middles**2).sum(axis=1, keepdims=True)
    # The squares expanded: products of a patch and a cluster, and the patch's own square.
    torques, metrics = patches.torques.reshape(k, -1), patches.metric.reshape(k, -1)
    of_patches = [torques, metrics, weights[:, None] * apart]
    of_clusters = [-2.0 * turns.reshape(len(turns), -1), squares, -2.0 * near * middles, away]
    left, right = np.hstack([*of_patches, weights[:, None]]), np.hstack(of_clusters)
    own = patches.turned + near * weights * (apart**2).sum(axis=1)
    favour = tie_breakers(len(turns))
    home = np.empty(len(turns), dtype=np.int64)
    home[clusters] = parts
    found = np.empty_like(clusters)
    for part in np.unique(parts):
        here, there = np.flatnonzero(parts == part), np.flatnonzero(home == part)
        cost = left[here] @ right[there].T
        cost += own[here, None]
        cost *= favour[there]
        found[here] = there[cost.argmin(axis=1)]
    return np.unique(found, return_inverse=True)[1]


def _floored(values: FloatArray) -> FloatArray:
    most = np.abs(values).max(axis=1, keepdims=True)
    least = np.maximum(LEAST_STIFFNESS * most, np.finfo(float).tiny)
    return np.asarray(np.maximum(values, least))


def _sums(values: FloatArray, clusters: IntArray) -> FloatArray:
    """Return the sum of *values* (k, ...) over each cluster."""
    order = np.argsort(clusters, kind="stable")
    starts = np.searchsorted(clusters[order], np.arange(int(clusters.max()) + 1))
    return np.asarray(np.add.reduceat(values[order], starts, axis=0))


def _squares(roots: FloatArray, shares: FloatArray) -> FloatArray:
    """Return (m, m), the sum of share r^T r over the rows r of *roots* (k, 3, m)."""
    rows = (roots * np.sqrt(shares)[:, None, None]).reshape(-1, roots.shape[2])
    return np.asarray(rows.T @ rows)


def _invariant(rest: FloatArray, form: FloatArray) -> FloatArray:
    """Return *form* (m, m) projected so that it is zero for every affine map of the rest shape."""
    basis, _ = np.linalg.qr(np.hstack([np.ones((len(rest), 1)), rest]))
    form = form - basis @ (basis.T @ form)
    form = form - (form @ basis) @ basis.T
    return np.asarray(0.5 * (form + form.T))
