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
        i0, i1, i2, i3 = ids[c, 0], ids[c, 1], ids[c, 2], ids[c, 3]
        along = align = 0.0
        for j in range(3):
            h0, h1, h2, h3 = hat[j], hat[3 + j], hat[6 + j], hat[9 + j]
            for i in range(3):
                change = (
                    h0 * moves[i0, i] + h1 * moves[i1, i] + h2 * moves[i2, i] + h3 * moves[i3, i]
                )
                along += term[9 + 3 * j + i] * change
                align += term[3 * j + i] * change
        a, of_own = term[18], term[20] * along
        of_other = term[20] * align + term[21] * along
        for j in range(3):
            h0, h1, h2, h3 = hat[j], hat[3 + j], hat[6 + j], hat[9 + j]
            for i in range(3):
                change = (
                    h0 * moves[i0, i] + h1 * moves[i1, i] + h2 * moves[i2, i] + h3 * moves[i3, i]
                )
                force = a * change + of_own * term[3 * j + i] + of_other * term[9 + 3 * j + i]
                out[i0, i] += h0 * force
                out[i1, i] += h1 * force
                out[i2, i] += h2 * force
                out[i3, i] += h3 * force
