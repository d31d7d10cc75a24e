"""Local rotations: how each bit of surface has turned, per vertex or per cluster of vertices.

The detail delta of eq. (5) turns with the surface (b depends on x in eq. (10)).  The turn of a
bit of surface is the rotation R that brings its rest vectors v_k closest to the present ones y_k:

    R = argmax tr(R S),   S = sum_k w_k v_k y_k^T,   S = U Sigma V^T   =>   R = V D U^T

with D = diag(1, 1, det(V U^T)), so that R never mirrors.

Source
------
O. Sorkine, M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007.  Eqs. (5)-(6).
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray
from ..kernels import compiled_kernels, inputs

_TIMES = 40  # as long as a face of a volume takes each


def closest_rotations(covariances: FloatArray) -> FloatArray:
    """Return the (k, 3, 3) rotations R that maximise tr(R S) for each of the (k, 3, 3) S."""
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

    Points on a line or a single point leave R undetermined; the smallest such turn is returned.
    """
    weights = np.ones(len(rest)) if weights is None else weights
    from_, to = weights @ rest / weights.sum(), weights @ moved / weights.sum()
    a, b = rest - from_, moved - to
    covariance = (a * weights[:, None]).T @ b
    u, s, vt = np.linalg.svd(covariance)
    if s[0] <= 1e-12 * (np.abs(weights) @ (a * a).sum(axis=1)):
        rotation = np.eye(3)
    elif s[1] <= 1e-9 * s[0]:
        rotation = _turn_onto(u[:, 0], vt[0])
    else:
        rotation = closest_rotations(covariance[None])[0]
    return rotation, to - rotation @ from_


def _turn_onto(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation that turns unit vector *a* onto unit vector *b*."""
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-12:  # opposite: half a turn about any axis across
        across = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        across /= np.linalg.norm(across)
        return np.asarray(2.0 * np.outer(across, across) - np.eye(3))
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + cosine))
