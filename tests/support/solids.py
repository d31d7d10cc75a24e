"""Small solids with a closed form for volume, area or coordinates."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

FloatArray = np.ndarray
TETRAHEDRON = (
    np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]),
)
OCTAHEDRON = (
    np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]),
    np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    ),
)
CUBE = (  # side 1, corner at the origin: volume 1, area 6
    np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)]),
    np.array(
        [
            [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
            [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
        ]
    ),
)  # fmt: skip
SOLIDS = {"tetrahedron": TETRAHEDRON, "octahedron": OCTAHEDRON, "cube": CUBE}


def icosphere(subdivisions: int = 3, radius: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return a sphere: the octahedron with each triangle split in four *subdivisions* times."""
    vertices, faces = OCTAHEDRON
    for _ in range(subdivisions):
        vertices, faces = _split(vertices, faces)
        vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return radius * vertices, faces


def torus(
    around: int = 48, across: int = 24, major: float = 1.0, minor: float = 0.35
) -> tuple[FloatArray, FloatArray]:
    """Return a torus about z; volume tends to 2 pi^2 major minor^2."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    ring = major + minor * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), minor * np.sin(b)], axis=-1)

    def number(i: FloatArray, j: FloatArray) -> FloatArray:
        return (i % around) * across + j % across

    here, east, north = number(u, v), number(u + 1, v), number(u, v + 1)
    corner = number(u + 1, v + 1)
    faces = np.concatenate(
        [np.stack([here, east, corner], -1), np.stack([here, corner, north], -1)]
    )
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def two_components() -> tuple[FloatArray, FloatArray]:
    """Return two separate spheres as one mesh."""
    vertices, faces = icosphere(2)
    shifted = vertices * 0.7 + [2.5, 0.0, 0.0]
    return np.concatenate([vertices, shifted]), np.concatenate([faces, faces + len(vertices)])


def revolved(profile, around: int = 24) -> tuple[FloatArray, FloatArray]:
    """Return the surface of revolution of a *profile* (k, 2): radii, heights; ends on the axis."""
    profile = np.asarray(profile, dtype=float)
    inner, phi = profile[1:-1], np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rings = inner[:, 0, None, None] * np.stack([np.cos(phi), np.sin(phi), 0.0 * phi], axis=1)
    rings[:, :, 2] += inner[:, 1, None]
    ends = [[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]]
    k, j = np.meshgrid(np.arange(len(inner) - 1) * around, np.arange(around), indexing="ij")
    a, b = (k + j).ravel(), (k + (j + 1) % around).ravel()
    j, on = np.arange(around), (np.arange(around) + 1) % around
    n, last = inner.shape[0] * around, (len(inner) - 1) * around
    first = np.stack([np.full(around, n), on, j], axis=1)
    final = np.stack([np.full(around, n + 1), last + j, last + on], axis=1)
    sides = [np.stack([a, b, b + around], axis=1), np.stack([a, b + around, a + around], axis=1)]
    faces = np.concatenate([first, *sides, final])
    return np.concatenate([rings.reshape(-1, 3), ends]), faces


def rotation(axis: FloatArray, angle: float) -> FloatArray:
    """Return the (3, 3) rotation by *angle* radians about *axis* (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def somewhere(n: int = 50, seed: int = 0, size: float = 2.0) -> FloatArray:
    """Return *n* random points, uniform in a box of half-width *size*."""
    return np.random.default_rng(seed).uniform(-size, size, (n, 3))


def _split(vertices: FloatArray, faces: FloatArray) -> tuple[FloatArray, FloatArray]:
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, which = np.unique(pairs, axis=0, return_inverse=True)
    middle = len(vertices) + which.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = faces.T, middle.T
    parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return (
        np.concatenate([vertices, vertices[edges].mean(axis=1)]),
        np.concatenate([np.stack(part, axis=-1) for part in parts]),
    )


def exact_volume_change(before: np.ndarray, after: np.ndarray, faces: np.ndarray) -> float:
    """Return (V - V0) / V0 for two (n, 3) poses of *faces*, computed with integers."""

    def six_volumes(vertices: np.ndarray) -> int:
        points = [[int(math.ldexp(c, 400)) for c in point] for point in vertices.tolist()]
        total = 0
        for i, j, k in faces.tolist():
            (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points[i], points[j], points[k]
            total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        return total

    rest = six_volumes(before)
    return float(Fraction(six_volumes(after) - rest, rest))


def soup(vertices, faces):
    """Return the triangles with three points each, as STL has them."""
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def joined(*solids):
    """Return several surfaces as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in solids])
    faces = [f + start for (_, f), start in zip(solids, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in solids]), np.concatenate(faces)


def together(*solids):
    """Return several surfaces as one, coincident vertices merged."""
    vertices, faces = joined(*solids)
    vertices, number = np.unique(vertices, axis=0, return_inverse=True)
    return vertices, number.reshape(-1)[faces]
