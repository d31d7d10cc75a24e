"""Constraints on the area of a surface, and on the centroid of what it encloses.

    A(x) = sum over triangles of |(x_j - x_i) x (x_k - x_i)| / 2
    C_a(x) = a . integral of y dy over the body / V(x)
           = sum of det(x_i, x_j, x_k) a . (x_i + x_j + x_k) / 24 / V(x),    a unit vector a

Unlike volumes they are no cubics along a direction, so Newton's method meets them, and their second
derivatives are not in H.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..geometry import area, area_gradient, area_slopes_along, corner_and_edges, slopes_of
from ..kernels import compiled_kernels, inputs
from .volume_constraints import VolumeConstraint


@dataclass(frozen=True, eq=False, repr=False)
class AreaConstraint(VolumeConstraint):
    """The area of *faces* is equal to *target*."""

    @property
    def is_cubic(self) -> bool:
        """False."""
        return False

    def value(self, points: FloatArray) -> float:
        """Return A."""
        return area(points, self.faces)

    def slope(self, points: FloatArray) -> FloatArray:
        """Return dA/dx, (n, 3)."""
        return area_gradient(points, self.faces)

    def along(self, paths: FloatArray) -> FloatArray:
        """Return A, and its derivative along each direction, (1 + d,)."""
        return area_slopes_along(paths, self.faces)


@dataclass(frozen=True, eq=False, repr=False)
class CentroidConstraint(VolumeConstraint):
    """A coordinate of the centroid of the body inside *faces* is equal to *target*.

    *axis* (3,) is a, *diagonal* the length to which errors are relative, and *shift* by how much
    *target* differs from the value at rest, relative to it.  *origin* is added to the value.
    """

    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    diagonal: float = 1.0
    shift: float = 0.0
    origin: float = 0.0

    @property
    def is_cubic(self) -> bool:
        """False."""
        return False

    @property
    def has_origin(self) -> bool:
        """True."""
        return True

    @property
    def size(self) -> float:
        """The diagonal."""
        return self.diagonal

    def value(self, points: FloatArray) -> float:
        """Return C_a."""
        if kernels := compiled_kernels(len(self.faces)):
            return float(self._moments(kernels, points)[0])
        volumes, means, _ = self._tetrahedra(points)
        return float(volumes @ means) / float(volumes.sum()) + self.origin

    def slope(self, points: FloatArray) -> FloatArray:
        """Return dC_a/dx, (n, 3)."""
        if kernels := compiled_kernels(len(self.faces)):
            given, sums = inputs(points, self.faces, np.array(self.axis)), np.empty((2, 1))
            kernels.moment_slopes(*given, sums)
            (total, moment), found = sums[:, 0], np.zeros(points.shape)
            kernels.moment_gradient(*given, moment / total / 4.0, found)
            return np.asarray(found * (6.0 / total))
        volumes, means, corners = self._tetrahedra(points)
        total, a = float(volumes.sum()), np.array(self.axis)
        away = (means - float(volumes @ means) / total) / total
        along = volumes[:, None] / total * a / 4.0
        x, y, z = corners
        sides = (np.cross(y, z), np.cross(z, x), np.cross(x, y))
        return _summed(
            self.faces, [away[:, None] * side / 6.0 + along for side in sides], len(points)
        )

    def along(self, paths: FloatArray) -> FloatArray:
        """Return C_a, and its derivative along each direction, (1 + d,)."""
        if kernels := compiled_kernels(len(self.faces)):
            return self._moments(kernels, paths)
        points = paths[:, :3]
        slopes = slopes_of(self.slope(points), paths)
        return np.array([self.value(points), *slopes])

    def _moments(self, kernels: Any, paths: FloatArray) -> FloatArray:
        """Return `along` by *kernels*."""
        sums = np.empty((2, paths.shape[1] // 3))
        kernels.moment_slopes(*inputs(paths, self.faces, np.array(self.axis)), sums)
        (total, *of_total), (moment, *of_moment) = sums
        slopes = np.array(of_moment) - moment / total * np.array(of_total)
        return np.array([moment / total / 4.0 + self.origin, *(slopes / (4.0 * total))])

    def second_derivatives(
        self, points: FloatArray, rows: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the second derivatives of C_a, if *points* (n, 3) are ``rows @ p``, by p (m, 3).

        As weights (f,) of the second derivatives of the determinants of faces, divided by 6, and
        the rest, (3m, 3m).
        """
        volumes, means, (x, y, z) = self._tetrahedra(points)
        total, a = float(volumes.sum()), np.array(self.axis)
        centre = float(volumes @ means) / total
        near = [rows[corner] for corner in self.faces.T]
        every = near[0] + near[1] + near[2]
        sides = (np.cross(y, z), np.cross(z, x), np.cross(x, y))
        normals = [
            sum(side[:, [axis]] * row for side, row in zip(sides, near, strict=True)) / 6.0
            for axis in range(3)
        ]  # of det / 6 by p, face by face
        of_volume = np.concatenate([each.sum(axis=0) for each in normals])
        of_mean = [
            ((means - centre) @ normals[axis] + a[axis] / 4.0 * (volumes @ every)) / total
            for axis in range(3)
        ]
        mixed = np.outer(np.concatenate(of_mean), of_volume)
        found = -(mixed + mixed.T) / total
        m = rows.shape[1]
        for axis in range(3):
            block = (normals[axis].T @ every) / (4.0 * total)
            for other in np.flatnonzero(a):
                i, j = slice(axis * m, (axis + 1) * m), slice(other * m, (other + 1) * m)
                found[i, j] += a[other] * block
                found[j, i] += a[other] * block.T
        return (means - centre) / total, found

    def change(self, off: float) -> float:
        """Return by how much one that is *off* differs from that at rest, in diagonals."""
        return self.shift + off

    def nearer(self, off: float) -> float:
        """Return the target with which one that is *off* would be met."""
        return self.target - off * self.size

    def at_points(self, points: FloatArray, unit: float, /) -> CentroidConstraint:
        """Return the same for *points* at rest, whose unit is longer by *unit*."""
        own = replace(self, target=0.0, diagonal=self.diagonal / unit, origin=0.0)
        return replace(own, target=own.violation(points) + own.shift * own.size)

    def _tetrahedra(
        self, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
        """Return the volumes (m,) up to the origin, a . their centroids, and the corners."""
        x, e, f = corner_and_edges(points, self.faces)
        y, z = x + e, x + f
        volumes = np.einsum("ij,ij->i", x, np.cross(e, f)) / 6.0
        return volumes, (x + y + z) @ np.array(self.axis) / 4.0, (x, y, z)


def area_of(x: FloatArray, faces: IntArray) -> AreaConstraint:
    """Return the constraint that *faces* (m, 3) of *x* (n, 3) keep their area."""
    return AreaConstraint(faces, area(x, faces))


def centroid_of(
    body: VolumeConstraint,
    x: FloatArray,
    axis: int,
    *,
    diagonal: float,
    origin: float = 0.0,
) -> CentroidConstraint:
    """Return the constraint that the coordinate *axis* of the centroid of a *body* stays.

    *x* (n, 3) is the mesh at rest, relative to *origin*.
    """
    a = (float(axis == 0), float(axis == 1), float(axis == 2))
    free = CentroidConstraint(
        body.faces, 0.0, body.extension, axis=a, diagonal=diagonal, origin=origin
    )
    return replace(free, target=free.violation(x))


def _summed(faces: IntArray, slopes: Sequence[FloatArray], n: int) -> FloatArray:
    """Return the sums (n, 3) of *slopes*, three (m, 3), of the corners of *faces*."""
    found = np.zeros((n, 3))
    for corner, slope in zip(faces.T, slopes, strict=True):
        for axis in range(3):
            found[:, axis] += np.bincount(corner, slope[:, axis], minlength=n)
    return found
