"""Connectivity of triangles in linear time: half-edge pairs, fans and components, for `mesh`.

Half-edge 3 f + c runs from corner c of face f to the next, as in `mesh.topology`.  At vertex a,
face (a, b, c) links b to c; around a vertex with one fan, the links are a cycle or a path.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()
_LOW = 0xFFFFFFFF


@_compile("i4[:], i4[:], i4[:], i4[:], i8[:], const i8[:,:]")
def one_fan_each(border, starts, onward, backward, links, faces):
    """Return the number of half-edges without a twin, or -1 unless every vertex has one fan.

    Put into *border* (n,) the vertex to which such a half-edge runs from each vertex; -1 if none.
    *starts* (n + 2,), *onward* (n,), *backward* (n,) and *links* (3m,) int64 are of any values.  No
    face may repeat a vertex.
    """
    n = len(border)
    starts[:] = 0
    for f in range(len(faces)):
        for c in range(3):
            starts[faces[f, c] + 2] += 1
    for v in range(n):
        starts[v + 2] += starts[v + 1]
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        k = starts[a + 1]
        starts[a + 1], links[k] = k + 1, (b << 32) | c
        k = starts[b + 1]
        starts[b + 1], links[k] = k + 1, (c << 32) | a
        k = starts[c + 1]
        starts[c + 1], links[k] = k + 1, (a << 32) | b
    n_alone = 0
    for v in range(n):
        first, last = starts[v], starts[v + 1]
        border[v] = -1
        if first == last:
            continue
        for k in range(first, last):
            onward[links[k] & _LOW] = -1
        for k in range(first, last):
            onward[links[k] >> 32] = links[k] & _LOW
        begin = at = links[first] >> 32
        steps = 0
        while steps < last - first and at >= 0:
            steps += 1
            at = onward[at]
            if at == begin:
                break
        if at == begin:
            if steps < last - first or steps == 2:  # two faces with the same vertices
                return -1
            continue
        for k in range(first, last):
            backward[links[k] >> 32] = -1
        for k in range(first, last):
            backward[links[k] & _LOW] = 0
        at = -1
        for k in range(first, last):
            if backward[links[k] >> 32] < 0:
                at = links[k] >> 32
        border[v] = at
        n_alone += 1
        steps = 0
        while steps < last - first and at >= 0:
            steps += 1
            at = onward[at]
        if at < 0 or onward[at] >= 0:
            return -1
    return n_alone


@_compile("i8[:], i4[:], const i8[:,:]")
def border_half_edges(alone, border, faces):
    """Put the half-edges that run to the *border* (n,) of their first vertex into *alone*."""
    k = 0
    for f in range(len(faces)):
        for c in range(3):
            if border[faces[f, c]] == faces[f, (c + 1) % 3]:
                alone[k] = 3 * f + c
                k += 1


@_compile("i8[:], i8[:], i8[:], i8[:], const i8[:,:]")
def pair_half_edges(opposite, starts, edges, bucket, faces):
    """Put the other half-edge of each pair into *opposite* (3m,); -1 if alone, -2 if several.

    Return the numbers of half-edges that are alone, of those on edges of three or more, and of
    those in pairs with the same direction.

    Half-edges are put into a bucket for each lower vertex, as codes 2 h + (1 if h runs up).  A
    table over upper vertices then has for each edge the number of its half-edges, in the higher 32
    bits, and the exclusive or of their codes: with one code of a pair, it gives the other.
    *starts* (n + 2,), *edges* (n,) and *bucket* (3m,) int64 are of any values.
    """
    n = len(edges)
    starts[:] = 0
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        starts[min(a, b) + 2] += 1
        starts[min(b, c) + 2] += 1
        starts[min(c, a) + 2] += 1
    for v in range(n):
        starts[v + 2] += starts[v + 1]
    for f in range(len(faces)):
        a = faces[f, 0]
        for c in range(3):
            b = faces[f, c + 1] if c < 2 else faces[f, 0]
            k = starts[min(a, b) + 1]
            starts[min(a, b) + 1] = k + 1
            bucket[k] = (max(a, b) << 32) | (6 * f + 2 * c + (a < b))
            a = b
    n_alone, n_several, n_parallel = 0, 0, 0
    for v in range(n):
        first, last = starts[v], starts[v + 1]
        for k in range(first, last):
            edges[bucket[k] >> 32] = 0
        for k in range(first, last):
            end = bucket[k] >> 32
            edges[end] = (edges[end] + (_LOW + 1)) ^ (bucket[k] & _LOW)
        for k in range(first, last):
            edge, code = edges[bucket[k] >> 32], bucket[k] & _LOW
            if edge >> 32 == 2:
                other = (edge & _LOW) ^ code
                opposite[code >> 1] = other >> 1
                n_parallel += (other ^ code ^ 1) & 1
            elif edge >> 32 == 1:
                opposite[code >> 1] = -1
                n_alone += 1
            else:
                opposite[code >> 1] = -2
                n_several += 1
    return n_alone, n_several, n_parallel


@_compile("i8[:], const i8[:], const i8[:]")
def link(parent, one, other):
    """Join the trees of items one[i] and other[i]; *parent* (n,) of each is at most itself."""
    for i in range(len(one)):
        a, b = one[i], other[i]
        while parent[a] != a:
            parent[a] = parent[parent[a]]
            a = parent[a]
        while parent[b] != b:
            parent[b] = parent[parent[b]]
            b = parent[b]
        if a < b:
            parent[b] = a
        elif b < a:
            parent[a] = b


@_compile("i8[:]")
def number_trees(parent):
    """Replace the *parent* (n,) of each item by the number of its tree, by first members."""
    count = 0
    for i in range(len(parent)):
        if parent[i] == i:
            parent[i] = count
            count += 1
        else:
            parent[i] = parent[parent[i]]  # which has its number already


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
