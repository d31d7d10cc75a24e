"""Products of W~ with a few columns, for `blocks` and `patches`; single precision is widened.

Four rows at a time: what is read of the columns then serves all of them.
"""

from __future__ import annotations

import numba
import numpy as np

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


@_compile
def put_patches(x, base, p, vertices, columns, left, right, starts, first, last):
    """Put W~ @ p.T into *x* for some patches of `patches.Patches`; *p* is (k, m), k by threes.

    To the first three columns *base* (n, 3) is added; or (0, 3), which is nothing.
    """
    most = 0
    for t in range(first, last):
        most = max(most, starts[t + 1, 0] - starts[t, 0])
    sums = np.empty((3, most + 72))  # 72: rows a power of two apart would share cache lines
    here = np.empty((3, p.shape[1]))
    for t in range(first, last):
        ids = vertices[starts[t, 0] : starts[t + 1, 0]]
        own = columns[starts[t, 1] : starts[t + 1, 1]]
        n, c = len(ids), len(own)
        rank = (starts[t + 1, 3] - starts[t, 3]) // c
        u, v = left[starts[t, 2] : starts[t + 1, 2]], right[starts[t, 3] : starts[t + 1, 3]]
        turned = np.zeros((3, (rank + 3) // 4 * 4))
        for a in range(0, len(p), 3):
            for d in range(3):
                for j in range(c):
                    here[d, j] = p[a + d, own[j]]
            for k in range(rank):
                row = v[k * c : (k + 1) * c]
                q0 = q1 = q2 = 0.0
                for j in range(c):
                    w = float(row[j])
                    q0 += w * here[0, j]
                    q1 += w * here[1, j]
                    q2 += w * here[2, j]
                turned[0, k], turned[1, k], turned[2, k] = q0, q1, q2
            _add_rows(sums, u, turned, n, rank)
            if a == 0 and len(base) > 0:
                for i in range(n):
                    r = ids[i]
                    x[r, 0] = base[r, 0] + sums[0, i]
                    x[r, 1] = base[r, 1] + sums[1, i]
                    x[r, 2] = base[r, 2] + sums[2, i]
            else:
                for i in range(n):
                    r = ids[i]
                    x[r, a], x[r, a + 1], x[r, a + 2] = sums[0, i], sums[1, i], sums[2, i]


@_compile
def _add_rows(sums, u, q, n, rank):
    """Put q @ u into *sums* (3, n), for the *rank* rows u of *n* numbers and *q* (3, rank)."""
    x, y, z = sums[0], sums[1], sums[2]
    x[:n], y[:n], z[:n] = 0.0, 0.0, 0.0
    four = rank // 4 * 4
    for k in range(0, four, 4):
        u0, u1 = u[k * n : (k + 1) * n], u[(k + 1) * n : (k + 2) * n]
        u2, u3 = u[(k + 2) * n : (k + 3) * n], u[(k + 3) * n : (k + 4) * n]
        x0, x1, x2, x3 = q[0, k], q[0, k + 1], q[0, k + 2], q[0, k + 3]
        y0, y1, y2, y3 = q[1, k], q[1, k + 1], q[1, k + 2], q[1, k + 3]
        z0, z1, z2, z3 = q[2, k], q[2, k + 1], q[2, k + 2], q[2, k + 3]
        for i in range(n):
            a, b, c, d = float(u0[i]), float(u1[i]), float(u2[i]), float(u3[i])
            x[i] += a * x0 + b * x1 + c * x2 + d * x3
            y[i] += a * y0 + b * y1 + c * y2 + d * y3
            z[i] += a * z0 + b * z1 + c * z2 + d * z3
    for k in range(four, rank):
        row = u[k * n : (k + 1) * n]
        x0, y0, z0 = q[0, k], q[1, k], q[2, k]
        for i in range(n):
            a = float(row[i])
            x[i] += a * x0
            y[i] += a * y0
            z[i] += a * z0
