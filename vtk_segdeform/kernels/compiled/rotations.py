"""Closest rotations, for `rotations`: the largest eigenvector of a 4 x 4 matrix.

Source
------
B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", J. Opt. Soc.
Am. A 4(4), 1987.  D. L. Theobald, "Rapid calculation of RMSDs using a quaternion-based
characteristic polynomial", Acta Cryst. A61, 2005.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .kernels import kernel

_compile = kernel()

_SWEEPS, _ROUNDS = 12, 40  # most iterations of Jacobi's and Newton's methods
_CLEAR = 1e-3  # least cofactor, relative to the cube of the largest eigenvalue


@_compile
def _minor(n, i, j):
    """Return the cofactor (i, j) of *n* (4, 4)."""
    r, s, t = (i + 1) % 4, (i + 2) % 4, (i + 3) % 4
    u, v, w = (j + 1) % 4, (j + 2) % 4, (j + 3) % 4
    sign = -1.0 if (i + j) % 2 else 1.0
    return sign * (
        n[r, u] * (n[s, v] * n[t, w] - n[s, w] * n[t, v])
        - n[r, v] * (n[s, u] * n[t, w] - n[s, w] * n[t, u])
        + n[r, w] * (n[s, u] * n[t, v] - n[s, v] * n[t, u])
    )


@_compile
def _largest(n, q):
    """Put the eigenvector of the largest eigenvalue of *n* (4, 4), trace 0, into *q*.

    Newton's method on the characteristic polynomial, from above, then a row of cofactors.  Returns
    False if two eigenvalues are too close for that.
    """
    square = 0.0
    for i in range(4):
        for j in range(4):
            square += n[i, j] * n[i, j]
    c2 = -0.5 * square
    c0 = c1 = 0.0
    best: Any = np.int64(0)  # literals would compile `_minor` once more for each
    most = 0.0
    for j in range(4):
        c1 -= _minor(n, j, j)
        c0 += n[0, j] * _minor(n, best, j)
    top = math.sqrt(0.75 * square)  # not below the largest eigenvalue
    if not top > 0.0:
        return False
    for _ in range(_ROUNDS):
        value = ((top * top + c2) * top + c1) * top + c0
        slope = (4.0 * top * top + 2.0 * c2) * top + c1
        if slope <= 0.0:
            return False
        step = value / slope
        top -= step
        if abs(step) <= 1e-15 * top:
            break
    else:
        return False
    for i in range(4):
        n[i, i] -= top
    for i in range(4):
        size = abs(_minor(n, i, i))
        if size > most:
            best, most = i, size
    for j in range(4):
        q[j] = _minor(n, best, j)
    for i in range(4):
        n[i, i] += top
    return most > _CLEAR * top * top * top


@_compile
def _jacobi(n, v):
    """Put the eigenvector into the first row of *v*, by Jacobi's method, to the last digit."""
    scale = 0.0
    for i in range(4):
        for j in range(4):
            v[i, j] = 1.0 if i == j else 0.0
            scale += n[i, j] * n[i, j] if j >= i else 0.0
    for _ in range(_SWEEPS):
        off = 0.0
        for i in range(3):
            for j in range(i + 1, 4):
                off += n[i, j] * n[i, j]
        if off <= 1e-34 * scale:
            break
        for i in range(3):
            for j in range(i + 1, 4):
                if n[i, j] == 0.0:
                    continue
                theta = (n[j, j] - n[i, i]) / (2.0 * n[i, j])
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                d = t * c
                for k in range(4):
                    a, b = n[k, i], n[k, j]
                    n[k, i], n[k, j] = c * a - d * b, d * a + c * b
                for k in range(4):
                    a, b = n[i, k], n[j, k]
                    n[i, k], n[j, k] = c * a - d * b, d * a + c * b
                    a, b = v[i, k], v[j, k]
                    v[i, k], v[j, k] = c * a - d * b, d * a + c * b
    best = 0
    for i in range(1, 4):
        if n[i, i] > n[best, best]:
            best = i
    for k in range(4):
        v[0, k], v[best, k] = v[best, k], v[0, k]


@_compile
def rotations(s, out):
    """Put the rotations R that maximise tr(R S) into *out* (k, 3, 3), for *s* (k, 3, 3).

    With R as a unit quaternion q, tr(R S) = q^T N q for a 4 x 4 matrix N (Horn 1987).
    """
    n = np.empty((4, 4))
    v = np.empty((4, 4))
    for g in range(len(s)):
        m = s[g]
        n[0, 0] = m[0, 0] + m[1, 1] + m[2, 2]
        n[0, 1] = m[1, 2] - m[2, 1]
        n[0, 2] = m[2, 0] - m[0, 2]
        n[0, 3] = m[0, 1] - m[1, 0]
        n[1, 1] = m[0, 0] - m[1, 1] - m[2, 2]
        n[1, 2] = m[0, 1] + m[1, 0]
        n[1, 3] = m[2, 0] + m[0, 2]
        n[2, 2] = m[1, 1] - m[0, 0] - m[2, 2]
        n[2, 3] = m[1, 2] + m[2, 1]
        n[3, 3] = m[2, 2] - m[0, 0] - m[1, 1]
        most = 0.0
        for i in range(4):
            for j in range(i, 4):
                most = max(most, abs(n[i, j]))
        most = most if most > 0.0 else 1.0
        for i in range(4):
            for j in range(i, 4):
                n[i, j] /= most
                n[j, i] = n[i, j]
        if not _largest(n, v[0]):
            _jacobi(n, v)
        w, x, y, z = v[0, 0], v[0, 1], v[0, 2], v[0, 3]
        size = w * w + x * x + y * y + z * z
        k = 2.0 / size
        out[g, 0, 0] = 1.0 - k * (y * y + z * z)
        out[g, 0, 1] = k * (x * y - w * z)
        out[g, 0, 2] = k * (x * z + w * y)
        out[g, 1, 0] = k * (x * y + w * z)
        out[g, 1, 1] = 1.0 - k * (x * x + z * z)
        out[g, 1, 2] = k * (y * z - w * x)
        out[g, 2, 0] = k * (x * z - w * y)
        out[g, 2, 1] = k * (y * z + w * x)
        out[g, 2, 2] = 1.0 - k * (x * x + y * y)
