"""Products of a block of W~ with a few columns, for `blocks`; single precision is widened.

Four rows at a time: what is read of the columns then serves all of them.
"""

from __future__ import annotations

import numba

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})


@_compile
def add_product(x, rows, block, p, start, stop):
    """Add block @ p.T to the *rows* start..stop of *x*, for *p* (k, m) with k a multiple of 3."""
    k, m = p.shape
    four = start + (stop - start) // 4 * 4
    for i in range(start, four, 4):
        b0, b1, b2, b3 = block[i], block[i + 1], block[i + 2], block[i + 3]
        r0, r1, r2, r3 = rows[i], rows[i + 1], rows[i + 2], rows[i + 3]
        for c in range(0, k, 3):
            px, py, pz = p[c], p[c + 1], p[c + 2]
            x0 = y0 = z0 = x1 = y1 = z1 = x2 = y2 = z2 = x3 = y3 = z3 = 0.0
            for j in range(m):
                u, v, w = px[j], py[j], pz[j]
                t = float(b0[j])
                x0 += t * u
                y0 += t * v
                z0 += t * w
                t = float(b1[j])
                x1 += t * u
                y1 += t * v
                z1 += t * w
                t = float(b2[j])
                x2 += t * u
                y2 += t * v
                z2 += t * w
                t = float(b3[j])
                x3 += t * u
                y3 += t * v
                z3 += t * w
            for r, a, b, d in (
                (r0, x0, y0, z0),
                (r1, x1, y1, z1),
                (r2, x2, y2, z2),
                (r3, x3, y3, z3),
            ):
                x[r, c] += a
                x[r, c + 1] += b
                x[r, c + 2] += d
    for i in range(four, stop):
        b0, r0 = block[i], rows[i]
        for c in range(0, k, 3):
            px, py, pz = p[c], p[c + 1], p[c + 2]
            x0 = y0 = z0 = 0.0
            for j in range(m):
                t = float(b0[j])
                x0 += t * px[j]
                y0 += t * py[j]
                z0 += t * pz[j]
            x[r0, c] += x0
            x[r0, c + 1] += y0
            x[r0, c + 2] += z0


@_compile
def add_adjoint(p, rows, block, y):
    """Add (block.T @ y[rows]).T to *p* (3, m), for *y* (n, 3)."""
    m = block.shape[1]
    px, py, pz = p[0], p[1], p[2]
    four = len(rows) // 4 * 4
    for i in range(0, four, 4):
        b0, b1, b2, b3 = block[i], block[i + 1], block[i + 2], block[i + 3]
        r0, r1, r2, r3 = rows[i], rows[i + 1], rows[i + 2], rows[i + 3]
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
