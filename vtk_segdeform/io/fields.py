"""Vectors and tensors on a surface that follow its deformation: fibres, velocities, stresses.

    stays         v' = v          by default, as scalars and colours do
    turned        v' = R v        T' = R T R^T     lengths are kept
    pushed        v' = F v        T' = F T F^T     forward with the surface: lengths change

F is the deformation gradient of a triangle, whose normal keeps its length, and R its rotation; at a
point, the mean of the triangles around it, by area.  A tensor has nine components, by rows, or six:
xx, yy, zz, xy, yz, xz, as in VTK.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..checks import all_of
from ..errors import ArgumentError
from ..geometry import closest_rotations
from .polygons import cells_of, polygons_of

_SYMMETRIC = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])  # components of a tensor of six
_UNIQUE = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]


def follow(
    moved: Any,
    rest: Any,
    *,
    turn: Sequence[str] = (),
    push: Sequence[str] = (),
    gradients: tuple[FloatArray, FloatArray] | None = None,
) -> None:
    """Let the arrays *turn* and *push* of *moved* follow its deformation from *rest*.

    They are point or cell arrays of vectors or tensors; where both have the name, both follow.
    Without *gradients* of the points (p, 3, 3) and the cells (c, 3, 3) both are surfaces.

    Raises
    ------
    ArgumentError
        If there is no such array.
    """
    turned, pushed = all_of(turn, str, "turn"), all_of(push, str, "push")
    names = {**dict.fromkeys(turned, True), **dict.fromkeys(pushed, False)}
    if not names:
        return
    if gradients is not None:
        change = _Change(*gradients)
    else:
        change = _Change.of(rest, np.asarray(moved.points, dtype=np.float64))
    for name, turns in names.items():
        places = [
            (of_points, data)
            for of_points, data in ((True, moved.point_data), (False, moved.cell_data))
            if name in data and data[name].shape[1:] in ((3,), (6,), (9,))
        ]
        if not places:
            option = "turn" if turns else "push"
            raise ArgumentError(f"{option}: there is no array {name!r} of vectors or tensors")
        for of_points, data in places:
            by = change.at_points if of_points else change.at_cells
            matrices = closest_rotations(np.swapaxes(by, 1, 2)) if turns else by
            values = np.array(data[name])
            data[name] = _moved(values.astype(np.float64), matrices).astype(
                values.dtype if values.dtype.kind == "f" else np.float64
            )


def _moved(values: FloatArray, gradients: FloatArray) -> FloatArray:
    """Return vectors or tensors (k, 3), (k, 6) or (k, 9) by *gradients* (k, 3, 3)."""
    if values.shape[1] == 3:
        return np.asarray(np.einsum("kij,kj->ki", gradients, values))
    full = values.reshape(-1, 3, 3) if values.shape[1] == 9 else values[:, _SYMMETRIC]
    full = gradients @ full @ np.swapaxes(gradients, 1, 2)
    return np.asarray(
        full.reshape(-1, 9) if values.shape[1] == 9 else full[(slice(None), *_UNIQUE)]
    )


class _Change(NamedTuple):
    """The deformation gradients of points (p, 3, 3) and of cells (c, 3, 3)."""

    at_points: FloatArray
    at_cells: FloatArray

    @classmethod
    def of(cls, rest: pv.PolyData, points: FloatArray) -> _Change:
        """Return those from *rest* to the same polygons at *points* (p, 3)."""
        counts, corners = polygons_of(rest)
        triangles, polygon = _fans(counts, corners)
        x = np.asarray(rest.points, dtype=np.float64)
        (a, areas), (b, _) = _frames(x, triangles), _frames(points, triangles)
        is_flat = np.abs(np.linalg.det(a)) == 0.0
        a[is_flat] = b[is_flat] = np.eye(3)
        each = b @ np.linalg.inv(a)
        weights = np.where(is_flat, 0.0, areas)
        cells = cells_of(rest)[polygon]
        corner, at = np.repeat(each, 3, axis=0), triangles.ravel()
        return cls(
            means_at(corner, np.repeat(weights, 3), at, len(x)),
            means_at(each, weights, cells, rest.n_cells),
        )


def means_at(values: FloatArray, weights: FloatArray, at: IntArray, count: int) -> FloatArray:
    """Return the means (count, 3, 3) of *values* (k, 3, 3) by where they are *at* (k,)."""
    total = np.bincount(at, weights, count)
    sums = [np.bincount(at, weights * each, count) for each in values.reshape(-1, 9).T]
    found = np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]
    found = found.reshape(-1, 3, 3)
    found[total <= 0.0] = np.eye(3)  # in no face: it stays as it is
    return np.asarray(found)


def _fans(counts: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangles (t, 3) of fans of polygons, and the polygon of each."""
    starts, numbers = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), numbers)
    rank = np.arange(len(polygon)) - np.repeat(np.cumsum(numbers) - numbers, numbers)
    at = starts[polygon]
    return corners[np.stack([at, at + rank + 1, at + rank + 2], axis=1)], polygon


def _frames(x: FloatArray, triangles: IntArray) -> tuple[Any, FloatArray]:
    """Return two edges and the unit normal of each triangle as columns, and twice the areas."""
    a, b, c = (x[corner] for corner in triangles.T)
    normal = np.cross(b - a, c - a)
    areas = np.linalg.norm(normal, axis=1)
    normal /= np.where(areas > 0.0, areas, 1.0)[:, None]
    return np.stack([b - a, c - a, normal], axis=2), areas
