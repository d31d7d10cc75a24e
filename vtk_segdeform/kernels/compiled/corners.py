"""The energy of the corners of cells and its derivatives, for `untangling`.

Of a corner c: the points ids[c, q], the derivative hats[c, 3 q + j] by coordinate j of the function
that is 1 at point q, and the terms[c]: J (9), its cofactors C (9), and a, s, b, k.
"""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile = kernel(fastmath={"reassoc", "contract"})


@_compile("const i8[:,:], const f8[:,:], const f8[:], const f8[:,:], f8, f8[:,:], f8[:,:], i8, i8")
def corner_terms(ids, hats, volumes, x, eps, terms, found, start, stop):
    """Put the terms at *x* (p, 3), and d and the energy, into *found* (c, 2), start..stop."""
    for c in range(start, stop):
        hat, term = hats[c], terms[c]
        size = 0.0
        for j in range(3):
            for i in range(3):
                total = 0.0
                for q in range(4):
                    total += hat[3 * q + j] * x[ids[c, q], i]
                term[3 * j + i] = total
                size += total * total
        for j in range(3):
            u, v = 3 * ((j + 1) % 3), 3 * ((j + 2) % 3)
            for i in range(3):
                m, n = (i + 1) % 3, (i + 2) % 3
                term[9 + 3 * j + i] = term[u + m] * term[v + n] - term[u + n] * term[v + m]
        d = term[0] * term[9] + term[1] * term[10] + term[2] * term[11]
        chi, slope = d, 1.0
        if eps > 0.0:
            root = math.sqrt(d * d + eps * eps)
            chi = 0.5 * (d + root) if d > 0.0 else 0.5 * eps * eps / (root - d)
            slope = chi / root
        found[c, 0] = d
        if chi <= 0.0:
            found[c, 1] = math.inf
            continue
        root = np.cbrt(chi)
        rate, power = slope / chi, 1.0 / (root * root)
        angles, bulk = size * power / 3.0, 0.5 * (d * d + 1.0) / chi
        a = volumes[c] * 2.0 / 3.0 * power
        found[c, 1] = volumes[c] * (angles + bulk)
        term[18] = a
        term[19] = volumes[c] * (d / chi - rate * (2.0 / 3.0 * angles + bulk))
        term[20] = -2.0 / 3.0 * a * rate
        left = 1.0 - d * rate
        term[21] = volumes[c] * (
            10.0 / 9.0 * angles * rate * rate + (left * left + rate * rate) / chi
        )


@_compile("const i8[:,:], const f8[:,:], const f8[:,:], f8[:,:], i8, i8")
def add_corner_forces(ids, hats, terms, out, start, stop):
    """Add the slope and the diagonal of the Hessian to *out* (p, 6), of corners start..stop."""
    for c in range(start, stop):
        hat, term = hats[c], terms[c]
        a, s, b, k = term[18], term[19], term[20], term[21]
        for q in range(4):
            h0, h1, h2 = hat[3 * q], hat[3 * q + 1], hat[3 * q + 2]
            square = a * (h0 * h0 + h1 * h1 + h2 * h2)
            point = ids[c, q]
            for i in range(3):
                j = h0 * term[i] + h1 * term[3 + i] + h2 * term[6 + i]
                f = h0 * term[9 + i] + h1 * term[12 + i] + h2 * term[15 + i]
                out[point, i] += a * j + s * f
                out[point, 3 + i] += square + 2.0 * b * j * f + k * f * f


@_compile("const i8[:,:], const f4[:,:], const f4[:,:], const f8[:,:], f8[:,:], i8, i8")
def add_corner_products(ids, hats, terms, moves, out, start, stop):
    """Add the product of the Hessian and *moves* (p, 3) to *out* (p, 3), of corners start..stop."""
    for c in range(start, stop):
        hat, term = hats[c], terms[c]
        p, q, r, s = ids[c, 0], ids[c, 1], ids[c, 2], ids[c, 3]
        # Everything is read before anything is written, so that it stays in registers.
        u, v, w, t = moves[p], moves[q], moves[r], moves[s]
        x, y, z, o = (u[0], u[1], u[2]), (v[0], v[1], v[2]), (w[0], w[1], w[2]), (t[0], t[1], t[2])
        f = (hat[0], hat[3], hat[6], hat[9])
        g = (hat[1], hat[4], hat[7], hat[10])
        h = (hat[2], hat[5], hat[8], hat[11])
        r0, r1, r2 = _change(f, x, y, z, o), _change(g, x, y, z, o), _change(h, x, y, z, o)
        own = _dot(term, 0, r0) + _dot(term, 3, r1) + _dot(term, 6, r2)
        other = _dot(term, 9, r0) + _dot(term, 12, r1) + _dot(term, 15, r2)
        a, of_own, of_other = term[18], term[20] * other, term[20] * own + term[21] * other
        r0 = _force(term, 0, a, of_own, of_other, r0)
        r1 = _force(term, 3, a, of_own, of_other, r1)
        r2 = _force(term, 6, a, of_own, of_other, r2)
        _spread(out[p], f[0], g[0], h[0], r0, r1, r2)
        _spread(out[q], f[1], g[1], h[1], r0, r1, r2)
        _spread(out[r], f[2], g[2], h[2], r0, r1, r2)
        _spread(out[s], f[3], g[3], h[3], r0, r1, r2)


@_compile()
def _change(h, x, y, z, o):
    return (
        h[0] * x[0] + h[1] * y[0] + h[2] * z[0] + h[3] * o[0],
        h[0] * x[1] + h[1] * y[1] + h[2] * z[1] + h[3] * o[1],
        h[0] * x[2] + h[1] * y[2] + h[2] * z[2] + h[3] * o[2],
    )


@_compile()
def _dot(term, j, row):
    return term[j] * row[0] + term[j + 1] * row[1] + term[j + 2] * row[2]


@_compile()
def _force(term, j, a, of_own, of_other, row):
    return (
        a * row[0] + of_own * term[j] + of_other * term[j + 9],
        a * row[1] + of_own * term[j + 1] + of_other * term[j + 10],
        a * row[2] + of_own * term[j + 2] + of_other * term[j + 11],
    )


@_compile()
def _spread(out, f, g, h, r0, r1, r2):
    out[0] += f * r0[0] + g * r1[0] + h * r2[0]
    out[1] += f * r0[1] + g * r1[1] + h * r2[1]
    out[2] += f * r0[2] + g * r1[2] + h * r2[2]
