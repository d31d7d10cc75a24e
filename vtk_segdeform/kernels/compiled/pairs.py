"""Pairs of points near each other, for `contact`."""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile
def facing_pairs(y, normals, reaches, margins, held, ids, excluded, limits, pairs):
    """Put the pairs that are, or may soon be, within reach into *pairs*; return their number.

    *y* (n, 3) is sorted by its first column.  *ids* (n,) are the rows and columns of *excluded*
    (n, n), the pairs that do not count, like those of which both are *held* (n,).  *limits* are
    the largest reach of a pair, the largest cosine between normals, the factor of a gap and the
    largest distance beyond reach.  *pairs* (k, 2) is filled as far as it goes.
    """
    largest, facing, share, slack = limits[0], limits[1], limits[2], limits[3]
    count = 0
    for i in range(len(y)):
        x0, x1, x2 = y[i]
        nx, ny, nz = normals[i]
        own, margin, id_, is_held = reaches[i] + slack, margins[i], ids[i], held[i]
        for j in range(i + 1, len(y)):
            ex = y[j, 0] - x0
            if ex >= largest:
                break
            ey, ez = y[j, 1] - x1, y[j, 2] - x2
            if ex * ex + ey * ey + ez * ez >= (own + reaches[j]) ** 2:
                continue
            mx, my, mz = normals[j]
            if nx * mx + ny * my + nz * mz >= facing:
                continue
            gap = 0.5 * ((nx - mx) * ex + (ny - my) * ey + (nz - mz) * ez)
            if share * (gap - margin - margins[j]) >= slack:
                continue
            if excluded[id_, ids[j]] or (is_held and held[j]):
                continue
            if count < len(pairs):
                pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return count


@_compile
def opposite_pairs(y, faces, starts, places, radii, margins, limits, pairs, found):
    """Put the numbers of the *pairs* (k, 2) that face each other within reach into *found* (k,).

    Returns how many they are.  *y* (s, 3) are samples, and *places* those of the *faces* (t, 3) at
    each of them, from *starts* (s + 1,) on.  *limits* are the largest depth and lateral distance of
    a pair, in sums of its *radii* (s,), and the least cosine between one normal and the opposite
    of the other.
    """
    depth, lateral, facing = limits[0], limits[1], limits[2]
    count = 0
    normal = np.empty((2, 3))
    for k in range(len(pairs)):
        a, b = pairs[k]
        ex, ey, ez = y[a, 0] - y[b, 0], y[a, 1] - y[b, 1], y[a, 2] - y[b, 2]
        squared = ex * ex + ey * ey + ez * ez
        reach = radii[a] + radii[b]
        if squared >= (depth * depth + lateral * lateral) * reach * reach:
            continue
        for end in range(2):
            at = pairs[k, end]
            n0, n1, n2 = 0.0, 0.0, 0.0
            for place in places[starts[at] : starts[at + 1]]:
                i, j, m = faces[place]
                ux, uy, uz = y[j, 0] - y[i, 0], y[j, 1] - y[i, 1], y[j, 2] - y[i, 2]
                vx, vy, vz = y[m, 0] - y[i, 0], y[m, 1] - y[i, 1], y[m, 2] - y[i, 2]
                n0 += uy * vz - uz * vy
                n1 += uz * vx - ux * vz
                n2 += ux * vy - uy * vx
            length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2) + 1e-30
            normal[end, 0], normal[end, 1], normal[end, 2] = n0 / length, n1 / length, n2 / length
        (n0, n1, n2), (m0, m1, m2) = normal[0], normal[1]
        if -(n0 * m0 + n1 * m1 + n2 * m2) <= facing:
            continue
        gap = 0.5 * ((m0 - n0) * ex + (m1 - n1) * ey + (m2 - n2) * ez)
        if gap >= margins[a] + margins[b] or gap <= -depth * reach:
            continue
        if squared - gap * gap >= (lateral * reach) ** 2:
            continue
        found[count] = k
        count += 1
    return count
