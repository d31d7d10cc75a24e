"""Products of a block of W~ with a few columns, for `blocks`; single precision is widened."""

from __future__ import annotations

import numba

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})


@_compile
def add_points(x, rows, block, p, start, stop):
    """Add block @ p.T to the *rows* start..stop of *x*, for *p* (3, m).

    Four rows at a time: what is read of p then serves all of them.
    """
    m = p.shape[1]
    p0, p1, p2 = p[0], p[1], p[2]
    four = start + (stop - start) // 4 * 4
    for i in range(start, four, 4):
        u, v, w, z = block[i], block[i + 1], block[i + 2], block[i + 3]
        u0 = u1 = u2 = v0 = v1 = v2 = w0 = w1 = w2 = z0 = z1 = z2 = 0.0
        for j in range(m):
            a, b, c = p0[j], p1[j], p2[j]
            s = float(u[j])
            u0 += s * a
            u1 += s * b
            u2 += s * c
            s = float(v[j])
            v0 += s * a
            v1 += s * b
            v2 += s * c
            s = float(w[j])
            w0 += s * a
            w1 += s * b
            w2 += s * c
            s = float(z[j])
            z0 += s * a
            z1 += s * b
            z2 += s * c
        row = rows[i]
        x[row, 0] += u0
        x[row, 1] += u1
        x[row, 2] += u2
        row = rows[i + 1]
        x[row, 0] += v0
        x[row, 1] += v1
        x[row, 2] += v2
        row = rows[i + 2]
        x[row, 0] += w0
        x[row, 1] += w1
        x[row, 2] += w2
        row = rows[i + 3]
        x[row, 0] += z0
        x[row, 1] += z1
        x[row, 2] += z2
    for i in range(four, stop):
        u, row = block[i], rows[i]
        u0 = u1 = u2 = 0.0
        for j in range(m):
            s = float(u[j])
            u0 += s * p0[j]
            u1 += s * p1[j]
            u2 += s * p2[j]
        x[row, 0] += u0
        x[row, 1] += u1
        x[row, 2] += u2


@_compile
def add_product(x, rows, block, p, start, stop):
    """Add block @ p.T to the *rows* start..stop of *x*, for *p* (k, m) with k a multiple of 3.

    Six columns, then three at a time, so that each row of the block is read as seldom as can be.
    """
    k, m = p.shape
    for i in range(start, stop):
        w, row = block[i], rows[i]
        c = 0
        while c + 6 <= k:
            p0, p1, p2, p3, p4, p5 = p[c], p[c + 1], p[c + 2], p[c + 3], p[c + 4], p[c + 5]
            s0 = s1 = s2 = s3 = s4 = s5 = 0.0
            for j in range(m):
                v = float(w[j])
                s0 += v * p0[j]
                s1 += v * p1[j]
                s2 += v * p2[j]
                s3 += v * p3[j]
                s4 += v * p4[j]
                s5 += v * p5[j]
            x[row, c] += s0
            x[row, c + 1] += s1
            x[row, c + 2] += s2
            x[row, c + 3] += s3
            x[row, c + 4] += s4
            x[row, c + 5] += s5
            c += 6
        while c + 3 <= k:
            p0, p1, p2 = p[c], p[c + 1], p[c + 2]
            s0 = s1 = s2 = 0.0
            for j in range(m):
                v = float(w[j])
                s0 += v * p0[j]
                s1 += v * p1[j]
                s2 += v * p2[j]
            x[row, c] += s0
            x[row, c + 1] += s1
            x[row, c + 2] += s2
            c += 3


@_compile
def add_adjoint(p, rows, block, y):
    """Add (block.T @ y[rows]).T to *p* (3, m), for *y* (n, 3)."""
    m = block.shape[1]
    p0, p1, p2 = p[0], p[1], p[2]
    for i in range(len(rows)):
        w, row = block[i], rows[i]
        y0, y1, y2 = y[row, 0], y[row, 1], y[row, 2]
        for j in range(m):
            v = float(w[j])
            p0[j] += v * y0
            p1[j] += v * y1
            p2[j] += v * y2
