"""Products of W~ with a few columns, for `subspace.Subspace`; accumulated in double precision.

Several rows are processed at a time, so that the columns are read less often.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel(fastmath={"reassoc", "contract"})


@_compile(
    "f8[:,:], const i8[:], const f8[:,:], f8[:,:], i8, i8",
    "f8[:,:], const i8[:], const f4[:,:], f8[:,:], i8, i8",
)
def add_product(x, rows, block, p, start, stop):
    """Add block @ p.T to *rows* start..stop of *x*, for *p* (k, m), k a multiple of 3."""
    four = start + (stop - start) // 4 * 4
    for i in range(start, four, 4):
        b0, b1, b2, b3 = block[i], block[i + 1], block[i + 2], block[i + 3]
        for c in range(0, len(p), 3):
            p0, p1, p2 = p[c], p[c + 1], p[c + 2]
            q0 = q1 = q2 = r0 = r1 = r2 = s0 = s1 = s2 = t0 = t1 = t2 = 0.0
            for j in range(len(b0)):
                d0, d1, d2 = p0[j], p1[j], p2[j]
                q, r, s, t = float(b0[j]), float(b1[j]), float(b2[j]), float(b3[j])
                q0 += q * d0
                q1 += q * d1
                q2 += q * d2
                r0 += r * d0
                r1 += r * d1
                r2 += r * d2
                s0 += s * d0
                s1 += s * d1
                s2 += s * d2
                t0 += t * d0
                t1 += t * d1
                t2 += t * d2
            for k, d0, d1, d2 in (
                (np.uint64(rows[i]), q0, q1, q2),
                (np.uint64(rows[i + 1]), r0, r1, r2),
                (np.uint64(rows[i + 2]), s0, s1, s2),
                (np.uint64(rows[i + 3]), t0, t1, t2),
            ):
                x[k, c] += d0
                x[k, c + 1] += d1
                x[k, c + 2] += d2
    for i in range(four, stop):
        _add_row(x, rows[i], block[i], p)


@_compile()
def _add_row(x, row, b, p):
    for c in range(len(p)):
        q, s = p[c], 0.0
        for j in range(len(b)):
            s += float(b[j]) * q[j]
        x[row, c] += s


@_compile(
    "f8[:,:], const i8[:], const f8[:,:], f8[:,:]", "f8[:,:], const i8[:], const f4[:,:], f8[:,:]"
)
def add_adjoint(p, rows, block, y):
    """Add (block.T @ y[rows]).T to *p* (3, m), for *y* (n, 3)."""
    m = block.shape[1]
    px, py, pz = p[0], p[1], p[2]
    four = len(rows) // 4 * 4
    for i in range(0, four, 4):
        b0, b1, b2, b3 = block[i], block[i + 1], block[i + 2], block[i + 3]
        r0, r1 = np.uint64(rows[i]), np.uint64(rows[i + 1])
        r2, r3 = np.uint64(rows[i + 2]), np.uint64(rows[i + 3])
        x0, y0, z0 = y[r0, 0], y[r0, 1], y[r0, 2]
        x1, y1, z1 = y[r1, 0], y[r1, 1], y[r1, 2]
        x2, y2, z2 = y[r2, 0], y[r2, 1], y[r2, 2]
        x3, y3, z3 = y[r3, 0], y[r3, 1], y[r3, 2]
        for j in range(m):
            s, t, u, v = float(b0[j]), float(b1[j]), float(b2[j]), float(b3[j])
            px[j] += s * x0 + t * x1 + u * x2 + v * x3
            py[j] += s * y0 + t * y1 + u * y2 + v * y3
            pz[j] += s * z0 + t * z1 + u * z2 + v * z3
    for i in range(four, len(rows)):
        b0, r0 = block[i], rows[i]
        x0, y0, z0 = y[r0, 0], y[r0, 1], y[r0, 2]
        for j in range(m):
            t = float(b0[j])
            px[j] += t * x0
            py[j] += t * y0
            pz[j] += t * z0
