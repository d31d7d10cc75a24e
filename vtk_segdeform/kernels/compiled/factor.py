"""Sums of blocks for `hessian`, and triangular solves with few right-hand sides.

The solves are for `hessian` and `finish.factor`.  LAPACK is optimised for many right-hand sides;
for two it takes twice as long.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel(fastmath={"reassoc", "contract"})


@_compile("f8[:,:], f8[:,:], i8[:]")
def add_upper(total, part, places):
    """Add the upper half of *part* (c, c) to *total* (n, n) at the ascending *places* (c,)."""
    for i in range(len(places)):
        row, own = total[places[i]], part[i]
        for j in range(i, len(places)):
            row[places[j]] += own[j]


@_compile("f8[:,:], f8[:,:]")
def solve_factored(columns, y):
    """Replace each row of *y* (k, n) by (L L^T)^-1 y; *columns* (n, n) are the columns of L.

    Two rows of *y* are processed at a time, so that L is read half as often.
    """
    n = len(columns)
    for k in range(0, len(y), 2):
        a = y[k]
        b = y[k + 1] if k + 1 < len(y) else np.zeros(n)
        for i in range(n):
            column, rest_a, rest_b = columns[i, i:], a[i:], b[i:]
            s, t = a[i] / column[0], b[i] / column[0]
            for j in range(1, n - i):
                rest_a[j] -= column[j] * s
                rest_b[j] -= column[j] * t
            a[i], b[i] = s, t
        for i in range(n - 1, -1, -1):
            column, rest_a, rest_b = columns[i, i:], a[i:], b[i:]
            s = t = 0.0
            for j in range(1, n - i):
                s += column[j] * rest_a[j]
                t += column[j] * rest_b[j]
            a[i] = (a[i] - s) / column[0]
            b[i] = (b[i] - t) / column[0]


@_compile("f8[:,:], const i4[:], const i4[:], const f8[:], const f8[:]")
def solve_sparse(y, indptr, indices, values, d):
    """Replace *y* (n, 3) by (L D L^T)^-1 y; the sparse columns of L begin with 1."""
    n = len(d)
    for j in range(n):
        a, b, c = y[j, 0], y[j, 1], y[j, 2]
        for at in range(indptr[j] + 1, indptr[j + 1]):
            i, value = indices[at], values[at]
            y[i, 0] -= value * a
            y[i, 1] -= value * b
            y[i, 2] -= value * c
    for j in range(n - 1, -1, -1):
        a, b, c = y[j, 0] / d[j], y[j, 1] / d[j], y[j, 2] / d[j]
        for at in range(indptr[j] + 1, indptr[j + 1]):
            i, value = indices[at], values[at]
            a -= value * y[i, 0]
            b -= value * y[i, 1]
            c -= value * y[i, 2]
        y[j, 0], y[j, 1], y[j, 2] = a, b, c
