"""The enclosed volume, eqs. (8) and (9), its gradient, and the volume along a straight path.

    V(x) = sum over triangles (i, j, k) of det(x_i, x_j, x_k) / 6                       (8)
    g(x) = V(x) - V_0                                                                   (9)

V is a cubic polynomial of the positions, so along any direction d it is a cubic of the step:

    V(x + t d) = c0 + c1 t + c2 t^2 + c3 t^3

with all four coefficients from one pass over the triangles.  The step to an *exact* target volume
is therefore a root of a scalar cubic; the linearised multiplier of (14) leaves an error of 1e-4.

All sums use a vertex of the mesh as origin: the volume of a closed mesh does not depend on the
origin, and a mesh far from zero keeps its digits.  Determinants are computed as

    det(a, b, c) = a . ((b - a) x (c - a))

whose products are of the size of the triangle: on a wire 400 times as long as thick, products of
its corners would lose three digits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..freezing import Frozen
from ..kernels import ROWS_AT_ONCE, compiled_kernels, in_parallel, inputs
from ..mesh import cross_rows

_FACES_PER_SUM = 4096  # partial sums are fixed, so that results do not depend on threads


@dataclass(frozen=True, eq=False, repr=False)
class Parts(Frozen):
    """Faces of c parts of a surface, part after part; sums over them are made together.

    The faces are in blocks, each in one part, whose partial sums do not depend on threads.
    """

    faces: IntArray  # (m, 3)
    begins: IntArray  # (b + 1,), of the blocks among the faces, and the end
    firsts: IntArray  # (c,), the first block of each part

    @classmethod
    def of(cls, parts: Sequence[IntArray]) -> Parts:
        """Return the *parts*, (m_k, 3) each."""
        counts = [max(-(-len(faces) // _FACES_PER_SUM), 1) for faces in parts]
        ends = np.cumsum([len(faces) for faces in parts])
        starts = [
            end - len(faces) + _FACES_PER_SUM * np.arange(count)
            for faces, end, count in zip(parts, ends, counts, strict=True)
        ]
        faces = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return cls(faces, np.append(np.concatenate(starts), len(faces)), _starts(counts))

    def sums(self, kernel: Any, x: FloatArray, out: FloatArray) -> FloatArray:
        """Return the sums (c, ...) of a *kernel* over points *x*; *out* (b, ...) has a block's."""
        arguments = inputs(x, self.faces, self.begins)
        in_parallel(
            lambda first, last: kernel(*arguments, out, first, last),
            len(out),
            ROWS_AT_ONCE // _FACES_PER_SUM,
        )
        if len(self.firsts) == 1:  # numpy adds them pairwise
            return np.asarray(out.sum(axis=0, keepdims=True))
        return np.asarray(np.add.reduceat(out, self.firsts))

    def __iter__(self) -> Iterator[IntArray]:
        """Yield the faces of each part, (m_k, 3)."""
        ends = self.begins[np.append(self.firsts[1:], len(self.begins) - 1)]
        for start, end in zip(self.begins[self.firsts], ends, strict=True):
            yield self.faces[start:end]


def _starts(counts: Sequence[int]) -> IntArray:
    return np.cumsum([0, *counts[:-1]])


def signed_volume(vertices: FloatArray, faces: IntArray) -> float:
    """Return the enclosed volume (8) of *vertices* (n, 3), *faces* (m, 3); positive if outward."""
    return float(signed_volumes(vertices, Parts.of([faces]))[0])


def signed_volumes(vertices: FloatArray, parts: Parts) -> FloatArray:
    """Return the volume of each of *parts*, (c,), over the same *vertices* (n, 3)."""
    if kernels := compiled_kernels(len(parts.faces)):
        out = np.empty(len(parts.begins) - 1)
        return parts.sums(kernels.volume_sums, vertices, out) / 6.0
    points = vertices - vertices[0]
    corners = (corner_and_edges(points, faces) for faces in parts)
    return np.array([np.einsum("ij,ij", a, cross_rows(e, f)) / 6.0 for a, e, f in corners])


def volume_gradient(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return dV/dx, (n, 3): the entries of J_g in eq. (12), one row per vertex."""
    return volume_gradients(vertices, Parts.of([faces]))[0]


def volume_gradients(vertices: FloatArray, parts: Parts) -> list[FloatArray]:
    """Return dV/dx, (n, 3), for the volume of each of *parts*."""
    found, kernels = [], compiled_kernels(len(parts.faces))
    for faces in parts:
        gradient = np.zeros(vertices.shape)
        if kernels:
            kernels.volume_gradient(*inputs(vertices, faces), gradient)
        else:
            _, e, f = corner_and_edges(vertices, faces)
            normals = cross_rows(e, f) / 6.0  # on a closed mesh, in sum b x c, c x a, a x b
            for axis in range(3):
                column = np.repeat(normals[:, axis], 3)
                gradient[:, axis] = np.bincount(faces.ravel(), column, minlength=len(vertices))
        found.append(gradient)
    return found


def volume_along(vertices: FloatArray, direction: FloatArray, faces: IntArray) -> FloatArray:
    """Return (c0, c1, c2, c3) with V(vertices + t direction) = c0 + c1 t + c2 t^2 + c3 t^3."""
    return volume_along_path(np.hstack([vertices, direction]), Parts.of([faces]))


def volume_along_path(path: FloatArray, parts: Parts) -> FloatArray:
    """Return `volume_along` of *path* (n, 6), vertices and direction side by side, for one part."""
    faces = parts.faces
    if kernels := compiled_kernels(len(faces)):
        sums = parts.sums(kernels.volume_along_sums, path, np.empty((len(parts.begins) - 1, 4)))
        return np.asarray(sums[0] / 6.0)
    vertices, direction = path[:, :3], path[:, 3:]
    a, e, f = corner_and_edges(vertices - vertices[0], faces)
    u, v, w = corner_and_edges(direction - direction[0], faces)
    ef, vw = cross_rows(e, f), cross_rows(v, w)
    mixed = cross_rows(v, f) + cross_rows(e, w)
    c0 = np.einsum("ij,ij", a, ef)
    c1 = np.einsum("ij,ij", u, ef) + np.einsum("ij,ij", a, mixed)
    c2 = np.einsum("ij,ij", u, mixed) + np.einsum("ij,ij", a, vw)
    c3 = np.einsum("ij,ij", u, vw)
    return np.array([c0, c1, c2, c3]) / 6.0


def volume_slopes_along(paths: FloatArray, parts: Parts) -> FloatArray:
    """Return V of each of *parts*, and its derivative along each direction of *paths*, (c, 1 + d).

    *paths* (n, 3 + 3 d) has the vertices and their d directions side by side.
    """
    if kernels := compiled_kernels(len(parts.faces) + paths.size // 3):
        return _slopes(kernels.volume_slopes, paths, parts) / 6.0
    x = paths[:, :3]
    slopes = [slopes_of(volume_gradient(x, faces), paths) for faces in parts]
    return np.column_stack([signed_volumes(x, parts), slopes])


def area(x: FloatArray, faces: IntArray) -> float:
    """Return the area of *faces* (m, 3) of *x* (n, 3)."""
    return float(area_slopes_along(x, faces)[0])


def area_gradient(x: FloatArray, faces: IntArray) -> FloatArray:
    """Return the derivative of the area by each of *x* (n, 3), (n, 3)."""
    found = np.zeros(x.shape)
    if kernels := compiled_kernels(len(faces)):
        kernels.area_gradient(*inputs(x, faces), found)
        return found
    _, e, f = corner_and_edges(x, faces)
    normal = cross_rows(e, f)
    lengths = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = 0.5 * normal / np.where(lengths > 0.0, lengths, np.inf)
    of_j, of_k = cross_rows(f, normal), cross_rows(normal, e)
    for corner, slope in zip(faces.T, (-of_j - of_k, of_j, of_k), strict=True):
        for axis in range(3):
            found[:, axis] += np.bincount(corner, slope[:, axis], minlength=len(x))
    return found


def area_slopes_along(paths: FloatArray, faces: IntArray) -> FloatArray:
    """Return the area, and its derivatives as `volume_slopes_along`, (1 + d,)."""
    if kernels := compiled_kernels(len(faces) + paths.size // 3):
        return np.asarray(_slopes(kernels.area_slopes, paths, Parts.of([faces]))[0] / 2.0)
    _, e, f = corner_and_edges(paths[:, :3], faces)
    total = 0.5 * np.linalg.norm(cross_rows(e, f), axis=1).sum()
    return np.array([total, *slopes_of(area_gradient(paths[:, :3], faces), paths)])


def slopes_of(gradient: FloatArray, paths: FloatArray) -> FloatArray:
    """Return the derivative (d,) along each direction of *paths*, from a *gradient* (n, 3)."""
    directions = paths.reshape(len(gradient), -1, 3)[:, 1:]
    return np.asarray(np.einsum("ia,ida->d", gradient, directions))


def _slopes(kernel: Any, paths: FloatArray, parts: Parts) -> FloatArray:
    """Return the sums of a *kernel* over the faces of each part, (c, 1 + d)."""
    return parts.sums(kernel, paths, np.empty((len(parts.begins) - 1, paths.shape[1] // 3)))


def outer_components(x: FloatArray, component: IntArray, volumes: FloatArray) -> IntArray:
    """Return the component around each cavity, and of other components their own number, (c,) int.

    *component* (n,) is that of each vertex at *x* (n, 3).  Those whose volume (c,) is negative are
    cavities, in the smallest body whose bounding box is around theirs.
    """
    outer = np.arange(len(volumes))
    if not (volumes < 0.0).any():
        return outer
    low, high = np.full((2, len(volumes), 3), [[[np.inf]], [[-np.inf]]])
    np.minimum.at(low, component, x)
    np.maximum.at(high, component, x)
    largest = np.argsort(-volumes, kind="stable")
    for cavity in np.flatnonzero(volumes < 0.0):
        around = (low[largest] < low[cavity]) & (high[largest] > high[cavity])
        bodies = largest[around.all(axis=1) & (volumes[largest] > 0.0)]
        outer[cavity] = bodies[-1] if len(bodies) else cavity
    return outer


def step_to_volume(coefficients: FloatArray, target: float) -> float:
    """Return the step t of least magnitude at which the cubic of `volume_along` equals *target*.

    Newton's method refines the root to the last digit.  If the cubic never reaches *target*
    because its leading coefficients vanish, the step that comes closest is returned.
    """
    missing = target - coefficients[0]
    if missing == 0.0 or not coefficients[1:].any():
        return 0.0
    if near := _near_root(missing, *(float(c) for c in coefficients[1:])):
        return near
    powers = np.arange(1, 4)
    # Unit of t: the smallest step at which one term alone reaches the target; prevents overflow.
    with np.errstate(divide="ignore", over="ignore"):
        alone = np.abs(missing / coefficients[1:]) ** (1.0 / powers)
    unit = float(alone.min())
    terms = coefficients[1:] / missing * unit**powers  # relative to *missing*: the target is 1
    polynomial = np.array([*terms[::-1], -1.0])
    roots = np.roots(np.trim_zeros(polynomial, "f"))
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots).max(initial=0.0)].real
    if not len(real):
        real = roots.real
    if not len(real):
        return 0.0
    t = float(real[np.abs(real).argmin()])
    for _ in range(3):
        slope = np.polyval(np.polyder(polynomial), t)
        if slope == 0.0:
            break
        t -= float(np.polyval(polynomial, t) / slope)
    return t * unit


def _near_root(missing: float, c1: float, c2: float, c3: float) -> float | None:
    """Return the smallest t with c1 t + c2 t^2 + c3 t^3 = missing if the first term dominates.

    It dominates if at twice its root both other terms are less than a fifth of it; the cubic then
    is monotonic up to there and passes *missing*, so Newton's method finds the root.  Else None.
    """
    with np.errstate(all="ignore"):
        t = missing / c1 if c1 else math.inf
        if not (abs(2.0 * c2 * t) + abs(4.0 * c3 * t * t) < 0.1 * abs(c1)):
            return None
        for _ in range(6):
            t -= (t * (c1 + t * (c2 + t * c3)) - missing) / (c1 + t * (2.0 * c2 + t * 3.0 * c3))
    return t


def corner_and_edges(
    points: FloatArray, faces: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the first corner a of each face, b - a and c - a, (m, 3) each."""
    a, b, c = (np.take(points, corner, axis=0) for corner in faces.T)
    return a, b - a, c - a
