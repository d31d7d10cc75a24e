"""Products of W~ with a few columns, for `blocks` and `patches`; single precision is widened.

Several rows at a time: what is read of the columns then serves all of them.
"""

from __future__ import annotations

import numba
import numpy as np

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
_IN_A_ROW = 1 << 14  # numbers that are read forwards, so that they are fetched ahead


@_compile
def add_product(x, rows, block, p, start, stop):
    """Add block @ p.T to the *rows* start..stop of *x*, for *p* (k, m) with k a multiple of 3."""
    if len(p) == 6:
        _add_six(x, rows, block, p, start, stop)
        return
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
                (rows[i], q0, q1, q2),
                (rows[i + 1], r0, r1, r2),
                (rows[i + 2], s0, s1, s2),
                (rows[i + 3], t0, t1, t2),
            ):
                x[k, c] += d0
                x[k, c + 1] += d1
                x[k, c + 2] += d2
    for i in range(four, stop):
        _add_row(x[rows[i]], block[i], p)


@_compile
def _add_six(x, rows, block, p, start, stop):
    """Do `add_product` for six columns, and read a block once: all sums are in registers still."""
    p0, p1, p2, p3, p4, p5 = p[0], p[1], p[2], p[3], p[4], p[5]
    two = start + (stop - start) // 2 * 2
    for i in range(start, two, 2):
        b, c, q, r = block[i], block[i + 1], rows[i], rows[i + 1]
        s0 = s1 = s2 = s3 = s4 = s5 = t0 = t1 = t2 = t3 = t4 = t5 = 0.0
        for j in range(len(b)):
            u0, u1, u2, u3, u4, u5 = p0[j], p1[j], p2[j], p3[j], p4[j], p5[j]
            v, w = float(b[j]), float(c[j])
            s0 += v * u0
            s1 += v * u1
            s2 += v * u2
            s3 += v * u3
            s4 += v * u4
            s5 += v * u5
            t0 += w * u0
            t1 += w * u1
            t2 += w * u2
            t3 += w * u3
            t4 += w * u4
            t5 += w * u5
        for row, d0, d1, d2, d3, d4, d5 in (
            (q, s0, s1, s2, s3, s4, s5),
            (r, t0, t1, t2, t3, t4, t5),
        ):
            x[row, 0] += d0
            x[row, 1] += d1
            x[row, 2] += d2
            x[row, 3] += d3
            x[row, 4] += d4
            x[row, 5] += d5
    for i in range(two, stop):
        _add_row(x[rows[i]], block[i], p)


@_compile
def _add_row(x, b, p):
    """Add p @ b to *x* (k,)."""
    for c in range(len(p)):
        q, s = p[c], 0.0
        for j in range(len(b)):
            s += float(b[j]) * q[j]
        x[c] += s


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
def put_groups(x, base, p, rows, columns, weights, starts):
    """Put W~ @ p into *x* for all groups of `blocks.Groups`; *p* is (m, k), k by threes.

    To the first three columns *base* (n, 3) is added; or (0, 3), which is nothing.
    """
    here, k = np.empty(p.size), p.shape[1]
    for g in range(len(starts) - 1):
        ids = rows[starts[g, 0] : starts[g + 1, 0]]
        own = columns[starts[g, 1] : starts[g + 1, 1]]
        n, c = len(ids), len(own)
        block = weights[starts[g, 2] : starts[g + 1, 2]].reshape((n, c))
        some = here[: k * c].reshape((k, c))
        for j in range(c):
            for d in range(k):
                some[d, j] = p[own[j], d]
        for i in ids:
            for d in range(k):
                x[i, d] = 0.0
        if len(base) > 0:
            for i in ids:
                x[i, 0], x[i, 1], x[i, 2] = base[i, 0], base[i, 1], base[i, 2]
        add_product(x, ids, block, some, 0, n)


@_compile
def add_groups_adjoint(p, y, rows, columns, weights, starts):
    """Add (W~.T @ y).T to *p* (3, m), for *y* (n, 3).

    From the last group to the first, and in each from its last rows on: these are what
    `put_groups` has left in the cache, as this leaves it the first.
    """
    here = np.empty(p.size)
    for g in range(len(starts) - 2, -1, -1):
        ids = rows[starts[g, 0] : starts[g + 1, 0]]
        own = columns[starts[g, 1] : starts[g + 1, 1]]
        n, c = len(ids), len(own)
        block = weights[starts[g, 2] : starts[g + 1, 2]].reshape((n, c))
        some = here[: 3 * c].reshape((3, c))
        some[:] = 0.0
        step = max(_IN_A_ROW // c, 4)
        for k in range((n - 1) // step, -1, -1):
            piece = slice(k * step, min((k + 1) * step, n))
            add_adjoint(some, ids[piece], block[piece], y)
        for d in range(3):
            for j in range(c):
                p[d, own[j]] += some[d, j]


@_compile
def put_patches(x, base, p, vertices, columns, left, right, starts, first, last):
    """Put W~ @ p.T into *x* for some patches of `patches.Patches`; *p* is (k, m), k by threes.

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
