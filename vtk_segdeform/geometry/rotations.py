"""Local rotations of the surface, per vertex or per group of vertices.

The detail delta of eq. (5) rotates with the surface (b depends on x in eq. (10)).  The rotation R
of a part of the surface brings its rest vectors v_k closest to the deformed ones y_k:

    R = argmax tr(R S),   S = sum_k w_k v_k y_k^T,   S = U Sigma V^T   =>   R = V D U^T

with D = diag(1, 1, det(V U^T)), so that R is never a reflection.

Groups of vertices may share one rotation; they are clusters of positions (k-means), seeded at
the points farthest from each other.

Source
------
O. Sorkine, M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007.  Eqs. (5)-(6).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, is_whole
from ..errors import ArgumentError
from ..kernels import compiled_kernels, inputs, n_threads

_TIMES = 40  # as long as a face of a volume takes each
_MANY, _EACH = 8000, 10  # positions: so many tell where clusters are, or so many for each
_WORTH = 2000  # positions; fewer are looked up in one thread
_EQUAL = 4  # nearest centres among which the favoured one is found
_TIE_BREAK = 1e-6  # relative: of equal distances one is preferred, the same in every frame


def closest_rotations(covariances: FloatArray) -> FloatArray:
    """Return R, (k, 3, 3), that maximises tr(R S) for each S of *covariances* (k, 3, 3)."""
    if kernels := compiled_kernels(_TIMES * len(covariances)):
        kernels.rotations(*inputs(covariances), found := np.empty(covariances.shape))
        return found
    u, _, vt = np.linalg.svd(covariances)
    mirrored = np.linalg.det(u) * np.linalg.det(vt) < 0.0
    vt[mirrored, 2] *= -1.0
    return np.swapaxes(u @ vt, 1, 2)


def rigid_fit(
    rest: FloatArray, moved: FloatArray, weights: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return (R, t) of the rigid motion that brings *rest* (k, 3) closest to *moved* (k, 3).

    For collinear or coincident points, which do not determine R, the smallest rotation is returned.
    """
    weights = np.ones(len(rest)) if weights is None else weights
    from_, to = weights @ rest / weights.sum(), weights @ moved / weights.sum()
    a, b = rest - from_, moved - to
    covariance = (a * weights[:, None]).T @ b
    u, s, vt = np.linalg.svd(covariance)
    if s[0] <= 1e-12 * (np.abs(weights) @ (a * a).sum(axis=1)):
        rotation = np.eye(3)
    elif s[1] <= 1e-9 * s[0]:
        rotation = _smallest_rotation(u[:, 0], vt[0])
    else:
        rotation = closest_rotations(covariance[None])[0]
    return rotation, to - rotation @ from_


def group_by_position(
    positions: FloatArray, n_groups: int, *, rounds: int = 5, seeded: bool = True
) -> IntArray:
    """Return (n,) int: the cluster, 0..k-1 with k <= *n_groups*, that each position belongs to.

    Not *seeded* at the points farthest from each other they begin anywhere, which is quicker.

    Deterministic, and the same in every frame of reference: where a symmetric shape leaves many
    distances equal, a random number that belongs to the vertex decides, and rounding does not.
    """
    n_groups = min(n_groups, len(positions))
    rng = np.random.default_rng(0)
    favour = 1.0 + _TIE_BREAK * rng.random(len(positions))
    some = positions  # of many, these tell where the clusters are
    enough = max(_MANY, _EACH * n_groups)
    if len(positions) > enough:
        some = positions[np.sort(rng.permutation(len(positions))[:enough])]
    if seeded:
        centres = some[_farthest_points(some, n_groups, favour[: len(some)])]
    else:
        centres = some[rng.permutation(len(some))[:n_groups]]
    for _ in range(rounds - 1):
        labels = _numbered(_nearest(some, centres, favour))
        counts = np.bincount(labels)
        centres = np.stack([np.bincount(labels, p) / counts for p in some.T], axis=1)
    return _numbered(_nearest(positions, centres, favour))


def rotation_groups(
    positions: FloatArray, parts: IntArray, n_groups: int, *, quick: bool = False
) -> IntArray:
    """Return (n,) int: about *n_groups* clusters of position, none of which spans two *parts*.

    *parts* (n,) are numbers from 0 on; not all need be there.  *quick* ones are less even.
    """
    rounds, seeded = (3, False) if quick else (5, True)
    if not is_whole(n_groups, 1):
        raise ArgumentError(f"rotation groups must be a whole number, 1 or more; got {n_groups!r}")
    parts, groups = _numbered(parts), np.empty(len(positions), dtype=np.int64)
    used = 0
    by_part = np.argsort(parts, kind="stable")
    for here in np.split(by_part, np.cumsum(np.bincount(parts))[:-1]):
        share = max(1, round(n_groups * len(here) / len(positions)))
        local = group_by_position(positions[here], share, rounds=rounds, seeded=seeded)
        groups[here] = used + local
        used += int(local.max()) + 1
    return groups


def farthest_points(positions: FloatArray, count: int) -> IntArray:
    """Return (count,) int: some of *positions* (n, 3), each the farthest from those before it.

    The same in every frame; see `group_by_position`.
    """
    return _farthest_points(positions, count, _favour(len(positions)))


def _favour(count: int) -> FloatArray:
    return 1.0 + _TIE_BREAK * np.random.default_rng(0).random(count)


def _farthest_points(positions: FloatArray, count: int, favour: FloatArray) -> IntArray:
    chosen = np.empty(count, dtype=np.int64)
    x = np.ascontiguousarray(positions.T)
    way, towards = np.empty_like(x), np.empty(len(positions))

    def squares(centre: FloatArray) -> FloatArray:
        np.subtract(x, centre[:, None], out=way)
        return np.asarray(np.add.reduce(np.multiply(way, way, out=way), axis=0, out=towards))

    distance = squares(x.mean(axis=1)).copy()
    for k in range(count):
        chosen[k] = np.argmax(distance * favour)
        near = squares(x[:, chosen[k]])
        distance = near.copy() if k == 0 else np.minimum(distance, near, out=distance)
    return chosen


def _numbered(labels: IntArray) -> IntArray:
    number = np.cumsum(np.bincount(labels) > 0) - 1
    return np.asarray(number[labels], dtype=np.int64)


def _nearest(positions: FloatArray, centres: FloatArray, favour: FloatArray) -> IntArray:
    few = min(_EQUAL, len(centres))
    workers = n_threads() if len(positions) > _WORTH else 1  # threads are started at every call
    distance, which = cKDTree(centres).query(positions, k=[*range(1, few + 1)], workers=workers)
    best = (distance**2 * favour[which]).argmin(axis=1)
    return np.asarray(np.take_along_axis(which, best[:, None], axis=1)[:, 0], dtype=np.int64)


def _smallest_rotation(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation from unit vector *a* to unit vector *b*."""
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-12:  # opposite: by 180 degrees about any perpendicular axis
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        axis /= np.linalg.norm(axis)
        return np.asarray(2.0 * np.outer(axis, axis) - np.eye(3))
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + cosine))
