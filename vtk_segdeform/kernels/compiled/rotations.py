"""Closest rotations, for `rotations`: the largest eigenvector of a 4 x 4 matrix.

Source
------
B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", J. Opt. Soc.
Am. A 4(4), 1987.  D. L. Theobald, "Rapid calculation of RMSDs using a quaternion-based
characteristic polynomial", Acta Cryst. A61, 2005.
"""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile, _inline = kernel(), kernel(forceinline=True)

_SWEEPS, _ROUNDS = 12, 40  # most iterations of Jacobi's and Newton's methods
_CLEAR = 4e-3  # least slope, the sum of four cofactors, relative to the cube of the eigenvalue


@_inline()
def _largest(m, scale):
    """Return whether it is found, and the largest eigenvector of N of *m* (3, 3) times *scale*.

    Newton's method on the characteristic polynomial, from above, then a row of cofactors.  With the
    sum a of the squares of S, that of its cofactors b, and its determinant d, the polynomial is

        (t^2 - a)^2 - 4 (b + 2 d t),        so t^2 <= a + 2 sqrt(b + 2 max(d, 0) sqrt(3 a))

    for the largest root t.  In flat cells d is small, and the right side is almost t^2.  It is not
    found if two eigenvalues are too close for that.
    """
    xx, xy, xz = m[0, 0] * scale, m[0, 1] * scale, m[0, 2] * scale
    yx, yy, yz = m[1, 0] * scale, m[1, 1] * scale, m[1, 2] * scale
    zx, zy, zz = m[2, 0] * scale, m[2, 1] * scale, m[2, 2] * scale
    ux, uy, uz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    vx, vy, vz = zy * xz - zz * xy, zz * xx - zx * xz, zx * xy - zy * xx
    wx, wy, wz = xy * yz - xz * yy, xz * yx - xx * yz, xx * yy - xy * yx
    a = xx * xx + xy * xy + xz * xz + yx * yx + yy * yy + yz * yz + zx * zx + zy * zy + zz * zz
    b = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz + wx * wx + wy * wy + wz * wz
    d = xx * ux + xy * uy + xz * uz
    top = math.sqrt(a + 2.0 * math.sqrt(b + 2.0 * max(d, 0.0) * math.sqrt(3.0 * a)))
    if not top > 0.0:
        return False, 1.0, 0.0, 0.0, 0.0
    for _ in range(_ROUNDS):
        square = top * top - a
        slope = 4.0 * top * square - 8.0 * d
        if slope <= _CLEAR * top * top * top:
            return False, 1.0, 0.0, 0.0, 0.0
        step = (square * square - 4.0 * b - 8.0 * d * top) / slope
        top -= step
        if step <= 1e-15 * top:  # a negative one is rounding
            break
    # N - t, its minors of the first two and last two rows, and of these the cofactors.
    n00, n01, n02, n03 = xx + yy + zz - top, yz - zy, zx - xz, xy - yx
    n11, n12, n13 = xx - yy - zz - top, xy + yx, zx + xz
    n22, n23, n33 = yy - xx - zz - top, yz + zy, zz - xx - yy - top
    p01, p02, p03 = n00 * n11 - n01 * n01, n00 * n12 - n02 * n01, n00 * n13 - n03 * n01
    p12, p13, p23 = n01 * n12 - n02 * n11, n01 * n13 - n03 * n11, n02 * n13 - n03 * n12
    r02, r03, r12 = n02 * n23 - n22 * n03, n02 * n33 - n23 * n03, n12 * n23 - n22 * n13
    r13, r23 = n12 * n33 - n23 * n13, n22 * n33 - n23 * n23
    c00 = n11 * r23 - n12 * r13 + n13 * r12
    c11 = n00 * r23 - n02 * r03 + n03 * r02
    c22 = n03 * p13 - n13 * p03 + n33 * p01
    c33 = n02 * p12 - n12 * p02 + n22 * p01
    most = max(abs(c00), abs(c11), abs(c22), abs(c33))
    if abs(c00) == most:
        c01 = n02 * r13 - n01 * r23 - n03 * r12
        c02 = n13 * p23 - n23 * p13 + n33 * p12
        return True, c00, c01, c02, n22 * p13 - n12 * p23 - n23 * p12
    if abs(c11) == most:
        c01 = n02 * r13 - n01 * r23 - n03 * r12
        c12 = n23 * p03 - n03 * p23 - n33 * p02
        return True, c01, c11, c12, n02 * p23 - n22 * p03 + n23 * p02
    c23 = n12 * p03 - n02 * p13 - n23 * p01
    if abs(c22) == most:
        c02 = n13 * p23 - n23 * p13 + n33 * p12
        return True, c02, n23 * p03 - n03 * p23 - n33 * p02, c22, c23
    c03 = n22 * p13 - n12 * p23 - n23 * p12
    return True, c03, n02 * p23 - n22 * p03 + n23 * p02, c23, c33


@_compile()
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


@_compile("const f8[:,:,:], f8[:,:,:]")
def rotations(s, out):
    """Put the rotations R that maximise tr(R S) into *out* (k, 3, 3), for *s* (k, 3, 3).

    With R as a unit quaternion q, tr(R S) = q^T N q for a 4 x 4 matrix N (Horn 1987).
    """
    n = np.empty((4, 4))
    v = np.empty((4, 4))
    for g in range(len(s)):
        m = s[g]
        most = 0.0
        for i in range(3):
            for j in range(3):
                most = max(most, abs(m[i, j]))
        scale = 1.0 / most if most > 0.0 else 1.0
        found, w, x, y, z = _largest(m, scale)
        if not found:
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
            for i in range(4):
                for j in range(i, 4):
                    n[i, j] *= scale
                    n[j, i] = n[i, j]
            _jacobi(n, v)
            w, x, y, z = v[0, 0], v[0, 1], v[0, 2], v[0, 3]
        k = 2.0 / (w * w + x * x + y * y + z * z)
        out[g, 0, 0] = 1.0 - k * (y * y + z * z)
        out[g, 0, 1] = k * (x * y - w * z)
        out[g, 0, 2] = k * (x * z + w * y)
        out[g, 1, 0] = k * (x * y + w * z)
        out[g, 1, 1] = 1.0 - k * (x * x + z * z)
        out[g, 1, 2] = k * (y * z - w * x)
        out[g, 2, 0] = k * (x * z - w * y)
        out[g, 2, 1] = k * (y * z + w * x)
        out[g, 2, 2] = 1.0 - k * (x * x + y * y)
