"""Local rotations of the surface, per vertex or per cluster of vertices.

The detail delta of eq. (5) rotates with the surface (b depends on x in eq. (10)).  The rotation R
of a part of the surface brings its rest vectors v_k closest to the deformed ones y_k:

    R = argmax tr(R S),   S = sum_k w_k v_k y_k^T,   S = U Sigma V^T   =>   R = V D U^T

with D = diag(1, 1, det(V U^T)), so that R is never a reflection.

Source
------
O. Sorkine, M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007.  Eqs. (5)-(6).
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray
from ..kernels import compiled_kernels, inputs

_FACES_PER_ROTATION = 40  # of a volume, that take as long


def closest_rotations(covariances: FloatArray) -> FloatArray:
    """Return R, (k, 3, 3), that maximises tr(R S) for each S of *covariances* (k, 3, 3)."""
    if kernels := compiled_kernels(_FACES_PER_ROTATION * len(covariances)):
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


def _smallest_rotation(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation from unit vector *a* to unit vector *b*."""
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-12:  # opposite: by 180 degrees about any perpendicular axis
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        axis /= np.linalg.norm(axis)
        return np.asarray(2.0 * np.outer(axis, axis) - np.eye(3))
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + cosine))
