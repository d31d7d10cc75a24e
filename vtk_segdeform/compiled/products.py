"""Products of a block of W~ with a few columns, for `blocks`; single precision is widened."""

from __future__ import annotations

import numba

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})


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
