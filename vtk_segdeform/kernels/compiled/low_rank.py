"""The map of `low_rank.LowRankSubspace`, in double precision from factors in single."""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel(fastmath={"reassoc", "contract"})


@_compile
def map_low_rank(x, base, p, vertices, columns, left, right, starts, first, last):
    """Put W~ @ p.T into *x* for patches *first* to *last*; *p* is (k, m), k a multiple of 3.

    To the first three columns *base* (n, 3), patch by patch, is added; or (0, 3), which is nothing.
    """
    most = 0
    for t in range(first, last):
        most = max(most, starts[t + 1, 0] - starts[t, 0])
    sums = np.empty((3, most + 72))  # 72: rows a power of two apart would share cache lines
    here = np.empty((3, p.shape[1]))
    for t in range(first, last):
        first_row = starts[t, 0]
        ids = vertices[first_row : starts[t + 1, 0]]
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
            for i in range(n):
                r = ids[i]
                if a == 0 and len(base) > 0:
                    x[r, 0] = base[first_row + i, 0] + sums[0, i]
                    x[r, 1] = base[first_row + i, 1] + sums[1, i]
                    x[r, 2] = base[first_row + i, 2] + sums[2, i]
                else:
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
