"""The nearest points of triangles, for `surface_point`."""

from __future__ import annotations

import math

from .kernels import kernel

_compile = kernel()


@_compile("const f8[:,:,:], const f8[:,:], f8[:,:], f8[:]")
def nearest_on_triangles(corners, points, shares, away):
    """Put the shares of the nearest points of *corners* (k, 3, 3), and how far they are, out.

    From *points* (k, 3) into *shares* (k, 3), which are 0, and *away* (k,).
    """
    for t in range(len(corners)):
        x, y, z = points[t, 0], points[t, 1], points[t, 2]
        ax, ay, az = corners[t, 0, 0] - x, corners[t, 0, 1] - y, corners[t, 0, 2] - z
        bx, by, bz = corners[t, 1, 0] - x, corners[t, 1, 1] - y, corners[t, 1, 2] - z
        cx, cy, cz = corners[t, 2, 0] - x, corners[t, 2, 1] - y, corners[t, 2, 2] - z
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - bx, cy - by, cz - bz
        nearest, edge, along = math.inf, 0, 0.0
        for e, px, py, pz, dx, dy, dz in (
            (0, ax, ay, az, ux, uy, uz),
            (1, bx, by, bz, vx, vy, vz),
            (2, cx, cy, cz, ax - cx, ay - cy, az - cz),
        ):
            square = dx * dx + dy * dy + dz * dz
            s = 0.0
            if square > 0.0:
                s = min(max(-(px * dx + py * dy + pz * dz) / square, 0.0), 1.0)
            qx, qy, qz = px + s * dx, py + s * dy, pz + s * dz
            off = math.sqrt(qx * qx + qy * qy + qz * qz)
            if off < nearest:
                nearest, edge, along = off, e, s
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        size = nx * nx + ny * ny + nz * nz
        of_a = nx * (by * cz - bz * cy) + ny * (bz * cx - bx * cz) + nz * (bx * cy - by * cx)
        of_b = nx * (cy * az - cz * ay) + ny * (cz * ax - cx * az) + nz * (cx * ay - cy * ax)
        of_c = nx * (ay * bz - az * by) + ny * (az * bx - ax * bz) + nz * (ax * by - ay * bx)
        if size > 0.0 and of_a >= 0.0 and of_b >= 0.0 and of_c >= 0.0:
            total = of_a + of_b + of_c
            shares[t, 0], shares[t, 1], shares[t, 2] = of_a / total, of_b / total, of_c / total
            away[t] = abs(ax * nx + ay * ny + az * nz) / math.sqrt(size)
        else:
            shares[t, edge] = 1.0 - along
            shares[t, (edge + 1) % 3] = along
            away[t] = nearest
