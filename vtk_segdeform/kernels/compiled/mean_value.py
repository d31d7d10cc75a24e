"""Mean value coordinates, one point at a time; see `mean_value` for the formulas."""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile()
def _sum_near_plane(a, h, t1, length):
    """Return S h by psi_i, for *a*, *t1* and *length* (3,) of the edges of a face at height *h*."""
    total = 0.0
    for i in range(3):
        size = abs(a[i])
        far = math.sqrt(size * size + h * h)
        gap = h * h / (far + size)
        t, t2 = t1[i], t1[i] + length[i]
        psi = math.atan2(t2 * gap, size * far + t2 * t2) - math.atan2(t * gap, size * far + t * t)
        psi += gap / far * math.atan2(far * length[i], far * far + t * t2)
        total -= math.copysign(psi, a[i])
    return total


@_compile(
    "const f8[:,:], const f8[:,:], const i8[:,:], const i8[:,:], const i8[:,:], const f8[:,:,:], "
    "const f8[:,:,:,:], const f8[:,:,:], const f8[:], f8[:,:]"
)
def weights(points, vertices, edges, edge_of, faces, planes, starts, numbers, limits, out):
    """Put the coordinates of *points* (n, 3) into *out* (n, m).

    The cage: *vertices* (m, 3); *edges* (e, 2); *edge_of* (k, 3), the edges of each of *faces*
    (k, 3); *planes* (4, k, 4); *starts* (2, 3, k, 3), the starts and unit vectors of these edges;
    *numbers* (3, 3, k), their lengths, the cosines at the opposite corners and 1 / (2 H); *limits*
    are `mean_value._ON`, `_OFF` and `_NEAR`.
    """
    m, n_edges, n_faces = len(vertices), len(edges), len(faces)
    square = np.empty(m)
    theta, lengths, along = np.empty(n_edges), np.empty(n_edges), np.empty(n_edges)
    distance = np.empty(n_edges)
    a, b, t1, length = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for edge in range(n_edges):
        i, j = edges[edge, 0], edges[edge, 1]
        total = 0.0
        for axis in range(3):
            total += (vertices[j, axis] - vertices[i, axis]) ** 2
        lengths[edge] = math.sqrt(total)
    for point in range(len(points)):
        x, y, z = points[point, 0], points[point, 1], points[point, 2]
        row = out[point]
        row[:] = 0.0
        for i in range(m):
            u, v, w = vertices[i, 0] - x, vertices[i, 1] - y, vertices[i, 2] - z
            square[i] = u * u + v * v + w * w
        for f in range(n_faces):  # distances of x from the lines of all edges
            p = planes[3, f]
            h = p[0] * x + p[1] * y + p[2] * z + p[3] + limits[1]
            for i in range(3):
                p = planes[i, f]
                t = p[0] * x + p[1] * y + p[2] * z + p[3]
                distance[edge_of[f, i]] = math.sqrt(t * t + h * h)
        for edge in range(n_edges):
            i, j = edges[edge, 0], edges[edge, 1]
            along[edge] = square[i] + square[j] - lengths[edge] * lengths[edge]
            theta[edge] = math.atan2(2.0 * lengths[edge] * distance[edge], along[edge])
        for f in range(n_faces):
            p = planes[3, f]
            h = p[0] * x + p[1] * y + p[2] * z + p[3] + limits[1]
            most, least, s = 0.0, math.inf, 0.0
            for i in range(3):
                p = planes[i, f]
                a[i] = p[0] * x + p[1] * y + p[2] * z + p[3]
                b[i] = theta[edge_of[f, i]] / math.sqrt(a[i] * a[i] + h * h)
                most, least = max(most, abs(a[i])), min(least, a[i])
                s += a[i] * b[i]
            if abs(h) < limits[2] * most and least < 0.0:
                for i in range(3):
                    o, d = starts[0, i, f], starts[1, i, f]
                    t1[i] = (o[0] - x) * d[0] + (o[1] - y) * d[1] + (o[2] - z) * d[2]
                    length[i] = numbers[0, i, f]
                s = _sum_near_plane(a, h, t1, length)
            s /= h
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                w = h * (b[i] - b[j] * numbers[1, k, f] - b[k] * numbers[1, j, f])
                row[faces[f, i]] += (w + a[i] * s) * numbers[2, i, f]
        for edge in range(n_edges):
            if distance[edge] <= limits[0] and along[edge] < 0.0:
                i, j = edges[edge, 0], edges[edge, 1]
                row[:] = 0.0
                row[i], row[j] = math.sqrt(square[j]), math.sqrt(square[i])
        for i in range(m):
            if square[i] <= limits[0] * limits[0]:
                row[:] = 0.0
                row[i] = 1.0
        total = 0.0
        for i in range(m):
            total += row[i]
        for i in range(m):
            row[i] /= total
