"""Areas of faces, and equal points, for `mesh`.

The same operations in the same order as their equivalents in numpy, so that results are equal.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()


@_compile("b1[:], const f8[:,:], const i8[:,:], f8, i8, i8")
def flat_faces(flat, points, faces, share, start, stop):
    """Put into *flat* (m,) which of faces start..stop are at most *share* as high as long.

    That is twice the area over the square of the longest edge.  NaN is not flat.
    """
    for f in range(start, stop):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
        bx, by, bz = points[j, 0], points[j, 1], points[j, 2]
        cx, cy, cz = points[k, 0], points[k, 1], points[k, 2]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        wx, wy, wz = cx - bx, cy - by, cz - bz
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = np.sqrt((x * x + y * y) + z * z)
        first = (ux * ux + uy * uy) + uz * uz
        second = (wx * wx + wy * wy) + wz * wz
        third = (vx * vx + vy * vy) + vz * vz  # of a - c, with the same squares
        # All three, as the longest of NaN and numbers is NaN
        flat[f] = (area <= share * max(first, second, third)) and (
            first == first and second == second and third == third
        )


@_compile("f8[:], const f8[:,:], const i8[:,:], i8, i8")
def face_areas(areas, points, faces, start, stop):
    """Put the areas of faces start..stop into *areas* (m,)."""
    for f in range(start, stop):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
        ux, uy, uz = points[j, 0] - ax, points[j, 1] - ay, points[j, 2] - az
        vx, vy, vz = points[k, 0] - ax, points[k, 1] - ay, points[k, 2] - az
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        areas[f] = 0.5 * np.sqrt((x * x + y * y) + z * z)


@_compile("i8[:], const f8[:,:], i4[:]")
def first_equal_points(first, points, table):
    """Put the first row equal to each of *points* (n, 3) into *first* (n,); NaN equals nothing.

    *table* (a power of two above n,) must be filled with -1.
    """
    mask = np.uint64(len(table) - 1)
    bits = np.zeros(3, np.float64)
    as_bits = bits.view(np.uint64)
    for i in range(len(points)):
        x, y, z = points[i, 0] + 0.0, points[i, 1] + 0.0, points[i, 2] + 0.0  # 0 and -0 are equal
        bits[0], bits[1], bits[2] = x, y, z
        mixed = np.uint64(0)
        for c in range(3):
            mixed = (mixed ^ as_bits[c]) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        first[i] = i
        if x != x or y != y or z != z:
            continue
        slot = mixed & mask
        while table[slot] >= 0:
            j = table[slot]
            if points[j, 0] == x and points[j, 1] == y and points[j, 2] == z:
                first[i] = j
                break
            slot = (slot + np.uint64(1)) & mask
        else:
            table[slot] = i
