"""Volumes and boxes of shells, and which shell is around which, for `mesh`.

The same operations in the same order as their equivalents in numpy, so that results are equal;
only `shells_around` counts where numpy computes winding numbers.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()
_UNSURE = 1 << 40  # a count that no surface has


@_compile("f8[:], f8[:], f8[:], const f8[:,:], const f8[:,:], const i8[:,:], const i8[:]")
def shell_sums(volume, area, size, origins, points, faces, shells):
    """Add to *volume* and *area* (k,) of each shell six times and twice those of its faces.

    The origin (k, 3) of a shell is the apex of volumes, and *size* (k,) becomes the largest
    distance of a first corner from it.  *shells* (m,) is not read if there is only one.
    """
    several = len(origins) > 1
    for f in range(len(faces)):
        s = shells[f] if several else 0
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ox, oy, oz = origins[s, 0], origins[s, 1], origins[s, 2]
        ax, ay, az = points[i, 0] - ox, points[i, 1] - oy, points[i, 2] - oz
        bx, by, bz = points[j, 0] - ox, points[j, 1] - oy, points[j, 2] - oz
        cx, cy, cz = points[k, 0] - ox, points[k, 1] - oy, points[k, 2] - oz
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        volume[s] += (ax * x + ay * y) + az * z
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area[s] += np.sqrt((x * x + y * y) + z * z)
        size[s] = max(size[s], np.sqrt((ax * ax + ay * ay) + az * az))


@_compile("i8[:,:], const i8[:], const f8[:,:], const i8[:,:], const i8[:], const i8[:]")
def shell_extremes(extremes, some, points, faces, starts, stops):
    """Put the vertices with the least and the largest x, y, z of *some* shells into their rows.

    *extremes* (k, 6) must be filled with -1; the faces of shell s are ``starts[s]:stops[s]``.
    """
    for s in some:
        for f in range(starts[s], stops[s]):
            for c in range(3):
                v = faces[f, c]
                for axis in range(3):
                    x, low, high = points[v, axis], extremes[s, axis], extremes[s, 3 + axis]
                    if low < 0 or x < points[low, axis] or (x == points[low, axis] and v < low):
                        extremes[s, axis] = v
                    if high < 0 or x > points[high, axis] or (x == points[high, axis] and v < high):
                        extremes[s, 3 + axis] = v


@_compile()
def _side(points, tail, head, x, y):
    """Return twice the area of tail, head and a column at x, y, as `inside._side`."""
    a, b = min(tail, head), max(tail, head)
    along, across = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    area = along * (y - points[a, 1]) - across * (x - points[a, 0])
    if area == 0.0:
        shift = along if across == 0.0 else -across
        area = 1.0 if shift >= 0.0 else -1.0
    return area if tail < head else -area


@_compile()
def _faces_below(points, faces, start, stop, x, y, z, near):
    """Return how many of faces start..stop are below, +1 looking down, -1 looking up.

    `_UNSURE` if the distance to one of them may be at most *near*.
    """
    count = 0
    for f in range(start, stop):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, bx, cx = points[i, 0] - x, points[j, 0] - x, points[k, 0] - x
        if min(ax, bx, cx) > near or max(ax, bx, cx) < -near:
            continue
        ay, by, cy = points[i, 1] - y, points[j, 1] - y, points[k, 1] - y
        if min(ay, by, cy) > near or max(ay, by, cy) < -near:
            continue
        az, bz, cz = points[i, 2] - z, points[j, 2] - z, points[k, 2] - z
        if min(az, bz, cz) > near or i == j or j == k or k == i:
            continue
        is_below = True
        if max(az, bz, cz) >= -near:
            ux, uy, uz = bx - ax, by - ay, bz - az
            vx, vy, vz = cx - ax, cy - ay, cz - az
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            height = ax * nx + ay * ny + az * nz
            if height * height <= near * near * (nx * nx + ny * ny + nz * nz):
                return _UNSURE
            is_below = height * nz < 0.0
        one, two = _side(points, i, j, x, y) > 0.0, _side(points, j, k, x, y) > 0.0
        if is_below and one == two and one == (_side(points, k, i, x, y) > 0.0):
            count += -1 if one else 1
    return count


@_compile()
def _winding(points, faces, start, stop, x, y, z, near):
    """Return the winding number of faces start..stop around a point, as `inside`."""
    number = 0.0
    for f in range(start, stop):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        bx, by, bz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
        cx, cy, cz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
        a = np.sqrt(ax * ax + ay * ay + az * az)
        b = np.sqrt(bx * bx + by * by + bz * bz)
        c = np.sqrt(cx * cx + cy * cy + cz * cz)
        below = a * b * c + (ax * bx + ay * by + az * bz) * c
        below += (bx * cx + by * cy + bz * cz) * a + (cx * ax + cy * ay + cz * az) * b
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        if near > 0.0:
            ux, uy, uz = bx - ax, by - ay, bz - az
            vx, vy, vz = cx - ax, cy - ay, cz - az
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            if abs(volume) <= near * np.sqrt(nx * nx + ny * ny + nz * nz):
                continue
        number += np.arctan2(volume, below)
    return number / (2.0 * np.pi)


@_compile(
    "b1[:], const i8[:,:], const i8[:,:], f8, const f8[:], const f8[:,:], const i8[:,:], "
    "const i8[:], const i8[:], const i8[:,:], const i8[:], const i8[:], i8, i8"
)
def shells_around(
    found,
    pairs,
    extremes,
    inside,
    near,
    points,
    faces,
    starts,
    stops,
    cones,
    firsts,
    lasts,
    start,
    stop,
):
    """Put into *found* (p,) of *pairs* start..stop whether the first shell is around the second.

    That is if the winding number around all *extremes* of the second is above *inside*.  The
    *cones* of shell s, ``firsts[s]:lasts[s]``, close it: the winding number of both together is
    counted along columns, see `inside`, and that of the cones is subtracted.  If a face is so
    *near* (k,) that the count depends on rounding, the winding number is computed instead.
    """
    for p in range(start, stop):
        outer, inner = pairs[p, 0], pairs[p, 1]
        begin, end, first, last = starts[outer], stops[outer], firsts[outer], lasts[outer]
        found[p] = True
        for v in extremes[inner]:
            x, y, z = points[v, 0], points[v, 1], points[v, 2]
            count = _faces_below(points, faces, begin, end, x, y, z, near[outer])
            more = _faces_below(points, cones, first, last, x, y, z, near[outer])
            if count == _UNSURE or more == _UNSURE:
                number = _winding(points, faces, begin, end, x, y, z, near[outer])
            else:
                number = count + more - _winding(points, cones, first, last, x, y, z, 0.0)
            if abs(number) <= inside:
                found[p] = False
                break
