"""A round of edge collapses, for `cages.simplify`; to the bit what its numpy does.

Row v of *sums* (n, 11) is accumulated in vertex v: the entries xx, xy, xz, yy, yz, zz of A, then b,
c and the area.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()
_TINY = np.finfo(float).tiny
_ROUND = 2.0 * np.sqrt(3.0)


@_compile("i8[:], i8[:], i8[:,:], i8[:], i8[:], i8[:], const i8[:,:]")
def sorted_edges(i, j, ends, starts, upper, apex, faces):
    """Put the edges *i* < *j* (e,) of a closed surface into lexicographic order.

    Put the vertices opposite to each into *ends* (e, 2).  *starts* (n + 2,), *upper* (2e,) and
    *apex* (2e,) are of any values.
    """
    n = len(starts) - 2
    starts[:] = 0
    for f in range(len(faces)):
        for c in range(3):
            starts[min(faces[f, c], faces[f, (c + 1) % 3]) + 2] += 1
    for v in range(n):
        starts[v + 2] += starts[v + 1]
    for f in range(len(faces)):
        for c in range(3):
            a, b = faces[f, c], faces[f, (c + 1) % 3]
            k = starts[min(a, b) + 1]
            starts[min(a, b) + 1] = k + 1
            upper[k] = 2 * max(a, b) + (a > b)  # of two half-edges, the one that runs up is first
            apex[k] = faces[f, (c + 2) % 3]
    e = 0
    for v in range(n):
        for k in range(starts[v] + 1, starts[v + 1]):  # by insertion: vertices have few neighbours
            at, code, tip = k, upper[k], apex[k]
            while at > starts[v] and upper[at - 1] > code:
                upper[at], apex[at] = upper[at - 1], apex[at - 1]
                at -= 1
            upper[at], apex[at] = code, tip
        first = starts[v]
        while first < starts[v + 1]:
            last = first
            while last < starts[v + 1] and upper[last] >> 1 == upper[first] >> 1:
                last += 1
            half = (last - first) // 2  # run up, as many down; one each unless edges coincide
            for k in range(first, first + half):
                i[e], j[e] = v, upper[k] >> 1
                ends[e, 0], ends[e, 1] = apex[k], apex[k + half]
                e += 1
            first = last


@_compile(
    "f8[:], f8[:,:], const i8[:], const i8[:], const i8[:], const i8[:], const f8[:], "
    "const f8[:,:], const b1[:], f8, f8, const f8[:,:], const f8[:,:]"
)
def collapse_costs(
    cost, place, i, j, old_i, old_j, old_cost, old_place, is_moved, stiff, square, points, sums
):
    """Put the costs of edges into *cost* (e,), and the points that they collapse to into *place*.

    Edges between vertices that have not moved are in the same order among the old edges.
    """
    old = 0
    for e in range(len(cost)):
        v, w = i[e], j[e]
        if not (is_moved[v] or is_moved[w]):
            while is_moved[old_i[old]] or is_moved[old_j[old]]:
                old += 1
            cost[e] = old_cost[old]
            for k in range(3):
                place[e, k] = old_place[old, k]
            old += 1
            continue
        xx, xy, xz = (
            sums[v, 0] + sums[w, 0],
            sums[v, 1] + sums[w, 1],
            sums[v, 2] + sums[w, 2],
        )
        yy, yz, zz = (
            sums[v, 3] + sums[w, 3],
            sums[v, 4] + sums[w, 4],
            sums[v, 5] + sums[w, 5],
        )
        bx, by, bz = (
            sums[v, 6] + sums[w, 6],
            sums[v, 7] + sums[w, 7],
            sums[v, 8] + sums[w, 8],
        )
        c, area = sums[v, 9] + sums[w, 9], sums[v, 10] + sums[w, 10]
        x = 0.5 * (points[v, 0] + points[w, 0])
        y = 0.5 * (points[v, 1] + points[w, 1])
        z = 0.5 * (points[v, 2] + points[w, 2])
        pull_x = bx - ((xx * x + xy * y) + xz * z)
        pull_y = by - ((xy * x + yy * y) + yz * z)
        pull_z = bz - ((xz * x + yz * y) + zz * z)
        more = stiff * ((xx + yy) + zz)
        p, q, r = xx + more, yy + more, zz + more
        a00, a01, a02 = q * r - yz * yz, yz * xz - xy * r, xy * yz - q * xz
        a11, a12, a22 = r * p - xz * xz, xz * xy - yz * p, p * q - xy * xy
        volume = (p * a00 + xy * a01) + xz * a02
        x += ((a00 * pull_x + a01 * pull_y) + a02 * pull_z) / volume
        y += ((a01 * pull_x + a11 * pull_y) + a12 * pull_z) / volume
        z += ((a02 * pull_x + a12 * pull_y) + a22 * pull_z) / volume
        quadratic = ((xx * x + xy * y) + xz * z) * x + ((xy * x + yy * y) + yz * z) * y
        quadratic += ((xz * x + yz * y) + zz * z) * z
        error = (quadratic - 2.0 * ((bx * x + by * y) + bz * z)) + c
        dx, dy, dz = (
            points[v, 0] - points[w, 0],
            points[v, 1] - points[w, 1],
            points[v, 2] - points[w, 2],
        )
        cost[e] = error + square * area * ((dx * dx + dy * dy) + dz * dz)
        place[e, 0], place[e, 1], place[e, 2] = x, y, z


@_compile("i8[:], i8[:], i8, i8[:], i8[:], b1[:], b1[:], const i8[:], const i8[:]")
def independent_edges(chosen, cheap, passes, least, near, reach, beyond, i, j):
    """Put edges of *cheap* (c,), in ascending order of cost, into *chosen*; return how many.

    *cheap* is overwritten; *least*, *near* (n,) int64 and *reach*, *beyond* (n,) bool are of any
    values.
    """
    n, most, count, left = len(least), len(i), 0, len(cheap)
    for _ in range(passes):
        for v in range(n):
            least[v], reach[v] = most, False
        for rank in range(left):
            e = cheap[rank]
            least[i[e]] = min(least[i[e]], rank)
            least[j[e]] = min(least[j[e]], rank)
        for _ in range(2):
            for v in range(n):
                near[v] = least[v]
            for e in range(most):
                near[i[e]] = min(near[i[e]], least[j[e]])
                near[j[e]] = min(near[j[e]], least[i[e]])
            for v in range(n):
                least[v] = near[v]
        for rank in range(left):
            e = cheap[rank]
            if min(least[i[e]], least[j[e]]) == rank:
                chosen[count] = e
                count += 1
        for k in range(count):
            reach[i[chosen[k]]] = reach[j[chosen[k]]] = True
        for _ in range(2):
            for v in range(n):
                beyond[v] = reach[v]
            for e in range(most):
                if reach[i[e]] or reach[j[e]]:
                    beyond[i[e]] = beyond[j[e]] = True
            for v in range(n):
                reach[v] = beyond[v]
        kept = 0
        for rank in range(left):
            e = cheap[rank]
            if not (reach[i[e]] or reach[j[e]]):
                cheap[kept] = e
                kept += 1
        left = kept
    return count


@_compile(
    "b1[:], const i8[:], i8[:], i8[:], i8[:], f8[:], f8[:], f8, const f8[:,:], const f8[:,:], "
    "const i8[:,:]"
)
def valid_collapses(good, owner, count, of, common, sharp, blunt, turn, place, points, faces):
    """Put into *good* (k,) which collapses of the edges *owner* (n,), -1 if none, are valid.

    *blunt* (k,) is the least roundness that is always allowed.  *count* (n,), *common* (k,) are
    zero, *sharp* (k,) is infinite, and *of* (n,) is of any values.
    """
    corners, moved = np.empty((3, 3)), np.empty((3, 3))
    for f in range(len(faces)):
        for c in range(3):
            tail, head = faces[f, c], faces[f, (c + 1) % 3]
            if owner[tail] < 0 and owner[head] >= 0:
                count[tail] += 1
                of[tail] = owner[head]
    for v in range(len(owner)):
        if count[v] >= 2:
            common[of[v]] += 1
    for e in range(len(good)):
        good[e] = common[e] == 2
    for f in range(len(faces)):
        e, n_owned = -1, 0
        for c in range(3):
            if owner[faces[f, c]] >= 0:
                e = owner[faces[f, c]]
                n_owned += 1
        if n_owned != 1:
            continue
        for c in range(3):
            for k in range(3):
                corners[c, k] = moved[c, k] = points[faces[f, c], k]
                if owner[faces[f, c]] >= 0:
                    moved[c, k] = place[e, k]
        x, y, z, before = _normal(corners)
        u, v, w, after = _normal(moved)
        if not (x * u + y * v) + z * w > turn:
            good[e] = False
        blunt[e] = min(blunt[e], before)
        sharp[e] = min(sharp[e], after)
    for e in range(len(good)):
        if sharp[e] < blunt[e]:
            good[e] = False


@_compile()
def _normal(p):
    """Return the unit normal of a triangle (3, 3), and its roundness."""
    ux, uy, uz = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
    vx, vy, vz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
    wx, wy, wz = p[2, 0] - p[1, 0], p[2, 1] - p[1, 1], p[2, 2] - p[1, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    twice = np.sqrt((x * x + y * y) + z * z)
    edges = ((ux * ux + wx * wx) + vx * vx) + ((uy * uy + wy * wy) + vy * vy)
    edges += (uz * uz + wz * wz) + vz * vz
    length = max(twice, _TINY)
    return x / length, y / length, z / length, _ROUND * twice / max(edges, _TINY)
