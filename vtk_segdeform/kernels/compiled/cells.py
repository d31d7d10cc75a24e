"""Sums over the cells of vertices, for `cell_energy`; `start` to `stop` are rows of outputs."""

from __future__ import annotations

from .kernels import kernel

_compile = kernel()


@_compile("f8[:,:], f8[:,:], const f8[:,:], const i8[:], const i8[:], const f8[:,:], i8, i8")
def cell_sums(sums, product, x, indptr, indices, weights, start, stop):
    """Put sum_j k_ij x_j^T into *sums* (n, 9), and sum_j C_ij x_j into *product* (n, 3).

    *weights* (m, 4) has C_ij and k_ij of each entry.
    """
    for i in range(start, stop):
        for c in range(9):
            sums[i, c] = 0.0
        product[i, 0] = product[i, 1] = product[i, 2] = 0.0
        for at in range(indptr[i], indptr[i + 1]):
            j = indices[at]
            a, b, c = x[j, 0], x[j, 1], x[j, 2]
            for row in range(3):
                k = weights[at, 1 + row]
                sums[i, 3 * row] += k * a
                sums[i, 3 * row + 1] += k * b
                sums[i, 3 * row + 2] += k * c
            product[i, 0] += weights[at, 0] * a
            product[i, 1] += weights[at, 0] * b
            product[i, 2] += weights[at, 0] * c


@_compile("f8[:,:], const f8[:,:], const i4[:], const i4[:], const f8[:], const f8[:], f8, i8, i8")
def spread_cells(out, values, indptr, indices, given, taken, share, start, stop):
    """Put (1 - share) v_i + share taken_i sum_j given_j v_j into *out* (n, 9), v being *values*."""
    for i in range(start, stop):
        a = b = c = d = e = f = g = h = k = 0.0
        for at in range(indptr[i], indptr[i + 1]):
            j = indices[at]
            w = given[j]
            a += w * values[j, 0]
            b += w * values[j, 1]
            c += w * values[j, 2]
            d += w * values[j, 3]
            e += w * values[j, 4]
            f += w * values[j, 5]
            g += w * values[j, 6]
            h += w * values[j, 7]
            k += w * values[j, 8]
        for at, total in enumerate((a, b, c, d, e, f, g, h, k)):
            out[i, at] = (1.0 - share) * values[i, at] + share * taken[i] * total


@_compile(
    "f8[:,:], f8[:], const f8[:,:], const f8[:,:], const i8[:], const i8[:], const f8[:,:], i8, i8"
)
def cell_forces(forces, terms, x, rotations, indptr, indices, transposed, start, stop):
    """Subtract l_j = sum_i R_i^T k_ij from *forces* (n, 3), which are C x.

    *terms* (n,) become x_j . (C x - 2 l)_j; *transposed* (m, 3) has k_ij in row j.
    """
    for j in range(start, stop):
        a = b = c = 0.0
        for at in range(indptr[j], indptr[j + 1]):
            i = indices[at]
            u, v, w = transposed[at, 0], transposed[at, 1], transposed[at, 2]
            a += rotations[i, 0] * u + rotations[i, 1] * v + rotations[i, 2] * w
            b += rotations[i, 3] * u + rotations[i, 4] * v + rotations[i, 5] * w
            c += rotations[i, 6] * u + rotations[i, 7] * v + rotations[i, 8] * w
        p, q, r = forces[j, 0] - a, forces[j, 1] - b, forces[j, 2] - c
        forces[j, 0], forces[j, 1], forces[j, 2] = p, q, r
        terms[j] = x[j, 0] * (p - a) + x[j, 1] * (q - b) + x[j, 2] * (r - c)
