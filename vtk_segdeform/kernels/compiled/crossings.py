"""Pairs of triangles that may meet, for `near_faces`: a tree of boxes, and planes that separate.

The few pairs that remain are tested in numpy (`intersections`).  A pair is left out only if it is
apart by more than that test's tolerance and rounding.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile, _inline = kernel(), kernel(forceinline=True)

_SLACK = 1e-11  # of a pair's extent
_ROUNDING = 1e-15
_FOLD = 1e-6  # sine of the angle between two faces folded over their common edge
_DEEPEST = 64  # levels of a tree
_NEXT = 1, 2, 0


@_compile("f8[:,:], f8[:,:], f8[:,:], const f8[:,:], const i8[:,:]")
def grow_tree(boxes, tree, planes, points, faces):
    """Put the boxes (m, 6) of *faces*, those of a binary tree over them, and their planes in place.

    The faces of leaf i of *tree* (2 k, 6), of k leaves, are m / k in a row.  Node i contains the
    nodes 2 i and 2 i + 1; node 0 is unused.  *planes* (m, 4) are unit normals and their errors.
    """
    m, k = len(faces), len(tree) // 2
    size = -(-m // k)
    for i in range(len(tree)):
        for axis in range(3):
            tree[i, axis], tree[i, 3 + axis] = np.inf, -np.inf
    for f in range(m):
        leaf, a, b, c = k + f // size, faces[f, 0], faces[f, 1], faces[f, 2]
        for axis in range(3):
            x, y, z = points[a, axis], points[b, axis], points[c, axis]
            boxes[f, axis], boxes[f, 3 + axis] = min(x, y, z), max(x, y, z)
            tree[leaf, axis] = min(tree[leaf, axis], boxes[f, axis])
            tree[leaf, 3 + axis] = max(tree[leaf, 3 + axis], boxes[f, 3 + axis])
        ux, uy, uz = _between(points, a, b)
        vx, vy, vz = _between(points, a, c)
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = np.sqrt(x * x + y * y + z * z)
        longest = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
        share = 1.0 / area if area > 0.0 else 0.0
        planes[f, 0], planes[f, 1], planes[f, 2] = x * share, y * share, z * share
        planes[f, 3] = _SLACK + _ROUNDING * longest * share if area > 0.0 else np.inf
    for i in range(k - 1, 0, -1):
        for axis in range(3):
            tree[i, axis] = min(tree[2 * i, axis], tree[2 * i + 1, axis])
            tree[i, 3 + axis] = max(tree[2 * i, 3 + axis], tree[2 * i + 1, 3 + axis])


@_compile("i8[:,:], const f8[:,:], const f8[:,:], const b1[:], i8, i8")
def touching_boxes(pairs, boxes, tree, asked, start, stop):
    """Put the pairs of faces whose boxes touch into *pairs* (k, 2); return their number.

    The first face is in one of the leaves start..stop and before the second, and one of both is
    *asked* (m,).  *pairs* is filled as far as it goes.
    """
    k, m, count = len(tree) // 2, len(boxes), 0
    size = -(-m // k)
    nodes, lasts = np.empty(_DEEPEST, dtype=np.int64), np.empty(_DEEPEST, dtype=np.int64)
    for leaf in range(start, stop):
        begin, end = size * leaf, min(size * (leaf + 1), m)
        nodes[0], lasts[0], top = 1, k - 1, 1
        while top:
            top -= 1
            node, last = nodes[top], lasts[top]
            if last < leaf or _are_apart(tree, node, tree, k + leaf):
                continue
            if node < k:
                half = 1
                while node * 2 * half < k:
                    half *= 2
                nodes[top], lasts[top] = 2 * node, last - half
                nodes[top + 1], lasts[top + 1] = 2 * node + 1, last
                top += 2
                continue
            first = size * (node - k)
            for i in range(begin, end):
                if _are_apart(boxes, i, tree, node):
                    continue
                for j in range(max(first, i + 1), min(first + size, m)):
                    if (asked[i] or asked[j]) and not _are_apart(boxes, i, boxes, j):
                        if count < len(pairs):
                            pairs[count, 0], pairs[count, 1] = i, j
                        count += 1
    return count


@_compile("b1[:], const i8[:,:], const f8[:,:], const f8[:,:], const i8[:,:]")
def may_meet(found, pairs, planes, points, faces):
    """Put into *found* (k,) bool which *pairs* (k, 2) of faces may meet outside common corners."""
    corners, d = np.empty((6, 3)), np.empty(6)  # a common one first, and distances from the other
    for pair in range(len(pairs)):
        i, j = pairs[pair, 0], pairs[pair, 1]
        shared, alone_i, alone_j, at_i, at_j = 0, 3, 3, 0, 0
        for a in range(3):
            for b in range(3):
                if faces[i, a] == faces[j, b]:
                    shared += 1
                    alone_i, alone_j, at_i, at_j = alone_i - a, alone_j - b, a, b
        error = max(planes[i, 3], planes[j, 3])
        if shared == 3:
            found[pair] = True
            continue
        if shared == 2:
            x, y, z = planes[i, 0], planes[i, 1], planes[i, 2]
            u, v, w = planes[j, 0], planes[j, 1], planes[j, 2]
            begin_i, begin_j = faces[i, _NEXT[alone_i]], faces[j, _NEXT[alone_j]]
            is_folded = (x * u + y * v + z * w < 0.0) == (begin_i != begin_j)
            x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
            sine = np.sqrt(x * x + y * y + z * z)
            found[pair] = is_folded and sine <= _FOLD + 2.0 * error
            continue
        origin, extent = faces[i, at_i], 0.0
        for c in range(3):
            a, b = faces[i, at_i], faces[j, at_j]
            at_i, at_j = _NEXT[at_i], _NEXT[at_j]
            for axis in range(3):
                corners[c, axis] = points[a, axis] - points[origin, axis]
                corners[3 + c, axis] = points[b, axis] - points[origin, axis]
                extent = max(extent, abs(corners[c, axis]), abs(corners[3 + c, axis]))
        slack = error * extent
        found[pair] = True
        for own in (0, 3):
            plane = j if own == 0 else i
            above = below = True
            for c in range(own, own + 3):
                d[c] = 0.0
                for axis in range(3):
                    d[c] += (corners[c, axis] - corners[3 - own, axis]) * planes[plane, axis]
                if c >= own + shared:
                    above &= d[c] > slack
                    below &= d[c] < -slack
            if above or below:
                found[pair] = False
        if not found[pair]:
            continue
        found[pair] = False
        for own in (0, 3):
            plane = j if own == 0 else i
            nx, ny, nz = planes[plane, 0], planes[plane, 1], planes[plane, 2]
            for c in range(shared, 2 if shared else 3):
                begin, end = own + c, own + _NEXT[c]
                p, q = d[begin], d[end]
                if (p > slack and q > slack) or (p < -slack and q < -slack):
                    continue
                inside = True
                if abs(p - q) > 4.0 * slack:
                    share = p / (p - q)
                    x, y, z = _between(corners, begin, end)
                    reach = slack * (1.0 + np.sqrt(x * x + y * y + z * z) / abs(p - q))
                    for e in range(3):
                        at = 3 - own + e
                        ux, uy, uz = _between(corners, at, 3 - own + _NEXT[e])
                        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
                        wx, wy, wz = _between(corners, at, begin)
                        along = (
                            vx * (wx + share * x) + vy * (wy + share * y) + vz * (wz + share * z)
                        )
                        inside &= along >= -reach * np.sqrt(vx * vx + vy * vy + vz * vz)
                found[pair] |= inside


@_inline()
def _between(points, a, b):
    return points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]


@_inline()
def _are_apart(some, i, others, j):
    """Return whether box i of *some* and box j of *others* do not touch."""
    x = some[i, 0] > others[j, 3] or others[j, 0] > some[i, 3]
    y = some[i, 1] > others[j, 4] or others[j, 1] > some[i, 4]
    return x or y or some[i, 2] > others[j, 5] or others[j, 2] > some[i, 5]
