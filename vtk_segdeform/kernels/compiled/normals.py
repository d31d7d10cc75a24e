"""Rings of neighbours and vertex normals, for `normals`."""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile("i4[:], const i8[:,:], const i8[:]")
def rings(ring, faces, starts):
    """Put the neighbours of each vertex into *ring* (3m,), in cyclic order.

    Where its faces are not one closed fan, at a border for example, put the vertex itself.
    """
    n = len(starts) - 1
    fill, pairs, after = (
        starts[:-1].copy(),
        np.empty((len(ring), 2), np.int32),
        np.empty(n, np.int32),
    )
    for f in range(len(faces)):
        for corner in range(3):
            i = faces[f, corner]
            pairs[fill[i], 0] = faces[f, (corner + 1) % 3]
            pairs[fill[i], 1] = faces[f, (corner + 2) % 3]
            fill[i] += 1
    for i in range(n):
        first, last = starts[i], starts[i + 1] - 1
        for t in range(first, last + 1):
            after[pairs[t, 1]] = -1
        for t in range(first, last + 1):
            after[pairs[t, 0]] = pairs[t, 1]
        j = pairs[first, 0]
        for t in range(first, last + 1):
            j = after[j]
            if j < 0 or (j == pairs[first, 0]) != (t == last):
                ring[first : last + 1] = i
                break
            ring[t] = j


@_compile("f4[:,:], const i8[:], const f8[:,:], const i4[:], const i8[:], f8, i8, i8")
def ring_normals(out, vertices, x, ring, starts, scale, first, last):
    """Put the unit normals of vertices[first:last] into *out*; *x* is scaled by *scale*."""
    for k in range(first, last):
        i = vertices[k]
        end = starts[i + 1] - 1
        ox, oy, oz = x[i, 0], x[i, 1], x[i, 2]
        j = ring[end]
        ex, ey, ez = scale * (x[j, 0] - ox), scale * (x[j, 1] - oy), scale * (x[j, 2] - oz)
        nx = ny = nz = 0.0
        for t in range(starts[i], end + 1):
            j = ring[t]
            gx, gy, gz = scale * (x[j, 0] - ox), scale * (x[j, 1] - oy), scale * (x[j, 2] - oz)
            nx += ey * gz - ez * gy
            ny += ez * gx - ex * gz
            nz += ex * gy - ey * gx
            ex, ey, ez = gx, gy, gz
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not length > 0.0:
            nx, ny, nz, length = 0.0, 0.0, 0.0, 1.0
        out[k, 0], out[k, 1], out[k, 2] = nx / length, ny / length, nz / length
