"""Pairs of points near each other, for `contact`."""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile("const f8[:,:], const b1[:], const i8[:], const b1[:,:], const f8[:], i8[:,:], f8[:]")
def facing_pairs(samples, held, ids, excluded, limits, pairs, beyond):
    """Put the pairs that are, or may soon be, within reach into *pairs*; return their number.

    And into *beyond* (k,) how far each is beyond reach.

    *samples* (8, n) are places, normals, reaches and margins, sorted by the first row.  *ids* (n,)
    are the rows and columns of *excluded* (n, n), the pairs that do not count, like those of which
    both are *held* (n,).  *limits* are the largest reach of a pair, the largest cosine between
    normals, the factor of a gap and the largest distance beyond reach.  *pairs* (k, 2) is filled as
    far as it goes.
    """
    largest, facing, share, slack = limits
    n = samples.shape[1]
    is_near = np.empty(n, dtype=np.uint8)
    count = end = 0
    for i in range(n):
        x0, x1, x2 = samples[0, i], samples[1, i], samples[2, i]
        n0, n1, n2 = samples[3, i], samples[4, i], samples[5, i]
        own, margin = samples[6, i] + slack, samples[7, i]
        while end < n and samples[0, end] - x0 < largest:
            end += 1
        for j in range(i + 1, end):  # without branches, which are hard to predict here
            e0, e1, e2 = samples[0, j] - x0, samples[1, j] - x1, samples[2, j] - x2
            m0, m1, m2 = n0 - samples[3, j], n1 - samples[4, j], n2 - samples[5, j]
            reach = own + samples[6, j]
            cosine = 1.0 - 0.5 * (m0 * m0 + m1 * m1 + m2 * m2)
            gap = 0.5 * (m0 * e0 + m1 * e1 + m2 * e2)
            is_near[j] = (
                (e0 * e0 + e1 * e1 + e2 * e2 < reach * reach)
                & (cosine < facing)
                & (share * (gap - margin - samples[7, j]) < slack)
            )
        for j in range(i + 1, end):
            if not is_near[j] or excluded[ids[i], ids[j]] or (held[i] and held[j]):
                continue
            if count < len(pairs):
                pairs[count, 0], pairs[count, 1] = i, j
                beyond[count] = _beyond(samples, i, j, share)
            count += 1
    return count


@_compile()
def _beyond(samples, i, j, share):
    """Return how far two samples are beyond the reach of a pair, in distance or by their gap."""
    squared = gap = 0.0
    for c in range(3):
        e = samples[c, j] - samples[c, i]
        squared += e * e
        gap += 0.5 * e * (samples[3 + c, i] - samples[3 + c, j])
    away = math.sqrt(squared) - samples[6, i] - samples[6, j]
    return max(away, share * (gap - samples[7, i] - samples[7, j]))


@_compile(
    "const f8[:,:], const f8[:,:], const i8[:,:], const i8[:], const i8[:], const f8[:], "
    "const f8[:], const f8[:], const i8[:,:], const i8[:], i8[:]"
)
def opposite_pairs(y, before, faces, starts, places, radii, margins, limits, pairs, ends, found):
    """Put the numbers of the *pairs* (k, 2) that face each other within reach into *found* (k,).

    Returns how many they are; -1 if a sample has moved too far since *before* (s, 3), apart from
    the mean motion.  *y* (s, 3) are the samples, and *places* those of the *faces* (t, 3) at each
    of them, from *starts* (s + 1,) on.  *limits* are the largest depth and lateral distance of a
    pair, in sums of its *radii* (s,), the least cosine between one normal and the opposite of the
    other, and the farthest motion.  Only as many pairs are tested as *ends* (q,) has for that part
    of the farthest motion.
    """
    depth, lateral, facing, farthest = limits
    mean = np.zeros(3)
    for i in range(len(y)):
        for c in range(3):
            mean[c] += (y[i, c] - before[i, c]) / len(y)
    most = 0.0
    for i in range(len(y)):
        ux, uy, uz = y[i, 0] - before[i, 0], y[i, 1] - before[i, 1], y[i, 2] - before[i, 2]
        ux, uy, uz = ux - mean[0], uy - mean[1], uz - mean[2]
        most = max(most, ux * ux + uy * uy + uz * uz)
    if most > farthest * farthest:
        return -1
    part = int(len(ends) * math.sqrt(most) / farthest)
    tested = ends[min(part, len(ends) - 1)]
    count = 0
    normal = np.empty((2, 3))
    for k in range(tested):
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
