"""Pairs of points near each other, for `contact`."""

from __future__ import annotations

from .kernels import kernel

_compile = kernel()


@_compile
def facing_pairs(y, normals, reaches, margins, ids, excluded, limits, pairs):
    """Put the pairs that are, or may soon be, within reach into *pairs*; return their number.

    *y* (n, 3) is sorted by its first column.  *ids* (n,) are the rows and columns of *excluded*
    (n, n), the pairs that do not count.  *limits* are the largest reach of a pair, the largest
    cosine between normals, the factor of a gap and the largest distance beyond reach.  *pairs*
    (k, 2) is filled as far as it goes.
    """
    largest, facing, share, slack = limits[0], limits[1], limits[2], limits[3]
    count = 0
    for i in range(len(y)):
        for j in range(i + 1, len(y)):
            ex = y[j, 0] - y[i, 0]
            if ex >= largest:
                break
            ey, ez = y[j, 1] - y[i, 1], y[j, 2] - y[i, 2]
            squared = ex * ex + ey * ey + ez * ez
            reach = reaches[i] + reaches[j]
            if squared >= (reach + slack) ** 2:
                continue
            if excluded[ids[i], ids[j]]:
                continue
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            mx, my, mz = normals[j, 0], normals[j, 1], normals[j, 2]
            if nx * mx + ny * my + nz * mz >= facing:
                continue
            gap = 0.5 * ((nx - mx) * ex + (ny - my) * ey + (nz - mz) * ez)
            if share * (gap - margins[i] - margins[j]) >= slack:
                continue
            if count < len(pairs):
                pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return count
