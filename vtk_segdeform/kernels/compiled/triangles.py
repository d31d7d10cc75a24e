"""Areas and cuts of faces, and equal points, for `mesh` and `polygons`.

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


@_compile("i1[:], f8, const f8[:,:], const i8[:,:]")
def quad_cuts(cut, square, points, quads):
    """Put into *cut* (q,) along which diagonal to cut each of *quads* (q, 4).

    0 or 1, from that corner; 2 is 1, as long as the other; -1 if two of the normals at corners are
    not on the same side, or the height of a corner over a diagonal may have a smaller *square*.
    """
    up = np.empty((4, 3))
    for q in range(len(quads)):
        for k in range(4):
            i, j, h = quads[q, k], quads[q, (k + 1) % 4], quads[q, (k + 3) % 4]
            ux, uy, uz = (
                points[j, 0] - points[i, 0],
                points[j, 1] - points[i, 1],
                points[j, 2] - points[i, 2],
            )
            vx, vy, vz = (
                points[h, 0] - points[i, 0],
                points[h, 1] - points[i, 1],
                points[h, 2] - points[i, 2],
            )
            up[k, 0] = uy * vz - uz * vy
            up[k, 1] = uz * vx - ux * vz
            up[k, 2] = ux * vy - uy * vx
        i, j = quads[q, 0], quads[q, 2]
        x, y, z = (
            points[i, 0] - points[j, 0],
            points[i, 1] - points[j, 1],
            points[i, 2] - points[j, 2],
        )
        first = (x * x + y * y) + z * z
        i, j = quads[q, 1], quads[q, 3]
        x, y, z = (
            points[i, 0] - points[j, 0],
            points[i, 1] - points[j, 1],
            points[i, 2] - points[j, 2],
        )
        second = (x * x + y * y) + z * z
        convex = True
        for k in range(4):
            x, y, z = up[k, 0], up[k, 1], up[k, 2]
            convex &= (x * x + y * y) + z * z >= square * first
            convex &= (x * x + y * y) + z * z >= square * second
            for j in range(k):
                convex &= (x * up[j, 0] + y * up[j, 1]) + z * up[j, 2] > 0.0
        if not convex:
            cut[q] = -1
        elif first < second:
            cut[q] = 0
        else:
            cut[q] = 2 if first == second else 1


@_compile("i8[:,:], b1[:], f8, const f8[:,:], const i8[:], const i8[:], const i8[:], const i8[:]")
def convex_cuts(faces, is_cut, least, points, first, starts, counts, corners):
    """Put into *is_cut* (q,) which polygons are convex, and into *faces* (k, 3) their triangles.

    Polygon q has the corners from ``starts[q]`` and the rows from ``first[q]``; those of polygons
    that are not convex are not changed.  The ear with the shortest diagonal is cut first, of equal
    ones the first.  *least* is the square of the least sine of a corner.
    """
    most = counts.max() if len(counts) else 0
    sx, sy, sz, length = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    ring = np.empty(most, dtype=np.int64)
    for q in range(len(counts)):
        n, start, row = counts[q], starts[q], first[q]
        o = corners[start]
        for k in range(n):
            i = corners[start + k]
            ring[k] = k
            sx[k], sy[k], sz[k] = (
                points[i, 0] - points[o, 0],
                points[i, 1] - points[o, 1],
                points[i, 2] - points[o, 2],
            )
        ux = uy = uz = 0.0
        for k in range(1, n - 1):
            ux += sy[k] * sz[k + 1] - sz[k] * sy[k + 1]
            uy += sz[k] * sx[k + 1] - sx[k] * sz[k + 1]
            uz += sx[k] * sy[k + 1] - sy[k] * sx[k + 1]
        size = (ux * ux + uy * uy) + uz * uz
        convex = True
        for k in range(1, n - 1):
            x, y = sy[k] * sz[k + 1] - sz[k] * sy[k + 1], sz[k] * sx[k + 1] - sx[k] * sz[k + 1]
            z = sx[k] * sy[k + 1] - sy[k] * sx[k + 1]
            convex &= (x * ux + y * uy) + z * uz > 0.0
        for k in range(n):
            i, j = (k + 1 if k + 1 < n else 0), (k - 1 if k else n - 1)
            ax, ay, az = sx[i] - sx[k], sy[i] - sy[k], sz[i] - sz[k]
            bx, by, bz = sx[j] - sx[k], sy[j] - sy[k], sz[j] - sz[k]
            x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            up = (x * ux + y * uy) + z * uz
            lengths = ((ax * ax + ay * ay) + az * az) * ((bx * bx + by * by) + bz * bz)
            convex &= up > 0.0 and up * up >= least * (size * lengths)
            x, y, z = sx[i] - sx[j], sy[i] - sy[j], sz[i] - sz[j]
            length[k] = (x * x + y * y) + z * z  # of the diagonal of ear k
        is_cut[q] = convex
        left = n if convex else 0
        while left > 3:
            ear = 0
            for k in range(1, left):
                if length[k] < length[ear]:
                    ear = k
            faces[row, 0] = corners[start + ring[ear - 1 if ear else left - 1]]
            faces[row, 1] = corners[start + ring[ear]]
            faces[row, 2] = corners[start + ring[ear + 1 if ear + 1 < left else 0]]
            row += 1
            left -= 1
            for k in range(ear, left):
                ring[k], length[k] = ring[k + 1], length[k + 1]
            for k in (ear - 1 if ear else left - 1, ear if ear < left else 0):
                i, j = ring[k + 1 if k + 1 < left else 0], ring[k - 1 if k else left - 1]
                x, y, z = sx[i] - sx[j], sy[i] - sy[j], sz[i] - sz[j]
                length[k] = (x * x + y * y) + z * z
        if convex:
            for k in range(3):
                faces[row, k] = corners[start + ring[k]]


@_compile("i8[:,:], const i8[:], const i8[:,:], const i1[:]")
def quad_halves(faces, first, quads, cut):
    """Put the two triangles of each of *quads* (q, 4) into *faces*, at *first* (q,) and after it.

    *cut* (q,) is as of `quad_cuts`; quads that are not cut are skipped.
    """
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        k = first[q]
        if cut[q] == 0:
            faces[k, 0], faces[k, 1], faces[k, 2] = a, b, c
            faces[k + 1, 0], faces[k + 1, 1], faces[k + 1, 2] = a, c, d
        elif cut[q] > 0:
            faces[k, 0], faces[k, 1], faces[k, 2] = a, b, d
            faces[k + 1, 0], faces[k + 1, 1], faces[k + 1, 2] = b, c, d


@_compile(
    "b1[:], f8, f8, const f8[:,:], const i8[:], const i8[:], const i8[:], const i8[:,:], "
    "const i8[:]"
)
def wrongly_cut(failed, down, planar, points, starts, counts, corners, faces, polygon):
    """Mark polygons with too few triangles, or planar with one upside down, in *failed* (m,).

    *faces* (k, 3) are the triangles, and *polygon* (k,) are those of which, in ascending order.
    """
    first = 0
    for p in range(len(counts)):
        begin, n, last = starts[p], counts[p], first
        while last < len(polygon) and polygon[last] == p:
            last += 1
        o = corners[begin]
        ux, uy, uz, n_repeated = 0.0, 0.0, 0.0, 0
        for k in range(n):
            i, j = corners[begin + k], corners[begin + (k + 1) % n]
            n_repeated += i == j
            ax, ay, az = (
                points[i, 0] - points[o, 0],
                points[i, 1] - points[o, 1],
                points[i, 2] - points[o, 2],
            )
            bx, by, bz = (
                points[j, 0] - points[o, 0],
                points[j, 1] - points[o, 1],
                points[j, 2] - points[o, 2],
            )
            ux += ay * bz - az * by
            uy += az * bx - ax * bz
            uz += ax * by - ay * bx
        failed[p] = last - first < n - n_repeated - 2
        square = (ux * ux + uy * uy) + uz * uz
        is_down = False
        for f in range(first, last):
            i, j, h = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = (
                points[j, 0] - points[i, 0],
                points[j, 1] - points[i, 1],
                points[j, 2] - points[i, 2],
            )
            bx, by, bz = (
                points[h, 0] - points[i, 0],
                points[h, 1] - points[i, 1],
                points[h, 2] - points[i, 2],
            )
            x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            is_down |= (x * ux + y * uy) + z * uz < down * square
        if is_down:
            height, size = 0.0, 0.0
            for k in range(n):
                i = corners[begin + k]
                ax, ay, az = (
                    points[i, 0] - points[o, 0],
                    points[i, 1] - points[o, 1],
                    points[i, 2] - points[o, 2],
                )
                height = max(height, abs((ax * ux + ay * uy) + az * uz))
                size = max(size, abs(ax), abs(ay), abs(az))
            failed[p] |= height <= planar * np.sqrt(square) * size
        first = last


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
