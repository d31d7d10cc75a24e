"""Few rotations for many: groups of what turns alike, and what they stiffen taken off again.

Bits of surface that turn by a common rotation, instead of each by its own, make the body stiffer.
Where bit f would turn a little by omega_f, and its group g by omega_g, the energy comes out too
large by

    sum_g sum_{f in g}  (omega_f - omega_g)^T M_f (omega_f - omega_g),     M = tr(N) I - N,  N = K p

with p at rest.  Groups are what makes this small: k-means of how bits turn, each in its own
metric M, begun from clusters of position.  Where a limb bends they become bands across it, thin
along it; where nothing bends they stay as wide as they are long.  How bits turn is seen by pulling
at places spread over the cages, along every axis and each time with the same work:

    H u = f,        M omega = b,        b the torque of K u, H the Hessian at rest: `hessian`

What is left of the excess is mostly taken off again.  Let F be the deformation of a bit, as
N^-1 K p tells it.  The energy counts how F of a whole group differs from R_g, and

    sum_g sum_{f in g}  tr (F_f - F_g) N_f (F_f - F_g)^T

for how it varies within; which, like tr(p^T Q p), knows nothing of rotations.  The share of it
that was turning, not stretching, when the body was pulled, is taken out of Q, group by group.
Each share is below 1, so that E is still a sum of squares, and turning the body still costs
nothing.

Bends and twists by 40 to 70 degrees, and pulls, of ten bodies in 300 groups: the distance to the
pose with a rotation for each vertex, root mean square, is 0.6 of what it was with clusters of
position alone (0.4 to 0.8 by body), and what that pose costs is off by some 5 % instead of 20 %.
The mesh is gone through once, for some 2000 bits; groups add up their rows of K.

Source
------
A. Jacobson, I. Baran, L. Kavan, J. Popovic, O. Sorkine, "Fast automatic skinning transformations",
ACM Trans. Graph. 31(4), 2012: clusters by how things move, not by where they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray
from ..geometry import cluster_within_parts, farthest_points
from ..progress import Progress, tell
from .energy import Energy
from .hessian import curved_factor

_PULLS = 12  # places
_HELD = 1e-9  # of the stiffness, to hold a free body
_NEARNESS = 0.3  # what distance counts, beside how bits turn
_ROUNDS = 3  # of k-means
_TAKEN, _MOST = 0.9, 0.95  # of the share that turned: poses are not those few pulls; of all
_DOING = "grouping rotations"
_SOFTEST = 1e-3  # least eigenvalue of N and M, as a share of the largest
_TIE_BREAK = 1e-6  # as in `rotations`


class Response(NamedTuple):
    """What k bits of surface do while the body is pulled, c times in all."""

    metric: FloatArray  # (k, 3, 3), M
    torques: FloatArray  # (k, 3, c), b
    turned: FloatArray  # (k,), sum of omega^T M omega
    varied: FloatArray  # (k,), sum of tr F N F^T
    roots: FloatArray  # (k, 3, m), N^-1/2 K


def join_rotations(
    energy: Energy,
    rest: FloatArray,
    bits: tuple[FloatArray, IntArray, IntArray],
    n_groups: int,
    *,
    progress: Progress | None = None,
) -> tuple[Energy, IntArray]:
    """Return *energy* with fewer rotations, and the group that each of the present ones is in.

    Parameters
    ----------
    energy : Energy
        With k rotations, and `exact`.
    rest : (m, 3) float
        The cage vertices at rest, stacked.
    bits : (k, 3) float, (k,) int, (k,) int
        Of the bit of surface that each rotation belongs to: where it is, in which part, and of
        how many vertices.  No group spans two parts.
    n_groups : int
        About how many; at least one for each part.
    progress : Progress, optional
        Called between the steps; may cancel.
    """
    positions, parts, counts = bits
    rows = np.asarray(energy.fit).reshape(len(parts), 3, -1)
    groups = cluster_within_parts(positions, parts, n_groups)
    tell(progress, 0.0, _DOING)
    pulls = _pulls(energy, rest, progress)
    tell(progress, 0.4, _DOING)
    one = _response(rows, rest, pulls)
    for done in range(_ROUNDS if pulls.size else 0):
        tell(progress, 0.5 + 0.1 * done, _DOING)
        groups = _regrouped(groups, one, positions, parts)

    rows = _added(rows, groups)
    whole = _response(rows, rest, pulls)
    varied = _added(one.varied, groups) - whole.varied
    turned = _added(one.turned, groups) - whole.turned
    share = _TAKEN * np.clip(turned / np.maximum(varied, np.finfo(float).tiny), 0.0, 1.0)
    # Of what varies over n vertices, k equal pieces show only (1 - 1 / k) / (1 - 1 / n).
    n, k = np.bincount(groups, counts), np.bincount(groups).clip(min=2)
    share = np.minimum(share * (1.0 - 1.0 / n) / (1.0 - 1.0 / k), _MOST)
    tell(progress, 0.9, _DOING)
    excess = _squares(one.roots, share[groups]) - _squares(whole.roots, share)
    quadratic = energy.quadratic - _blind_to(rest, excess)
    return _with_rotations(replace(energy, quadratic=quadratic), rows), groups


def _with_rotations(energy: Energy, rows: FloatArray) -> Energy:
    """Return *energy* with K of *rows* (G, 3, m)."""
    k = rows.reshape(-1, rows.shape[2])
    return replace(energy, fit=k, pull=k)


def _pulls(energy: Energy, rest: FloatArray, progress: Progress | None) -> FloatArray:
    """Return (m, c, 3): how cages move as the body is pulled, c / 3 places along three axes.

    A free body is pulled against its own inertia, so that it neither flies nor spins.  None, c =
    0, if nothing holds it together.
    """
    m, mass, hold = len(rest), energy.mass, _HELD * np.trace(energy.quadratic)
    factor = curved_factor(energy.quadratic + hold / np.trace(mass) * mass, energy, rest)
    if factor is None:
        return np.zeros((m, 0, 3))
    tell(progress, 0.2, _DOING)
    axes = np.eye(3)
    shifts = np.broadcast_to(axes[:, None], (3, m, 3))
    fields = np.concatenate([shifts, np.cross(axes[:, None], rest)])
    rigid, inertia = fields.reshape(6, -1), (mass @ fields).reshape(6, -1)
    rigid_share = np.linalg.solve(inertia @ rigid.T, inertia)  # of a move, (6, 3m)
    where = farthest_points(rest, min(_PULLS, m))
    forces = np.einsum("pm,ab->pamb", mass[where], axes).reshape(-1, 3 * m)
    forces -= forces @ rigid.T @ rigid_share
    moves = np.stack(factor.solve_all(list(forces.reshape(-1, m, 3)))).reshape(-1, 3 * m)
    moves -= moves @ rigid_share.T @ rigid
    u, f = moves.reshape(-1, 3, 3 * m), forces.reshape(-1, 3, 3 * m)
    work, ways = np.linalg.eigh(f @ np.swapaxes(u, 1, 2))
    least = 1e-9 * work.max()  # of a cage vertex that moves nothing
    even = np.where(work > least, 1.0 / np.sqrt(np.maximum(work, least)), 0.0)
    u = (even[:, :, None] * np.swapaxes(ways, 1, 2)) @ u
    return np.ascontiguousarray(np.moveaxis(u.reshape(-1, m, 3), 1, 0))


def _response(rows: FloatArray, rest: FloatArray, pulls: FloatArray) -> Response:
    """Return what bits with K *rows* (k, 3, m) do under *pulls* (m, c, 3)."""
    k, _, m = rows.shape
    n = rows @ rest
    sizes, axes = np.linalg.eigh(0.5 * (n + np.swapaxes(n, 1, 2)))
    back, sizes = np.swapaxes(axes, 1, 2), _floored(sizes)
    stiffness = _floored(sizes.sum(axis=1, keepdims=True) - sizes)
    pulled = (rows.reshape(-1, m) @ pulls.reshape(m, -1)).reshape(k, 3, -1)  # K u
    seen = back @ pulled  # about the axes of N
    moved = pulled.reshape(k, 3, -1, 3)
    pairs = (1, 2), (2, 0), (0, 1)
    torques = np.stack([moved[:, a, :, b] - moved[:, b, :, a] for a, b in pairs], axis=1)
    return Response(
        metric=(axes * stiffness[:, None]) @ back,
        torques=torques,
        turned=((back @ torques) ** 2 / stiffness[:, :, None]).sum(axis=(1, 2)),
        varied=((seen**2).sum(axis=2) / sizes).sum(axis=1),
        roots=(back / np.sqrt(sizes)[:, :, None]) @ rows,
    )


def _regrouped(
    groups: IntArray, bits: Response, positions: FloatArray, parts: IntArray
) -> IntArray:
    """Return the group, within its part, that each of the *bits* is nearest to."""
    k, weights = len(groups), np.trace(bits.metric, axis1=1, axis2=2)
    apart = positions - weights @ positions / weights.sum()
    near = _NEARNESS * bits.turned.sum() / (weights @ (apart**2).sum(axis=1))
    metric, mass = _added(bits.metric, groups), _added(weights, groups)
    turns = np.linalg.solve(metric, _added(bits.torques, groups))
    middles = _added(weights[:, None] * apart, groups) / mass[:, None]
    squares = (turns @ np.swapaxes(turns, 1, 2)).reshape(len(turns), -1)
    away = near * (middles**2).sum(axis=1, keepdims=True)
    # The squares written out: what is the bit's times what is the group's, and the bit's own.
    of_bits = [bits.torques.reshape(k, -1), bits.metric.reshape(k, -1), weights[:, None] * apart]
    of_groups = [-2.0 * turns.reshape(len(turns), -1), squares, -2.0 * near * middles, away]
    left, right = np.hstack([*of_bits, weights[:, None]]), np.hstack(of_groups)
    own = bits.turned + near * weights * (apart**2).sum(axis=1)
    favour = 1.0 + _TIE_BREAK * np.random.default_rng(0).random(len(turns))
    home = np.empty(len(turns), dtype=np.int64)
    home[groups] = parts
    found = np.empty_like(groups)
    for part in np.unique(parts):
        here, there = np.flatnonzero(parts == part), np.flatnonzero(home == part)
        cost = left[here] @ right[there].T
        cost += own[here, None]
        cost *= favour[there]
        found[here] = there[cost.argmin(axis=1)]
    return np.unique(found, return_inverse=True)[1]


def _floored(values: FloatArray) -> FloatArray:
    most = np.abs(values).max(axis=1, keepdims=True)
    least = np.maximum(_SOFTEST * most, np.finfo(float).tiny)
    return np.asarray(np.maximum(values, least))


def _added(values: FloatArray, groups: IntArray) -> FloatArray:
    """Return the sums of *values* (k, ...) over each group."""
    order = np.argsort(groups, kind="stable")
    starts = np.searchsorted(groups[order], np.arange(int(groups.max()) + 1))
    return np.asarray(np.add.reduceat(values[order], starts, axis=0))


def _squares(roots: FloatArray, shares: FloatArray) -> FloatArray:
    """Return (m, m), the sum of share r^T r over the rows r of *roots* (k, 3, m)."""
    rows = (roots * np.sqrt(shares)[:, None, None]).reshape(-1, roots.shape[2])
    return np.asarray(rows.T @ rows)


def _blind_to(rest: FloatArray, form: FloatArray) -> FloatArray:
    """Return *form* (m, m) without what it makes of the rest shape moved or stretched."""
    basis, _ = np.linalg.qr(np.hstack([np.ones((len(rest), 1)), rest]))
    form = form - basis @ (basis.T @ form)
    form = form - (form @ basis) @ basis.T
    return np.asarray(0.5 * (form + form.T))
