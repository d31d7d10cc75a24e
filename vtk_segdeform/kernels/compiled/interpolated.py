"""Products with `interpolated.InterpolatedBlock`: sums over the 27 nodes around a vertex."""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel(fastmath={"reassoc", "contract"})


@_compile()
def _splines(out, t, factor):
    """Put the three quadratic B-splines at *t*, times *factor*, into *out* (3,)."""
    out[0] = factor * 0.5 * (0.5 - t) * (0.5 - t)
    out[1] = factor * (0.75 - t * t)
    out[2] = factor * 0.5 * (0.5 + t) * (0.5 + t)


@_compile(
    "f8[:,:], const i8[:], const f8[:], const f4[:,:], const i4[:], const i4[:,:], const f8[:,:]"
)
def add_interpolated(x, rows, blend, offsets, cells, lines, values):
    """Add the interpolated *values* (nodes, k), k a multiple of 3, to *rows* of *x*."""
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(rows)):
        _splines(u, float(offsets[i, 0]), blend[i])
        _splines(v, float(offsets[i, 1]), 1.0)
        _splines(w, float(offsets[i, 2]), 1.0)
        w0, w1, w2 = w[0], w[1], w[2]
        line, r = lines[cells[i]], rows[i]
        for c in range(0, values.shape[1], 3):
            x0 = x1 = x2 = 0.0
            for k in range(9):
                weight, n = u[k // 3] * v[k % 3], line[k]
                a, b, d = values[n], values[n + 1], values[n + 2]
                x0 += weight * (w0 * a[c] + w1 * b[c] + w2 * d[c])
                x1 += weight * (w0 * a[c + 1] + w1 * b[c + 1] + w2 * d[c + 1])
                x2 += weight * (w0 * a[c + 2] + w1 * b[c + 2] + w2 * d[c + 2])
            x[r, c] += x0
            x[r, c + 1] += x1
            x[r, c + 2] += x2


@_compile(
    "f8[:,:], const f8[:,:], const f8[:], const f4[:,:], const i4[:], const i4[:,:]",
)
def add_interpolated_adjoint(values, y, blend, offsets, cells, lines):
    """Add the transpose of the interpolation times *y* (n, k) to *values* (nodes, k)."""
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(y)):
        _splines(u, float(offsets[i, 0]), blend[i])
        _splines(v, float(offsets[i, 1]), 1.0)
        _splines(w, float(offsets[i, 2]), 1.0)
        line = lines[cells[i]]
        for k in range(9):
            weight, n = u[k // 3] * v[k % 3], line[k]
            for d in range(3):
                for c in range(y.shape[1]):
                    values[n + d, c] += weight * w[d] * y[i, c]


@_compile("f8[:,:], const f8[:], const f4[:,:], const i4[:], const i4[:,:], const f8[:,:]")
def interpolated_rows(out, blend, offsets, cells, lines, values):
    """Put the interpolated *values* (nodes, m) into *out* (k, m)."""
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(out)):
        _splines(u, float(offsets[i, 0]), blend[i])
        _splines(v, float(offsets[i, 1]), 1.0)
        _splines(w, float(offsets[i, 2]), 1.0)
        line, row = lines[cells[i]], out[i]
        row[:] = 0.0
        for k in range(9):
            weight, n = u[k // 3] * v[k % 3], line[k]
            a, b, d = values[n], values[n + 1], values[n + 2]
            w0, w1, w2 = weight * w[0], weight * w[1], weight * w[2]
            for j in range(len(row)):
                row[j] += w0 * a[j] + w1 * b[j] + w2 * d[j]
