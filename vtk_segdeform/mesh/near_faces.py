"""Pairs of faces that may meet, for `intersections`.

Compiled, the boxes of the faces form a binary tree over the faces in Morton order, in which near
ones are near each other, and pairs whose planes separate them are left out.  In numpy, pairs of
touching boxes are found by the distances of their centres.

Source
------
G. M. Morton, "A computer oriented geodetic data base", IBM, Ottawa 1966: the order.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import compiled_checks, in_parallel, inputs

_TIMES = 500  # the search takes as long as so many checks of each face
_LEAF = 8  # faces in a leaf of the tree, at most
_PIECE = 1_024  # leaves to a task
_NEAR = 10  # pairs of touching boxes per face for which space is reserved at first
_FACES = 10_000  # faces whose neighbourhoods are searched at once
_WIDER = 1.0 + 1e-12  # for rounding
_BITS = 10  # of each coordinate in the Morton order

_SPREAD = np.zeros(1 << _BITS, dtype=np.int64)  # the bits of each number, three places apart
for _bit in range(_BITS):
    _SPREAD |= (np.arange(1 << _BITS) >> _bit & 1) << 3 * _bit


def near_faces(points: FloatArray, faces: IntArray, asked: BoolArray) -> Iterator[IntArray]:
    """Yield pairs (k, 2) of *faces* (m, 3) that may meet, of which one is *asked* (m,), once each.

    All that do are among them.  The first of a pair is asked.
    """
    if not asked.any():
        return
    if kernels := compiled_checks(_TIMES * int(asked.sum())):
        yield _near_in_tree(kernels, points, faces, asked)
    else:
        yield from _near_centres(points, faces, asked)


def _near_in_tree(kernels: Any, points: FloatArray, faces: IntArray, asked: BoolArray) -> IntArray:
    order = _morton_order(points, faces)
    m = len(order)
    leaves = 1 << max(-(-m // _LEAF) - 1, 0).bit_length()
    boxes, tree, planes = np.empty((m, 6)), np.empty((2 * leaves, 6)), np.empty((m, 4))
    mesh = inputs(points, faces[order].astype(np.int64, copy=False))
    kernels.grow_tree(boxes, tree, planes, *mesh)
    boxes, tree, planes, is_asked = inputs(boxes, tree, planes, asked[order])
    found: dict[int, IntArray] = {}

    def work(start: int, stop: int) -> None:
        pairs = np.empty((_NEAR * _LEAF * (stop - start), 2), dtype=np.int64)
        count = kernels.touching_boxes(pairs, boxes, tree, is_asked, start, stop)
        if count > len(pairs):
            pairs = np.empty((count, 2), dtype=np.int64)
            kernels.touching_boxes(pairs, boxes, tree, is_asked, start, stop)
        (pairs,) = inputs(pairs[:count])
        kernels.may_meet(chosen := np.empty(count, dtype=bool), pairs, planes, *mesh)
        found[start] = order[pairs[chosen]]

    in_parallel(work, leaves, _PIECE, blas=False)
    pairs = np.concatenate([found[start] for start in sorted(found)])
    return np.where(asked[pairs[:, :1]], pairs, pairs[:, ::-1])


def _morton_order(points: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces (m,) along a curve through their centres that stays in each cube."""
    a, b, c = (np.take(points, corner, axis=0) for corner in faces.T)
    centres = a + b + c
    low, extent = centres.min(axis=0), float(np.ptp(centres, axis=0).max())
    scale = (len(_SPREAD) - 1) / extent if extent > 0.0 else 0.0
    x, y, z = ((centres - low) * scale).astype(np.int64).T
    key = _SPREAD[x] << 2 | _SPREAD[y] << 1 | _SPREAD[z]
    return np.argsort(key, kind="stable")


def _near_centres(points: FloatArray, faces: IntArray, asked: BoolArray) -> Iterator[IntArray]:
    """Yield the pairs whose boxes touch.

    The centres are searched separately for each power of two of the size, so that one large box
    does not slow down the search among small ones.
    """
    corners, some = points[faces], np.flatnonzero(asked)
    low, high = corners.min(axis=1), corners.max(axis=1)
    centre, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    size = np.frexp(radius)[1]
    grades = [np.flatnonzero(size == grade) for grade in np.unique(size)]
    trees = [(ids, cKDTree(centre[ids]), float(radius[ids].max())) for ids in grades]
    for start in range(0, len(some), _FACES):
        part = some[start : start + _FACES]
        for grade in np.unique(size[part]):
            mine = part[size[part] == grade]
            tree = cKDTree(centre[mine])
            for ids, others, largest in trees:
                reach = (float(radius[mine].max()) + largest) * _WIDER
                near = tree.sparse_distance_matrix(others, reach, output_type="ndarray")
                i, j = mine[near["i"]], ids[near["j"]]
                keep = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
                keep &= (i < j) | ~asked[j]
                yield np.stack([i[keep], j[keep]], axis=1)
