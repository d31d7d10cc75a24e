"""Mean value coordinates, for `mean_value`, whose header has the formulas; a point at a time."""

from __future__ import annotations

import math

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile
def _sum_near_plane(a, h, t1, length):
    """Return S h by psi_i: *a*, *t1*, *length* (3,) of a face's edges, seen from height *h*."""
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


@_compile
def weights(points, vertices, edges, sides, faces, planes, starts, numbers, limits, out):
    """Put the coordinates of *points* (n, 3) into *out* (n, m).

    The cage: *vertices* (m, 3); *edges* (e, 2); *sides* (k, 3) the edge of each side of *faces*
    (k, 3); *planes* (4, k, 4); *starts* (2, 3, k, 3) where sides begin and their unit vectors;
    *numbers* (3, 3, k) their length, the cosine at the opposite corner and 1 / (2 H); *limits*
    are `mean_value._ON`, `_OFF` and `_NEAR`.
    """
    m, n_edges, n_faces = len(vertices), len(edges), len(faces)
    square = np.empty(m)
    theta, lengths, along = np.empty(n_edges), np.empty(n_edges), np.empty(n_edges)
    distance = np.empty(n_edges)
    a, b, t1, length = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for side in range(n_edges):
        i, j = edges[side, 0], edges[side, 1]
        total = 0.0
        for axis in range(3):
            total += (vertices[j, axis] - vertices[i, axis]) ** 2
        lengths[side] = math.sqrt(total)
    for point in range(len(points)):
        x, y, z = points[point, 0], points[point, 1], points[point, 2]
        row = out[point]
        row[:] = 0.0
        for i in range(m):
            u, v, w = vertices[i, 0] - x, vertices[i, 1] - y, vertices[i, 2] - z
            square[i] = u * u + v * v + w * w
        for f in range(n_faces):  # how far the lines of all edges are
            p = planes[3, f]
            h = p[0] * x + p[1] * y + p[2] * z + p[3] + limits[1]
            for i in range(3):
                p = planes[i, f]
                t = p[0] * x + p[1] * y + p[2] * z + p[3]
                distance[sides[f, i]] = math.sqrt(t * t + h * h)
        for side in range(n_edges):
            i, j = edges[side, 0], edges[side, 1]
            along[side] = square[i] + square[j] - lengths[side] * lengths[side]
            theta[side] = math.atan2(2.0 * lengths[side] * distance[side], along[side])
        for f in range(n_faces):
            p = planes[3, f]
            h = p[0] * x + p[1] * y + p[2] * z + p[3] + limits[1]
            most, least, s = 0.0, math.inf, 0.0
            for i in range(3):
                p = planes[i, f]
                a[i] = p[0] * x + p[1] * y + p[2] * z + p[3]
                b[i] = theta[sides[f, i]] / math.sqrt(a[i] * a[i] + h * h)
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
        for side in range(n_edges):
            if distance[side] <= limits[0] and along[side] < 0.0:
                i, j = edges[side, 0], edges[side, 1]
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
